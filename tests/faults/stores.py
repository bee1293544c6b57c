"""Trials on published studies: `verify` finds what was changed, and nothing where all is well."""

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random

from msgdrop_cli.records.sums import SUMS
from tests.faults.row import Trial, expect
from tests.faults.study import start, undisturbed

_CLEAN = 50
"""One trial of so many looks at the study before it is changed, too."""


def changed_byte(path: Path, chance: Random) -> None:
    """One byte becomes another one."""
    content = bytearray(path.read_bytes())
    content[chance.randrange(len(content))] ^= chance.randrange(1, 256)
    path.write_bytes(content)


def added_byte(path: Path, chance: Random) -> None:
    """One byte more, anywhere."""
    content = bytearray(path.read_bytes())
    content.insert(chance.randrange(len(content) + 1), chance.randrange(256))
    path.write_bytes(content)


def cut(path: Path, chance: Random) -> None:
    """The file ends early."""
    path.write_bytes(path.read_bytes()[: chance.randrange(path.stat().st_size)])


def removed(path: Path, chance: Random) -> None:
    """It is gone."""
    path.unlink()


def copied(path: Path, chance: Random) -> None:
    """It is there twice."""
    shutil.copyfile(path, path.with_name(f"{path.name}{chance.randrange(9)}"))


def linked(path: Path, chance: Random) -> None:
    """A link with the same content stands in its place."""
    original = path.rename(path.parents[len(path.parts) % 2] / f"x{chance.randrange(9)}")
    path.symlink_to(original)


CHANGES: list[Callable[[Path, Random], None]] = [
    *(changed_byte, added_byte, cut, removed, copied, linked)
]


def change_a_store(trial: Trial) -> None:
    """One change of one file, half of them of a single byte: it is found, and the file named."""
    study = trial.folder / "published"
    shutil.copytree(_published(trial), study)
    if trial.number % _CLEAN == 0:
        process = start(["verify", str(study)], trial.folder)
        expect(process.wait() == 0, f"a false alarm: {process.last_line()}")
    file = trial.rng.choice(sorted(path for path in study.rglob("*") if path.is_file()))
    change = changed_byte if trial.number % 2 else trial.rng.choice(CHANGES)
    what = f"{change.__name__} {file.relative_to(study)}"
    change(file, trial.rng)
    process = start(["verify", str(study)], trial.folder)
    code = process.wait()
    expect(code == 65, f"{what}: ended with {code}: {process.last_line()}")
    expect(str(file) in process.said or file.name == SUMS, f"{what}: {process.last_line()}")


def _published(trial: Trial) -> Path:
    """The undisturbed study as it is published; made once for all trials."""
    made = trial.bench / "published"
    if not made.exists():
        to = trial.folder / "made"
        question = str(trial.bench / "tiny.toml")
        folders = ["--results", str(undisturbed(trial, 2)), "--to", str(to)]
        process = start(["publish", question, *folders], trial.folder)
        expect(process.wait() == 0, process.last_line())
        with suppress(OSError):  # another trial was faster
            to.rename(made)
    return made
