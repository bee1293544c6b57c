"""Numbers that are not finite: noticed where they count, named, and never a checkpoint."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import run as engine
from msgdrop_cli.engine.checkpoint import Checkpoints
from msgdrop_cli.engine.divergence import not_finite
from msgdrop_cli.engine.graphs import Chunks
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from msgdrop_cli.records.files import count_jsonl
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.store import METRICS
from tests.chunk_runs import STEPS, small_runs
from tests.runs import planned
from tests.tape import Tapes, be_a_device, without_c

NAN = float("nan")
Spoil = Callable[[Training], object]


def spoilt_at(env_steps: int, spoil: Spoil) -> type[Training]:
    """A training in which something happens to the numbers after so many env steps."""

    class Spoilt(Training):
        def advance(self) -> None:
            super().advance()
            if self.env_steps == env_steps:
                spoil(self)

    return Spoilt


def bias_of_agent_2(training: Training) -> None:
    """One number of one network of the first run."""
    training.learner.tensors(0)["online.h2.bias"][2, 0, 1] = NAN


def ends(
    run: PlannedRun, root: Path, monkeypatch: pytest.MonkeyPatch, at: int, spoil: Spoil
) -> Outcome:
    """The outcome of a run whose numbers are spoilt."""
    monkeypatch.setattr(engine, "Training", spoilt_at(at, spoil))
    [outcome] = train_cohort([run], root)
    return outcome


@pytest.mark.parametrize(
    ("algorithm", "environment"),
    [
        ("dcc-md", "pursuit-n6"),
        ("concat-md", "navigation-n8"),
        ("maddpg-md", "waterworld-n8"),
    ],
)
def test_sound_training_is_finite(algorithm: str, environment: str) -> None:
    """No false alarm: nothing in any game's or learner's state is infinite for a purpose."""
    training = Training([planned(algorithm, environment=environment).spec])
    training.begin()
    assert not_finite(training, 0) is None
    while training.learner.progress[0] < 4:
        training.advance()
    assert not_finite(training, 0) is None


def test_agent_and_layer_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first place in the learner's order, seen before it has spread to the other layers."""
    outcome = ends(planned(), tmp_path, monkeypatch, 240, bias_of_agent_2)
    assert outcome.status == "diverged"
    assert outcome.reason == (
        "agent 2, layer h2: online bias is not finite at 240 env steps, after 36 updates"
    )


