"""Run folders on disk for the tests of analysis and report: what the engine would have written."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from msgdrop_cli.analysis.summary import Group
from msgdrop_cli.records.store import RunRecord, list_runs
from msgdrop_envs.pursuit.rules import Pursuit

GROUP = Group("pursuit-n6", 1000, "quick")


def write_run(
    root: Path,
    variant: str,
    seed: int,
    *,
    catches: Mapping[float, int] | None = None,
    curve: Sequence[float | None] = (1.0, 2.0, 3.0, 4.0),
    status: str = "done",
    profile: str = "quick",
    train_env_steps: int = 1000,
    algorithm: Mapping[str, Any] | None = None,
    **changes: Any,
) -> RunRecord:
    """One run; catches: broken links -> catches in two episodes of 250 steps, so catches per 500.

    curve: catches per 500 of windows that share the training equally. changes: keys of `run.json`.
    """
    settings = {"learner": "dcc", "network": "fgh", "dropout": "message", "drops_own": False}
    algorithm = {**settings, "rate": 0.0, **(algorithm or {})}
    window = train_env_steps // max(1, len(curve))
    training = {"train_env_steps": train_env_steps, "games": 8, "log_every_env_steps": window}
    run = {
        "schema": 1,
        "run_id": _run_id(variant, seed, profile, train_env_steps, algorithm),
        "variant": variant,
        "label": variant.upper(),
        "definition": "test",
        "profile": profile,
        "status": status,
        "reason": None,
        "environment": "pursuit-n6",
        "seed": seed,
        "spec": {
            "environment": {"name": "pursuit-n6"},
            "algorithm": algorithm,
            "training": training,
            "seed": seed,
        },
        "env_steps": train_env_steps,
        "wall_time_s": 1.0,
        "commit": "0123456789ab",
        "metrics": {name: asdict(metric) for name, metric in Pursuit.metrics.items()},
    } | changes
    path = root / "runs" / str(run["environment"]) / f"{variant}-s{seed}-{run['run_id']}"
    path.mkdir(parents=True)
    (path / "run.json").write_text(json.dumps(run))
    _write_rows(path / "metrics.jsonl", _windows(curve, window, train_env_steps))
    _write_rows(path / "episodes.jsonl", _episodes(catches or {}))
    return list_runs(path)[0]


def write_arm(root: Path, variant: str, catches: Sequence[int], **settings: Any) -> list[RunRecord]:
    """Seeds 1, 2, ... of one variant, evaluated with all links."""
    return [
        write_run(root, variant, seed, catches={0.0: count}, **settings)
        for seed, count in enumerate(catches, start=1)
    ]


def _windows(
    curve: Sequence[float | None], window: int, train_env_steps: int
) -> list[dict[str, Any]]:
    ends = [*(window * rank for rank in range(1, len(curve))), train_env_steps]
    return [
        {"env_steps": end, "catches_per_500": value}
        for end, value in zip(ends, curve, strict=False)
    ]


def _episodes(catches: Mapping[float, int]) -> list[dict[str, Any]]:
    return [
        {
            "broken_links": broken_links,
            "episode": episode,
            "steps": 250,
            "catches": count if episode == 0 else 0,
            "finished": episode == 0,
            "return": -10.0,
        }
        for broken_links, count in catches.items()
        for episode in range(2)
    ]


def _write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def _run_id(*parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:8]
