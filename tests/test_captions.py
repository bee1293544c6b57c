"""The words around a figure."""

from pathlib import Path

from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.report.captions import footer
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
