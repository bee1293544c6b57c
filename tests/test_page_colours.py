"""The page's colours are told apart by everybody: contrast AA (4.5 to 1), light and dark."""

import re
from pathlib import Path

import pytest

import msgdrop_cli.report.page
from msgdrop_cli.analysis.reproduction import WORDS

CSS = (Path(msgdrop_cli.report.page.__file__).parent / "page.css").read_text()
ENOUGH = 4.5
CHIPS = [word.replace(" ", "-") for word in WORDS]
PAIRS = [
    *((f"{word}-ink", f"{word}-paper") for word in CHIPS),
    *((ink, paper) for ink in ("ink", "quiet", "link", "warn") for paper in ("paper", "raised")),
]


def schemes() -> dict[str, dict[str, str]]:
    """The colours by name, light and dark; dark ones lie over light ones."""
    light, dark = re.findall(r":root \{([^}]*)\}", CSS)[:2]
    colours = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", text)) for text in (light, dark)]
    return {"light": colours[0], "dark": colours[0] | colours[1]}


def luminance(colour: str) -> float:
    """Relative luminance as WCAG 2 defines it."""
    shares = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    """From 1 to 21."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_of_what_is_known() -> None:
    """Black on white, and a grey that just does."""
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("ink", "paper"), PAIRS)
def test_text_is_read_by_everybody(scheme: str, ink: str, paper: str) -> None:
    """Every ink on the papers that it stands on."""
    colours = schemes()[scheme]
    assert contrast(colours[ink], colours[paper]) >= ENOUGH


def test_every_word_has_a_pair_and_no_colour_stands_elsewhere() -> None:
    """What the rules use are these names: a colour in a rule would be in no test."""
    for word in CHIPS:
        assert f".{word} {{ background: var(--{word}-paper); color: var(--{word}-ink); }}" in CSS
    rules = re.sub(r":root \{[^}]*\}", "", CSS)
    assert set(re.findall(r"#[0-9a-f]{3,6}\b", rules)) <= {"#fff"}  # of pictures, which are light
