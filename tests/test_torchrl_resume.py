"""docs/resume.md: what it says of TorchRL's resume, tried where torchrl is installed."""

from pathlib import Path

import pytest

Told = list[tuple[str, int, dict[str, str]]]


def train(folder: Path) -> Told:
    """What a training, or its going on, tells."""
    from benchmarks.torchrl_recipe import train

    told: Told = []
    train(folder, lambda *each: told.append(each))
    return told


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # TorchRL says that its trainer is an experiment
def test_torchrl_brings_back_all_but_the_game(tmp_path: Path) -> None:
    """Two undisturbed trainings are equal; one that goes on has another game, and another end."""
    pytest.importorskip("torchrl")
    from benchmarks.torchrl_recipe import CHECKPOINTS, LOADED

    undisturbed = train(tmp_path / "a")
    assert train(tmp_path / "b") == undisturbed
    newest = max((tmp_path / "a" / CHECKPOINTS).iterdir())
    newest.rename(tmp_path / newest.name)
    [(moment, env_steps, loaded), *_, ended] = train(tmp_path / "a")
    assert moment == "loaded"
    [saved] = [said for word, steps, said in undisturbed if (word, steps) == ("saved", env_steps)]
    assert {name for name in LOADED if loaded[name] != saved[name]} == {"environment"}
    assert ended[2]["network"] != undisturbed[-1][2]["network"]
