"""How a run ended: what trainer, evaluator and scheduler tell whoever asked for it."""

from dataclasses import dataclass
from pathlib import Path

from msgdrop_cli.records.run_file import Status


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How one run ended."""

    run_id: str
    path: Path
    """Its folder; of a run that was not begun, where it will be."""
    status: Status
    """done, failed, diverged or interrupted."""
    reason: str | None = None
    env_steps: int = 0
    wall_time_s: float = 0.0
    exit_code: int = 0
    """What the command exits with on account of this run: 0, 3 for one that failed or diverged, or
    what a fault of the disk asks for."""
