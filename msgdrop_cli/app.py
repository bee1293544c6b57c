"""The command line as a whole: which commands there are, and what every error looks like.

Whatever goes wrong is one line on stderr and an exit code (docs/exit-codes.md); a traceback is
shown only if MSGDROP_TRACEBACK=1 asks for it.
"""

import os
import re
import shlex
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from msgdrop_cli import __version__
from msgdrop_cli.commands.parts import console
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DISK_FAULTS, DefinitionErrors, MsgdropError
from msgdrop_cli.stopping import Stopped

_MOST_TOLD = 20
"""Mistakes of one file: nobody reads more at once."""
_INTERNAL, _USAGE, _MACHINE, _BROKEN_PIPE = 1, 2, 74, 141

_NAMES = """
    ablate train eval unstable-test plot status explain config publish reproduce verify watch
    replay diff export mirror import doctor
"""
COMMANDS = {name: name.replace("-", "_") for name in _NAMES.split()} | {"import": "import_archives"}
"""Every command and its file, in the order of the help; `import` is a word of Python."""

_LACKS = (
    "annot allocate memory",
    "an't allocate memory",
    "failed to map segment",
    "bad_alloc",
    "can't start new thread",
    "error return without exception set",
)
"""What libraries and Python say for want of memory where it is no MemoryError."""

_BAD_VALUE = re.compile(r"Invalid value for '([^' ]+)[^']*': ")
"""How typer begins what is said of a value; ours begins with the option or argument."""


class _Commands(Mapping[str, Any]):
    """The commands as typer makes them, each loaded when it is asked for.

    So whoever uses one, or presses the TAB key, does not wait for the others.
    """

    def __getitem__(self, name: str) -> Any:
        alone = typer.Typer(rich_markup_mode=None, add_completion=False)
        alone.add_typer(import_module(f"msgdrop_cli.commands.{COMMANDS[name]}").app)
        made: Any = typer.main.get_command(alone)
        return made.commands[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class _Group(TyperGroup):
    """The program, whose commands are those above."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = _Commands()

    def list_commands(self, ctx: Any) -> list[str]:
        """The names alone, without loading a command."""
        return list(self.commands)


app = typer.Typer(
    name="msgdrop",
    cls=_Group,
    help=(
        "Train, break, compare and check message-dropout in multi-agent reinforcement learning.\n\n"
        "Start with:  msgdrop ablate blockwise-vs-elementwise"
    ),
    rich_markup_mode=None,  # plain help: quick to load, and no text is ever taken for markup
    pretty_exceptions_enable=False,
    context_settings={"max_content_width": 100, "help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """Show the version or, without any command, the help."""
    if version:
        console.result(f"msgdrop {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        console.result(context.get_help())


def run(arguments: Sequence[str]) -> int:
    """Run one command line; returns the exit code, and shows errors in one line each."""
    command = typer.main.get_command(app)
    try:
        code = command.main(list(arguments), prog_name="msgdrop", standalone_mode=False)
        sys.stdout.flush()
    except Stopped as stopped:
        console.note(f"stopped; the same command goes on:\n  {shlex.join(['msgdrop', *arguments])}")
        return 128 + stopped.signal
    except BrokenPipeError:
        return _broken_pipe()
    except SystemExit as ended:
        if isinstance(ended.__context__, BrokenPipeError):  # click has made an exit with 1 of it
            return _broken_pipe()
        raise
    except DefinitionErrors as error:
        return _failed_at(error)
    except MsgdropError as error:
        return _failed(str(error), error.exit_code)
    except Exception as error:
        return _unexpected(error)
    return code if isinstance(code, int) else 0


def _broken_pipe() -> int:
    """The reader of our output has gone (`| head`): nobody is left to be told."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return _BROKEN_PIPE


def _unexpected(error: Exception) -> int:
    """An error of the command line's words (2), of the machine (74), or of ours (1)."""
    if hasattr(error, "format_message"):  # typer's own; their class moved between its versions
        path = getattr(getattr(error, "ctx", None), "command_path", "msgdrop")
        said = _BAD_VALUE.sub(r"\1: ", error.format_message()).rstrip(".")
        return _failed(f"{said} (see {path} --help)", _USAGE)
    if os.environ.get("MSGDROP_TRACEBACK") == "1":
        console.note(traceback.format_exc().rstrip())
    if isinstance(error, OSError) and error.errno in DISK_FAULTS:
        return _failed(f"{error.filename or 'disk'}: {error.strerror}", _MACHINE)
    what = f"{type(error).__name__}: {error}"
    if lack := _lack_of_memory(error):
        return _failed(f"memory is short: {lack} (free some, or see ulimit -a)", _MACHINE)
    if isinstance(error, FileNotFoundError) and "temporary directory" in what:
        return _failed(f"{error.strerror}; name a folder in TMPDIR", _MACHINE)
    hint = "this is a bug in msgdrop; MSGDROP_TRACEBACK=1 shows it"
    return _failed(f"{what} ({hint})", _INTERNAL)


def _lack_of_memory(error: BaseException | None) -> str | None:
    """What a lack of memory was seen by, also if something else was made of it; None without."""
    while error is not None:
        what = str(error) or type(error).__name__
        if isinstance(error, MemoryError) or any(word in what for word in _LACKS):
            return what
        error = error.__cause__ or error.__context__
    return None


def _failed_at(error: DefinitionErrors) -> int:
    """Each of several mistakes has a line of its own."""
    for each in error.errors[:_MOST_TOLD]:
        _failed(str(each), error.exit_code)
    if (more := len(error.errors) - _MOST_TOLD) > 0:
        console.note(f"and {more:,} more")
    return error.exit_code


def _failed(message: str, code: int) -> int:
    console.error(one_line(message))
    return code
