"""The same training on a GPU; skipped where there is none."""

from pathlib import Path

import pytest
import torch

from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.records.files import read_jsonl
from msgdrop_cli.records.store import METRICS
from tests.runs import planned

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no CUDA device")


def test_random_numbers_are_the_same() -> None:
    """Every stream gives exactly the same numbers on both."""
    cpu, gpu = (Streams([1, 2], device).uniforms("env", 1000) for device in ("cpu", "cuda"))
    assert torch.equal(cpu, gpu.cpu())


def test_a_cohort_trains_as_on_the_cpu(tmp_path: Path) -> None:
    """The first windows of the log, before rounding can change an action, agree."""
    runs = [planned(seed=1), planned(seed=2, rate=0.5)]
    rows: dict[str, list[dict[str, float]]] = {}
    for device in ("cpu", "cuda"):
        outcomes = train_cohort(runs, tmp_path / device, device=device)
        assert [outcome.status for outcome in outcomes] == ["done", "done"]
        assert len(evaluate(outcomes[0].path, broken_links=0.5, episodes=4, device=device)) == 4
        rows[device] = [read_jsonl(outcome.path / METRICS)[1] for outcome in outcomes]
    for cpu, gpu in zip(rows["cpu"], rows["cuda"], strict=True):
        assert gpu["loss"] == pytest.approx(cpu["loss"], rel=1e-3)
        assert gpu["q"] == pytest.approx(cpu["q"], rel=1e-3)
