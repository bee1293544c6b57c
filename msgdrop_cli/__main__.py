"""`msgdrop`: says at once what it is about to do, then loads the rest of the program."""

import gc
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from msgdrop_cli import __version__
from msgdrop_cli.signals import end_at_once

TYPE_CHECKING = False
"""Not typing's, which takes longer to load than everything here."""
if TYPE_CHECKING:
    from typing import NoReturn

_SLOW = (
    *("train", "eval", "ablate", "unstable-test", "plot", "publish", "replay", "watch", "import"),
    *("doctor", "reproduce", "verify", "export", "diff"),
)
"""Commands that load torch or matplotlib before they can say anything else."""
_QUICK = {"-h", "--help", "--list"}
_WIDTH = 120
_COMPLETE = "_MSGDROP_COMPLETE"
"""What a shell sets when the TAB key is pressed."""


def main() -> None:
    """Run the command line and exit with its code."""
    end_at_once()
    _mend_streams()
    if _COMPLETE in os.environ:
        _complete()
    arguments = sys.argv[1:]
    if words := greeting(arguments):
        with suppress(OSError):
            print(words, file=sys.stderr, flush=True)
    # When we are killed, joblib's tracker cleans up after us; it need not tell the terminal.
    os.environ.setdefault("PYTHONWARNINGS", "ignore:resource_tracker")
    from msgdrop_cli.app import run  # not above: the greeting shall not wait for it

    sys.exit(run(arguments))


def greeting(arguments: Sequence[str]) -> str | None:
    """The first line of a slow command; None for one that answers at once."""
    if not arguments or arguments[0] not in _SLOW or _QUICK.intersection(arguments):
        return None
    if arguments == ["ablate"]:
        return None
    words = "".join(c if c.isprintable() else " " for c in " ".join(arguments))
    line = f"msgdrop {__version__}: {words}"
    return line if len(line) <= _WIDTH else f"{line[: _WIDTH - 1]}…"


def _complete() -> "NoReturn":
    """Answer the TAB key, and leave without tidying up: that is a quarter of the time it takes."""
    gc.disable()
    sys.modules["rich"] = None  # type: ignore[assignment]  # typer breaks every help's lines by it
    from msgdrop_cli.app import run
    from msgdrop_cli.commands.parts.bash_words import joined

    if "\n" in (words := os.environ.get("COMP_WORDS", "")):  # so the script of bash puts them
        typed, at = joined(words.split("\n"), int(os.environ.get("COMP_CWORD", "0")))
        os.environ |= {"COMP_WORDS": "\n".join(typed), "COMP_CWORD": str(at)}
    try:
        code: object = run([])
    except SystemExit as ended:
        code = ended.code
    with suppress(OSError):
        sys.stdout.flush()
    os._exit(code if isinstance(code, int) else 0)


def _mend_streams() -> None:
    """Put /dev/null where a stream was closed (`>&-`); what an encoding lacks becomes `?`."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)  # the lowest free number: the stream's own
            os.set_inheritable(handle, True)
            setattr(sys, name, os.fdopen(handle, "r" if number == 0 else "w"))
        elif number and hasattr(getattr(sys, name), "reconfigure"):
            getattr(sys, name).reconfigure(errors="replace")


if __name__ == "__main__":
    main()
