"""Numbers from records: metrics, statistics over seeds, learning curves, verdicts on claims.

Reads runs through `records` only; draws nothing, prints nothing, imports numpy inside functions.
"""
