"""A channel as a value, i.e. what becomes of messages on their way: its reader and its printers.

Which kinds exist is not known here: each is a file in `channels`, and whoever builds one has them.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from msgdrop_cli.definition.strict import number, shown
from msgdrop_cli.errors import DefinitionError, nearest

LINKS = "links"
"""The paper's kind, broken links (l. 519-541): a share alone means it, and so do old records."""
WORDS = {"none": 0.0, "half": 0.5, "all": 1.0}
"""Shares of broken links as people say them."""
_EXPECTED = "expected none, half, all, a share from 0 to 1 (0.3 or 30%) or kind:settings"
_KIND = re.compile(r"[a-z][a-z0-9-]{0,63}")


@dataclass(frozen=True, slots=True)
class Channel:
    """A kind with its settings. In order: broken links by their share, then the others by name."""

    kind: str
    settings: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not _KIND.fullmatch(self.kind):
            raise ValueError(f"{shown(self.kind)} cannot name a channel")
        if self.kind == LINKS and not (len(self.settings) == 1 and 0 <= self.settings[0] <= 1):
            raise ValueError("broken links need one share from 0 to 1 (0.3 or 30%)")

    def __lt__(self, other: "Channel") -> bool:
        mine, theirs = ((each.kind != LINKS, each.kind, each.settings) for each in (self, other))
        return mine < theirs

    @classmethod
    def read(cls, value: object) -> "Channel":
        """What people and records write: `half`, `30%`, 0.3, `links:0.3`, `kind:1,0.5`, `kind`.

        Raises ValueError for anything else; a kind that does not exist is not noticed here.
        """
        if not isinstance(value, str | int | float):
            raise ValueError(f"{_EXPECTED}, not {shown(value)}")
        text = str(value).strip()
        if text in WORDS:
            return cls(LINKS, (WORDS[text],))
        kind, colon, settings = text.partition(":")
        try:
            if not isinstance(value, str) or not (colon or text[:1].isalpha()):
                return cls(LINKS, (number(text),))
            return cls(kind, tuple(map(number, settings.split(","))) if colon else ())
        except ValueError as error:
            raise ValueError(f"{_EXPECTED}, not {shown(value)}") from error

    @property
    def key(self) -> str:
        """`links:0.5`, `kind:1,0.5`: what `read` reads, one text a channel."""
        return self.kind + ":" * bool(self.settings) + ",".join(map(_digits, self.settings))

    @property
    def entry(self) -> dict[str, float | str]:
        """How rows of records and of `--json` name it; broken links as before there were others."""
        if self.kind == LINKS:
            return {"broken_links": self.settings[0]}
        return {"channel": self.key}

    @property
    def word(self) -> str:
        """For a mark on an axis: `half`, `30%`; of other kinds `kind 1, 0.5`."""
        if self.kind != LINKS:
            return " ".join([self.kind, ", ".join(map(_digits, self.settings))]).strip()
        words = {share: word for word, share in WORDS.items()}
        return words.get(self.settings[0], f"{100 * self.settings[0]:g}%")

    @property
    def short(self) -> str:
        """For the head of a column: `half broken`; of other kinds the word."""
        return f"{self.word} broken" if self.kind == LINKS else self.word

    @property
    def label(self) -> str:
        """For a sentence: `half of the links broken`; of other kinds the word."""
        return f"{self.word} of the links broken" if self.kind == LINKS else self.word


NONE_BROKEN = Channel(LINKS, (0.0,))
"""Every message arrives."""


def only_links(channels: Iterable[Channel]) -> bool:
    """Whether it is the paper's test: nothing but broken links."""
    return all(each.kind == LINKS for each in channels)


def title_of(channels: Iterable[Channel]) -> str:
    """What tables and figures call these channels side by side."""
    return "Broken links" if only_links(channels) else "Channels"


def check_each_once(channels: Sequence[Channel]) -> None:
    """Refuse (ValueError) evaluations through no channel, or through one twice."""
    if not channels or len(set(channels)) < len(channels):
        raise ValueError("expected at least one channel, each only once")


def build_channel(channel: Channel, kinds: Mapping[str, type[Any]]) -> Any:
    """What the channel does: an object of its kind's dataclass, whose fields are the settings.

    Raises DefinitionError: an unknown kind, or settings that it does not take.
    """
    if channel.kind not in kinds:
        known = nearest(channel.kind, [*WORDS, *kinds])
        raise DefinitionError(f"no channel is called {channel.kind!r}; {known}")
    kind = kinds[channel.kind]
    names = [field.name for field in fields(kind)]
    if len(names) != len(channel.settings):
        takes = ":" * bool(names) + ",".join(names).upper()
        example = Channel(channel.kind, kind.example).key
        raise DefinitionError(f"channel {channel.key}: expected {channel.kind}{takes} ({example})")
    try:
        return kind(*channel.settings)
    except ValueError as error:
        raise DefinitionError(f"channel {channel.key}: {error}") from error


def _digits(value: float) -> str:
    """The shortest digits that are this number."""
    return repr(value).removesuffix(".0")
