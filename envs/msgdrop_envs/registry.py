"""Finds games by folder: every package here is one, with its rules and whatever else it has.

`rules.py` holds `PAPER`, settings by name, each a frozen Config, and the game's class, which is
called like the folder (`Pursuit`) and built of a Config and a device. Two more files may stand
beside it: `view.py` with the class that shows one game (`PursuitView`, built of a Config), and
`baselines.py` with `baselines(game)`. No rule of a game imports either.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import torch

import msgdrop_envs
from msgdrop_envs.protocol import Baseline, Environment, View, random_play


def settings() -> dict[str, Any]:
    """Each setting of the paper, e.g. `pursuit-n6`, with its environment's frozen Config."""
    found: dict[str, Any] = {}
    for module in pkgutil.iter_modules(msgdrop_envs.__path__):
        if module.ispkg:
            found.update(importlib.import_module(f"msgdrop_envs.{module.name}.rules").PAPER)
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
    rules = importlib.import_module(f"{_package(config)}.rules")
    environment: Environment = getattr(rules, _class_name(config))(config, torch.device(device))
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
