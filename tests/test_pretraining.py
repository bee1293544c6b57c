"""What an encoder learns before the training: once, exactly, and how much a message still tells."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.hearing import Encoding
from msgdrop_cli.algorithms.reconstruction import Reconstruction
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine import arithmetic, pretraining
from msgdrop_cli.engine.pretraining import RECORD, WEIGHTS, Pretrained, pretrained
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.tensors import read_tensors
from msgdrop_cli.engine.training import Training
from msgdrop_cli.errors import RecordError
from msgdrop_cli.messages.encoders import encoder_of
from msgdrop_cli.records.files import run_lock
from msgdrop_cli.records.store import POLICY, list_runs
from tests.cli_runs import msgdrop
from tests.dcc_samples import rand
from tests.runs import StopAt, planned
from tests.stopped_runs import flip

SAMPLES = 600


@pytest.fixture(autouse=True)
def often_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """`stop` is asked after every step."""
    monkeypatch.setattr(pretraining, "_LOOK_UP_EVERY_S", 0.0)


def _run(**changes: Any) -> PlannedRun:
    given = {"encoder": "autoencoder", "encoder_samples": SAMPLES, "train_env_steps": 160}
    return planned(**{**given, **changes})


def _encoding(run: PlannedRun) -> Encoding:
    samples = run.spec.algorithm_config.encoder_samples
    return Encoding("autoencoder", 147, 1, "cpu", samples=samples)


@arithmetic.settled()
def _pretrained(root: Path, run: PlannedRun, stop: Any = lambda: False) -> Pretrained | None:
    return pretrained(run.spec, _encoding(run), root, stop)


def _weights(root: Path, run: PlannedRun) -> Mapping[str, Tensor]:
    made = _pretrained(root, run)
    assert made is not None
    return made.weights


def _folder(root: Path) -> Path:
    [folder] = (root / pretraining.PRETRAINED).iterdir()
    return folder


def test_runs_of_any_seed_and_rate_share_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is made once, and stands in every policy that hears it."""
    runs = [_run(), _run(seed=2, rate=0.5)]
    train_cohort(runs[:1], tmp_path)
    monkeypatch.setattr(pretraining, "_make", None)
    train_cohort(runs[1:], tmp_path)
    made = read_tensors(_folder(tmp_path) / WEIGHTS)
    for record in list_runs(tmp_path):
        assert record.status == "done"
        policy = read_tensors(record.path / POLICY)
        for name in ("encode1.weight", "encode1.bias", "encode2.weight", "encode2.bias"):
            assert torch.equal(policy[f"encoder.{name}"], made[f"encoder.{name}"])
        assert not [name for name in policy if "decode" in name]


def test_it_comes_out_the_same_wherever_it_is_made(tmp_path: Path) -> None:
    """Made in another folder, and made again where a bit is wrong or the record is lost."""
    expected = {name: part.clone() for name, part in _weights(tmp_path / "one", _run()).items()}
    folder = _folder(tmp_path / "one")
    for number in range(2):
        if number:
            (folder / RECORD).unlink()
        else:
            flip(folder / WEIGHTS)
        found = _weights(tmp_path / "one", _run())
        assert all(torch.equal(part, expected[name]) for name, part in found.items())
    other = _weights(tmp_path / "two", _run(seed=9))
    assert all(torch.equal(part, expected[name]) for name, part in other.items())


def test_another_game_or_another_number_of_samples_is_another_one(tmp_path: Path) -> None:
    """Each has a folder of its own; cosmetics and the learner's settings have none."""
    runs = [_run(), _run(gamma=0.5), _run(map_size=9), _run(encoder_samples=SAMPLES + 1)]
    for run in runs:
        _weights(tmp_path, run)
    assert len([*(tmp_path / pretraining.PRETRAINED).iterdir()]) == 3


