"""Numbers and short answers as people write them; prints nothing."""

from msgdrop_cli.errors import DefinitionError

_LINKS = {"none": 0.0, "half": 0.5, "all": 1.0}


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


def broken_links(text: str) -> float:
    """`none`, `half`, `all` or a fraction such as 0.3; DefinitionError for anything else."""
    try:
        fraction = _LINKS[text] if text in _LINKS else float(text)
    except ValueError:
        fraction = -1.0
    if not 0.0 <= fraction <= 1.0:  # also refuses nan
        raise DefinitionError(
            f"--broken-links: expected none, half, all or a fraction from 0 to 1, not {text[:40]!r}"
        )
    return fraction + 0.0  # -0.0 is 0.0
