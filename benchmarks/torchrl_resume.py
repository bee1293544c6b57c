"""What a resume brings back, TorchRL's and ours: python -m benchmarks.torchrl_resume [row=trials].

The faults of `tests/faults` on TorchRL's recipe (`torchrl_recipe.py`), beside as many of ours.
Install it first, beside the test extras:

    .venv/bin/python -m pip install -c constraints.txt torchrl==0.14.1 gymnasium

First two undisturbed trainings must be equal in every quantity; without that nothing is compared.
"""

import json
import os
import pickle
import platform
import random
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import torch

from benchmarks import torchrl_recipe as recipe
from tests.faults.corpus import _Execute
from tests.faults.disks import _SIZE, _disk, _fill
from tests.faults.study import STEPS, Running
from tests.faults.table import ROWS

TRIALS = {"kill": 100, "kills": 10, "full disk": 20, "damage": 200, "hostile": 1}
FULL = {row.name: row.trials for row in ROWS}
_KILLS = 3
"""Of one training, in the row of several."""


class Told(NamedTuple):
    """What a training told: "loaded", "saved" or "ended", at which env steps, with what."""

    moment: str
    env_steps: int
    digests: dict[str, str]


class Table:
    """How many of how many, fact by fact in the order in which they came."""

    def __init__(self) -> None:
        self.held: Counter[str] = Counter()
        self.asked: Counter[str] = Counter()

    def add(self, fact: str, holds: object) -> None:
        """Count one trial of a fact."""
        self.asked[fact] += 1
        self.held[fact] += bool(holds)

    def show(self) -> None:
        """Print the counts."""
        for fact, asked in self.asked.items():
            print(f"  {fact:<64} {self.held[fact]:>4} of {asked}", flush=True)


