"""Tables become dataclasses, or exactly one clear line says why not."""

import random
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest

from msgdrop_cli.definition.strict import Where, build, one_line, overlay
from msgdrop_cli.definition.typed_numbers import whole_number
from msgdrop_cli.errors import DefinitionError


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    """A nested table."""

    size: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """One field of each kind that Configs use."""

    rate: float = 0.0
    count: int = 1
    own: bool = False
    kind: Literal["message", "element"] = "message"
    widths: tuple[int, ...] = (64, 48)
    limit: float | None = None
    inner: Inner = field(default_factory=Inner)

    def __post_init__(self) -> None:
        if not 0 <= self.rate <= 1:
            raise ValueError(f"rate must lie between 0 and 1, not {self.rate}")


def test_every_kind_of_field_is_read() -> None:
    """A table with one field of each kind gives the dataclass with these values."""
    table = {"rate": 1, "own": True, "kind": "element", "widths": [8], "inner": {"size": 4}}
    made = build(Config, table, "a.toml")
    assert made == Config(
        rate=1.0, own=True, kind="element", widths=(8,), limit=None, inner=Inner(size=4)
    )
    assert type(made.rate) is float


def test_a_float_without_a_fraction_is_a_whole_number() -> None:
    """TOML has `1e6` for a float; people mean a million, in lists and tables within tables too."""
    made = build(Config, {"count": 1e6, "widths": [64.0, 48], "inner": {"size": -0.0}}, "a.toml")
    assert (made.count, made.widths, made.inner.size) == (1_000_000, (64, 48), 0)
    assert type(made.count) is type(made.inner.size) is int


def test_whole_numbers_as_they_are_typed() -> None:
    """Digits, digits in groups, and powers of ten."""
    typed = ("7", "1_000_000", "1e6", "1E5", "2.5e3", "-3", "9223372036854775807")
    assert [whole_number(text) for text in typed] == [
        *(7, 1_000_000, 1_000_000, 100_000, 2_500, -3),
        9223372036854775807,
    ]


@pytest.mark.parametrize(
    "text",
    ["", "x", "1.5", "1e-3", "inf", "nan", "0x10", "1,000", "1__0", "\u0663", "1e19", "9" * 5000],
)
def test_what_is_no_whole_number_is_refused(text: str) -> None:
    """In one line that says what would be one, however long the text is."""
    with pytest.raises(ValueError, match="expected a whole number such as 1000, 1_000 or 1e3"):
        whole_number(text)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"rat": 1}, "a.toml: rat: unknown key; did you mean 'rate'?"),
        ({"rate": "0.3"}, "a.toml: rate: expected a finite number, not '0.3'"),
        ({"rate": True}, "a.toml: rate: expected a finite number, not true"),
        ({"rate": float("nan")}, "a.toml: rate: expected a finite number, not nan"),
        ({"rate": float("inf")}, "a.toml: rate: expected a finite number, not inf"),
        ({"rate": 1.5}, "a.toml: rate must lie between 0 and 1, not 1.5"),
        ({"rate": 10**5000}, "a.toml: rate: expected a finite number, not a number beyond 64 bits"),
        ({"count": 1.5}, "a.toml: count: expected a whole number, not 1.5"),
        (
            {"count": 1e19},
            "a.toml: count: expected a whole number, not a number beyond 64 bits",
        ),
        ({"count": float("inf")}, "a.toml: count: expected a whole number, not inf"),
        ({"count": True}, "a.toml: count: expected a whole number, not true"),
        ({"count": 2**63}, "a.toml: count: expected a whole number, not a number beyond 64 bits"),
        ({"own": 1}, "a.toml: own: expected true or false, not 1"),
        (
            {"kind": "elemnt"},
            "a.toml: kind: expected one of message, element, not 'elemnt'; did you mean 'element'?",
        ),
        ({"widths": 3}, "a.toml: widths: expected a list [a whole number, ...], not 3"),
        ({"widths": [3, "x"]}, "a.toml: widths.2: expected a whole number, not 'x'"),
        ({"inner": {"siz": 3}}, "a.toml: inner.siz: unknown key; did you mean 'size'?"),
        ({"inner": []}, "a.toml: inner: expected a table, not a list"),
        ([], "a.toml: expected a table, not a list"),
    ],
)
def test_what_does_not_fit_is_one_clear_line(table: Any, message: str) -> None:
    """The message names the file, the key, what was expected and the nearest known name."""
    with pytest.raises(DefinitionError) as caught:
        build(Config, table, "a.toml")
    assert str(caught.value) == message


