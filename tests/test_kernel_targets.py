"""The kernels built for other processors: vectors of every width, with fused instructions or not.

The same bits come out of all of them, so a run's result does not depend on where it was trained.
"""

import platform
from pathlib import Path

import pytest

from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.kernels import build
from tests.runs import digest, planned

pytestmark = [
    pytest.mark.skipif(build.library() is None, reason="no C compiler, or MSGDROP_KERNEL=torch"),
    pytest.mark.skipif(platform.machine() != "x86_64", reason="the processors named are x86"),
]
RUNS = [
    planned(environment="pursuit-n6", train_env_steps=160),
    planned(environment="navigation-n8", train_env_steps=160, time_limit=7),
    planned("maddpg-md", environment="waterworld-n8", train_env_steps=160, time_limit=7),
]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.spec.environment)
@pytest.mark.parametrize("processor", ["haswell", "x86-64"])
def test_every_processor_gives_the_same_bits(
    processor: str, run: PlannedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Eight and four numbers in a register instead of sixteen; x86-64 has no fused instruction."""
    if processor == "haswell" and b"avx2" not in build._processor().split():
        pytest.skip("no AVX2 here")
    [here] = train_cohort([run], tmp_path / "here")
    flags = [f"-march={processor}" if flag.startswith("-march") else flag for flag in build._FLAGS]
    monkeypatch.setattr(build, "_FLAGS", flags)
    build._loaded.cache_clear()
    try:
        [there] = train_cohort([run], tmp_path / "there")
    finally:
        monkeypatch.undo()
        build._loaded.cache_clear()
    assert digest(here.path) == digest(there.path)
