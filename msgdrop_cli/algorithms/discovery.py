"""Finds learners by file: every module here with a `NAMED` table is one."""

from types import ModuleType
from typing import Any

import msgdrop_cli.algorithms
from msgdrop_cli.algorithms.learner import LearnerFactory
from msgdrop_cli.definition.modules import modules_in


def learners() -> dict[str, ModuleType]:
    """The learners' modules by name; each has a `Config`, `NAMED` and its class.

    It may have `SIZES`, its needs in games for which no file of sizes has any: by the game, tables
    `algorithm` and `training` as in `paper.toml`.
    """
    package = msgdrop_cli.algorithms
    modules = modules_in(package.__name__, package.__path__)
    return {name: module for name, module in modules.items() if hasattr(module, "NAMED")}


def learner_class(name: str) -> LearnerFactory:
    """The class of learner `name`, called like its file in capitals; KeyError if there is none."""
    factory: Any = getattr(learners()[name], name.upper())
    learner: LearnerFactory = factory
    return learner
