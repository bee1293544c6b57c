"""`msgdrop diff`: what two runs or two variants do not have in common."""

import json
from collections import Counter
from pathlib import Path

import pytest

from msgdrop_cli.analysis.comparison import compare
from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.commands.parts import console
from msgdrop_cli.report.table import Table
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Seven seeds of one variant, eight of another with another rate and commit."""
    for seed in range(1, 9):
        if seed < 8:
            write_run(tmp_path, "dcc", seed, catches={0.0: seed}, curve=[50.0, float(seed)])
        write_run(
            tmp_path, "md-0.2", seed, catches={0.0: 2 * seed}, curve=[2.0, 3.0 * seed],
            algorithm={"rate": 0.2}, commit="fedcba", kernel="c-dcc",
        )  # fmt: skip
    return tmp_path


def test_variants_are_compared_seed_by_seed(root: Path) -> None:
    """Those that both have, with the interval of their differences."""
    said = msgdrop("diff", "dcc", "md-0.2", "--results", root, "--json")
    assert said.code == 0, said.err
    [found] = json.loads(said.out)
    assert found["settings"] == {"algorithm.rate": [0.0, 0.2]}
    assert found["made_with"] == {"commit": ["0123456789ab", "fedcba"], "kernel": [None, "c-dcc"]}
    first = found["evaluations"][0]
    low, high = mean_interval([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) or (None, None)
    assert first == {
        "channel": "links:0", "metric": "catches_per_500", "difference": 4.0,
        "low": low, "high": high, "pairs": 7,
    }  # fmt: skip
    assert found["curves_differ_most"] == [500, -48.0]


def test_two_runs_are_a_pair_whatever_their_seeds(root: Path) -> None:
    """By folder or by id; one pair has no interval."""
    one = next((root / "runs" / "pursuit-n6").glob("dcc-s1-*"))
    other = next((root / "runs" / "pursuit-n6").glob("md-0.2-s5-*"))
    said = msgdrop("diff", one, other.name[-8:], "--results", root, "--json")
    assert said.code == 0, said.err
    [found] = json.loads(said.out)
    assert found["evaluations"][0]["difference"] == 9.0
    assert found["evaluations"][0]["low"] is None
    assert found["curves_differ_most"] == [500, -48.0]


def test_one_pair_says_that_it_has_no_interval(root: Path) -> None:
    """As other tables do, with a dash; and it is a pair, not pairs."""
    one = next((root / "runs" / "pursuit-n6").glob("dcc-s1-*"))
    other = next((root / "runs" / "pursuit-n6").glob("md-0.2-s5-*"))
    said = msgdrop("diff", one, other, "--results", root).out
    assert "+9 [\u2013]" in said
    assert "1 pair, " in said
    assert "one pair has no interval" in said


def test_a_commit_is_shown_by_its_first_digits(tmp_path: Path) -> None:
    """A pipe wraps no line, and two whole ones would make 100 characters; programs get them all."""
    commits = [f"{digit * 12}{'0' * 28}" for digit in "ab"]
    sides = [
        write_run(tmp_path, name, 1, commit=f"{commit}{more}").path
        for name, commit, more in zip(("dcc", "md-0.2"), commits, ("", "+"), strict=True)
    ]
    said = msgdrop("diff", *sides, "--results", tmp_path).out
    assert ["commit", "a" * 12, "b" * 12 + "+"] in [line.split() for line in said.splitlines()]
    [found] = json.loads(msgdrop("diff", *sides, "--results", tmp_path, "--json").out)
    assert found["made_with"]["commit"] == [commits[0], f"{commits[1]}+"]


def test_a_run_and_itself_differ_in_nothing(root: Path) -> None:
    """And the terminal says so in words."""
    one = next((root / "runs" / "pursuit-n6").glob("dcc-s1-*"))
    said = msgdrop("diff", one, one)
    assert said.code == 0, said.err
    assert "setting: nothing differs" in said.out
    assert "made with: nothing differs" in said.out
    assert "+0" in said.out


def test_runs_that_broke_down_still_have_settings(tmp_path: Path) -> None:
    """There is nothing else to compare then."""
    one = write_run(tmp_path, "dcc", 1, catches={0.0: 1})
    other = write_run(tmp_path, "dcc", 2, status="failed", algorithm={"gamma": 0.5})
    found = compare([one], [other])
    assert [row.name for row in found.settings] == ["algorithm.gamma"]
    assert (found.evaluations, found.curve, found.largest) == ((), None, None)


def test_other_games_cannot_be_compared(root: Path) -> None:
    """Variants of two games of which none is the other's; an unknown name has its nearest."""
    write_run(root, "sd-0.2", 1, environment="pursuit-n8")
    write_run(root, "sd-0.2", 2, environment="pursuit-n8", train_env_steps=500)
    apart = msgdrop("diff", "dcc", "sd-0.2", "--results", root)
    assert (apart.code, "never trained in one game" in apart.err) == (2, True)
    wrong = msgdrop("diff", "dcc", "md-0.3", "--results", root)
    assert (wrong.code, "md-0.2" in wrong.err) == (2, True)


def test_a_variant_with_two_setups_is_asked_about(root: Path) -> None:
    """Which of them is meant nobody can guess."""
    write_run(root, "dcc", 9, overrides=["algorithm.gamma=0.9"], algorithm={"gamma": 0.9})
    said = msgdrop("diff", "dcc", "md-0.2", "--results", root)
    assert said.code == 2
    assert "dcc: which one, nothing overridden or algorithm.gamma=0.9? name a run id" in said.err


def test_runs_of_a_side_that_disagree_are_all_told(root: Path) -> None:
    """In JSON as a list of what they say, in the terminal side by side."""
    write_run(root, "md-0.2", 9, algorithm={"rate": 0.2}, commit="abc", threads=2)
    said = msgdrop("diff", "dcc", "md-0.2", "--results", root, "--json")
    [found] = json.loads(said.out)
    assert found["made_with"]["commit"] == ["0123456789ab", ["abc", "fedcba"]]
    assert found["made_with"]["threads"] == [None, 2]
    assert "abc, fedcba" in msgdrop("diff", "dcc", "md-0.2", "--results", root).out


def test_what_is_no_name_is_refused(root: Path) -> None:
    """An empty word would be the folder that we are in."""
    said = msgdrop("diff", "", "dcc", "--results", root)
    assert (said.code, said.out) == (2, "")
    assert "expected a variant, a run id or a folder, not ''" in said.err


def test_words_are_never_left_out_for_want_of_room(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Long ones go on in the next line, whole to the last letter; numbers have their own rule."""
    monkeypatch.setattr(console, "_PIPED_WIDTH", 60)
    rows = (("commit", f"{'a' * 39}b, {'c' * 39}d", f"{'e' * 39}f"), ("kernel", "c-dcc", "torch"))
    table = Table(title="besides", headers=("made with", "first", "second"), rows=rows, caption="")
    console.table(table, numbers_from=3)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 60
    assert Counter(said) & Counter("acebdf" * 40) >= Counter("a" * 39 + "c" * 39 + "e" * 39 + "bdf")
    assert "no room" not in said
