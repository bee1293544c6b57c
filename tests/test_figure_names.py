"""Names in figures: all of them are there as a whole, and none stands on another."""

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

from msgdrop_cli.analysis.summary import Summary, summarise
from msgdrop_cli.records.references import Policy, References, game_key
from msgdrop_cli.report.bars import draw_channels
from msgdrop_cli.report.figures import draw_all, draw_learning
from msgdrop_cli.report.lettering import drawable, drawable_name, width, wrapped
from msgdrop_cli.report.looks import shown_arms
from msgdrop_cli.report.marks import spread
from msgdrop_cli.report.rates import draw_dropout_rate
from msgdrop_cli.report.settings import own_settings
from msgdrop_cli.report.write import Folder
from tests.fake_runs import GROUP, write_run

PNG = ("png",)
LONG = "WWWW MMMM learning rate 3e-4, variant {}"
"""More than forty letters, wide ones among them."""


@pytest.fixture(autouse=True)
def settings() -> Iterator[None]:
    """Those of figures."""
    with own_settings():
        yield


def study(root: Path, variants: int, label: str = LONG) -> Summary:
    """So many rates of message dropout and two without messages, all with close results."""
    references = References(
        episodes=9,
        seed=1,
        commit=None,
        policies={
            name: Policy(meaning="any", metrics={"catches_per_500": 0.1 * rank})
            for rank, name in enumerate(("random", "nothing", "scripted"))
        },
    )
    records = [
        write_run(
            root,
            f"exp-{rank}",
            1,
            catches={0.0: 8, 1 / 3: 4, 1.0: 1},
            curve=[0.0, 4.0, 7.0 + 0.01 * rank],
            algorithm={"rate": rank / variants} if rank < variants - 2 else {"network": "own"},
            label=label.format(rank),
        )
        for rank in range(variants)
    ]
    return summarise(records, references={game_key({"name": "pursuit-n6"}): references})


def overlaps(figure: Figure) -> list[tuple[str, str]]:
    """Every two texts of which one stands on the other."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()  # each text would make one of its own
    found = figure.findobj(Text)
    texts = [text for text in found if isinstance(text, Text) and text.get_visible()]
    boxes = [
        (each.get_text(), each.get_window_extent(renderer)) for each in texts if each.get_text()
    ]
    return [
        (one, other)
        for (one, box), (other, another) in combinations(boxes, 2)
        if box.overlaps(another)
    ]


@pytest.mark.parametrize("draw", [draw_learning, draw_dropout_rate, draw_channels])
@pytest.mark.parametrize("variants", [5, 12, 30])
def test_no_text_stands_on_another(variants: int, draw: object, tmp_path: Path) -> None:
    """Names, ticks, title and footer have their places, however many and long the names are."""
    assert callable(draw)
    drawn = draw(study(tmp_path, variants), GROUP)
    assert overlaps(drawn.figure) == []


def test_nothing_is_cut(tmp_path: Path) -> None:
    """The picture grows with its texts: nothing is drawn to its very edge."""
    summary = study(tmp_path, 8, "W" * 60 + " {}")
    for path in draw_all(summary, Folder(tmp_path / "figures"), suffixes=PNG):
        picture = imread(path)[..., :3]
        edges = (picture[:, :3], picture[:, -3:], picture[:3], picture[-3:])
        assert all((edge == 1.0).all() for edge in edges), path.name


def test_short_names_leave_the_picture_as_it_is(tmp_path: Path) -> None:
    """Figures of the questions that are shipped have one size, to be laid side by side."""
    records = [
        write_run(tmp_path, f"md-0.{rate}", 1, catches={0.0: 8, 0.5: 4, 1.0: 1})
        for rate in range(4)
    ]
    paths = draw_all(summarise(records), Folder(tmp_path / "figures"), suffixes=PNG)
    assert {imread(path).shape[1] for path in paths} == {1350}


def test_a_large_study_stays_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wider than a picture may be, it is drawn more coarsely."""
    monkeypatch.setattr("msgdrop_cli.report.drawn._MOST_PIXELS", 900)
    paths = draw_all(study(tmp_path, 8), Folder(tmp_path / "figures"), suffixes=PNG)
    assert {max(imread(path).shape) for path in paths} == {900}


@pytest.mark.parametrize(
    ("text", "drawn"),
    [
        ("na\u00efve \u0394 \u0416", "na\u00efve \u0394 \u0416"),
        ("e\u0301te\u0301", "\u00e9t\u00e9"),
        ("\uff24\uff23\uff23", "DCC"),
        ("\u6d88\u606f 0.2", "? 0.2"),
        ("fast \U0001f680\U0001f680", "fast ?"),
        ("$x^2$", "$x^2$"),
    ],
)
def test_what_the_font_lacks_is_replaced(text: str, drawn: str) -> None:
    """By compatible letters, or each run by one question mark."""
    assert drawable(text) == drawn


def test_who_cannot_be_written_is_named(tmp_path: Path) -> None:
    """Two labels in Chinese must not become the same; a warning would be an error here."""
    labels = ["\u6d88\u606f", "\u4e22\u5f03?", "DCC?"]
    records = [
        write_run(tmp_path, f"exp-{rank}", 1, catches={0.0: 1, 1.0: 2}, label=label)
        for rank, label in enumerate(labels)
    ]
    shown = shown_arms(summarise(records), GROUP)
    assert [each.label for each in shown] == ["exp-0: ?", "exp-1: ??", "DCC?"]
    assert len(draw_all(summarise(records), Folder(tmp_path / "figures"), suffixes=PNG)) == 2


def test_variants_of_one_label_are_told_apart(tmp_path: Path) -> None:
    """By their names, which differ."""
    records = [write_run(tmp_path, f"exp-{rank}", 1, label="mine") for rank in (1, 2)]
    labels = [each.label for each in shown_arms(summarise(records), GROUP)]
    assert labels == ["exp-1: mine", "exp-2: mine"]


def test_lines_are_no_wider_than_asked() -> None:
    """Words stay whole where they can, and break behind a sign where they cannot."""
    lines = wrapped("DCC (algorithm.learning_rate=0.0001)", 1.2, 9.5, "bold")
    assert lines == ["DCC", "(algorithm.", "learning_rate=", "0.0001)"]
    assert max(width(line, 9.5, "bold") for line in lines) <= 1.2
    assert wrapped("W" * 9, 0.5, 9.0) == ["WWWW", "WWWW", "W"]


def test_of_a_name_beyond_measure_both_ends_are_left() -> None:
    """That is where names differ."""
    name = drawable_name("a" * 300 + "z" * 300)
    assert name == "a" * 48 + "\u2026" + "z" * 48


def test_labels_are_spread_as_little_as_needed() -> None:
    """Two that touch move apart by the same amount; a far one stays."""
    placed = spread([5.0, 1.0, 1.5], [1.0] * 3, low=-9.0, high=9.0)
    assert placed == pytest.approx([5.0, 0.75, 1.75])


def test_a_label_of_two_lines_has_twice_the_room() -> None:
    """Half of each one's height is between two middles."""
    placed = spread([1.0, 1.0], [1.0, 2.0], low=-9.0, high=9.0)
    assert np.diff(placed) == pytest.approx([1.5])


def test_labels_stay_between_the_ends() -> None:
    """Twelve curves that end at 0 are named above the axis, not in the footer."""
    placed = spread([0.0] * 4, [0.2] * 4, low=0.0, high=1.0)
    assert placed == pytest.approx([0.1, 0.3, 0.5, 0.7])
