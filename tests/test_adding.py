"""What is published is added up in one way, so it is the same under every Python and processor."""

import ast
import random
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msgdrop_cli.analysis.metrics import UNKNOWN
from msgdrop_cli.analysis.statistics import mean, signed_sums, total

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("msgdrop_cli/analysis", "msgdrop_cli/report", "benchmarks/readme")
"""Where records become the numbers that are published."""
THE_WAY = ROOT / "msgdrop_cli" / "analysis" / "statistics.py"
WHOLE = {"_copy_run", "count", "diverged", "env_steps", "failed", "len", "length", "runs"}
"""Functions and attributes that give whole numbers, which add up alike in any order."""
ANOTHER_WAY = {
    *("average", "dot", "einsum", "fmean", "fsum", "inner", "matmul", "mean", "pvariance"),
    *("std", "sum", "trapezoid", "var", "variance", "vdot"),
}
"""Of arrays and modules: an order that suits the processor, or the one way a second time."""


def is_whole(node: ast.expr) -> bool:
    """Whether what is added is a whole number, as far as its form says."""
    match node:
        case ast.Compare() | ast.UnaryOp(op=ast.Not()):
            return True
        case ast.BinOp(left=left, right=right):
            return is_whole(left) and is_whole(right)
        case ast.Call(func=function):
            return is_whole(function)
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name in WHOLE
    return False


def adds_otherwise(node: ast.AST) -> bool:
    """Whether numbers that may be no whole ones are added up here, and not by `total`."""
    match node:
        case ast.Call(func=ast.Name(id="sum"), args=[ast.GeneratorExp(elt=added)]):
            return not is_whole(added)
        case ast.Call(
            func=ast.Name(id="sum"), args=[ast.Call(func=ast.Name(id="map"), args=[function, _])]
        ):
            return not is_whole(function)
        case ast.Call(func=ast.Name(id="sum")) | ast.BinOp(op=ast.MatMult()):
            return True
        case ast.Call(func=ast.Attribute(attr=name)):
            return name in ANOTHER_WAY
        case ast.ImportFrom(names=names):
            return any(each.name in {"fmean", "fsum", "pvariance", "variance"} for each in names)
    return False


@pytest.mark.parametrize("room", ROOMS)
def test_floats_are_added_in_one_way(room: str) -> None:
    """Nothing else adds them: as far as the form of the source says, types are not looked at."""
    sources = [path for path in sorted((ROOT / room).rglob("*.py")) if path != THE_WAY]
    assert len(sources) >= 5
    assert [
        f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)}"
        for path in sources
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.expr | ast.stmt) and adds_otherwise(node)
    ] == []


@pytest.mark.parametrize(
    ("source", "does"),
    [
        *((f"sum(each.{name} for each in runs)", False) for name in ("runs", "failed")),
        ("sum(a.failed + a.diverged for a in arms)", False),
        ("sum(len(each) > 2 for each in runs)", False),
        ("sum(map(len, runs))", False),
        ("sum(each.hours for each in runs)", True),
        ("sum(len(each) * 0.5 for each in runs)", True),
        ("sum(values)", True),
        ("sum(map(float, values))", True),
        ("table.mean(axis=0)", True),
        ("np.sum(table)", True),
        ("signs @ table", True),
        ("row.mean", False),
        ("from statistics import fmean", True),
    ],
)
def test_the_rule_tells_whole_numbers_from_others(source: str, does: bool) -> None:
    """What may be added in any order, and what may not."""
    assert any(map(adds_otherwise, ast.walk(ast.parse(source)))) == does


@pytest.fixture
def numbers() -> list[float]:
    """Of very different sizes: added one after the other, every order gives another sum."""
    chance = random.Random(5)
    return [chance.gauss(0.0, 1.0) * 10.0 ** chance.randrange(12) for _ in range(1_000)]


def test_a_total_is_the_exact_sum_rounded_once(numbers: list[float]) -> None:
    """Fractions are the oracle."""
    assert total(numbers) == float(sum(map(Fraction, numbers)))


def test_the_order_of_episodes_shows_in_no_digit(numbers: list[float]) -> None:
    """Neither in a run's value nor in its error."""
    [metric] = UNKNOWN.all
    rows = [{"return": number} for number in numbers]
    backwards = rows[::-1]
    assert metric.value(rows) == metric.value(backwards)
    assert mean(numbers) == mean(numbers[::-1])
    assert metric.standard_error(rows) == metric.standard_error(backwards)


@pytest.fixture
def signs() -> Any:
    """[1000, 5]: -1, 0 and 1."""
    return np.random.default_rng(5).integers(-1, 2, (1_000, 5)).astype(np.int8)


def test_signed_sums_are_the_same_in_any_order(numbers: list[float], signs: Any) -> None:
    """Of numbers that differ in every other way of adding, and in parts, too."""
    table = np.array([numbers, numbers[::-1]])
    found = signed_sums(table, signs)
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(1_000)
        assert np.array_equal(signed_sums(table[:, order], signs[order]), found)
    first = np.arange(1_000)[:, None] < 300
    parts = [signed_sums(table, np.where(here, signs, 0)) for here in (first, ~first)]
    assert np.array_equal(np.add(*parts), found)


@pytest.mark.parametrize("size", [1.0, 2.0**-1073, 1e100])
def test_signed_sums_are_exact_sums_of_nearly_the_numbers(
    numbers: list[float], signs: Any, size: float
) -> None:
    """Each is rounded by 2^-42 of the largest at most; of what it is then, fractions tell sums."""
    table = np.array([numbers]) * size
    rounded = signed_sums(table, np.eye(1_000, dtype=np.int8))
    assert np.abs(rounded - table).max() <= np.abs(table).max() / 2**42
    terms = [Fraction(float(number)) for number in rounded[0]]
    exact = [
        sum(x * int(sign) for x, sign in zip(terms, column, strict=True)) for column in signs.T
    ]
    assert [Fraction(float(number)) for number in signed_sums(table, signs)[0]] == exact
    assert not signed_sums(0.0 * table, signs).any()


def test_signed_sums_may_reach_the_largest_whole_number() -> None:
    """As many terms of the largest size as there can be on their grid: still exact."""
    numbers = np.full((1, 1_023), 1.0 - 2.0**-44)
    numbers[0, ::2] = 2.0**-43
    expected = sum(Fraction(round(x * 2**43), 2**43) for x in numbers[0].tolist())
    assert signed_sums(numbers, np.ones((1_023, 1), dtype=np.int8))[0, 0] == expected
