"""Tables and figures: what is drawn from which records, what they say, how they are written."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.spec import Claim
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.bars import draw_channels
from msgdrop_cli.report.drawn import Drawn
from msgdrop_cli.report.figures import draw_all, draw_learning
from msgdrop_cli.report.rates import draw_dropout_rate
from msgdrop_cli.report.table import (
    Table,
    channels_table,
    claims_table,
    results_table,
    to_markdown,
)
from msgdrop_cli.report.write import Folder
from tests.fake_runs import GROUP, write_arm, write_run

BROKEN = {0.0: 8, 0.5: 4, 1.0: 1}
ELEMENT = {"dropout": "element"}
PNG = ("png",)


def full_study(root: Path) -> list[RunRecord]:
    """FDC, DCC and two rates of message dropout, two seeds each, three channels."""
    variants: dict[str, dict[str, Any]] = {
        "fdc": {"network": "own"},
        "dcc": {"rate": 0.0},
        "md-0.2": {"rate": 0.2},
        "md-0.5": {"rate": 0.5},
    }
    return [
        write_run(root, variant, seed, catches=BROKEN, algorithm=algorithm)
        for variant, algorithm in variants.items()
        for seed in (1, 2)
    ]


def test_a_full_study_gives_every_figure(tmp_path: Path) -> None:
    """Three kinds for one group in four files each, and nothing else in the folder."""
    paths = draw_all(summarise(full_study(tmp_path)), Folder(tmp_path / "figures"))
    assert [path.name for path in paths] == [
        f"pursuit-n6-quick-1000-{kind}.{suffix}"
        for kind in ("learning", "dropout-rate", "broken-links")
        for suffix in ("png", "pdf", "svg", "csv")
    ]
    assert sorted((tmp_path / "figures").iterdir()) == sorted(paths)
    begin = {".png": b"\x89PNG\r\n", ".pdf": b"%PDF-", ".svg": b"<?xml", ".csv": b"environment,"}
    assert all(path.read_bytes().startswith(begin[path.suffix]) for path in paths)


def test_bars_of_other_channels_are_not_called_broken_links(tmp_path: Path) -> None:
    """One message that comes late is no broken link: neither the file nor the title says so."""
    records = full_study(tmp_path)
    for record in records:
        rows = (record.path / "episodes.jsonl").read_text()
        late = rows.replace('"broken_links": 1.0', '"channel": "delay:2"')
        (record.path / "episodes.jsonl").write_text(late)
    summary = summarise(records)
    names = [path.name for path in draw_all(summary, Folder(tmp_path / "figures"), suffixes=PNG)]
    assert "pursuit-n6-quick-1000-channels.png" in names
    assert not any("broken-links" in name for name in names)


def test_a_figure_that_nobody_wants_is_not_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawing takes longer than all that a figure shows."""
    monkeypatch.setattr("msgdrop_cli.report.figures.draw_learning", None)
    paths = draw_all(
        summarise(full_study(tmp_path)),
        Folder(tmp_path / "figures"),
        suffixes=["csv"],
        wanted=lambda name: not name.endswith("-learning"),
    )
    kinds = [path.stem.removeprefix("pursuit-n6-quick-1000-") for path in paths]
    assert kinds == ["dropout-rate", "broken-links"]


def test_same_records_same_bytes(tmp_path: Path) -> None:
    """Drawing again changes no published file."""
    records = full_study(tmp_path)
    first, second = (
        draw_all(summarise(records), Folder(tmp_path / name), suffixes=PNG)
        for name in ("one", "two")
    )
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_only_what_the_records_allow_is_drawn(tmp_path: Path) -> None:
    """One channel and two rates make a learning curve only."""
    records = [
        write_run(tmp_path, name, 1, catches={0.0: 3}, algorithm={"rate": rate})
        for name, rate in (("dcc", 0.0), ("md-0.2", 0.2))
    ]
    paths = draw_all(summarise(records), Folder(tmp_path / "figures"), suffixes=PNG)
    assert [path.name for path in paths] == ["pursuit-n6-quick-1000-learning.png"]


def test_nothing_done_nothing_drawn(tmp_path: Path) -> None:
    """Unfinished runs give no figure and no folder."""
    records = write_arm(tmp_path, "dcc", [1, 2], status="running")
    assert draw_all(summarise(records), Folder(tmp_path / "figures")) == []
    assert not (tmp_path / "figures").exists()


