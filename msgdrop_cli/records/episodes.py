"""Which channel each row of `episodes.jsonl` was played through."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import RecordError


def by_channel(rows: Iterable[dict[str, Any]], file: Path) -> dict[Channel, list[dict[str, Any]]]:
    """The rows of a log, channel by channel, in their order.

    Rows of before there were others say `broken_links`, as the paper's channel does to this day.
    Raises RecordError, naming file and line, for a row without a channel.
    """
    sorted_out: dict[Channel, list[dict[str, Any]]] = {}
    known: dict[str, list[dict[str, Any]]] = {}  # thousands of rows, a few spellings
    for line, row in enumerate(rows, start=1):
        value = row.get("channel", row.get("broken_links"))
        text = str(value)
        if text not in known:
            try:
                known[text] = sorted_out.setdefault(Channel.read(value), [])
            except ValueError as error:
                raise RecordError(one_line(f"{file}: line {line}: channel: {error}")) from error
        known[text].append(row)
    return sorted_out
