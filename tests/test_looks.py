"""Who looks like whom in figures: in colour, in grey, and from one figure to the next."""

import random
from itertools import combinations

import numpy as np
import pytest

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.shipped import shipped_questions
from msgdrop_cli.report.looks import Look, looks


def look(variant: str) -> Look:
    """Of a variant that is alone."""
    return looks([variant])[0]


KNOWN = {
    "fdc": "#474747",
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


BLIND = {
    "deuteranopia": ((0.367, 0.861, -0.228), (0.280, 0.673, 0.047), (-0.012, 0.043, 0.969)),
    "protanopia": ((0.152, 1.053, -0.205), (0.115, 0.786, 0.099), (-0.004, -0.048, 1.052)),
    "none": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}
"""What becomes of linear red, green and blue (Machado, Oliveira, Fernandes 2009, severity 1)."""


def lab(colour: str, seen_as: str) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """The colour in CIELAB under D65, where distances are about what eyes make of them."""
    srgb = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(BLIND[seen_as]) @ linear, 0.0, 1.0)
    to_xyz = ((0.4125, 0.3576, 0.1804), (0.2127, 0.7152, 0.0722), (0.0193, 0.1192, 0.9503))
    xyz = np.array(to_xyz) @ linear / (0.9505, 1.0, 1.0888)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("seen_as", BLIND)
def test_known_colours_stay_apart_for_everybody(seen_as: str) -> None:
    """By 12 in CIELAB, where 2 is just noticed; the grey of FDC was 9 from MD 0.5's green."""
    apart = {
        (one, other): float(np.linalg.norm(lab(KNOWN[one], seen_as) - lab(KNOWN[other], seen_as)))
        for one, other in combinations(KNOWN, 2)
    }
    assert {pair: far for pair, far in apart.items() if far < 12.0} == {}


@pytest.mark.parametrize("question", shipped_questions())
def test_no_two_of_a_question_differ_by_colour_alone(question: str) -> None:
    """Line or marker tells them apart where colours are not seen at all."""
    found = looks(list(load_definition(question).variants))
    assert len({each[1:] for each in found}) == len(found)
