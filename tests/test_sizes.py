"""No file and no function is too long to be read in one go."""

import ast

from tests.test_rooms import ROOT, SOURCES, found

MAX_FILE_LINES = 300
MAX_FUNCTION_LINES = 50


def long_functions(source: str) -> list[tuple[str, int]]:
    """Name and length of the functions that are too long, from `def` to the last line."""
    functions = (
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )
    lengths = [(node.name, (node.end_lineno or 0) - node.lineno + 1) for node in functions]
    return [(name, length) for name, length in lengths if length > MAX_FUNCTION_LINES]


def test_a_long_function_is_noticed() -> None:
    """Fifty lines pass, fifty-one do not, and methods count."""
    body = "        x = 1\n"
    assert long_functions("class A:\n    def f():\n" + 49 * body) == []
    assert long_functions("class A:\n    def f():\n" + 50 * body) == [("f", 51)]


def test_files_are_short() -> None:
    """No file is longer than 300 lines, C and its headers included."""
    compiled = [*(ROOT / "msgdrop_cli").rglob("*.[ch]")]
    assert compiled
    sources = [*SOURCES, *compiled]
    lengths = {str(path): len(path.read_text().splitlines()) for path in sources}
    assert {path: n for path, n in lengths.items() if n > MAX_FILE_LINES} == {}


def test_functions_are_short() -> None:
    """No function is longer than 50 lines."""
    assert found(SOURCES, lambda path: long_functions(path.read_text())) == {}
