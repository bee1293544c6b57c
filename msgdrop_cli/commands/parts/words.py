"""Numbers and short answers as people write them; prints nothing."""

from collections.abc import Sequence

from msgdrop_cli.commands.parts import vocabulary
from msgdrop_cli.definition.channel import Channel, build_channel, only_links
from msgdrop_cli.definition.typed_numbers import number
from msgdrop_cli.errors import DefinitionError


def duration(seconds: float) -> str:
    """`4 s`, `12:03 min`, `3:05 h`; days beyond two of them."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02} min"
    if whole < 48 * 3600:
        return f"{whole // 3600}:{whole % 3600 // 60:02} h"
    return f"{whole / 86400:.1f} days"


def about(seconds: float, least: float, most: float) -> str:
    """`about 2:05 h (1:40 h to 2:30 h)`."""
    return f"about {duration(seconds)} ({duration(least)} to {duration(most)})"


def size(count: float) -> str:
    """Bytes in decimal units: `850 kB`, `1.2 GB`."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 999.5:
            return (
                f"{count:.0f} {unit}"
                if unit in ("B", "kB") or count >= 10
                else f"{count:.1f} {unit}"
            )
        count /= 1000
    return f"{count:.1f} TB"


def several(count: int, word: str) -> str:
    """`1 run`, `3 runs`."""
    return f"{count:,} {word}{'s' * (count != 1)}"


def counted(run_ids: Sequence[str], word: str = "run") -> str:
    """`4 runs`; `242 runs, 172 distinct` where copies of a run stand in several places."""
    distinct = len(set(run_ids))
    told = several(len(run_ids), word)
    return told if distinct == len(run_ids) else f"{told}, {distinct:,} distinct"


def channel(text: str, option: str) -> Channel:
    """`none`, `half`, `all`, 0.3, 30%, `kind:1,0.5` or `trace:FILE`, which is looked at.

    Raises DefinitionError for anything else, and for kinds and settings that there are not; loads
    torch for any but broken links.
    """
    try:
        asked = Channel.read(text).located()
        check_kinds([asked])
    except ValueError as error:
        raise DefinitionError(f"{option}: {error}") from error
    return asked


def check_kinds(channels: Sequence[Channel]) -> None:
    """Refuse (ValueError) kinds and settings that there are not. Loads torch for all but links."""
    if not only_links(channels):
        for each in channels:  # a mistyped name need not wait for torch
            build_channel(each, vocabulary.kinds())
        from msgdrop_cli.channels import kind_of

        for each in channels:
            kind_of(each)


def share(text: str, option: str) -> float:
    """`0.3` or `30%`; DefinitionError for anything that is no share from 0 to 1."""
    try:
        value = number(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        expected = "a share from 0 to 1 (0.3 or 30%)"
        raise DefinitionError(f"{option}: expected {expected}, not {text[:40]!r}")
    return value