def test_who_comes_second_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While another process holds the lock nothing is made; then it is read."""
    expected = _weights(tmp_path, _run())
    monkeypatch.setattr(pretraining, "_make", None)
    with run_lock(_folder(tmp_path)):
        assert _pretrained(tmp_path, _run(), stop=StopAt(3)) is None
    assert _weights(tmp_path, _run()).keys() == expected.keys()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    """The folder may have come from somebody else."""
    (tmp_path / pretraining.PRETRAINED).symlink_to(tmp_path)
    with pytest.raises(RecordError, match="is a symbolic link"):
        _pretrained(tmp_path, _run())


def test_a_stop_leaves_nothing_half_made(tmp_path: Path) -> None:
    """The run is interrupted before its first step, and begins anew."""
    [stopped] = train_cohort([_run()], tmp_path, stop=StopAt(5))
    assert (stopped.status, stopped.env_steps) == ("interrupted", 0)
    assert stopped.reason == "stopped while its encoder learnt"
    assert not (_folder(tmp_path) / RECORD).exists()
    [done] = train_cohort([_run()], tmp_path)
    assert done.status == "done"


def test_nothing_begins_without_its_encoder() -> None:
    """A training that was given no weights says so, instead of sending zeros."""
    with pytest.raises(KeyError, match="encode1"):
        Training([_run().spec]).begin()


def test_the_error_is_told_channel_by_channel(tmp_path: Path) -> None:
    """In the record, and below the table of results; the mean of a channel is pencil-checkable."""
    [outcome] = train_cohort([_run()], tmp_path)
    known = list_runs(outcome.path)[0].pretraining
    assert known is not None
    assert list(known.errors) == ["others", "evaders", "boundary"]
    assert known.samples == SAMPLES
    record = json.loads((_folder(tmp_path) / RECORD).read_text())
    assert record["asked"]["samples"] == SAMPLES
    with arithmetic.settled():
        seen, unseen = _seen().split([SAMPLES, SAMPLES])
    variance = (unseen.double() - seen.double().mean(0)).square().mean(0).view(3, 49).sum(1)
    told = [each.of_the_mean for each in known.errors.values()]
    assert told == pytest.approx(variance.tolist(), abs=2e-4)
    shown = msgdrop("eval", outcome.path, "--episodes", "2")
    assert shown.code == 0, shown.err
    assert f"encoder  {known.folder}: of what is seen it loses others " in shown.out


def _seen() -> Tensor:
    env = Training([_run().spec]).env
    return pretraining._play(env, Streams([1]), 2 * SAMPLES, pretraining.HOW["games"])


def test_random_play_is_what_is_learnt_from() -> None:
    """As many observations as asked, of all agents of games that stand at any step of theirs."""
    with arithmetic.settled():
        seen = _seen()
    assert seen.shape == (2 * SAMPLES, 147)
    assert seen.dtype == torch.uint8
    frames = seen[: 3 * 384].view(3, 384, 147)  # 64 games of 6 agents, step by step
    assert not torch.equal(frames[0], frames[1])
    assert bool((frames[0] != frames[1]).any(1).float().mean() > 0.7)  # nearly all see a change


def test_a_linear_autoencoder_finds_what_there_is() -> None:
    """Observations of three hidden numbers are reconstructed from 32; noise is not."""
    hidden, mixing = rand(400, 3, seed=1), rand(3, 20, seed=2)
    noise = rand(400, 60, seed=3)
    left = []
    for obs in (hidden @ mixing, noise):
        obs = obs - obs.mean(0)
        learner = Reconstruction(encoder_of("autoencoder"), obs.shape[1], 3e-3)
        learner.initialise(rand(1, learner.init_uniforms, seed=4))
        for _ in range(400):
            learner.minimise(lambda obs=obs: obs)  # type: ignore[misc]
        left.append(float(learner.errors(obs).sum() / obs.square().mean(0).sum()))
    assert left[0] < 0.02
    assert left[1] > 0.1


def test_the_shipped_autoencoder_has_the_papers_layers() -> None:
    """147-64-32-64-147 as drawn; the message is the middle."""
    encoder = encoder_of("autoencoder")
    assert encoder.layers(147) == {"encode1": (147, 64), "encode2": (64, 32)}
    assert encoder.decoder(147) == {"decode1": (32, 64), "decode2": (64, 147)}
    assert encoder.width(147) == 32


def test_no_other_run_has_it_in_its_record(tmp_path: Path) -> None:
    """Runs whose messages are observations pretrain nothing."""
    [outcome] = train_cohort([planned(train_env_steps=80)], tmp_path)
    assert list_runs(outcome.path)[0].pretraining is None
    assert not (tmp_path / pretraining.PRETRAINED).exists()
    spec = _run().spec
    assert replace(spec.algorithm_config, encoder="observation", encoder_samples=1_000_000) == (
        replace(planned().spec.algorithm_config)
    )
