"""The files that come with the program: one for each question, and a few beside them."""

from importlib import resources
from importlib.resources.abc import Traversable

from msgdrop_cli.errors import DefinitionError

PAPER = "paper.toml"
"""Sizes and lengths (`paper.py`)."""
READINGS = "readings.toml"
"""Other readings of the paper (`readings.py`)."""
FIGURES = "figures.toml"
"""The paper's figures (`figures.py`)."""
_NO_QUESTIONS = (PAPER, READINGS, FIGURES)


def shipped_questions() -> dict[str, Traversable]:
    """The questions' files by the questions' names."""
    files = (file for file in _folder().iterdir() if file.name.endswith(".toml"))
    return {
        file.name.removesuffix(".toml"): file for file in files if file.name not in _NO_QUESTIONS
    }


def shipped_file(name: str) -> bytes:
    """What a file that is shipped beside the questions contains."""
    return _folder().joinpath(name).read_bytes()


def _folder() -> Traversable:
    try:
        return resources.files("msgdrop_ablations")
    except ModuleNotFoundError as error:
        raise DefinitionError("msgdrop_ablations is not importable; install msgdrop") from error