@pytest.mark.parametrize("draw", [draw_learning, draw_dropout_rate, draw_channels])
def test_a_figure_says_what_it_was_made_from(tmp_path: Path, draw: object) -> None:
    """Environment, profile, length, seeds, losses, commit, formula and band stand in the footer."""
    records = [*full_study(tmp_path), write_run(tmp_path, "sd-0.2", 1, status="diverged")]
    assert callable(draw)
    figure = draw(summarise(records), GROUP).figure
    footer = " ".join(figure.texts[0].get_text().split())
    for fact in (
        "pursuit-n6 · profile quick · 1,000 env steps a run · seeds 1, 2 · "
        "1 failed or diverged run left out · commit 0123456",
        "catches per 500 = 500 x catches / steps",
        "lowest to highest (2 seeds)",
    ):
        assert fact in footer


def test_fdc_is_a_point_of_its_own(tmp_path: Path) -> None:
    """The end of the rate axis says FDC, not 1, and no line leads to it."""
    drawn = draw_dropout_rate(summarise(full_study(tmp_path)), GROUP)
    assert drawn is not None
    (axes,) = drawn.figure.axes
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["0", "0.2", "0.5", "FDC"]
    assert _rates(drawn) == [0.0, 0.2, 0.5]


def test_element_dropout_makes_no_message_curve(tmp_path: Path) -> None:
    """Three rates of something else are not drawn as message dropout."""
    records = [
        write_run(tmp_path, f"sd-{rate}", 1, catches=BROKEN, algorithm={"rate": rate} | ELEMENT)
        for rate in (0.1, 0.2, 0.3)
    ]
    assert draw_dropout_rate(summarise(records), GROUP) is None


def test_other_set_ups_stay_out_of_the_rate_curve(tmp_path: Path) -> None:
    """Element-wise dropout and overridden runs are no points of the curve."""
    records = [
        *full_study(tmp_path),
        write_run(tmp_path, "sd-0.3", 1, catches=BROKEN, algorithm={"rate": 0.3} | ELEMENT),
        write_run(tmp_path, "md-0.4", 1, catches=BROKEN, algorithm={"rate": 0.4, "gamma": 0.5}),
    ]
    drawn = draw_dropout_rate(summarise(records), GROUP)
    assert drawn is not None
    assert _rates(drawn) == [0.0, 0.2, 0.5]


def test_a_rate_that_is_no_number_is_no_point(tmp_path: Path) -> None:
    """Somebody else's record is left out of the curve, and is no error."""
    strange = write_run(tmp_path, "strange", 1, catches=BROKEN, algorithm={"rate": "x"})
    drawn = draw_dropout_rate(summarise([*full_study(tmp_path), strange]), GROUP)
    assert drawn is not None
    assert _rates(drawn) == [0.0, 0.2, 0.5]


