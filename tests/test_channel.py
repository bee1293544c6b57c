"""A channel as a value: what is read, what is printed, in which order, and what is refused."""

import re

import pytest

from msgdrop_cli.definition.channel import Channel, build_channel, title_of
from tests.definition_samples import CATALOGUE

KINDS = CATALOGUE.channels
HALF = Channel("links", (0.5,))


@pytest.mark.parametrize("value", ["half", 0.5, ".5", "50%", "50 %", "links:0.5", "links:50%"])
def test_a_share_alone_means_broken_links(value: object) -> None:
    """In whatever way people or records write it."""
    assert Channel.read(value) == HALF


@pytest.mark.parametrize(
    "text",
    [
        "loss:0.2",
        "bursts:0.082,15",
        "own",
        "links:0.5+mean",
        "delay:3+hold:2",
        "loss:1e-07+scale:one",
        "loss:0.5+mean+scale:one+epsilon:0.02",
    ],
)
def test_a_key_is_read_as_what_it_was_printed_from(text: str) -> None:
    """One text a channel, with the shortest digits."""
    assert Channel.read(text).key == text


@pytest.mark.parametrize(
    "value",
    ["", ":", "1.5", "-0.1", "links", "links:2", "links:0.1,0.2", "loss:", "loss:x", "loss:inf",
     "Loss:1", "a b", "half:1,", "loss:1+hold:0",
     "loss:1+hold:03", "loss:1+hold:\u0663", "loss:0.\u0663",
     "loss:1+hold:2+mean", "loss:1+scale:two", "half+x",
     "half+epsilon:2", "half+epsilon", "half+epsilon:0.1+epsilon:0.1", True, None,
     [0.5], {"links": 0.5}, 10**400, float("nan")],
)  # fmt: skip
def test_anything_else_is_refused(value: object) -> None:
    """In one line that says what was expected."""
    with pytest.raises(ValueError, match=r"^expected none, half, all, a share ") as caught:
        Channel.read(value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("text", "word", "short", "label"),
    [
        ("none", "none", "none broken", "none of the links broken"),
        ("all", "all", "all broken", "all of the links broken"),
        ("0.3", "30%", "30% broken", "30% of the links broken"),
        ("bursts:0.1,8", "bursts 0.1, 8", "bursts 0.1, 8", "bursts 0.1, 8"),
        ("tmc-light", "tmc-light", "tmc-light", "tmc-light"),
        ("none+epsilon:2%", *["none broken, epsilon 0.02"] * 3),
    ],
)
def test_a_channel_has_words_for_people(text: str, word: str, short: str, label: str) -> None:
    """At an axis, over a column, in a sentence."""
    channel = Channel.read(text)
    assert (channel.word, channel.short, channel.label) == (word, short, label)


def test_rows_name_broken_links_as_ever_and_others_by_their_key() -> None:
    """A row of before there were others is one of broken links."""
    assert HALF.entry == {"broken_links": 0.5}
    assert Channel.read("loss:0.2").entry == {"channel": "loss:0.2"}


def test_broken_links_come_first() -> None:
    """By their share; then the other kinds by name, each by its settings."""
    texts = ["none", "links:0.05", "all", "bursts:0.1,8", "bursts:0.5,1", "delay:3"]
    channels = [Channel.read(text) for text in texts]
    assert sorted(channels[4:] + channels[:4]) == channels
    assert [title_of(channels[:3]), title_of(channels)] == ["Broken links", "Channels"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("los:0.2", "no channel is called 'los'; did you mean 'loss'?"),
        ("constant:3", "constant:3: constant takes no settings"),
        ("half:0.5", "half:0.5: half takes no settings"),
        ("haf", "no channel is called 'haf'; did you mean 'half'?"),
        ("loss", "loss: expected loss:RATE (loss:0.5)"),
        ("loss:1,2", "loss:1,2: expected loss:RATE (loss:0.5)"),
        ("loss:2", "loss:2: rate must lie between 0 and 1, not 2.0"),
    ],
)
def test_a_channel_that_there_is_not_is_named(text: str, message: str) -> None:
    """With the nearest kind, or with the settings that its kind takes."""
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        build_channel(Channel.read(text), KINDS)
    assert str(caught.value) == message


def test_a_blank_beside_a_number_changes_nothing() -> None:
    """It was read as a per cent: `loss: 0.2` lost two messages of a thousand."""
    assert Channel.read("loss: 0.2") == Channel.read("loss:0.2")
    assert Channel.read("bursts:0.2, 4") == Channel.read("bursts:0.2,4")
