"""Numbers below 1.2e-38 are 0 in training: what that changes, and what it does not."""

from collections.abc import Iterator
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
from tests.runs import planned

SMALLEST = torch.finfo(torch.float32).tiny
FADED = 1e-39
"""A first moment that an input has left behind which was silent for some thousand updates."""


@pytest.fixture(autouse=True)
def settled() -> Iterator[None]:
    """Whatever a test asks for, the next one computes as all do."""
    yield
    arithmetic.settle()


def _learnt(*, flush: bool) -> tuple[Tensor, Tensor]:
    """Weights and first moments after ten updates that began with faded moments."""
    torch.set_flush_denormal(flush)
    learner = make_learner(small_config())
    learner.adam.moments["exp_avg"].flat.fill_(FADED)
    for step in range(10):
        learner.update(make_batch(learner, seed=step), mask_uniforms(learner, 1, step))
    torch.set_flush_denormal(False)  # or nobody could see such a number
    return learner.online.flat, learner.adam.moments["exp_avg"].flat


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

    torch.set_flush_denormal(False)
    monkeypatch.setattr(Training, "begin", look)
    train_cohort([planned()], tmp_path)
    assert found == [(0.0, 1, True)]
