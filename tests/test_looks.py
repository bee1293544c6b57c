"""Who looks like whom in figures: in colour, in grey, and from one figure to the next."""

import random

import pytest

from msgdrop_cli.report.looks import Look, looks


def look(variant: str) -> Look:
    """Of a variant that is alone."""
    return looks([variant])[0]


KNOWN = {
    "fdc": "#8A8A8A",
    "dcc": "#0072B2",
    "md-0.1": "#F0C060",
    "md-0.2": "#E69F00",
    "md-0.3": "#D55E00",
    "md-0.4": "#66C7AC",
    "md-0.5": "#009E73",
    "sd-0.2": "#CC79A7",
    "full-md-0.2": "#56B4E9",
    "full-sd-0.2": "#000000",
}
"""As they are in every figure that has been published."""


def test_known_variants_have_their_colours_in_any_company() -> None:
    """Theirs go by family and rate; the line says that the network is another one."""
    own = [f"exp-{number}" for number in range(20)]
    for company in ([], own, [*own, *KNOWN]):
        assert [each.colour for each in looks([*KNOWN, *company])[: len(KNOWN)]] == [
            *KNOWN.values()
        ]
    assert look("md-0.2").colour == look("concat-md-0.2").colour
    assert look("md-0.2").line != look("concat-md-0.2").line


def test_the_critics_of_waterworld_look_like_their_relatives() -> None:
    """DDPG like FDC, MADDPG like DCC, its dropout like DCC-MD's; the four differ."""
    pairs = {"ddpg": "fdc", "maddpg": "dcc", "maddpg-md-0.2": "md-0.2", "maddpg-md-0.5": "md-0.5"}
    assert all(look(one) == look(other) for one, other in pairs.items())
    assert len({look(name).colour for name in (*pairs, "vanilla-maddpg")}) == 5


def test_eight_variants_of_ones_own_have_eight_colours_no_known_one_has() -> None:
    """Whatever they are called."""
    for start in range(0, 400, 8):
        colours = {look.colour for look in looks([f"exp-{start + n}" for n in range(8)])}
        assert len(colours) == 8
        assert not colours & {*KNOWN.values()}


@pytest.mark.parametrize(
    "variants",
    [
        [f"exp-{number}" for number in range(12)],
        ["sd-0.2", "sd-0.3", "full-md-0.2", "full-md-0.5", "md-0.6", "md-0.7", "dcc", "dcc", "dcc"],
        [*KNOWN, "concat-dcc", "concat-md-0.2", "one", "two", "three"],
    ],
)
def test_all_of_a_figure_differ_in_grey(variants: list[str]) -> None:
    """By line and marker, also where one family or several set-ups of a variant share a colour."""
    assert len({(look.line, look.marker) for look in looks(variants)}) == len(variants)


def test_forty_variants_still_differ() -> None:
    """When lines and markers are used up, colours help."""
    assert len({*looks([f"exp-{number}" for number in range(40)])}) == 40


def test_looks_do_not_depend_on_the_order() -> None:
    """Figures of one question can be laid side by side, in whatever order they stand."""
    variants = [*KNOWN, *(f"exp-{number}" for number in range(8))]
    mixed = random.Random(1).sample(variants, len(variants))
    assert dict(zip(mixed, looks(mixed), strict=True)) == dict(
        zip(variants, looks(variants), strict=True)
    )


def test_another_set_up_takes_no_other_variants_look() -> None:
    """A second DCC is DCC's colour with other dashes, and FDC stays as it is."""
    first, second, fdc = looks(["dcc", "dcc", "fdc"])
    assert (first, fdc) == (look("dcc"), look("fdc"))
    assert second.colour == first.colour
    assert second != first
