"""HTML from Python: whatever is no Html yet is escaped, so no text of a record can be markup."""

from html import escape

_VOID = {"br", "img", "input", "meta"}
"""Elements of HTML without an end; those of drawings have one."""


class Html(str):
    """A text that is markup."""

    __slots__ = ()


def el(name: str, /, *inside: str, **attributes: str | int | bool | None) -> Html:
    """An element: `el("td", "a < b", class_="number", data_v="1")`.

    Attributes: a last `_` is dropped, others become dashes; None and False leave one out.
    """
    given = []
    for key, value in attributes.items():
        if value is None or value is False:
            continue
        written = key.removesuffix("_").replace("_", "-")
        given.append(f" {written}" if value is True else f' {written}="{escape(str(value))}"')
    start = f"<{name}{''.join(given)}>"
    return Html(start if name in _VOID else f"{start}{join(*inside)}</{name}>")


def join(*inside: str) -> Html:
    """Parts one after the other."""
    return Html("".join(part if isinstance(part, Html) else escape(part) for part in inside))
