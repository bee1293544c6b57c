"""What bash hands over when the TAB key is pressed: it parts words at `=` and `:`, we do not."""

from collections.abc import Sequence

_BREAKS = "=:"


def joined(words: Sequence[str], at: int) -> tuple[list[str], int]:
    """The words as they were typed, and the place of the one that is being typed.

    Before that one `--set a.b = 3` becomes `--set a.b=3`. An option loses its `=`, for it may stand
    apart from its value; what is being typed stays as it is, for bash will replace that much.
    """
    found: list[str] = []
    glue = ""
    for word in words[:at]:
        is_break = bool(word) and not word.strip(_BREAKS)
        if is_break and found:
            glue = "" if found[-1].startswith("--") else word
        elif glue:
            found[-1] += glue + word
            glue = ""
        else:
            found.append(word)
    if glue:
        found.append(glue)
    return [*found, *words[at:]], len(found)
