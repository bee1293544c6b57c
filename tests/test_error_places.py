"""An error about a value begins with what was typed: the option, or the file and its key."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.cli_runs import msgdrop

TYPED = [
    (["eval", "--channel", "nonsense"], "--channel: no channel is called 'nonsense'"),
    (["eval", "--channel", "loss:2"], "--channel: loss:2: the rate of loss must lie between"),
    (["eval", "--broken-links", "nonsense"], "--broken-links: no channel is called 'nonsense'"),
    (["unstable-test", "--sweep", "los:0..1:3"], "--sweep: no channel is called 'los'"),
    (["unstable-test", "--sweep", "loss:0..3:3"], "--sweep: loss:1.5: the rate of loss must"),
    (["train", "--channel", "worst:1"], "--channel: worst:1 needs a trained policy"),
    (["train", "--channel", "silent:9"], "--channel: the number of silent agents is at most 6"),
    (["train", "--set", "training.channel=worst:1"], "--set: training.channel: worst:1 needs"),
    (["train", "--set", "training.channel=los:1"], "--set: training.channel: no channel is"),
    (["train", "--set", "training.channel=3"], "--set: training.channel: expected a line of text"),
    (["train", "--env", "nonsense"], "--env: no environment is called 'nonsense'"),
    (["train", "--env", "no name"], "--env: 'no name' is not a name"),
    (["train", "--algorithm", "nonsense"], "--algorithm: no algorithm is called 'nonsense'"),
    (["train", "--steps", "1e18"], "--steps: log_every_env_steps must be at least"),
    (["train", "--profile", "nonsense"], "--profile: none is called 'nonsense'"),
    (["train", "--seed", "x"], "--seed: expected a whole number"),
    (["ablate", "dropout-rate", "--profile", "x"], "--profile: no profile of dropout-rate.toml is"),
    (["config", "show", "--env", "nonsense"], "--env: no environment is called 'nonsense'"),
    (["config", "show", "--algorithm", "nonsense"], "--algorithm: no algorithm is called"),
    (["config", "show", "--profile", "nonsense"], "--profile: none is called 'nonsense'"),
]


@pytest.mark.parametrize(("arguments", "expected"), TYPED)
def test_an_error_begins_with_the_option(
    arguments: Sequence[str], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not with what the program has made of it."""
    monkeypatch.chdir(tmp_path)
    said = msgdrop(*arguments)
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith(f"msgdrop: error: {expected}")


def test_a_question_says_which_of_its_keys_training_refuses(tmp_path: Path) -> None:
    """The file, the variant and the key, though only the engine knows what training can do."""
    file = tmp_path / "mine.toml"
    file.write_text(QUESTION)
    said = msgdrop("ablate", file, "--dry-run", "--results", tmp_path)
    place = f"{file}: variants.worst.training.channel: worst:1 needs a trained policy"
    assert said.err.startswith(f"msgdrop: error: {place}")


QUESTION = """
title = "Late"
question = "What if?"
source = "ours"
environments = ["pursuit-n6"]
[variants.dcc]
label = "DCC"
algorithm = { name = "dcc" }
[variants.worst]
label = "DCC through the worst"
algorithm = { name = "dcc" }
training = { channel = "worst:1" }
[profiles.quick]
seeds = 1
training = { train_env_steps = 1000 }
"""
