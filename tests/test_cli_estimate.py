"""What a plan needs of disk and memory: known, and refused, before anything is trained."""

import os
from collections.abc import Container
from pathlib import Path

import pytest
import torch

from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.commands.parts import estimate
from msgdrop_cli.commands.parts.shapes import on_no_device, run_sizes
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.paper import paper_sizes
from msgdrop_cli.definition.plan import ad_hoc_definition, plan
from msgdrop_cli.definition.spec import PlannedRun, Profile
from msgdrop_cli.engine.checkpoint import Checkpoints
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.run import _Session, train_cohort
from msgdrop_envs import registry
from tests import runs as tiny
from tests.cli_runs import QUESTION, msgdrop

KNOWN = catalogue()
CONFIGS = {named.learner: named.config_class for named in KNOWN.algorithms.values()}
PAPER = paper_sizes(KNOWN.environments, CONFIGS)
ARMS = [
    (environment, algorithm)
    for environment in KNOWN.environments
    for algorithm, named in KNOWN.algorithms.items()
    if (environment, named.learner) in PAPER
]
"""Every named algorithm where the paper has it."""


def planned(environment: str, algorithm: str) -> PlannedRun:
    """One run at the paper's settings."""
    definition = ad_hoc_definition(environment, [algorithm], "paper", Profile(seeds=1))
    return plan(definition, "paper", KNOWN).runs[0]


@pytest.fixture
def question(tmp_path: Path) -> Path:
    """A question of four tiny runs."""
    path = tmp_path / "tiny.toml"
    path.write_text(QUESTION)
    return path


@pytest.mark.parametrize(("environment", "algorithm"), ARMS)
def test_sizes_are_known_without_memory(environment: str, algorithm: str) -> None:
    """Every learner on every environment has the parameters that it has where it trains."""
    run = planned(environment, algorithm)
    env = registry.make(run.spec.environment_config, "cpu")
    learner = learner_class(run.spec.algorithm)([run.spec.algorithm_config], env, "cpu")
    learnt = {"dcc": ["online"], "maddpg": ["actor.online", "critic.online"]}[run.spec.algorithm]
    tensors = learner.tensors(0).items()
    parameters = sum(part.numel() for name, part in tensors if name.startswith(tuple(learnt)))
    sizes = run_sizes(run, episodes=8)
    assert sizes.parameters == parameters
    replay = run.spec.algorithm_config.replay_capacity * env.agents * env.observation_size
    assert sizes.memory > replay * env.observation_dtype.itemsize
    assert sizes.memory < 1.5 * replay * env.observation_dtype.itemsize
    assert torch.ones(1).device.type == "cpu"  # nothing is left switched over


@pytest.mark.parametrize(
    ("settings", "written_at"),
    [
        # Networks are most of it: two checkpoints are kept while the third one is written.
        (["algorithm.replay_capacity=50"], range(20, 201, 20)),
        # Replay is most of it: two files of 1,000 steps still hold one each that is needed.
        (
            [
                *("algorithm.f_units=[4, 4]", "algorithm.g_units=4", "algorithm.h_units=4"),
                *("algorithm.replay_capacity=1000", "training.train_env_steps=4200"),
            ],
            (1_000, 1_500, 1_996, 2_496, 3_000, 4_000),
        ),
    ],
    ids=["networks", "replay"],
)
def test_disk_is_enough_while_a_checkpoint_is_written(
    question: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    settings: list[str],
    written_at: Container[int],
) -> None:
    """However long checkpoints were put off, a run fills no more than was said."""
    overrides = ["training.checkpoint_every_env_steps=4", *settings]
    asked = plan(load_definition(str(question)), "quick", KNOWN, overrides=overrides)
    run = asked.runs[0]
    filled = []
    prune, checkpoint = Checkpoints._prune, _Session._checkpoint

    def measure(checkpoints: Checkpoints) -> None:
        files = [path for path in tmp_path.rglob("*") if path.is_file()]
        filled.append(sum(path.stat().st_blocks * 512 for path in files))
        prune(checkpoints)

    def put_off(session: _Session) -> None:
        if session.training.env_steps in written_at:
            checkpoint(session)

    monkeypatch.setattr(Checkpoints, "_prune", measure)
    monkeypatch.setattr(_Session, "_checkpoint", put_off)
    [outcome] = train_cohort([run], tmp_path)
    assert outcome.status == "done", outcome.reason
    sizes = run_sizes(run, episodes=8)
    assert sizes.kept + sizes.working > max(filled) > 0.7 * (sizes.kept + sizes.working)


