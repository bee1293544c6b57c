"""Whoever evaluates says what is played: the game, the variant, the seed, and through what."""

from pathlib import Path

import pytest

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.records.store import list_runs
from msgdrop_cli.scheduler import Task, work
from msgdrop_cli.stopping import Control, in_memory
from tests.cli_runs import Store, copied_store, filled_store, msgdrop


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Four tiny runs."""
    return filled_store(tmp_path_factory.mktemp("cli"))


def test_every_command_calls_a_run_alike(store: Store, tmp_path: Path) -> None:
    """Training, evaluation and the test of each link."""
    name = "pursuit-n6, DCC-MD 0.2, seed 1"
    assert f"done         {name}  (" in store.said.err
    copy = copied_store(store, tmp_path)
    asked = ("--channel", "loss:0.2", "--episodes", "3", "--workers", "1")
    for command in (("eval", *asked), ("unstable-test", *asked, "--channel", "delay:1")):
        said = msgdrop(command[0], copy.results, *command[1:])
        assert f"evaluated    {name}  (" in said.err
    said = msgdrop("unstable-test", copy.results, "--links", "--episodes", "1")
    assert f"evaluating   {name}, without each of its links\n" in said.err
    assert "What each link is worth, pursuit-n6, profile quick, " in said.out


def test_a_terminal_is_told_the_channel(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One phase after the other, as whoever shows it reads it."""
    record = list_runs(copied_store(store, tmp_path).results)[0]
    through = (Channel.read("half"), Channel.read("loss:0.2"))
    task = Task(root=record.path, trained=(record,), channels=through, episodes=2, device="cpu")
    seen: list[str] = []
    with in_memory() as control:
        mark = Control.mark

        def marked(self: Control, run_id: str, phase: str) -> None:
            mark(self, run_id, phase)
            seen.extend(self.phases().values())

        monkeypatch.setattr(Control, "mark", marked)
        work(task, control)
    assert seen == ["evaluating half broken", "evaluating loss 0.2"]


def test_a_damaged_published_policy_is_named_where_it_lies(store: Store, tmp_path: Path) -> None:
    """It is played in a copy, which is gone when somebody looks for it."""
    copy = copied_store(store, tmp_path)
    kept = copy.results / "published" / "x-quick" / "pursuit-n6"
    kept.parent.mkdir(parents=True)
    (copy.results / "runs" / "pursuit-n6").rename(kept)
    policy = next(kept.glob("dcc-s1-*")) / "policy.safetensors"
    policy.write_bytes(policy.read_bytes()[:100])
    said = msgdrop("eval", policy.parent, "--channel", "delay:1", "--episodes", "2")
    assert f"evaluation: {policy}: is damaged" in said.err
