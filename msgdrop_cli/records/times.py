"""What a run's training has taken of a processor: its wall time also says what else was at work."""

from msgdrop_cli.records.store import RunRecord

_LONGEST_S = 1e12


def cpu_time_s(record: RunRecord) -> float | None:
    """Seconds of a processor that its training took; None where the record does not say so."""
    spent = record.run.get("cpu_time_s")
    if isinstance(spent, bool) or not isinstance(spent, int | float):
        return None
    return float(spent) if 0.0 <= spent < _LONGEST_S else None