@pytest.mark.parametrize("environment", KNOWN.environments)
def test_every_environment_has_its_shapes_without_memory(environment: str) -> None:
    """The tables of an environment are as large on no device as on the processor."""
    config = KNOWN.environments[environment]
    with torch.device("meta"):
        env = registry.make(config, "meta")
    there = registry.make(config, "cpu")
    assert (env.agents, env.observation_size) == (there.agents, there.observation_size)


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("can't start new thread")])
def test_only_sizes_are_called_too_large(error: Exception) -> None:
    """What else goes wrong while shapes are looked up is not blamed on the settings."""
    with pytest.raises(type(error)), on_no_device("here"):
        raise error


@pytest.mark.parametrize(
    "setting",
    [
        "environment.map_size=9223372036854775807",
        "environment.map_size=1000000",
        "environment.sight=1000000000",
        "algorithm.batch_size=9223372036854775807",
        "algorithm.batch_size=1000000000",
        "algorithm.g_units=9223372036854775807",
        "algorithm.g_units=1000000000",
        "algorithm.replay_capacity=9223372036854775807",
        "training.games=1000000000",
        "training.games=9223372036854775807",
    ],
)
def test_absurd_sizes_are_refused(question: Path, tmp_path: Path, setting: str) -> None:
    """What fits no memory is refused in one line before anything is written."""
    results = tmp_path / "results"
    said = msgdrop("ablate", question, "--results", results, "--set", setting)
    last = said.err.splitlines()[-1]
    assert (said.code, said.out) == (2, "")
    assert "bytes) of memory" in last or "than 64 bits can count" in last
    assert len(last) < 300
    assert not results.exists()


def test_memory_is_named_where_it_lacks(question: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Needed and free bytes stand in the line; a GPU's memory is not judged by the machine's."""
    monkeypatch.setattr(estimate, "free_memory", lambda: 1_000)
    said = msgdrop("ablate", question, "--results", question.parent / "results")
    assert said.code == 2
    assert "1,000 bytes) are free" in said.err.splitlines()[-1]
    estimate.check_memory(10**18, "cuda")


@pytest.mark.parametrize(("load", "told"), [(2.0, False), (2.1, True)])
def test_a_plan_says_that_the_machine_is_busy(
    question: Path, monkeypatch: pytest.MonkeyPatch, load: float, told: bool
) -> None:
    """Beside the time that holds for free cores, and only if more is at work than there are.

    There, not here: a job with one core of a machine that has two is told nothing of the other.
    """
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    said = msgdrop("ablate", question, "--dry-run", "--results", question.parent / "results")
    assert ("now the load is 2.1 on 2 cores" in " ".join(said.out.split())) == told
    assert ("the load" in said.out) == told


def test_a_gpu_gets_all_that_can_be_stacked() -> None:
    """Seeds and rates of one network train together there, each alone on a processor."""
    runs = [tiny.planned(seed=seed, rate=rate) for rate in (0.0, 0.2) for seed in (1, 2, 3)]
    other = tiny.planned("fdc")
    assert estimate.cohorts([*runs, other], "cuda") == [tuple(runs), (other,)]
    assert [len(cohort) for cohort in estimate.cohorts([*runs, other], "cpu")] == [1] * 7


def test_free_memory_is_a_part_of_the_machines() -> None:
    """More than nothing and at most what the machine has."""
    whole = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    assert 0 < estimate.free_memory() <= whole


def test_a_claim_on_an_unknown_metric_is_refused(question: Path) -> None:
    """A misspelt metric is found before the training that nobody could judge."""
    question.write_text(QUESTION.replace('"catches_per_500"', '"catches_per_50"'))
    said = msgdrop("ablate", question, "--results", question.parent / "results", "--dry-run")
    assert said.code == 2
    assert "does not measure 'catches_per_50'; did you mean 'catches_per_500'?" in said.err


def test_work_counts_rows_and_updates() -> None:
    """By pencil: own networks see 32 rows each, shared ones 32 of every agent."""
    one = run_sizes(planned("pursuit-n6", "dcc"), episodes=8)
    assert one.work == 6 * 88_053 * 32 / 4
    shared = run_sizes(planned("waterworld-n8", "maddpg"), episodes=8)
    actor = 152 * 64 + 64 + 64 * 2 + 2
    assert shared.parameters == 172_129 + actor
    assert shared.work == (172_129 + actor) * 32 * 8 / 5
