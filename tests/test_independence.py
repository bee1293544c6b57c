"""A run's result depends on its spec and seed only, bit for bit on one machine."""

from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import run as engine
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from msgdrop_cli.records.store import list_runs
from tests.runs import StopAt, digest, planned


@pytest.fixture
def asked_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes `stop` precise: it is asked after every step instead of twice a second."""
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)


def _train(runs: list[PlannedRun], root: Path) -> list[str]:
    outcomes = train_cohort(runs, root)
    assert [outcome.status for outcome in outcomes] == ["done"] * len(runs)
    return [digest(outcome.path) for outcome in outcomes]


def test_alone_and_in_a_cohort_of_three(tmp_path: Path) -> None:
    """Stacked with other seeds and other rates, a run gives the bits that it gives alone."""
    runs = [planned(seed=1), planned(seed=2, rate=0.5), planned(seed=3, rate=0.0)]
    together = _train(runs, tmp_path / "together")
    alone = [_train([run], tmp_path / "alone")[0] for run in runs]
    assert together == alone
    assert len(set(alone)) == 3


@pytest.mark.parametrize("algorithm", ["fdc", "dcc-sd", "full-md", "concat-md"])
def test_every_variant_is_independent_of_its_cohort(algorithm: str, tmp_path: Path) -> None:
    """The same for the other networks and masks."""
    runs = [planned(algorithm, seed=seed, train_env_steps=200) for seed in (1, 2)]
    together = _train(runs, tmp_path / "together")
    assert together[1] == _train([runs[1]], tmp_path / "alone")[0]


@pytest.mark.parametrize("algorithm", ["fdc", "dcc-md", "dcc-sd"])
def test_numbers_instead_of_bytes_are_independent_too(algorithm: str, tmp_path: Path) -> None:
    """The same for navigation, whose observations go through the dense first layer."""
    spec: dict[str, Any] = {"environment": "navigation-n8", "time_limit": 7}
    runs = [planned(algorithm, seed=seed, train_env_steps=200, **spec) for seed in (1, 2, 3)]
    together = _train(runs, tmp_path / "together")
    assert together[1] == _train([runs[1]], tmp_path / "alone")[0]


@pytest.mark.usefixtures("asked_at_every_step")
def test_navigation_stopped_and_resumed_is_undisturbed(tmp_path: Path) -> None:
    """Places, velocities and the replay of numbers come back from a checkpoint as they were."""
    run = planned(environment="navigation-n10", time_limit=7, train_env_steps=320)
    expected = _train([run], tmp_path / "undisturbed")[0]
    [outcome] = train_cohort([run], tmp_path / "stopped", stop=StopAt(27))
    assert (outcome.status, outcome.env_steps) == ("interrupted", 216)
    assert _train([run], tmp_path / "stopped")[0] == expected


@pytest.mark.parametrize("steps", [3, 12, 20, 21, 40, 59])
@pytest.mark.usefixtures("asked_at_every_step")
def test_stopped_and_resumed_is_undisturbed(steps: int, tmp_path: Path) -> None:
    """Stopped before learning, at and between checkpoints, after the replay wrapped: same bits."""
    run = planned()
    expected = _train([run], tmp_path / "undisturbed")[0]
    [outcome] = train_cohort([run], tmp_path / "stopped", stop=StopAt(steps))
    assert (outcome.status, outcome.env_steps) == ("interrupted", 8 * steps)
    assert _train([run], tmp_path / "stopped")[0] == expected


@pytest.mark.usefixtures("asked_at_every_step")
def test_stopped_several_times(tmp_path: Path) -> None:
    """A run that is stopped again and again still ends with the same bits."""
    run = planned("dcc-sd", rate=0.3)
    expected = _train([run], tmp_path / "undisturbed")[0]
    stops = 0
    while train_cohort([run], tmp_path / "stopped", stop=StopAt(9))[0].status == "interrupted":
        stops += 1
    assert stops == 6
    assert digest(next((tmp_path / "stopped").rglob("policy.safetensors")).parent) == expected


@pytest.mark.usefixtures("asked_at_every_step")
def test_a_stopped_cohort_can_go_on_in_parts(tmp_path: Path) -> None:
    """Runs that were stacked may be resumed one by one."""
    runs = [planned(seed=1), planned(seed=2)]
    expected = _train(runs, tmp_path / "undisturbed")
    train_cohort(runs, tmp_path / "stopped", stop=StopAt(30))
    assert [_train([run], tmp_path / "stopped")[0] for run in runs] == expected


def test_two_seeds_give_two_results(tmp_path: Path) -> None:
    """A seed that did nothing would make every test here pass."""
    first, second = (_train([planned(seed=s)], tmp_path / str(s))[0] for s in (1, 2))
    assert first != second


def test_a_finished_run_is_left_alone(tmp_path: Path) -> None:
    """A second call trains nothing and reports the same outcome."""
    run = planned(train_env_steps=120)
    [first] = train_cohort([run], tmp_path)
    before = (first.path / "run.json").read_bytes()
    assert train_cohort([run], tmp_path) == [first]
    assert (first.path / "run.json").read_bytes() == before
    assert not (first.path / "checkpoints").exists()


def test_a_failing_cohort_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception in training gives the status `failed` and its reason; the lock is free."""

    def broken(self: object, batch: object) -> None:
        raise ArithmeticError("on purpose")

    monkeypatch.setattr("msgdrop_cli.engine.training.Training.learn", broken)
    run = planned(train_env_steps=160)
    [outcome] = train_cohort([run], tmp_path)
    assert (outcome.status, outcome.reason) == ("failed", "ArithmeticError: on purpose")
    assert list_runs(tmp_path)[0].status == "failed"
    monkeypatch.undo()
    assert train_cohort([run], tmp_path)[0].status == "done"


def test_a_diverged_run_does_not_spoil_its_cohort(tmp_path: Path) -> None:
    """Weights that are not finite end one run as `diverged`; the other one's bits are its own."""
    runs = [planned(seed=1), planned(seed=2)]
    expected = _train([runs[1]], tmp_path / "alone")[0]

    class Poisoned(Training):
        def begin(self, encoder: Any = None) -> None:
            super().begin(encoder)
            if self.runs == 2:
                self.learner.tensors(0)["online.h2.bias"].fill_(float("nan"))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "Training", Poisoned)
        first, second = train_cohort(runs, tmp_path / "together")
    assert first.status == "diverged"
    assert "not finite" in str(first.reason)
    assert (second.status, digest(second.path)) == ("done", expected)
