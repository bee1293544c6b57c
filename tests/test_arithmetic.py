"""Numbers below 1.2e-38 are 0 in training: what that changes, and what it does not."""

from contextlib import nullcontext
from pathlib import Path

import pytest
import torch
from torch import Tensor

from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.training import Training
from tests.dcc_samples import (
    KERNELS,
    make_batch,
    make_learner,
    mask_uniforms,
    small_config,
    use_kernel,
)
from tests.minibatches import in_memory
from tests.runs import planned

SMALLEST = torch.finfo(torch.float32).tiny
FADED = 1e-39
"""A first moment that an input has left behind which was silent for some thousand updates."""


def _learnt(*, flush: bool) -> tuple[Tensor, Tensor]:
    """Weights and first moments after ten updates that began with faded moments."""
    learner = make_learner(small_config())
    moments = learner.adam.moments["exp_avg"].of_networks(0, learner.online.networks).values()
    for moment in moments:
        moment.fill_(FADED)
    with arithmetic.settled() if flush else nullcontext():
        for step in range(10):
            learner.update(
                in_memory(make_batch(learner, seed=step)), mask_uniforms(learner, 1, step)
            )
    return learner.online.flat, torch.cat([moment.flatten() for moment in moments])


def _faded(moments: Tensor) -> int:
    return int(((moments != 0) & (moments.abs() < SMALLEST)).sum())


@pytest.mark.parametrize("kernel", KERNELS)
def test_faded_moments_are_zero_and_no_weight_misses_them(
    kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With them or without them, weights agree within 1e-30: equal bits for all but a zero."""
    use_kernel(kernel, monkeypatch)
    weights, moments = _learnt(flush=True)
    exact_weights, exact_moments = _learnt(flush=False)
    assert _faded(moments) == 0 < _faded(exact_moments)
    torch.testing.assert_close(weights, exact_weights, rtol=0, atol=1e-30)


def test_a_training_computes_like_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`train_cohort` takes them for zero, on one thread, and keeps no book for derivatives."""
    found = []

    def look(*_: object) -> None:
        faded = torch.tensor(FADED) * 1.0
        found.append((float(faded), torch.get_num_threads(), torch.is_inference_mode_enabled()))
        raise RuntimeError

    monkeypatch.setattr(Training, "begin", look)
    train_cohort([planned()], tmp_path)
    assert found == [(0.0, 1, True)]
    assert torch.tensor(FADED) * 1.0 != 0  # numpy and matplotlib go on as before


def test_within_itself_it_stays(tmp_path: Path) -> None:
    """An evaluation within a training leaves the training's arithmetic as it was."""
    with arithmetic.settled():
        with arithmetic.settled():
            pass
        assert torch.tensor(FADED) * 1.0 == 0
