"""Finds games by folder: every package in `packages()` is one, with its rules and what else it has.

`rules.py` holds `PAPER`, settings by name, each a frozen Config, and the game's class, which is
called like the folder (`Pursuit`) and built of a Config and a device. Three more files may stand
beside it: `view.py` with the class that shows one game (`PursuitView`, built of a Config),
`baselines.py` with `baselines(game)`, and `sizes.toml` with what learners need for a game that the
paper does not have. No rule of a game knows of them.
"""

import importlib
from collections.abc import Mapping
from importlib import resources
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import torch

from msgdrop_envs.packages import packages
from msgdrop_envs.protocol import Baseline, Environment, View, random_play


class GameError(Exception):
    """A package that is said to hold a game does not, or not one that can be used."""


def settings() -> dict[str, Any]:
    """Each setting of the paper, e.g. `pursuit-n6`, with its environment's frozen Config.

    With them those of the games that other people have installed. Raises GameError for a package
    that cannot be loaded, has no settings or no class, or uses a name that is taken.
    """
    found: dict[str, Any] = {}
    for package in packages():
        paper = _loaded(package)
        if taken := sorted(set(found) & set(paper)):
            raise GameError(f"{package}: another game has the name {taken[0]!r}, too")
        found.update(paper)
    return found


def size_files() -> dict[str, bytes]:
    """What games bring along of sizes for learners: the `sizes.toml` of their packages, by path.

    They read like `paper.toml`, e.g. `[tag-n4.dcc.algorithm]`. Raises GameError: unreadable.
    """
    found: dict[str, bytes] = {}
    for package in packages():
        file = resources.files(package) / "sizes.toml"
        try:
            if file.is_file():
                found[str(file)] = file.read_bytes()
        except OSError as error:
            raise GameError(f"{file}: cannot be read: {error.strerror}") from error
    return found


def game(config: Any) -> str:
    """The name of the game, e.g. `pursuit`, that a Config (or a made environment) belongs to."""
    return _package(config).rpartition(".")[2]


def make(config: Any, device: torch.device | str = "cpu") -> Environment:
    """The batched environment whose rules `config` (a Config, or a name of the paper) describes.

    Raises KeyError for a name that is none of `settings()`.
    """
    if isinstance(config, str):
        config = settings()[config]
    environment: Environment = _class(config)(config, torch.device(device))
    return environment


def view(config: Any) -> View | None:
    """How one game with these rules is named, written down and drawn; None without a `view.py`."""
    module = _part(config, "view")
    if module is None:
        return None
    found: View = getattr(module, f"{_class_name(config)}View")(config)
    return found


def baselines(env: Environment) -> Mapping[str, Baseline]:
    """The policies that learn nothing, by name; random play without a `baselines.py`."""
    module = _part(env, "baselines")
    if module is None:
        return {"random": random_play(env)}
    found: Mapping[str, Baseline] = module.baselines(env)
    return found


def _loaded(package: str) -> dict[str, Any]:
    """The settings of one package; GameError, in one line, whatever is wrong with it."""
    try:
        paper = dict(importlib.import_module(f"{package}.rules").PAPER)
        for config in paper.values():
            _class(config)
    except Exception as error:  # it may be other people's code: anything
        said = " ".join(str(error).split())
        raise GameError(f"{package}: holds no game: {type(error).__name__}: {said}") from error
    return paper


def _class(config: Any) -> Any:
    return getattr(importlib.import_module(f"{_package(config)}.rules"), _class_name(config))


def _package(thing: Any) -> str:
    """The folder's package that the class of a Config or of an environment stands in."""
    return type(thing).__module__.rpartition(".")[0]


def _class_name(thing: Any) -> str:
    """What the game's class is called: `hide_and_seek` is `HideAndSeek`."""
    return "".join(word.capitalize() for word in game(thing).split("_"))


def _part(thing: Any, name: str) -> ModuleType | None:
    """A file of the game's folder that need not be there."""
    module = f"{_package(thing)}.{name}"
    return None if find_spec(module) is None else importlib.import_module(module)