class Trials:
    """The trials of all rows, with what an undisturbed training said at each moment."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made = 0
        began = time.monotonic()
        self.expected = self.finished(self.start(place := self.new()))
        self.seconds = time.monotonic() - began
        self.sample = place
        self.saved = {told.env_steps: told.digests for told in self.expected[:-1]}

    def new(self) -> Path:
        """A folder for one training."""
        self.made += 1
        return self.folder / str(self.made)

    def start(self, place: Path, work: Callable[..., object] = recipe.train) -> Running:
        """Begin to train in a folder, or to go on there, in a process of its own."""
        place.mkdir(exist_ok=True)
        said = self.folder / f"said-{place.name}-{time.monotonic_ns()}"
        said.touch()
        if pid := os.fork():
            return Running(pid, said)
        os.setsid()
        handle = os.open(said, os.O_WRONLY | os.O_APPEND)
        os.dup2(handle, 1), os.dup2(handle, 2)
        code = 1
        try:
            work(place, lambda *told: os.write(1, b"told " + json.dumps(told).encode() + b"\n"))
            code = 0
        except BaseException:
            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(code)

    def finished(self, process: Running) -> list[Told]:
        """What it told until its end; empty unless it ended well."""
        return told(process) if process.wait() == 0 else []

    def kill(self, table: Table, rng: random.Random) -> None:
        """Kill -9 at any moment, and the same again."""
        place = self.new()
        process = self.start(place)
        time.sleep(rng.uniform(0.0, self.seconds))
        process.send()
        self.go_on(table, place, process, process.wait())

    def kills(self, table: Table, rng: random.Random) -> None:
        """Kill -9 again and again, until it ends."""
        place = self.new()
        for _ in range(_KILLS):
            process = self.start(place)
            time.sleep(rng.uniform(0.3, 0.8) * self.seconds)
            process.send()
            if process.wait() == 0:
                break
        process = self.start(place)
        code = process.wait()
        table.add("the same again ends well", code == 0)
        self._compare(table, told(process), code)

    def full_disk(self, table: Table, rng: random.Random) -> None:
        """The disk is full from some moment on; then there is room, and the same again."""
        with _disk(self.new(), f"size={_SIZE}") as disk:
            process = self.start(disk / "run")
            time.sleep(rng.uniform(0.0, self.seconds))
            _fill(disk / "ballast")
            code = process.wait()
            table.add("trained on, or ended with an error and no signal", code >= 0)
            (disk / "ballast").unlink()
            self.go_on(table, disk / "run", process, code)

    def damage(self, table: Table, rng: random.Random) -> None:
        """A file of the newest checkpoint is cut or has another bit, and is loaded."""
        place = self.new()
        shutil.copytree(self.sample, place)
        newest = max((place / recipe.CHECKPOINTS).iterdir())
        files = [path for path in sorted(newest.rglob("*")) if path.is_file()]
        file = rng.choice([path for path in files if path.stat().st_size])
        content = bytearray(file.read_bytes())
        if rng.random() < 0.5:
            content = content[: rng.randrange(len(content))]
        else:
            bit = rng.randrange(8 * len(content))
            content[bit // 8] ^= 1 << bit % 8
        file.write_bytes(content)
        process = self.start(place, _load)
        code = process.wait()
        back = [each for each in told(process) if each.moment == "loaded"]
        as_saved = bool(back) and self._as_saved(back[0]) == set(recipe.LOADED) - {"environment"}
        table.add("ended by a signal", code < 0)
        table.add("refused in words", code > 0)
        table.add("an older checkpoint served", as_saved and back[0].env_steps < STEPS)
        table.add("what was saved came back all the same", as_saved)
        table.add("something else was loaded without a word", back and not as_saved)

    def hostile(self, table: Table, rng: random.Random) -> None:
        """Somebody's checkpoint has a pickle where the replay memory's prefetched rows stand."""
        place = self.new()
        shutil.copytree(self.sample, place)
        for file in (place / recipe.CHECKPOINTS).rglob("prefetch.pkl"):
            file.write_bytes(pickle.dumps(_Execute(place / "canary")))
        self.start(place, _load).wait()
        table.add("a checkpoint from others executed nothing", not (place / "canary").exists())

    def go_on(self, table: Table, place: Path, process: Running, code: int) -> None:
        """What came of a training; if it did not end well, of the same again."""
        table.add("had ended before the fault, or did not mind it", code == 0)
        if code:
            process = self.start(place)
            code = process.wait()
            table.add("the same again ends well", code == 0)
        said = told(process)
        if back := [each for each in said if each.moment == "loaded"]:
            same = self._as_saved(back[0])
            for name in recipe.LOADED:
                table.add(f"once loaded, as it was saved: {name}", name in same)
        self._compare(table, said, code)

    def _compare(self, table: Table, said: list[Told], code: int) -> None:
        """What it had come to at its end, quantity by quantity."""
        end = self.expected[-1].digests
        last = said[-1].digests if code == 0 else {}
        loaded = any(each.moment == "loaded" for each in said)
        went_on = "from a checkpoint" if loaded else "from the start"
        for name in recipe.COMPARED:
            table.add(f"at the end, {went_on}, as undisturbed: {name}", last.get(name) == end[name])
        rest = [last.get(name) == end[name] for name in end if name != "whole log"]
        table.add("everything but repeated rows of the log as undisturbed", all(rest))
        table.add("everything as undisturbed", last == end)

    def _as_saved(self, back: Told) -> set[str]:
        saved = self.saved.get(back.env_steps, {})
        return {name for name in recipe.LOADED if back.digests[name] == saved.get(name)}


def told(process: Running) -> list[Told]:
    """What a training told so far."""
    lines = (line for line in process.said.splitlines() if line.startswith("told "))
    return [Told(*json.loads(line.removeprefix("told "))) for line in lines]


def _load(place: Path, watch: Callable[[str, int, dict[str, str]], object]) -> None:
    """Only load the newest checkpoint, and tell what came back."""
    trainer = recipe.make_trainer(place)
    trainer.load_from_file(trainer.checkpoint_rotation.latest())
    game = trainer.collector.env.base_env._env.unwrapped
    watch("loaded", trainer.collected_frames, recipe.quantities(trainer, game, place))


def ours(row: str, trials: int) -> str:
    """What the row of the fault table says after about as many trials."""
    scale = {"FAULTS": str(trials / FULL[row])}
    command = [sys.executable, "-m", "tests.faults", "--row", row, "--json"]
    done = subprocess.run(command, env={**os.environ, **scale}, capture_output=True, text=True)
    [said] = json.loads(done.stdout)
    failed = f"; {said['first_failure']}" if said["first_failure"] else ""
    return f"{said['survived']} of {said['trials']}: {said['promise']}{failed}"


def main() -> None:
    """Run the rows that are asked for, all of them without a word."""
    asked = {name: int(count) for name, _, count in (word.partition("=") for word in sys.argv[1:])}
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    names = ("torchrl", "tensordict", "torch", "gymnasium")
    print(
        ", ".join(f"{name} {version(name)}" for name in names),
        f"Python {platform.python_version()}",
    )
    with tempfile.TemporaryDirectory(prefix="msgdrop-torchrl-") as folder:
        trials = Trials(Path(folder))
        again = trials.finished(trials.start(trials.new()))
        if not again or again != trials.expected:
            sys.exit("two undisturbed trainings differ: nothing can be compared")
        print(f"two undisturbed trainings are equal; one takes {trials.seconds:.1f} s")
        for row, count in (asked or TRIALS).items():
            _show(trials, row, count)


def _show(trials: Trials, row: str, count: int) -> None:
    table, began = Table(), time.monotonic()
    for number in range(count):
        getattr(trials, row.replace(" ", "_"))(table, random.Random(f"{row} {number}"))
    print(f"\n{row}: {count} trials, {time.monotonic() - began:.0f} s\n TorchRL")
    table.show()
    print(f" msgdrop\n  {ours('hostile file' if row == 'hostile' else row, count)}", flush=True)


if __name__ == "__main__":
    main()
