"""The fault table: what must survive what, row by row, and what runs it (`make faults`).

A row is data (`table.py`); a trial disturbs a tiny real study in processes of its own (`study.py`),
and is believed only if the oracle (`oracle.py`) finds every quantity as it is without the fault.
"""
