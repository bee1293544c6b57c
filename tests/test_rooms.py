"""The rules of the house, read from the source: who imports whom, and what stays cold.

The rules are in the README's map of rooms. Nothing is imported here except by the last test.
"""

import ast
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
LEARN = ("engine", "algorithms", "msgdrop_envs", "kernels")
WARM = (*LEARN, "networks", "channels", "messages", "ops")
ORDER = (
    *("__main__", "app", "commands", "report", "analysis", "cluster", "scheduler"),
    *WARM,
    *("records", "definition", "msgdrop_ablations", "stopping", "signals", "errors"),
)
"""A room imports itself and what stands to its right."""
LUKEWARM = "msgdrop_envs.metric"
"""A file of a warm room that loads nothing heavy, so that records are read with it."""
TORCH_FREE = {"records", "definition", "msgdrop_ablations", "errors"}
"""These need no tensors at all, not even inside a function."""
EXTRAS = {
    "parallel.py": {"pettingzoo", "gymnasium", "numpy"},
    "connection.py": {"distributed"},
    "workers.py": {"distributed"},
    "shared.py": {"distributed"},
    "tasks.py": {"distributed"},
    "apart.py": {"distributed"},
    "guests.py": {"distributed"},
    "frames.py": {"pandas"},
    "parquet.py": {"pyarrow"},
    "mirrors.py": {"tensorboard", "wandb", "trackio"},
    "replay.py": {"imageio_ffmpeg"},
}
"""Files that import what is no dependency of the program, and say so to whoever lacks it."""
HEAVY = {"torch", "numpy", "matplotlib", "joblib", "safetensors"}.union(*EXTRAS.values())
SOURCE_ROOTS = {"msgdrop_cli": "", "msgdrop_envs": "envs", "msgdrop_ablations": "ablations"}
PRODUCT = sorted(
    path for name, root in SOURCE_ROOTS.items() for path in (ROOT / root / name).rglob("*.py")
)
SOURCES = sorted([*PRODUCT, *(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")])


class Import(NamedTuple):
    """One imported name, e.g. `torch.Tensor` for `from torch import Tensor`."""

    line: int
    name: str
    when_loaded: bool
    """False inside a function or under `if TYPE_CHECKING`."""

    @property
    def root(self) -> str:
        """The top-level package."""
        return self.name.split(".")[0]


def imports(node: ast.AST, when_loaded: bool = True) -> Iterator[Import]:
    """Every import below a node."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            for alias in child.names:
                yield Import(child.lineno, alias.name, when_loaded)
        elif isinstance(child, ast.ImportFrom):
            for alias in child.names:
                yield Import(child.lineno, f"{child.module}.{alias.name}", when_loaded)
        else:
            later = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            typing = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test)
            later = later or typing
            yield from imports(child, when_loaded and not later)


def room_of(name: str) -> str:
    """The room of an imported name or of a module; `` for everything outside the house."""
    first, *rest = name.split(".")
    room = rest[0] if first == "msgdrop_cli" and rest else first
    return room if room in ORDER and first in SOURCE_ROOTS else ""


def module_of_file(path: Path) -> str:
    """The name that a file is imported by; a package ends in `__init__`."""
    root = next(root for name, root in SOURCE_ROOTS.items() if (ROOT / root / name) in path.parents)
    return ".".join(path.relative_to(ROOT / root).with_suffix("").parts)


def room_of_file(path: Path) -> str:
    """The room that a file stands in."""
    return room_of(module_of_file(path))


def wrong_way(source: str, room: str) -> list[Import]:
    """Imports from a room to the left, wherever they stand."""
    allowed = {"", *ORDER[ORDER.index(room) :]}
    return [i for i in imports(ast.parse(source)) if room_of(i.name) not in allowed]


def warming(source: str, room: str) -> list[Import]:
    """Imports that load something heavy where the room must stay cold."""
    if room in WARM:
        return []
    return [
        i
        for i in imports(ast.parse(source))
        if (i.root in HEAVY or room_of(i.name) in WARM) and (i.when_loaded or room in TORCH_FREE)
        if not i.name.startswith(f"{LUKEWARM}.")
    ]


def circle(sources: Mapping[str, str]) -> list[str]:
    """Modules that import each other in turn, wherever the imports stand; sources by module."""
    known = {name.removesuffix(".__init__") for name in sources}
    graph = {
        name.removesuffix(".__init__"): {
            module
            for i in imports(ast.parse(source))
            for module in (i.name, i.name.rpartition(".")[0])
            if module in known
        }
        for name, source in sources.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        modules: list[str] = error.args[1]
        return modules
    return []


def foreign(path: Path, allowed: set[str]) -> list[Import]:
    """Imports from outside the standard library that are not allowed."""
    known = allowed | sys.stdlib_module_names
    return [i for i in imports(ast.parse(path.read_text())) if i.root not in known]


def found(paths: Sequence[Path], check: Callable[[Path], list[Any]]) -> dict[str, list[Any]]:
    """What a check finds, by file; empty if all is well."""
    findings = {str(path.relative_to(ROOT)): check(path) for path in paths}
    return {path: finding for path, finding in findings.items() if finding}


@pytest.mark.parametrize(
    ("source", "room", "caught"),
    [
        ("from msgdrop_cli.engine.run import train_cohort", "algorithms", True),
        ("from msgdrop_cli import engine", "ops", True),
        ("def f():\n    import msgdrop_cli.commands.train", "engine", True),
        ("import msgdrop_envs.registry", "networks", True),
        ("from msgdrop_cli.errors import RunError", "engine", False),
        ("from msgdrop_cli import __version__", "records", False),
        ("from msgdrop_cli.engine.rng import Streams", "engine", False),
    ],
)
def test_an_import_to_the_left_is_noticed(source: str, room: str, caught: bool) -> None:
    """The check of the order fires on what breaks it, and only on that."""
    assert bool(wrong_way(source, room)) == caught


@pytest.mark.parametrize(
    ("source", "room", "caught"),
    [
        ("import torch", "commands", True),
        ("from numpy import mean", "analysis", True),
        ("class A:\n    import joblib", "scheduler", True),
        ("try:\n    import matplotlib.pyplot\nexcept ImportError: pass", "report", True),
        ("from msgdrop_cli.engine import run", "scheduler", True),
        ("from msgdrop_envs.metrics import Metric", "analysis", True),
        ("from msgdrop_envs.metric import Metric", "analysis", False),
        ("def f():\n    import torch", "records", True),
        ("def f():\n    import torch", "commands", False),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import numpy", "report", False),
        ("import torch", "engine", False),
    ],
)
def test_a_heavy_import_is_noticed(source: str, room: str, caught: bool) -> None:
    """The check of the cold rooms fires on what warms them, and only on that."""
    assert bool(warming(source, room)) == caught


@pytest.mark.parametrize(
    "back",
    [
        "from a.rules import State",
        "from a import rules",
        "import a.rules",
        "def f():\n    from a import rules",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from a.rules import State",
    ],
)
def test_a_circle_is_noticed(back: str) -> None:
    """Imports for types and inside functions count; a package that is imported from does not."""
    sources = {"a.__init__": "", "a.rules": "from a.view import View", "a.view": "import torch"}
    assert circle(sources) == []
    assert set(circle({**sources, "a.view": back})) == {"a.rules", "a.view"}


def test_the_rooms_are_found() -> None:
    """The discovery below is not empty by a wrong path."""
    rooms = {room_of_file(path) for path in PRODUCT}
    assert rooms - {""} == set(ORDER)


def test_every_file_stands_in_a_room() -> None:
    """A new room has to be given its place in the order first."""
    homeless = [path for path in PRODUCT if not room_of_file(path)]
    assert homeless == [ROOT / "msgdrop_cli" / "__init__.py"]


def test_imports_go_to_the_right() -> None:
    """A room imports only rooms to its right, inside functions too."""
    in_rooms = [path for path in PRODUCT if room_of_file(path)]
    assert found(in_rooms, lambda path: wrong_way(path.read_text(), room_of_file(path))) == {}


def test_no_files_import_each_other() -> None:
    """There is no circle between files, imports for types and inside functions included."""
    assert circle({module_of_file(path): path.read_text() for path in PRODUCT}) == []


def test_cold_rooms_load_nothing_heavy() -> None:
    """Cold rooms import no torch, numpy, matplotlib, joblib or warm room when they are loaded."""
    assert found(PRODUCT, lambda path: warming(path.read_text(), room_of_file(path))) == {}


def test_the_file_that_is_read_with_records_needs_nothing() -> None:
    """The standard library alone, and so does its package when it is loaded."""
    package = ROOT / "envs" / "msgdrop_envs"
    assert (
        found([package / "metric.py", package / "__init__.py"], lambda p: foreign(p, set())) == {}
    )


def test_environments_need_only_torch() -> None:
    """`msgdrop_envs` stands alone: torch and the standard library; parallel.py has its extra."""
    alone = {"torch", "msgdrop_envs"}
    environments = [path for path in PRODUCT if room_of_file(path) == "msgdrop_envs"]
    assert found(environments, lambda p: foreign(p, alone | EXTRAS.get(p.name, set()))) == {}


def test_only_core_dependencies_are_imported() -> None:
    """The program needs no extra but in the files that say so to whoever lacks it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    core = {requirement.split(">=")[0] for requirement in project["dependencies"]}
    core = {"PIL" if name == "pillow" else name for name in core}  # its name to Python
    core |= set(SOURCE_ROOTS)
    assert found(PRODUCT, lambda path: foreign(path, core | EXTRAS.get(path.name, set()))) == {}


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["ablate", "--help"], ["explain", "dcc-md"]]
)
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    """Help and version answer at once: nothing heavy is loaded on the way, by anybody."""
    paths = [str(ROOT / root) for root in SOURCE_ROOTS.values()]
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "msgdrop_cli", *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    lines = done.stderr.splitlines()
    said = [line for line in lines if not line.startswith("import time:")]
    assert done.returncode == 0, said
    loaded = {line.rsplit("|", 1)[1].strip().split(".")[0] for line in lines if line not in said}
    assert "msgdrop_cli" in loaded
    assert loaded & HEAVY == set()
