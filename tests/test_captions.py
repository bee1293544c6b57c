"""The words around a figure."""

from pathlib import Path

from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.report.captions import footer, spread_note
from tests.fake_runs import GROUP, write_run


def test_a_footer_says_what_was_overridden(tmp_path: Path) -> None:
    """Of all, and of one variant by its name; a figure without overrides does not speak of them."""
    of_all, of_one = "algorithm.gamma=0.9", "variants.md-0.2.algorithm.rate=0.3"
    runs = [
        write_run(tmp_path, "dcc", 1, overrides=[of_all]),
        write_run(tmp_path, "md-0.2", 1, overrides=[of_all, of_one]),
    ]
    summary = summarise(runs)
    first, _ = footer(summary, GROUP, summary.arms, "").split("\n")
    assert f"1,000 env steps a run · overridden: {of_all}, {of_one} · seed 1" in first
    plain = summarise([write_run(tmp_path, "fdc", 1)])
    assert "overridden" not in footer(plain, GROUP, plain.arms, "")


def test_a_footer_says_which_runs_it_is_of(tmp_path: Path) -> None:
    """A tree that differed from its commit, and as many seeds that are not the same ones."""
    runs = [write_run(tmp_path, "dcc", 1, commit="0123456789ab+"), write_run(tmp_path, "fdc", 2)]
    summary = summarise(runs)
    first, _ = footer(summary, GROUP, summary.arms, "").split("\n")
    assert "1 seed a variant, not the same" in first
    assert "commits 0123456, 0123456+" in first


def test_a_caption_says_what_the_band_is() -> None:
    """An interval from six seeds on, lowest to highest below, nothing for one; all if all occur."""
    assert spread_note({6, 20}, "line", "band") == (
        "Line: mean over seeds; band: 95% interval of the mean, inverted sign-flips."
    )
    assert spread_note({2, 5}, "line", "band") == (
        "Line: mean over seeds; band: lowest to highest (2 or 5 seeds)."
    )
    assert spread_note({1, 3, 7}, "bar", "line") == (
        "Bar: mean over seeds; line: 95% interval of the mean, inverted sign-flips; "
        "line: lowest to highest (3 seeds); 1 seed: no line."
    )
