"""Differences of arms, paired by seed: which are drawn, from which numbers."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.analysis.differences import paired_curves, pairs_of, shipped_claims
from msgdrop_cli.analysis.intervals import mean_interval
from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.spec import Claim
from msgdrop_cli.report.differences import draw_differences
from msgdrop_cli.report.figures import draw_all
from msgdrop_cli.report.learning_differences import draw_learning_differences
from msgdrop_cli.report.write import Folder
from tests.fake_runs import GROUP, write_run

CLAIM = Claim(
    says="MD helps",
    source="l. 1",
    better="md-0.2",
    worse="dcc",
    environment="pursuit-n6",
    metric="catches_per_500",
)
LEARNING = replace(CLAIM, measure="learning")
BROKEN = replace(CLAIM, channel=Channel.read("half"))
CURVES = {"md-0.2": ([3.0, 5.0], [4.0, 9.0]), "dcc": ([2.0, 6.0], [1.0, 4.0])}
"""Two seeds each; the differences are [1, -1] and [3, 5]."""


def study(root: Path, **changes: Any) -> Summary:
    """Two arms with two seeds, evaluated with none and half of the links broken."""
    return summarise(
        [
            write_run(
                root, variant, seed, curve=curve, catches={0.0: 8 + seed, 0.5: seed}, **changes
            )
            for variant, curves in CURVES.items()
            for seed, curve in enumerate(curves, start=1)
        ]
    )


def test_curves_are_subtracted_seed_by_seed(tmp_path: Path) -> None:
    """Their mean and, below six seeds, the lowest and the highest."""
    summary = study(tmp_path)
    [curve] = paired_curves(pairs_of(summary, GROUP, [LEARNING])).values()
    assert curve.by_seed == {1: [1.0, -1.0], 2: [3.0, 5.0]}
    assert curve.mean == [2.0, 2.0]
    assert curve.band == [(1.0, 3.0), (-1.0, 5.0)]


def test_from_six_seeds_on_the_band_is_an_interval_of_the_differences(tmp_path: Path) -> None:
    """Inverted sign-flips of the pairs: arms that rise and fall together have a narrow one."""
    runs = [
        write_run(tmp_path, variant, seed, curve=[10.0 * seed + shift + seed % 3])
        for variant, shift in (("md-0.2", 1.0), ("dcc", 0.0))
        for seed in range(1, 8)
    ]
    [curve] = paired_curves(pairs_of(summarise(runs), GROUP, [LEARNING])).values()
    assert curve.band == [mean_interval([1.0] * 7)]


def test_where_less_is_better_the_difference_is_turned(tmp_path: Path) -> None:
    """Above 0 speaks for the claim, in the curve as in the number."""
    formula = {"count": "catches", "per": "steps", "scale": 500.0, "meaning": "any"}
    metrics = {"catches_per_500": {**formula, "better": "lower"}}
    pairs = pairs_of(study(tmp_path, metrics=metrics), GROUP, [LEARNING])
    [curve] = paired_curves(pairs).values()
    assert curve.mean == [-2.0, -2.0]
    assert list(pairs[0].differences.values()) == [0.0, -4.0]


def test_each_comparison_is_drawn_once(tmp_path: Path) -> None:
    """Two questions may ask the same; claims about other games or without runs are in none."""
    others = (
        replace(CLAIM, says="again"),
        replace(CLAIM, environment="pursuit-n8"),
        replace(CLAIM, better="md-0.9"),
        replace(CLAIM, metric="steps_to_finish"),
    )
    pairs = pairs_of(study(tmp_path), GROUP, [CLAIM, BROKEN, *others])
    assert [pair.claim for pair in pairs] == [CLAIM, BROKEN]


def test_differences_after_training_have_their_seeds_in_the_file(tmp_path: Path) -> None:
    """Mean with low and high, then each seed, under the words of the comparison."""
    summary = study(tmp_path)
    drawn = draw_differences(summary, GROUP, pairs_of(summary, GROUP, [BROKEN, LEARNING]))
    assert drawn is not None
    assert [row[2:] for row in drawn.rows] == [
        ("learning", None, None, 2.0, 0.0, 4.0),
        ("learning", None, 1, 0.0, None, None),
        ("learning", None, 2, 4.0, None, None),
        ("evaluation", "links:0.5", None, 0.0, 0.0, 0.0),
        ("evaluation", "links:0.5", 1, 0.0, None, None),
        ("evaluation", "links:0.5", 2, 0.0, None, None),
    ]


def test_panels_are_of_claims_about_learning(tmp_path: Path) -> None:
    """What broken links do after training is on no axis of env steps."""
    summary = study(tmp_path)
    assert draw_learning_differences(summary, GROUP, pairs_of(summary, GROUP, [BROKEN])) is None
    drawn = draw_learning_differences(summary, GROUP, pairs_of(summary, GROUP, [LEARNING]))
    assert drawn is not None
    titles = [axes.get_title(loc="left") for axes in drawn.figure.axes[1:]]
    assert titles == ["MD-0.2 vs DCC"]


@pytest.mark.parametrize(("definition", "drawn"), [("navigation", 0), ("blockwise", 0)])
def test_only_shipped_questions_bring_their_claims(
    definition: str, drawn: int, tmp_path: Path
) -> None:
    """Those of the game and variants at hand; of a stranger's question none are known."""
    summary = study(tmp_path, definition=definition)
    assert len(pairs_of(summary, GROUP, shipped_claims(summary))) == drawn


def test_figures_of_a_shipped_question_show_its_differences(tmp_path: Path) -> None:
    """Its claims are found by the name in the records; nobody has to give them."""
    summary = study(tmp_path, definition="blockwise-vs-elementwise")
    paths = draw_all(summary, Folder(tmp_path / "figures"), suffixes=["csv"])
    assert [path.name.removeprefix("pursuit-n6-quick-1000-") for path in paths] == [
        *("learning.csv", "learning-differences.csv", "broken-links.csv", "differences.csv")
    ]
