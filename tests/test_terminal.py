"""A terminal that is drawn on is left as it was found, however that ends."""

import os
import signal

import pytest

from msgdrop_cli.commands.parts.terminal import _KEY, _name
from tests.pseudo_terminal import ENTERED, LEFT, at_a_terminal

PROGRAM = """
from msgdrop_cli.commands.parts import console, terminal
from msgdrop_cli.signals import end_at_once
end_at_once()
with terminal.Terminal(console.second_screen()) as screen:
    while (key := screen.key(60.0)) != "q":
        screen.draw(f"[{key}]")
        1 / (key != "!")
"""


@pytest.mark.parametrize(
    ("keys", "code"), [("q", 0), ("\x03", 130), ("!", 1)], ids=["left", "Ctrl-C", "exception"]
)
def test_the_first_screen_comes_back(keys: str, code: int) -> None:
    """With its cursor and its way to read lines."""
    with at_a_terminal("-c", PROGRAM) as terminal:
        before = terminal.modes()
        terminal.wait_for(ENTERED)
        terminal.type("x")
        terminal.wait_for("[x]")
        assert terminal.modes() != before
        terminal.type(keys)
        assert terminal.ended() == code
        assert terminal.modes() == before
    assert LEFT in terminal.seen
    assert terminal.seen.rindex(b"\x1b[?25h") > terminal.seen.rindex(b"\x1b[?25l")


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_it_as_it_was(signum: signal.Signals) -> None:
    """And the exit code says which one it was."""
    with at_a_terminal("-c", PROGRAM) as terminal:
        before = terminal.modes()
        terminal.wait_for(ENTERED)
        terminal.type("x")
        terminal.wait_for("[x]")
        terminal.process.send_signal(signum)
        assert terminal.ended() == 128 + signum
        assert terminal.modes() == before
    assert LEFT in terminal.seen
    assert b"Traceback" not in terminal.seen


def test_it_can_be_suspended() -> None:
    """Ctrl-Z shows the first screen, and who comes back finds the second one."""
    with at_a_terminal("-c", PROGRAM) as terminal:
        before = terminal.modes()
        terminal.wait_for(ENTERED)
        terminal.type("x")
        terminal.wait_for("[x]")
        terminal.process.send_signal(signal.SIGTSTP)  # what Ctrl-Z is, with a shell around it
        _, status = os.waitpid(terminal.process.pid, os.WUNTRACED)
        assert os.WIFSTOPPED(status)
        assert terminal.modes() == before
        terminal.process.send_signal(signal.SIGCONT)
        terminal.wait_for(ENTERED)
        terminal.type("y")
        terminal.wait_for("[y]")
        assert terminal.seen.count(ENTERED) == 2
        terminal.type("q")
        assert terminal.ended() == 0


def test_keys_have_names() -> None:
    """Arrows by their direction, letters by themselves, whatever arrives at once."""
    typed = b"a\x1b[C\x1b[A\x1bOD\t\x1b[5~ \x1b"
    names = [_name(key) for key in _KEY.findall(typed)]
    assert names == ["a", "right", "up", "left", "\t", "", " ", "\x1b"]
