"""The command that finishes runs, made of what their records say."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from os.path import relpath
from pathlib import Path
from shlex import quote
from typing import NamedTuple

from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.overrides import SECTIONS
from msgdrop_cli.definition.plan import AD_HOC_NAME
from msgdrop_cli.definition.readings import all_readings, apart
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.write import home_of

_STEPS = "training.train_env_steps"
_QUESTIONS = (".", "ablations")
"""Where people keep questions of their own; no record says where."""


class OnceMore(NamedTuple):
    """What to type."""

    command: str
    lacks: str = ""
    """What has to be put into it first, in words."""


def once_more(runs: Sequence[RunRecord]) -> OnceMore:
    """What finishes runs of one question, profile and overrides; of `train`, of one arm."""
    first, lacks = runs[0], ""
    if first.definition == AD_HOC_NAME:
        words, read = _train(first), set[str]()
    else:
        shipped = first.definition in list_definitions()
        asked, lacks = (first.definition, "") if shipped else _file(first.definition)
        known: Iterable[str] = ()
        with suppress(DefinitionError):  # the file is not there, or no question any more
            known = load_definition(asked).profiles
        profile, readings = apart(first.profile, known)
        words = ["msgdrop", "ablate", asked, "--profile", profile]
        words += [word for reading in readings for word in ("--reading", reading)]
        read = {
            f"{section}.{key}"
            for reading in readings
            for section in SECTIONS
            for key in getattr(all_readings()[reading], section)
        }
    words += [w for o in first.overrides if _path(o) not in read for w in ("--set", _typed(o))]
    seeds = ",".join(str(seed) for seed in sorted({run.seed for run in runs}))
    words += ["--seeds", seeds] if "," in seeds else ["--seed", seeds]
    if (home := home_of(first.path).resolve()) != Path("results").resolve():
        words += ["--results", relpath(home) if home.is_relative_to(Path.cwd()) else str(home)]
    return OnceMore(" ".join(quote(word) for word in words), lacks)


def _train(run: RunRecord) -> list[str]:
    """`train` with the options that its record has; a length is there, however it was asked for."""
    game = str(run.spec["environment"].get("factory", run.environment))
    words = ["msgdrop", "train", "--env", game, "--algorithm", run.variant]
    words += ["--profile", run.profile]
    if run.setup and _STEPS not in map(_path, run.overrides):
        words += ["--steps", str(run.setup.train_env_steps)]
    return words


def _file(question: str) -> tuple[str, str]:
    """The file of a question that is not shipped, and what is not known of it."""
    files = (Path(folder) / f"{question}.toml" for folder in _QUESTIONS)
    if file := next((file for file in files if file.is_file()), None):
        return str(file), ""
    return f"PATH/{question}.toml", f"PATH, the folder of {question}.toml: no record has it"


def _typed(override: str) -> str:
    """As `--set` takes it: records have Python's truth values."""
    path, _, value = override.partition("=")
    return f"{path}={value.lower() if value in ('True', 'False') else value}"


def _path(override: str) -> str:
    return override.partition("=")[0]