@pytest.mark.parametrize(
    ("algorithm", "environment", "what", "update"),
    [
        ("dcc-md", "pursuit-n6", "agent 0, layer f1: online weight", 17),
        ("maddpg-md", "waterworld-n8", "all agents, layer f1: critic online weight", 14),
    ],
)
@pytest.mark.parametrize("kernel", ["c", "torch"])
def test_a_loss_is_seen_at_its_update(
    algorithm: str,
    environment: str,
    what: str,
    update: int,
    kernel: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A discount that is no number makes all targets so, at 168 env steps, in the first update."""
    if kernel == "torch":
        without_c(monkeypatch)
    run = planned(algorithm, environment=environment)
    outcome = ends(run, tmp_path, monkeypatch, 160, lambda t: t.replay.discount.fill_(NAN))
    expected = f"{what} is not finite at 168 env steps, after {update} updates"
    assert (outcome.status, outcome.reason) == ("diverged", expected)


def test_a_reward_is_seen_at_its_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long before a minibatch happens to hold it."""
    outcome = ends(planned(), tmp_path, monkeypatch, 168, lambda t: t.sums[-1].fill_(NAN))
    assert outcome.reason == "return is not finite at 176 env steps, after 19 updates"


def test_in_a_cohort_only_one_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody else gets another row of the log by it."""
    monkeypatch.setattr(engine, "Training", spoilt_at(168, bias_of_agent_2))
    first, second = train_cohort([planned(), planned(seed=2)], tmp_path)
    assert (first.status, second.status) == ("diverged", "done")
    assert "not finite at 176 env steps" in str(first.reason)
    assert count_jsonl(first.path / METRICS) == 2
    assert (first.env_steps, second.env_steps) == (176, 480)
    assert count_jsonl(second.path / METRICS) == 6


def test_repeated_chunks_are_looked_at_one_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a GPU the numbers of a chunk are read while the next one is at work."""
    be_a_device(monkeypatch)
    monkeypatch.setattr(engine, "recorder", lambda device: Tapes())
    monkeypatch.setattr(engine, "Chunks", partial(Chunks, steps=STEPS))
    run = planned(train_env_steps=4_000, checkpoint_every_env_steps=4_000)
    plan = replace(run.spec.training, log_every_env_steps=4_000)
    run = replace(run, spec=replace(run.spec, training=plan))
    took: list[int] = []
    look = Training.look

    def spoil(training: Training, numbers: list[float], updates: int) -> None:
        took.append(updates)
        if len(took) == 3:
            bias_of_agent_2(training)
        look(training, numbers, updates)

    monkeypatch.setattr(Training, "look", spoil)
    [outcome] = train_cohort([run], tmp_path)
    assert outcome.status == "diverged"
    assert str(outcome.reason).endswith(f"after {took[-1]} updates")
    assert took[-1] - took[2] == 2 * STEPS * 8 // 4


@pytest.mark.parametrize(
    ("channel", "starts", "most"),
    [("links:0", 10_000, 100), ("links:0", 0, 100), ("links:0", 0, STEPS - 1), ("delay:1", 0, 100)],
    ids=["before learning", "first of its pattern", "short of a stop", "through a channel"],
)
def test_steps_that_no_recording_repeats_are_looked_at(
    channel: str, starts: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a GPU, too, and not only for a row of the log: one chunk late, as repeated ones."""
    be_a_device(monkeypatch)
    [run, _] = small_runs("dcc", replay_start_env_steps=starts)
    through = replace(run.spec.training, channel=channel)
    training, tapes = Training([replace(run.spec, training=through)]), Tapes()
    training.begin()
    training.sums[-1].fill_(NAN)
    chunks = Chunks(training, tapes, STEPS)
    while not training.odd and training.env_steps < 100 * 8:
        chunks.advance(most)
    assert (training.env_steps, tapes.tapes) == (2 * STEPS * 8, [])


def test_large_numbers_are_finite() -> None:
    """Their sum may be too large for a float where none of them is."""
    training = Training([planned().spec])
    training.begin()
    training.learner.tensors(0)["target.f1.weight"].fill_(3e38)
    assert not_finite(training, 0) is None


def test_a_network_that_all_agents_share_is_named() -> None:
    """MADDPG has one critic: no single agent is to blame."""
    run = planned("maddpg-md", environment="waterworld-n8")
    training = Training([run.spec])
    training.begin()
    training.learner.tensors(0)["critic.target.g1.weight"][0, 0, 0] = float("inf")
    assert not_finite(training, 0) == "all agents, layer g1: critic target weight"


def test_a_loss_that_is_not_finite_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where every weight still is finite, the row of the log says what is not."""

    def overflow(training: Training) -> None:
        training.learner.tensors(0)["metric_sums"][0] = float("inf")

    outcome = ends(planned(), tmp_path, monkeypatch, 240, overflow)
    assert outcome.reason == "loss is not finite at 240 env steps, after 36 updates"


@pytest.mark.parametrize("every", [8, 24, 1_000])
def test_the_last_good_checkpoint_is_kept(
    every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However often checkpoints are written, the run ends at the same update; none is spoilt."""
    run = planned(checkpoint_every_env_steps=every)
    outcome = ends(run, tmp_path, monkeypatch, 176, bias_of_agent_2)
    assert (outcome.status, outcome.env_steps) == ("diverged", 184)
    assert str(outcome.reason).startswith("agent 2, layer ")
    assert str(outcome.reason).endswith(" is not finite at 184 env steps, after 21 updates")
    found = Checkpoints(outcome.path, run.run_id).latest(count_jsonl(outcome.path / METRICS))
    good = 175 // every * every
    assert (found.counters.env_steps if found else 0) == good
    if found is not None:
        assert all(bool(t.isfinite().all()) for t in found.state.values() if t.is_floating_point())


def test_what_spoils_the_last_update_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The losses of the last window are finite, but what they left behind is no policy."""
    outcome = ends(planned(), tmp_path, monkeypatch, 480, bias_of_agent_2)
    assert outcome.status == "diverged"
    assert not (outcome.path / "policy.safetensors").exists()
