"""Which of several published copies of a run counts: one that has the episodes asked for."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from msgdrop_cli.commands.parts.survey import Survey, Wanted, survey
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.counted import preferred
from msgdrop_cli.records.packed import pack, packed_name
from msgdrop_cli.records.store import EPISODES, POLICY, RunRecord, list_runs
from tests import runs
from tests.fake_runs import write_run

HALF = Channel.read("half")
RUN = runs.planned()


@dataclass(frozen=True)
class Copies:
    """A results folder with published copies of one run."""

    root: Path

    def add(self, study: str, catches: Mapping[float, int], *, policy: bool = False) -> Path:
        """Two episodes through each of these channels."""
        made = write_run(
            self.root, RUN.variant, 1, catches=catches, run_id=RUN.run_id, definition=study
        ).path
        place = self.root / "published" / f"{study}-quick" / made.parent.name / made.name
        shutil.copytree(made, place)
        shutil.rmtree(self.root / "runs")
        if policy:
            (place / POLICY).write_bytes(b"?")
        return place

    def survey(self) -> Survey:
        """Two episodes through all links and through half of them are wanted."""
        wanted = Wanted(run=RUN, channels=(NONE_BROKEN, HALF), episodes=2)
        return survey([wanted], self.root)

    def records(self) -> list[RunRecord]:
        """All copies."""
        return list_runs(self.root)


@pytest.fixture
def copies(tmp_path: Path) -> Copies:
    """None as yet."""
    return Copies(tmp_path)


def test_a_copy_with_the_episodes_comes_before_one_that_could_be_played(copies: Copies) -> None:
    """Also where that is of the question that asks."""
    copies.add(RUN.definition, {0.0: 1}, policy=True)
    whole = copies.add("other", {0.0: 1, 0.5: 1})
    found = copies.survey()
    assert [record.path for record in found.records.values()] == [whole]
    assert found.to_play == frozenset()


def test_a_copy_that_can_be_played_comes_before_training(copies: Copies) -> None:
    """Whatever stands before it."""
    copies.add(RUN.definition, {0.0: 1})
    playable = copies.add("other", {0.0: 1}, policy=True)
    found = copies.survey()
    assert [record.path for record in found.records.values()] == [playable]
    assert found.to_play == {RUN.run_id}
    assert found.short == frozenset()


def test_damaged_episodes_matter_only_where_no_other_copy_is_sound(copies: Copies) -> None:
    """Then they are no reason to train the run again unasked."""
    damaged = copies.add(RUN.definition, {0.0: 1, 0.5: 1}) / EPISODES
    damaged.write_text("{\n")
    sound = copies.add("other", {0.0: 1, 0.5: 1})
    assert [record.path for record in copies.survey().records.values()] == [sound]
    shutil.rmtree(sound)
    with pytest.raises(RecordError, match=str(damaged)):
        copies.survey()


def test_of_copies_that_with_most_episodes_is_preferred(copies: Copies) -> None:
    """Packed or not."""
    copies.add("fewer", {0.0: 1})
    more = copies.add("more", {0.0: 1, 0.5: 1})
    log = more / EPISODES
    log.with_name(packed_name(EPISODES)).write_bytes(pack(log.read_bytes()))
    log.unlink()
    assert preferred(copies.records())[0].path == more


def test_a_damaged_log_has_no_episodes(copies: Copies) -> None:
    """Whoever has none comes before it."""
    damaged = copies.add("damaged", {0.0: 1, 0.5: 1})
    (damaged / EPISODES).rename(damaged / packed_name(EPISODES))
    sound = copies.add("sound", {0.0: 1})
    assert [record.path for record in preferred(copies.records())] == [sound, damaged]
