"""Finds learners by file: every module here with a `NAMED` table is one."""

import importlib
import pkgutil
from types import ModuleType
from typing import Any

import msgdrop_cli.algorithms
from msgdrop_cli.algorithms.learner import LearnerFactory


def learners() -> dict[str, ModuleType]:
    """The learners' modules by name; each has a `Config`, `NAMED` and its class.

    It may have `SIZES`, its needs in games for which no file of sizes has any: by the game, tables
    `algorithm` and `training` as in `paper.toml`.
    """
    package = msgdrop_cli.algorithms
    modules = {
        found.name: importlib.import_module(f"{package.__name__}.{found.name}")
        for found in pkgutil.iter_modules(package.__path__)
    }
    return {name: module for name, module in modules.items() if hasattr(module, "NAMED")}


def learner_class(name: str) -> LearnerFactory:
    """The class of learner `name`, called like its file in capitals; KeyError if there is none."""
    factory: Any = getattr(learners()[name], name.upper())
    learner: LearnerFactory = factory
    return learner
