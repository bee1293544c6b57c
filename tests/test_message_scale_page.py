"""docs/message-scale.md says what the published policies do."""

from pathlib import Path

import pytest

from msgdrop_cli.analysis.metrics import metrics_of
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.records.store import list_runs

ROOT = Path(__file__).parents[1]
RUNS = ROOT / "results/published/broken-links-two-million/pursuit-n6"
POLICIES = {"DCC": "dcc-s1-f7cdd27c", "DCC-MD 0.5": "md-0.5-s1-797a661b"}


def table() -> dict[tuple[str, str], float]:
    """The page's numbers of pursuit, by policy and channel."""
    text = (ROOT / "docs/message-scale.md").read_text().splitlines()
    lines = [line.strip("| ").split(" | ") for line in text if line.startswith("|")]
    _, _, *channels = lines[0]
    rows = [line for line in lines if line[0] == "pursuit-n6"]
    return {
        (label, channel.strip("`")): float(value)
        for _, label, *values in rows
        for channel, value in zip(channels, values, strict=True)
    }


@pytest.mark.parametrize("channel", ["none", "half"])
@pytest.mark.parametrize("label", ["DCC", "DCC-MD 0.2", "DCC-MD 0.5", "FDC"])
def test_the_page_of_the_scale_says_what_is_recorded(label: str, channel: str) -> None:
    """As far as the published episodes go: of pursuit, at the scale of the paper."""
    [record] = [each for each in list_runs(RUNS) if (each.seed, each.label) == (1, label)]
    rows = record.episodes()[Channel.read(channel)]
    catches = metrics_of(record).headline.value(rows)
    assert f"{catches:.1f}" == f"{table()[label, channel]:.1f}"


@pytest.mark.slow
@pytest.mark.parametrize("channel", ["half", "half+scale:one", "half+scale:delivered"])
@pytest.mark.parametrize("label", POLICIES)
def test_the_page_of_the_scale_says_what_the_policies_do(label: str, channel: str) -> None:
    """Catches per 500 steps over 1,000 episodes, of the two policies that it is about."""
    rows = evaluate(RUNS / POLICIES[label], channel=Channel.read(channel), episodes=1_000)
    catches = sum(row["catches"] for row in rows) * 500 / sum(row["steps"] for row in rows)
    assert abs(catches - table()[label, channel]) < 0.051