def test_a_missing_key_is_named() -> None:
    """A field without a default has to stand in the table."""

    @dataclass(frozen=True, kw_only=True)
    class Needs:
        name: str

    with pytest.raises(DefinitionError, match=r"^a\.toml: 'name' is missing$"):
        build(Needs, {}, "a.toml")


def test_a_bad_combination_is_blamed_on_the_layer_that_spoiled_it() -> None:
    """Three layers, the second is out of range: the message names the second."""
    layers = [(Where("one"), {}), (Where("two"), {"rate": 2.0}), (Where("three"), {"count": 2})]
    with pytest.raises(DefinitionError, match=r"^two: rate must lie"):
        overlay(Config, layers)


def test_a_later_layer_repairs_an_earlier_one() -> None:
    """Only the values that are used in the end have to fit together."""
    layers = [(Where("one"), {"rate": 2.0}), (Where("two"), {"rate": 0.5})]
    assert overlay(Config, layers).rate == 0.5


def test_a_repaired_layer_is_not_blamed_for_a_later_one() -> None:
    """Bad, repaired, bad again: the message names the last."""
    layers = [(Where("one"), {"rate": 2.0}), (Where("two"), {"rate": 0.5})]
    with pytest.raises(DefinitionError, match=r"^three: rate must lie"):
        overlay(Config, [*layers, (Where("three"), {"rate": 3.0})])


def test_keys_with_dots_are_quoted() -> None:
    """A place reads as TOML would write it."""
    place = Where("a.toml").at("variants").at("md-0.2").at("label")
    assert str(place) == 'a.toml: variants."md-0.2".label'


def test_control_characters_do_not_reach_the_terminal() -> None:
    """Escape sequences and line breaks of a hostile key are not printed."""
    with pytest.raises(DefinitionError) as caught:
        build(Config, {"\x1b[31m\nrate\u202e": 1}, "a\x07.toml")
    assert str(caught.value).isprintable()


def test_one_line_is_one_line() -> None:
    """Line breaks, tabs and control characters become single spaces."""
    assert one_line("a\r\n\tb\x00\u2028c") == "a b c"


def test_minus_zero_is_zero() -> None:
    """Two ways to write one number cannot give two run ids."""
    assert str(build(Config, {"rate": -0.0}, "a.toml").rate) == "0.0"


def test_random_tables_never_raise_anything_else() -> None:
    """2,000 random tables are read or refused with a DefinitionError of one printable line."""
    rng = random.Random(1)
    values: list[Any] = [0, 1, -1, 2**70, 0.5, 1e300, float("nan"), "x", "", "\n", None, True]
    keys = ["rate", "count", "own", "kind", "widths", "limit", "inner", "size", "\x00", "ab", ""]

    def anything(depth: int) -> Any:
        choice = rng.random()
        if depth == 0 or choice < 0.6:
            return rng.choice(values)
        if choice < 0.8:
            return [anything(depth - 1) for _ in range(rng.randrange(3))]
        return {rng.choice(keys): anything(depth - 1) for _ in range(rng.randrange(3))}

    refusals = []
    for _ in range(2_000):
        table = {rng.choice(keys): anything(3) for _ in range(rng.randrange(4))}
        try:
            build(Config, table, "a.toml")
        except DefinitionError as error:
            refusals.append(str(error))
    assert all(line.isprintable() for line in refusals)
    assert 1_000 < len(refusals) < 2_000
