"""What every test shares: torch on one thread, because the number of threads changes bits."""

import pytest
import torch

from msgdrop_cli.engine.arithmetic import THREADS

torch.set_num_threads(THREADS)


@pytest.fixture(autouse=True)
def _no_checkpoint_is_put_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy disk one would be, and tests that count on it would fail."""
    monkeypatch.setattr("msgdrop_cli.engine.run._PUT_OFF", 0)
