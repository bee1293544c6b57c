"""Tiny but real runs for the tests of the engine: the paper's shapes, few steps."""

import hashlib
import json
from dataclasses import fields, replace
from pathlib import Path

from msgdrop_cli.definition.plan import ad_hoc_definition, plan
from msgdrop_cli.definition.run_id import run_id
from msgdrop_cli.definition.spec import PlannedRun, Profile, RunSpec, TrainingSpec
from msgdrop_cli.engine.offers import catalogue


def planned(
    algorithm: str = "dcc-md",
    *,
    seed: int = 1,
    environment: str = "pursuit-n6",
    time_limit: int = 60,
    map_size: int | None = None,
    train_env_steps: int = 480,
    checkpoint_every_env_steps: int = 160,
    **config: object,
) -> PlannedRun:
    """A run of a few hundred env steps that learns, wraps its replay round and cuts episodes."""
    known = catalogue()
    named = known.algorithm(algorithm)
    early = {
        "replay_capacity": 200,
        "replay_start_env_steps": 100,
        "target_update_every_updates": 20,
        "epsilon_anneal_env_steps": 300,
    }
    known_fields = {field.name for field in fields(named.config_class)}
    settings = {
        **{name: value for name, value in early.items() if name in known_fields},
        **named.overrides,
        **config,
    }
    rules = {"time_limit": time_limit, **({"map_size": map_size} if map_size else {})}
    spec = RunSpec(
        environment=environment,
        environment_config=replace(known.environment(environment), **rules),
        algorithm=named.learner,
        algorithm_config=named.config_class(**settings),
        training=TrainingSpec(
            train_env_steps=train_env_steps,
            log_every_env_steps=80,
            checkpoint_every_env_steps=checkpoint_every_env_steps,
        ),
        seed=seed,
    )
    return PlannedRun(
        run_id=run_id(spec),
        variant=algorithm,
        label=algorithm.upper(),
        definition="test",
        profile="tiny",
        spec=spec,
    )


def foreign_run(
    game: str, algorithm: str = "dcc-md", *overrides: str, steps: int = 480
) -> PlannedRun:
    """A run of a few hundred env steps, as `train --env` plans it."""
    training = {"train_env_steps": steps, "log_every_env_steps": 80}
    training["checkpoint_every_env_steps"] = 160
    name = f"tests.somebodys_game:{game}"
    question = ad_hoc_definition(name, [algorithm], "tiny", Profile(seeds=1, training=training))
    small = ("algorithm.replay_start_env_steps=100", "algorithm.replay_capacity=200")
    [run] = plan(question, "tiny", catalogue(), overrides=[*small, *overrides]).runs
    return run


class StopAt:
    """Stops the training when it is asked for the `calls`-th time; asked at every step."""

    def __init__(self, calls: int) -> None:
        self.calls = calls

    def __call__(self) -> bool:
        """Whether to stop now."""
        self.calls -= 1
        return self.calls <= 0


def digest(path: Path) -> str:
    """SHA-256 over a run's policy and log, wall times left out: one digest, one result."""
    lines = (path / "metrics.jsonl").read_text().splitlines()
    rows = [{k: v for k, v in json.loads(x).items() if k != "wall_time_s"} for x in lines]
    content = (path / "policy.safetensors").read_bytes() + json.dumps(rows).encode()
    return hashlib.sha256(content).hexdigest()
