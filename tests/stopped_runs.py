"""A run that was stopped after two checkpoints, and what may happen to them before it goes on."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.seals import seal
from tests.runs import StopAt, planned

STOPPED = 45
"""Steps of 8 games: 360 env steps, with checkpoints at 320 and 360."""


def stop(root: Path) -> Path:
    """The run's folder; `stop` has to be asked at every step."""
    [outcome] = train_cohort([planned()], root, stop=StopAt(STOPPED))
    assert len(list((outcome.path / "checkpoints").glob("0*"))) == 2
    return outcome.path


def resume(folder: Path, stop: Callable[[], bool] = lambda: False) -> Outcome:
    """Go on with the run in `folder`."""
    [outcome] = train_cohort([planned()], folder.parents[2], stop=stop)
    return outcome


def flip(file: Path) -> None:
    """Change one bit in the middle of a file."""
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def newest(folder: Path) -> Path:
    """The newest checkpoint."""
    return max((folder / "checkpoints").glob("0*"))


def segments(checkpoint: Path) -> list[Path]:
    """The stretches of the replay memory of one checkpoint, in order."""
    files = json.loads((checkpoint / "MANIFEST.json").read_text())["files"]
    return [checkpoint.parent / "replay" / name for name in sorted(files) if name[0].isdigit()]


def rewrite(checkpoint: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change the manifest of a checkpoint, and seal it again."""
    file = checkpoint / "MANIFEST.json"
    manifest = json.loads(file.read_text())
    del manifest["seal"]
    change(manifest)
    file.write_text(json.dumps({**manifest, "seal": seal(manifest)}))
