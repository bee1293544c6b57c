"""The examples at the end of every command's help, typed where there is something to do."""

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from msgdrop_cli import app
from msgdrop_cli.records.archive import pack
from msgdrop_cli.records.store import list_runs
from tests.cli_runs import QUESTION, Said, msgdrop

COMMANDS: dict[str, Any] = typer.main.get_command(app.app).commands  # type: ignore[attr-defined]
EXAMPLES = [
    line.strip().partition("  (")[0]
    for command in COMMANDS.values()
    for line in (command.epilog or "").splitlines()
    if line.strip().startswith("msgdrop ")
]
BRIEFLY: dict[str, tuple[str, ...]] = {
    "ablate": ("--dry-run",),
    "train": ("--dry-run",),
    "eval": ("--episodes", "2", "--workers", "1"),
    "unstable-test": ("--episodes", "2", "--workers", "1"),
    **dict.fromkeys(("plot", "status", "explain", "publish", "replay", "import"), ()),
    **dict.fromkeys(("config", "export"), ()),
}
"""What makes a matter of seconds of a command; of one that is not here no example is typed."""
ELSEWHERE = {
    "reproduce": "test_cli_reproduce.py",
    "verify": "test_verify.py",
    "watch": "test_watch.py",
    "mirror": "test_mirror.py",
    "diff": "test_cli_diff.py",
    "doctor": "test_cli_doctor.py",
}
"""What needs a terminal, an extra or the published records, and the tests that have them."""
REFUSED = {
    "msgdrop publish dropout-rate --profile million": "results: holds no finished run of "
    "dropout-rate, profile million (train them: msgdrop ablate dropout-rate --profile million)",
}
"""Examples that need runs which take hours, with what is said without them."""


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with all that the examples name: runs, a question, archives, published records."""
    root = tmp_path_factory.mktemp("examples")
    few = QUESTION.replace("seeds = 2", "seeds = [7]").replace("episodes = 8", "episodes = 2")
    (root / "my-question.toml").write_text(few)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        for line in ("ablate my-question.toml --workers 1", "publish my-question.toml"):
            said = msgdrop(*line.split())
            assert said.code == 0, said.err
        [archive] = pack(list_runs(root / "results" / "runs"), root, "tiny-quick")
        for name in ("campaign/a.zip", "a.zip", "b.zip"):
            (root / name).parent.mkdir(exist_ok=True)
            shutil.copyfile(archive, root / name)
        shutil.copytree(root / "results", root / "other-results")
        [run] = (root / "results" / "runs").rglob("md-0.2-s7-*")
        shutil.copytree(run, root / "RUN")
        yield root


def typed(line: str, folder: Path) -> Said:
    """What an example does, as a shell would have it done."""
    _, command, *arguments = shlex.split(line)
    wild = [
        sorted(str(path.relative_to(folder)) for path in folder.glob(word))
        if "*" in word
        else [word]
        for word in arguments
    ]
    return msgdrop(command, *(word for words in wild for word in words), *BRIEFLY[command])


@pytest.mark.parametrize("line", [line for line in EXAMPLES if line.split()[1] in BRIEFLY])
def test_an_example_works(line: str, folder: Path) -> None:
    """It ends with 0 and shows something, or says what it would need."""
    said = typed(line, folder)
    if line in REFUSED:
        assert (said.code, said.err) == (2, f"msgdrop: error: {REFUSED[line]}\n")
        return
    assert said.code == 0, said.err
    assert said.out or said.err
    for file in re.findall(r"\S+\.(?:html|gif|mp4)\b", line):
        assert (folder / file).stat().st_size > 1_000


def test_every_command_has_two_that_are_typed() -> None:
    """Say in BRIEFLY how those of a new one are kept short; what is refused is among them."""
    assert set(BRIEFLY) | set(ELSEWHERE) == set(COMMANDS)
    assert all((Path(__file__).parent / name).exists() for name in ELSEWHERE.values())
    for name in COMMANDS:
        assert sum(line.split()[1] == name for line in EXAMPLES) >= 2
    assert set(REFUSED) <= set(EXAMPLES)