def test_a_full_disk_leaves_the_old_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that fails is exit code 74, with the old file intact and nothing temporary left."""
    records, out = full_study(tmp_path), tmp_path / "figures"
    paths = draw_all(summarise(records), Folder(out), suffixes=PNG)
    old = paths[0].read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(RecordError, match="No space left") as caught:
        draw_all(summarise(records[:2]), Folder(out), suffixes=PNG)
    assert caught.value.exit_code == 74
    assert paths[0].read_bytes() == old
    assert sorted(out.iterdir()) == sorted(paths)


def test_a_reader_never_sees_half_a_figure(tmp_path: Path) -> None:
    """Who has the old file open goes on reading the old one."""
    records, out = full_study(tmp_path), tmp_path / "figures"
    path = draw_all(summarise(records), Folder(out), suffixes=PNG)[0]
    old = path.read_bytes()
    with path.open("rb") as reader:
        draw_all(summarise(records[:2]), Folder(out), suffixes=PNG)
        assert reader.read() == old
    assert path.read_bytes() != old


def test_a_file_in_the_way_is_refused(tmp_path: Path) -> None:
    """An output folder that is a file cannot be created: exit code 73."""
    (tmp_path / "figures").write_text("mine")
    with pytest.raises(RecordError) as caught:
        draw_all(summarise(full_study(tmp_path)), Folder(tmp_path / "figures"))
    assert caught.value.exit_code == 73


def test_results_table(tmp_path: Path) -> None:
    """A row per variant: seeds, mean [low, high], IQM and the rest; losses are counted."""
    records = write_arm(tmp_path, "dcc", [4, 8])
    records.append(write_run(tmp_path, "dcc", 3, status="diverged"))
    table = results_table(summarise(records), GROUP)
    assert table.headers[:5] == (
        "variant",
        "seeds",
        "catches per 500 [95% interval]",
        "error in a seed, spread of seeds",
        "IQM [95% interval]",
    )
    assert table.rows == (
        (
            "DCC",
            "2 (1 diverged)",
            "6.00 [4.00, 8.00]",
            "6.32, 2.83",
            "6.00 [\u2013]",
            "3.00",
            "0.50",
            "250",
            "-10.0",
        ),
    )
    assert "profile quick, 1,000 env steps a run; 2 greedy evaluation episodes" in table.caption


def test_one_seed_has_a_dash_for_its_interval(tmp_path: Path) -> None:
    """Nobody reads a spread out of a single seed."""
    table = results_table(summarise(write_arm(tmp_path, "dcc", [4])), GROUP)
    assert table.rows[0][2] == "4.00 [\u2013]"


def test_an_arm_without_numbers_has_dashes(tmp_path: Path) -> None:
    """A variant that only diverged keeps its row."""
    table = results_table(summarise(write_arm(tmp_path, "x", [1], status="diverged")), GROUP)
    assert table.rows == (("X", "0 (1 diverged)", *["\u2013"] * 7),)


def test_broken_links_table(tmp_path: Path) -> None:
    """A column for each evaluated share of broken links, in words."""
    table = channels_table(summarise([write_run(tmp_path, "dcc", 1, catches=BROKEN)]), GROUP)
    assert table.headers == ("variant", "seeds", "none broken", "half broken", "all broken")
    assert table.rows[0][2:] == ("8.00 [\u2013]", "4.00 [\u2013]", "1.00 [\u2013]")


def test_claims_table(tmp_path: Path) -> None:
    """Claim with its source, what was compared, the difference, the verdict and why."""
    claim = Claim(
        says="MD helps",
        source="l. 1",
        better="md-0.2",
        worse="dcc",
        environment="pursuit-n6",
        metric="catches_per_500",
    )
    records = write_arm(tmp_path, "dcc", [1, 2]) + write_arm(tmp_path, "md-0.2", [5, 8])
    question = replace(load_definition("broken-links"), claims=(claim,))
    (row,) = claims_table(judge_claims([claim], summarise(records), question)).rows
    assert row[:5] == (
        "MD helps (l. 1)",
        "pursuit-n6, 1,000 env steps, quick",
        "md-0.2 against dcc: catches per 500 after training",
        "5.00 [4.00, 6.00]",
        "undecided",
    )
    assert row[5].startswith(
        "first registered look at 6 seeds, which can decide nothing: 10 can;"
        " below 3 seeds there is no forecast;"
    )
    assert "; 4 of the runs were planned before" in row[5]
    missing = Verdict(claim=claim, verdict="undecided", reason="no run of dcc")
    assert claims_table([missing]).rows[0][3] == "\u2013"


def test_markdown() -> None:
    """Heading, grid and caption; a label cannot open a cell, a line or a tag."""
    table = Table(title="T", headers=("a", "b"), rows=(("x|y\nz", "<b>"),), caption="C")
    assert to_markdown(table) == (
        "### T\n\n| a | b |\n| --- | --- |\n| x\\|y z | &lt;b&gt; |\n\nC\n"
    )
    typed = "![](https://x/p.png) [a][b] *b* `c` md_0.2 _i_ 10.2 [9.8, 10.6]"
    shown = to_markdown(Table(title="T", headers=("a",), rows=((typed,),), caption=""))
    assert r"| ![]\(https://x/p.png) [a]\[b] \*b\* \`c\` md_0.2 \_i\_ 10.2 [9.8, 10.6] |" in shown


def _rates(drawn: Drawn) -> list[float]:
    """Where the line of the rate figure has its points."""
    rates: list[float] = np.asarray(drawn.figure.axes[0].lines[0].get_xdata()).tolist()
    return rates
