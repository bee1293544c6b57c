"""Every figure of the paper that shows results is asked by its name, and shares its runs.

Which figures there are, and of which games, is read off the captions and the text a second time.
"""

import json
import re
from itertools import chain
from pathlib import Path

import pytest

from msgdrop_cli.analysis.order import definition_order
from msgdrop_cli.definition.figures import all_figures
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.engine.offers import catalogue
from tests.cli_runs import msgdrop
from tests.fake_runs import write_run

CATALOGUE = catalogue()
ROOT = Path(__file__).parents[1]
RATES = ["dcc", "md-0.1", "md-0.2", "md-0.3", "md-0.4", "md-0.5", "fdc"]  # l. 417-418
FEW = ["fdc", "dcc", "md-0.2", "md-0.5"]  # l. 428
CRITICS = ["ddpg", "vanilla-maddpg", "maddpg", "maddpg-md-0.2", "maddpg-md-0.5"]  # l. 435-436
# name: (environments, arms, lines of the claims); 1 and 2 show the method and the games, 8 and 9
# networks.
SHOWN: dict[str, tuple[list[str], list[str], list[str]]] = {
    "figure-3a": (["pursuit-n6"], RATES, ["420", "420-421"]),
    "figure-3b": (["pursuit-n8"], RATES, ["420", "420-421", "422"]),
    "figure-3c": (["navigation-n8"], FEW, ["430"]),
    "figure-3d": (["navigation-n10"], FEW, ["430"]),
    "figure-3e": (["waterworld-n8"], CRITICS, ["439", "514-516"]),
    "figure-3f": (["waterworld-n10"], CRITICS, ["439", "514-516"]),
    "figure-4a": (["pursuit-n6"], RATES, ["456-457", "458"]),
    "figure-4b": (["pursuit-n8"], RATES, ["456-457", "458"]),
    "figure-5a": (
        ["pursuit-n6"],
        ["dcc", "md-0.2", "sd-0.2", "full-md-0.2", "full-sd-0.2"],  # l. 464, 489-492
        ["465", "490", "491", "492"],
    ),
    "figure-5b": (
        ["pursuit-n6"],
        ["dcc", "md-0.2", "concat-dcc", "concat-md-0.2"],  # l. 508
        ["514-516"],
    ),
    "figure-6": (["pursuit-n6", "pursuit-n8"], FEW, ["528", "529"]),
    "figure-7": (["pursuit-n8"], ["dcc", "md-0.2", "ae-dcc", "ae-md-0.2"], ["786", "787"]),
}


def planned(name: str, profile: str) -> Plan:
    """What a question or a figure trains and measures."""
    return plan(load_definition(name), profile, CATALOGUE)


def test_every_figure_that_shows_results_is_asked() -> None:
    """None is missing, and the paper's N=6 and N=8 (l. 373) are both there."""
    assert set(SHOWN) == set(all_figures())
    games = {game for environments, *_ in SHOWN.values() for game in environments}
    assert games == set(CATALOGUE.environments)


@pytest.mark.parametrize("name", SHOWN)
def test_a_figure_has_its_games_and_arms_in_every_profile(name: str) -> None:
    """Also where the question's own profile leaves some out."""
    environments, arms, _ = SHOWN[name]
    for profile in load_definition(name).profiles:
        runs = planned(name, profile).runs
        assert list(dict.fromkeys(run.spec.environment for run in runs)) == environments
        assert set(dict.fromkeys(run.variant for run in runs)) == set(arms)


@pytest.mark.parametrize("name", SHOWN)
def test_a_figures_claims_are_those_of_what_it_shows(name: str) -> None:
    """Its question's of its games and measures, all of them, each judged at the paper's scale."""
    environments, _, lines = SHOWN[name]
    asked = planned(name, "paper")
    assert asked.claims == asked.definition.claims
    sources = [re.match(r"l\. ([\d-]+)", claim.source) for claim in asked.claims]
    assert sorted({source[1] for source in sources if source}) == lines
    assert {claim.environment for claim in asked.claims} == set(environments)
    question = load_definition(all_figures()[name].question)
    measures = {claim.measure for claim in asked.claims}
    assert list(asked.claims) == [
        claim
        for claim in question.claims
        if claim.environment in environments and claim.measure in measures
    ]


@pytest.mark.parametrize("profile", ["quick", "two-million", "paper"])
def test_a_run_that_several_figures_need_is_one(profile: str) -> None:
    """One id for each game, variant and seed, whichever figure asks for it."""
    names = [name for name in SHOWN if profile in load_definition(name).profiles]
    runs = list(chain.from_iterable(planned(name, profile).runs for name in names))
    ids: dict[tuple[str, str, int], set[str]] = {}
    for run in runs:
        ids.setdefault((run.spec.environment, run.variant, run.spec.seed), set()).add(run.run_id)
    assert all(len(found) == 1 for found in ids.values())
    assert len(ids) < 0.6 * len(runs)


def test_what_is_published_is_found_by_the_figures() -> None:
    """Runs of two million steps that questions have trained are the runs of 3a, 5a, 5b and 6."""
    folders = (ROOT / "results" / "published").glob("*-two-million/pursuit-n6")
    files = chain.from_iterable(folder.glob("*/run.json") for folder in folders)
    published = {
        (run["variant"], run["run_id"]) for run in map(json.loads, map(Path.read_text, files))
    }
    assert len(published) >= 30
    figures = ("figure-3a", "figure-5a", "figure-5b", "figure-6")
    ten = range(1, 11)
    runs = chain.from_iterable(
        plan(load_definition(name), "two-million", CATALOGUE, seeds=ten).runs for name in figures
    )
    assert published <= {(run.variant, run.run_id) for run in runs}


def test_the_variants_of_a_figure_stand_in_its_order(tmp_path: Path) -> None:
    """Also where records are all that is known."""
    records = [
        write_run(tmp_path, variant, 1, definition="figure-5a") for variant in ("sd-0.2", "dcc")
    ]
    assert definition_order(records) == tuple(SHOWN["figure-5a"][1])


def test_figures_are_listed() -> None:
    """Below the questions for people, beside them for programs."""
    shown = " ".join(msgdrop("ablate").out.split())
    assert all(f"{name} {each.shows}" in shown for name, each in all_figures().items())
    document = json.loads(msgdrop("ablate", "--list", "--json").out)
    listed = chain.from_iterable(question["figures"] for question in document)
    assert sorted(listed) == sorted(all_figures())


def test_a_figure_that_there_is_not_is_refused() -> None:
    """With the nearest there is."""
    said = msgdrop("ablate", "figure-9")
    assert said.code == 2
    assert "did you mean 'figure-" in said.err
