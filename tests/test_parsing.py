"""Rows that are parsed together are those that would be parsed one by one, or are parsed so."""

from pathlib import Path

import pytest

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records import parsing
from msgdrop_cli.records.packed import log_bytes
from msgdrop_cli.records.parsing import parse_rows

PUBLISHED = Path("results/published/broken-links-two-million/pursuit-n6/dcc-s1-f7cdd27c")
USUAL = [b'{"a": 1, "b": -0.25, "c": null, "d": true}', b'{"a": 0.30000000000000004}']
UNUSUAL = [
    b'{"a": NaN}',
    b'{"a": 1e400}',
    b'{"a": 9223372036854775808}',
    b'{"a": [1]}',
    b'{"a": {"b": 1}}',
    b'{"a": "text\\u0007"}',
    b'{"a": "text"}',
    b'{"a\\nb": 1}',
    b'{"a": 1, "a": 2}',
    b'{"a": 1},{"a": 2}',
    b'{"a": 1',
    b"1",
    b"",
    b"[]",
    b'{"\xff": 1}',
    b"{" + b", ".join(b'"a%d": 1' % number for number in range(65)) + b"}",
]


def said(lines: list[bytes]) -> str:
    """The rows, or the error."""
    try:
        return repr(parse_rows(lines, "log"))
    except RecordError as error:
        return str(error)


@pytest.mark.parametrize("line", [*USUAL, *UNUSUAL])
def test_what_is_read_is_what_each_line_says(line: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors name the same line in the same words."""
    together = said([*USUAL, line, *USUAL])
    monkeypatch.setattr(parsing, "_plain_rows", lambda *_: None)
    assert together == said([*USUAL, line, *USUAL])


@pytest.mark.parametrize("lines", [[b'{"a": 1', b'"b": 2},{"c": 3}'], [b'{"a": 1},{"b": 2}', b""]])
def test_a_row_does_not_end_on_another_line(lines: list[bytes]) -> None:
    """Together they would be JSON."""
    assert "line 1: is damaged" in said(lines)


@pytest.mark.parametrize("log", ["metrics.jsonl", "episodes.jsonl"])
def test_logs_that_we_write_are_read_together(log: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Row by row it would take three times as long."""
    monkeypatch.delattr(parsing, "_each_row")
    lines = (log_bytes(PUBLISHED / log) or b"").splitlines()
    assert len(parse_rows(lines, log)) == len(lines)
