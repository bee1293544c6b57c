"""What every test shares: torch on one thread, because the number of threads changes bits."""

import gc
import os
import signal
import warnings
from collections.abc import Iterator

import pytest
import torch

from msgdrop_cli.engine.arithmetic import THREADS

torch.set_num_threads(THREADS)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # `nohup make test` would have programs ignore it


@pytest.fixture(autouse=True, scope="session")
def _nobody_pulls_the_plug() -> Iterator[None]:
    """So nothing needs to be waited for; whose fsync fails, or is counted, brings one along."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", os.fstat)
        yield


@pytest.fixture(autouse=True)
def _no_checkpoint_is_put_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy disk one would be, and tests that count on it would fail."""
    monkeypatch.setattr("msgdrop_cli.engine.run._PUT_OFF", 0)


@pytest.fixture(autouse=True)
def _dask_leaves_sockets(request: pytest.FixtureRequest) -> Iterator[None]:
    """A connection of Dask's that fails leaves its socket to the garbage collector, which warns.

    So it is collected here, and not in the middle of somebody else's test.
    """
    if "cluster" not in request.module.__name__:
        yield
        return
    request.node.add_marker(pytest.mark.filterwarnings("ignore::ResourceWarning"))
    yield
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        gc.collect()
