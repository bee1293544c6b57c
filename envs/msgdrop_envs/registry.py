"""Finds environments by file: every module here with a `PAPER` table of settings is one."""

import importlib
import pkgutil
from typing import Any

import torch

import msgdrop_envs
from msgdrop_envs.protocol import Environment


def settings() -> dict[str, Any]:
    """Each setting of the paper, e.g. `pursuit-n6`, with its environment's frozen Config."""
    found: dict[str, Any] = {}
    for module in pkgutil.iter_modules(msgdrop_envs.__path__):
        if module.name != "parallel":  # needs the extra `pettingzoo`, and is no environment
            found.update(
                getattr(importlib.import_module(f"msgdrop_envs.{module.name}"), "PAPER", {})
            )
    return found


def make(config: Any, device: torch.device | str = "cpu") -> Environment:
    """The batched environment whose rules `config` (a Config, or a name of the paper) describes.

    Raises KeyError for a name that is none of `settings()`.
    """
    if isinstance(config, str):
        config = settings()[config]
    environment: Environment = config.build(torch.device(device))
    return environment
