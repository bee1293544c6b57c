"""docs/does-it-help.md says of every claim what results/README.md says, and leaves none out."""

import re

from msgdrop_cli.definition.load import list_definitions
from tests.cli_runs import ROOT
from tests.markdown import Page, named, page

PAGE = page("does-it-help.md")
RESULTS = Page((ROOT / "results" / "README.md").read_text())
JUDGED = RESULTS.section("Judged again")
EIGHT = RESULTS.text.partition("### With eight agents")[2].partition("\n## ")[0]
WATERWORLD = RESULTS.section("`published/waterworld-million/`").text
LINE = re.compile(r"^\* (.*): \*\*([\w -]+)\*\*$", re.MULTILINE)


def told(text: str = PAGE.text) -> list[tuple[str, str]]:
    """Every claim of a page with its verdict."""
    found = []
    for claims, word in LINE.findall(text):
        place, _, rest = claims.rpartition(": ")
        found += [(f"{place}: {claim}" if place else claim, word) for claim in rest.split(", ")]
    return found


def judged() -> list[tuple[str, str]]:
    """Every claim of the table with its verdict; `...` goes on with the place of the row above."""
    found, place, last = [], "", ""
    for claim, *_, now, _before in JUDGED.rows():
        rest = claim.removeprefix("... ")
        if rest == claim:
            place, last = claim.rpartition(": ")[0], claim
        elif place:
            claim = f"{place}: {rest}"
        else:
            claim = last.replace("after training", rest)
        found.append((claim, now))
    eight = [(f"N = 8, {claim}", word) for claim, word in told(EIGHT)]
    return found + eight + told(WATERWORLD)


def test_every_claim_is_told_with_its_verdict() -> None:
    """Once each, by the same word."""
    assert sorted(told()) == sorted(judged())
    assert len(judged()) > 20


def test_the_questions_that_it_names_are_there() -> None:
    """What was not found out can be asked."""
    names = [
        name for name in named(PAGE.section("What was not found out").text) if "msgdrop" not in name
    ]
    assert names == ["dropout-rate", "trained-through"]
    assert set(names) <= set(list_definitions())
