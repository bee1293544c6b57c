"""The paper as a tree: all of its claims, and one word for what was judged several times."""

from itertools import chain

import pytest

from msgdrop_cli.analysis.reproduction import WORDS, Answer, Reading, counts, one_word, reproduce
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.analysis.verdict import Evidence, Word
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import list_definitions, load_definition

LOOK = Evidence(
    look=1,
    seeds=6,
    p=0.03,
    p_family=0.03,
    p_holm=0.03,
    smallest_p=0.03,
    sampling_error=0.0,
    alpha_spent=0.015,
    alpha=0.05,
)


def reading(
    word: Word, *readings: str, steps: int = 1000, seeds: int = 6, look: bool = True
) -> Reading:
    """A claim under some readings."""
    return Reading(
        readings=readings,
        environment="pursuit-n6",
        profile="quick",
        train_env_steps=steps,
        word=word,
        reason="",
        difference=1.0,
        low=0.5,
        high=1.5,
        seeds=seeds,
        lost=0,
        evidence=LOOK if look else None,
        is_judged=look,
        prospect=None,
        unforeseen="",
        margin=None,
        runs=(),
    )


DEFAULT, OTHER = reading("supported"), reading("contradicted", "huber")


def test_readings_that_decide_differently_leave_the_paper_under_specified() -> None:
    """Also a level against a supported one; no reading tells the word then."""
    assert one_word([DEFAULT, OTHER]) == ("under-specified", None)
    assert one_word([DEFAULT, reading("level", "huber")]) == ("under-specified", None)


def test_what_is_open_contradicts_nobody() -> None:
    """The word is that of the reading that decides, and it is named."""
    assert one_word([reading("undecided", seeds=2), OTHER]) == ("contradicted", 1)
    assert one_word([DEFAULT, reading("undecided", "huber")]) == ("supported", 0)


def test_of_one_reading_the_largest_scale_counts() -> None:
    """A short training that says something else is no other reading."""
    assert one_word([OTHER, reading("supported", "huber", steps=2000)]) == ("supported", 1)


def test_a_scale_without_a_look_does_not_push_one_with_it_away() -> None:
    """One seed of a longer training takes nothing back."""
    longer = reading("undecided", steps=5000, seeds=1, look=False)
    assert one_word([DEFAULT, longer]) == ("supported", 0)


def test_of_open_readings_that_with_most_seeds_is_shown() -> None:
    """It says what is known best."""
    few = reading("undecided", seeds=2, look=False)
    assert one_word([few, reading("undecided", "huber", seeds=10)]) == ("undecided", 1)


def test_nothing_is_not_run() -> None:
    """No reading, no word."""
    assert one_word([]) == ("not run", None)


@pytest.fixture(scope="module")
def empty() -> list[Answer]:
    """Every shipped question, without a run."""
    nothing = summarise([])
    definitions = map(load_definition, list_definitions())
    return [Answer(definition=each, summary=nothing) for each in definitions]


def test_every_claim_of_every_question_is_in_one_section(empty: list[Answer]) -> None:
    """None is left out, none is there twice, and what the paper does not say comes last."""
    sections = reproduce(empty, all_figures())
    lines = [line for section in sections for line in section.lines]
    found = sorted(
        (line.question, line.says, line.source, line.better, line.worse, line.environment)
        for line in lines
    )
    claims = chain.from_iterable(
        ((each.definition.name, claim) for claim in each.definition.claims) for each in empty
    )
    assert found == sorted(
        (name, c.says, c.source, c.better, c.worse, c.environment) for name, c in claims
    )
    assert len({line.key for line in lines}) == len(lines)
    assert counts(lines) == {**dict.fromkeys(WORDS, 0), "not run": len(lines)}
    ours = ["message-scale", "trained-through"]
    assert [section.key for section in sections if not section.papers] == ours
    assert [section.key for section in sections[-2:]] == ours


def test_every_figure_has_its_section(empty: list[Answer]) -> None:
    """In the order of the paper."""
    keys = [section.key for section in reproduce(empty, all_figures())]
    assert [key for key in keys if key.startswith("figure-")] == list(all_figures())
    assert keys[keys.index("figure-3d") + 1] == "navigation"  # what its figures do not show
