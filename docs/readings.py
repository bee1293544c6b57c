"""Writes `docs/readings.md`: every reading that has a name, with the row of PAPER.md it belongs to.

python -m docs.readings
"""

import json
import re
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path

from msgdrop_cli.definition.overrides import SECTIONS
from msgdrop_cli.definition.readings import Reading, all_readings

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "readings.md"
_HEAD = """# The register of readings

Where the paper leaves something open, [`PAPER.md`](../PAPER.md) says how it is read here. Where
another reading could turn a verdict it has a name, and any question can be asked under it:

```
msgdrop ablate broken-links --reading capture-once
```

Its runs are others than those by default (but for `exploring`, which plays the same policies
otherwise), and are told apart wherever they are shown. This page of {count} readings is made of
[`readings.toml`](../ablations/msgdrop_ablations/readings.toml) and `PAPER.md`, by `python -m
docs.readings`.
"""
_COLUMNS = ("reading", "the paper says (line)", "by default", "under this reading")


def register() -> str:
    """The whole page, as Markdown."""
    readings = all_readings()
    parts = [_HEAD.format(count=len(readings))]
    for games, group in groupby(readings.items(), key=lambda item: item[1].environments):
        parts += [f"## {', '.join(games)}\n", _table(dict(group))]
    return "\n".join(parts)


def _table(readings: Mapping[str, Reading]) -> str:
    paper = (ROOT / "PAPER.md").read_text().splitlines()
    lines = [_row(_COLUMNS), _row(("---",) * len(_COLUMNS))]
    for name, reading in readings.items():
        [row] = [line for line in paper if line.startswith(f"| {reading.row}")]
        says, by_default = (cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:3])
        otherwise = ": ".join(filter(None, (reading.says, ", ".join(_settings(reading)))))
        lines.append(_row((f"`{name}`", says, by_default, otherwise)))
    return "\n".join((*lines, ""))


def _settings(reading: Reading) -> list[str]:
    return [
        f"`{section}.{key}={json.dumps(value)}`"
        for section in SECTIONS
        for key, value in getattr(reading, section).items()
    ]


def _row(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    PAGE.write_text(register())
