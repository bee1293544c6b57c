"""What a record says about how it was made, so that a number can be traced and made again."""

import os
import platform
import re
import subprocess
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

import msgdrop_cli
from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.definition.spec import RunSpec
from msgdrop_cli.engine.arithmetic import THREADS
from msgdrop_envs import registry
from msgdrop_envs.protocol import Environment

_COMMIT = re.compile(r"[0-9a-f]{40}\+?")


def facts(env: Environment, kernel: str, device: str) -> dict[str, Any]:
    """Versions, commit, host, device, threads, and the formulas of the environment's metrics."""
    return {
        "versions": versions(),
        "commit": commit(),
        "host": host(),
        "device": device,
        "threads": THREADS,
        "kernel": kernel,
        "metrics": {name: asdict(metric) for name, metric in env.metrics.items()},
    }


def versions() -> dict[str, str]:
    """Of everything that numbers depend on."""
    return {
        "msgdrop": msgdrop_cli.__version__,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
    }


def kernel_name(spec: RunSpec, device: str) -> str:
    """What computes this run's updates: results are bit-equal only with the same one."""
    if torch.device(device).type == "cuda":
        return "cuda"
    env = registry.make(spec.environment_config, device)
    return learner_class(spec.algorithm).kernel(spec.algorithm_config, env, device)


def commit() -> str | None:
    """The commit of this source tree, `+` if files differ from it.

    Outside a checkout, what MSGDROP_COMMIT says of this copy of one; None if it says no commit.
    """
    tree = Path(__file__).parents[2]
    if not (tree / ".git").exists():
        said = os.environ.get("MSGDROP_COMMIT", "")
        return said if _COMMIT.fullmatch(said) else None
    status = ["git", "--no-optional-locks", "status", "--porcelain", "-uno"]  # else it writes there
    commands = (["git", "rev-parse", "HEAD"], status)
    try:
        head, changes = (
            subprocess.run(c, cwd=tree, capture_output=True, text=True, check=True).stdout.strip()
            for c in commands
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return head + ("+" if changes else "")


def host() -> str:
    """The kind of processor: results are bit-equal on one kind only."""
    return f"{platform.machine()} {torch.backends.cpu.get_cpu_capability()}"
