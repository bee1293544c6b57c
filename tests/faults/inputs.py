"""Trials with what others may send: files, names, definitions, arguments."""

import shutil
import time
from collections.abc import Sequence
from itertools import count, pairwise
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from tests.cli_runs import msgdrop
from tests.faults.corpus import ARGUMENTS, HOSTILE_FILES, NAMES, definitions, mutated
from tests.faults.row import Broken, Trial, expect
from tests.faults.study import start, undisturbed

_MOST_BYTES, _MOST_SECONDS = 256 * 2**20, 2.0
_CODES = (0, 2, 3, 73, 74)
EXAMPLES = 100
"""Cases of the fuzzer in one trial."""
_BY_COMMAND = 20
"""One case of so many goes through the command line."""
_KEYS = (
    ("algorithm", "gamma"),
    ("algorithm", "learning_rate"),
    ("algorithm", "batch_size"),
    ("training", "train_env_steps"),
    ("training", "checkpoint_every_env_steps"),
    ("environment", "time_limit"),
)


def read_a_hostile_file(trial: Trial) -> float:
    """A file of somebody else in a results folder: nothing is executed, one line says what it is.

    The first trials take the kinds one by one, the others change some bytes of sound files.
    """
    results = trial.folder / "results"
    shutil.copytree(undisturbed(trial), results)
    canary = trial.folder / "canary"
    [run] = results.glob("runs/*/*")
    kinds = list(HOSTILE_FILES)
    if trial.number < len(kinds):
        what = kinds[trial.number]
        HOSTILE_FILES[what](results, canary)
    else:
        what = mutated(results, trial.rng)
    worst = 0.0
    pages = ["--html", str(trial.folder / "page.html")]
    for arguments in (
        ["status", str(results)],
        ["eval", str(results), "--episodes", "4", "--workers", "1"],
        ["replay", str(run), *pages],
    ):
        worst = max(worst, _survives(trial, what, arguments))
    expect(not canary.exists(), f"{what}: something was executed")
    return worst


def take_a_hostile_name(trial: Trial) -> None:
    """Names and paths that lead elsewhere, or are commands somewhere: refused or contained."""
    before = sorted(trial.bench.rglob("*"))
    name = NAMES[trial.number % len(NAMES)]
    results = trial.folder / "inside" / "results"
    for template in ARGUMENTS:
        arguments = [part.replace("{}", name) for part in template]
        _survives(trial, f"{template}: {name!r}", [*arguments, "--results", str(results)])
    outside = [path for path in trial.folder.iterdir() if not path.name.startswith("said")]
    expect(outside in ([], [trial.folder / "inside"]), f"{name!r} wrote {outside}")
    expect(sorted(trial.bench.rglob("*")) == before, f"{name!r} wrote into another folder")


def fuzz_definitions(trial: Trial) -> None:
    """Any text for a definition, any override: a plan, or one line that says what is wrong.

    Most cases are planned without the command line, which is what takes the time.
    """
    file = trial.folder / "fuzzed.toml"
    cases, known = count(), catalogue()

    @seed(trial.number)
    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(definitions())
    def fuzz(case: tuple[str, list[str]]) -> None:
        text, arguments = case
        file.write_text(text, errors="replace")
        if next(cases) % _BY_COMMAND:
            _plan(file, arguments, text, known)
            return
        said = msgdrop("ablate", file, "--dry-run", *arguments)
        if said.code not in (0, 2) or "Traceback" in said.err or "this is a bug" in said.err:
            raise Broken(f"{arguments} with {text!r}: {said.code}: {said.err[-200:]}")

    fuzz()
    _name_the_nearest(trial)


def _plan(file: Path, arguments: Sequence[str], text: str, known: Catalogue) -> None:
    """What `ablate --dry-run` does with the definition and the `--set` of a case."""
    sets = [each for before, each in pairwise(arguments) if before == "--set"]
    try:
        plan(load_definition(str(file)), "quick", known, overrides=sets)
    except DefinitionError as error:
        expect(str(error).isprintable(), f"{sets} with {text!r}: {str(error)!r} is no line")
    except Exception as error:
        raise Broken(f"{sets} with {text!r}: {type(error).__name__}: {error}") from error


def _name_the_nearest(trial: Trial) -> None:
    """A known key without one of its letters: the error names the key."""
    table, key = trial.rng.choice(_KEYS)
    place = trial.rng.randrange(1, len(key))
    wrong = f"{table}.{key[:place]}{key[place + 1 :]}"
    said = msgdrop("train", "--dry-run", "--set", f"{wrong}=1")
    expect(said.code == 2 and repr(key) in said.err, f"{wrong}: {said.err.strip()}")


def _survives(trial: Trial, what: str, arguments: Sequence[str]) -> float:
    """A command ends in time, with a code that it has, in words; returns what it took."""
    began = time.monotonic()
    process = start(arguments, trial.folder)
    code = process.wait(20)
    took = time.monotonic() - began
    shown = f"{what}: {arguments[0]}"
    expect(process.grown < _MOST_BYTES, f"{shown} took {process.grown:,} bytes")
    expect(code in _CODES, f"{shown} ended with {code}: {process.last_line()}")
    expect("Traceback" not in process.said, f"{shown} showed a traceback")
    expect("\x1b]" not in process.said, f"{shown} let an escape sequence through")
    return took
