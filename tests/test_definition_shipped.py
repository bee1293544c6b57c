"""The contract of every shipped definition: it plans, in each profile, with what really exists.

The claims are held against a table of their own, read off the paper's text a second time.
"""

import json
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.readings import apart
from msgdrop_cli.engine.offers import catalogue

CATALOGUE = catalogue()
NAMES = list_definitions()
OF_THE_PAPER = [name for name in NAMES if name not in ("trained-through", "message-scale")]
PUBLISHED, SEEDS = Path(__file__).parents[1] / "results" / "published", range(1, 21)

BOTH = ("pursuit-n6", "pursuit-n8")
SIX, EIGHT = BOTH[:1], BOTH[1:]
AFTER, DURING = ("evaluation",), ("learning",)
PROPER = ("md-0.2", "md-0.3")  # l. 420: "the best dropout rate is around [0.2, 0.3]"
NAVIGATION = ("navigation-n8", "navigation-n10")
WATERWORLD = ("waterworld-n8", "waterworld-n10")
CENTRAL = ("maddpg-md-0.2", "maddpg-md-0.5")
UNSTABLE = ("md-0.2", "md-0.5")  # no rate is named; those of l. 428 and 436
# (definition, lines of the paper, better, worse, environments, measures, broken links); a row
# stands for every combination of its entries.
CLAIMS = [
    # "outperforms both simple DCC and FDC", number of catches after training (l. 419)
    ("dropout-rate", (420, 421), PROPER, ("dcc", "fdc"), BOTH, AFTER, 0.0),
    # "in the case that [...] N=8, simple DCC has even worse performance than FDC"
    ("dropout-rate", (422, 422), ("fdc",), ("dcc",), EIGHT, AFTER, 0.0),
    # "improves as the dropout rate increases initially and then [...] deteriorates"
    ("dropout-rate", (420, 420), ("md-0.1",), ("dcc",), BOTH, AFTER, 0.0),
    ("dropout-rate", (420, 420), PROPER, ("md-0.1",), BOTH, AFTER, 0.0),
    ("dropout-rate", (420, 420), ("md-0.4", "md-0.5"), ("fdc",), BOTH, AFTER, 0.0),
    # "gain in both the learning speed and the steady-state performance"
    ("dropout-rate", (458, 458), PROPER, ("dcc",), BOTH, DURING, 0.0),
    # "the learning speed increases as the dropout rate increases", "clearly seen [for] N=8"
    ("dropout-rate", (456, 457), ("md-0.1",), ("dcc",), BOTH, DURING, 0.0),
    ("dropout-rate", (456, 457), ("md-0.2",), ("md-0.1",), BOTH, DURING, 0.0),
    ("dropout-rate", (456, 457), ("md-0.3",), ("md-0.2",), BOTH, DURING, 0.0),
    ("dropout-rate", (456, 457), ("md-0.4",), ("md-0.3",), BOTH, DURING, 0.0),
    ("dropout-rate", (456, 457), ("md-0.5",), ("md-0.4",), BOTH, DURING, 0.0),
    # "message-dropout yields better performance than the standard element-wise dropout"
    ("blockwise-vs-elementwise", (465, 465), ("md-0.2",), ("sd-0.2",), SIX, AFTER + DURING, 0.0),
    ("own-observation", (465, 465), ("md-0.2",), ("sd-0.2",), SIX, AFTER + DURING, 0.0),
    # "message-dropout makes training faster than simple DCC"
    ("blockwise-vs-elementwise", (491, 491), ("md-0.2",), ("dcc",), SIX, DURING, 0.0),
    ("own-observation", (491, 491), ("md-0.2",), ("dcc",), SIX, DURING, 0.0),
    # "elementwise dropout without dropping agent's own observation also yields faster training"
    ("blockwise-vs-elementwise", (492, 492), ("sd-0.2",), ("dcc",), SIX, DURING, 0.0),
    ("own-observation", (492, 492), ("sd-0.2",), ("dcc",), SIX, DURING, 0.0),
    # "the full message-dropout increases the training time"
    ("own-observation", (490, 490), ("md-0.2",), ("full-md-0.2",), SIX, DURING, 0.0),
    # "full message-dropout yields slower training than simple DCC"
    ("own-observation", (491, 491), ("dcc",), ("full-md-0.2",), SIX, DURING, 0.0),
    # "full standard elementwise dropout fails to train"
    ("own-observation", (492, 492), ("dcc", "sd-0.2"), ("full-sd-0.2",), SIX, AFTER + DURING, 0.0),
    # "In pursuit with N=8 [...] learning failed with the simple model architecture"
    ("architecture", (514, 516), ("md-0.2",), ("concat-md-0.2",), EIGHT, AFTER + DURING, 0.0),
    ("architecture", (514, 516), ("dcc",), ("concat-dcc",), EIGHT, AFTER + DURING, 0.0),
    # "the proposed model architecture is advantageous", figure 5 b with N=6 (ours)
    ("architecture", (514, 516), ("md-0.2",), ("concat-md-0.2",), SIX, DURING, 0.0),
    # "[In] waterworld, learning failed with the simple model architecture"
    ("waterworld", (514, 516), ("maddpg",), ("vanilla-maddpg",), WATERWORLD, AFTER + DURING, 0.0),
    # "outperforms both simple DCC and FDC when the [...] link is broken but not all"
    ("broken-links", (528, 528), UNSTABLE, ("dcc", "fdc"), BOTH, AFTER, 0.5),
    # "DCC-MD cannot recover [...] (but still better than simple DCC), but FDC is better"
    ("broken-links", (529, 529), UNSTABLE, ("dcc",), BOTH, AFTER, 1.0),
    ("broken-links", (529, 529), ("fdc",), UNSTABLE, BOTH, AFTER, 1.0),
    # "DCC-MD with the dropout rate 0.2 and 0.5 outperforms simple DCC and FDC"
    ("navigation", (430, 430), UNSTABLE, ("dcc", "fdc"), NAVIGATION, AFTER + DURING, 0.0),
    # "learning speed increases in the case of simple DCC and DCC-MD with dropout rate 0.2"
    ("autoencoder", (786, 786), ("ae-dcc",), ("dcc",), EIGHT, DURING, 0.0),
    ("autoencoder", (786, 786), ("ae-md-0.2",), ("md-0.2",), EIGHT, DURING, 0.0),
    # "DCC-MD still performs better than simple DCC when the messages are compressed"
    ("autoencoder", (786, 786), ("ae-md-0.2",), ("ae-dcc",), EIGHT, AFTER + DURING, 0.0),
    # "the compressed messages using autoencoder degrades the steady-state performance"
    ("autoencoder", (787, 787), ("dcc",), ("ae-dcc",), EIGHT, AFTER, 0.0),
    ("autoencoder", (787, 787), ("md-0.2",), ("ae-md-0.2",), EIGHT, AFTER, 0.0),
    # "MADDPG-MD outperforms both (independent) DDPG and MADDPG"
    ("waterworld", (439, 439), CENTRAL, ("ddpg", "maddpg"), WATERWORLD, AFTER + DURING, 0.0),
]
HEADLINE = {"pursuit": "catches_per_500", "navigation": "return_per_episode"}
HEADLINE["waterworld"] = "catches_per_500"
"""What the paper measures (l. 419, 429, 438, 455)."""
ALGORITHMS = {"md": "dcc-md", "sd": "dcc-sd", "concat-md": "concat-md"}
"""What the variants' names stand for where they are no names of algorithms."""


@pytest.mark.parametrize("name", NAMES)
def test_every_profile_plans(name: str) -> None:
    """All names, keys and values of the definition exist and are in range."""
    definition = load_definition(name)
    for profile in definition.profiles:
        assert plan(definition, profile, CATALOGUE).runs


@pytest.mark.parametrize("name", OF_THE_PAPER)
def test_claims_say_what_the_paper_says(name: str) -> None:
    """Line, order, environment, measure and channel of every claim, and no claim is missing."""
    expected = [
        (lines, *each, broken_links)
        for definition, lines, *lists, broken_links in CLAIMS
        if definition == name
        for each in product(*lists)
    ]
    found = []
    for claim in load_definition(name).claims:
        numbers = re.match(r"l\. (\d+)(?:-(\d+))?", claim.source)
        assert numbers is not None, claim.source
        first, last = numbers[1], numbers[2] or numbers[1]
        order = (claim.better, claim.worse, claim.environment, claim.measure)
        found.append(((int(first), int(last)), *order, *claim.channel.settings))
        assert claim.metric == HEADLINE[claim.environment.partition("-")[0]]
    assert sorted(found) == sorted(expected)


@pytest.mark.parametrize("name", OF_THE_PAPER)
def test_variants_are_what_they_are_called(name: str) -> None:
    """`md-0.2` is DCC-MD at rate 0.2, `ae-dcc` is DCC with an autoencoder: no more is changed."""
    for key, variant in load_definition(name).variants.items():
        plain = key.removeprefix("ae-")
        algorithm, _, rate = plain.rpartition("-") if key[-1].isdigit() else (plain, "", "")
        expected: dict[str, object] = {"name": ALGORITHMS.get(algorithm, algorithm)}
        expected |= {"rate": float(rate)} if rate else {}
        expected |= {"encoder": "autoencoder"} if key != plain else {}
        assert variant.algorithm == expected, key
        assert (variant.training, variant.environment) == ({}, {})


@pytest.mark.parametrize("name", NAMES)
def test_every_claim_can_be_judged_at_the_scale_of_the_paper(name: str) -> None:
    """With profile `paper` no claim is left out for want of runs or channels."""
    definition = load_definition(name)
    assert plan(definition, "paper", CATALOGUE).claims == definition.claims


@pytest.mark.parametrize("name", NAMES)
def test_the_variants_are_different_runs(name: str) -> None:
    """No two variants of a definition come out as the same run."""
    runs = plan(load_definition(name), "paper", CATALOGUE).runs
    assert len({run.run_id for run in runs}) == len(runs)


def test_trained_through_differs_in_the_channel_of_training_only() -> None:
    """Each is DCC or DCC-MD 0.2 whose games lose messages; and is evaluated through that, too."""
    definition = load_definition("trained-through")
    lossy = {"through-loss": "loss:0.2", "through-bursts": "bursts:0.2,4"}
    for key, variant in definition.variants.items():
        plain, _, how = key.partition("-through")
        assert variant.algorithm == definition.variants[plain].algorithm
        assert variant.training == ({"channel": lossy[f"through{how}"]} if how else {})
    assert set(lossy.values()) <= {channel.key for channel in definition.channels}
    assert all("ours" in claim.source for claim in definition.claims)


def test_the_scale_is_asked_of_the_runs_of_broken_links() -> None:
    """So that nothing is trained for it, and each claim is about a scale."""
    scale, links = (load_definition(name) for name in ("message-scale", "broken-links"))
    for profile in ("quick", "two-million"):
        asked, known = (
            [
                run.run_id
                for run in plan(each, profile, CATALOGUE).runs
                if run.spec.environment == "pursuit-n6"
            ]
            for each in (scale, links)
        )
        assert asked == known
    assert {claim.channel.scale for claim in scale.claims} == {"one", "delivered"}


@pytest.mark.parametrize("name", NAMES)
def test_the_papers_scale_is_the_papers(name: str) -> None:
    """7 seeds and 1000 episodes (paper l. 419), nothing else changed."""
    profile = load_definition(name).profiles["paper"]
    assert (profile.seeds, profile.evaluation_episodes) == (7, 1_000)
    assert (profile.training, profile.algorithm, profile.environment) == ({}, {}, {})


@pytest.mark.parametrize("name", NAMES)
def test_a_shorter_training_explores_for_half_of_it(name: str) -> None:
    """Epsilon kept at the paper's pace would leave short runs at random play; long ones keep it."""
    definition = load_definition(name)
    papers = {run.spec.environment: run.spec for run in plan(definition, "paper", CATALOGUE).runs}
    for profile in set(definition.profiles) - {"paper"}:
        for run in plan(definition, profile, CATALOGUE).runs:
            paper, steps = papers[run.spec.environment], run.spec.training.train_env_steps
            if not hasattr(paper.algorithm_config, "epsilon_anneal_env_steps"):
                continue  # MADDPG's noise is the same throughout
            whole = steps == paper.training.train_env_steps
            expected = paper.algorithm_config.epsilon_anneal_env_steps if whole else steps // 2
            assert run.spec.algorithm_config.epsilon_anneal_env_steps == expected


def test_what_is_published_is_what_is_planned() -> None:
    """Every published run has the id that its question and profile give it today."""
    published = [json.loads(path.read_text()) for path in PUBLISHED.rglob("run.json")]
    assert len(published) >= 60
    planned = {}
    for name, called in {(record["definition"], record["profile"]) for record in published}:
        question = load_definition(name)
        profile, readings = apart(called, question.profiles)
        asked = plan(question, profile, CATALOGUE, readings=readings, seeds=SEEDS)
        planned[name, called] = {run.run_id for run in asked.runs}
    for record in published:
        assert record["run_id"] in planned[record["definition"], record["profile"]], record[
            "run_id"
        ]


def test_the_published_question_is_what_the_issue_asks() -> None:
    """Its `million` profile is FDC, DCC, MD-0.2 and SD-0.2 with 2 seeds each, on pursuit-n6."""
    made = plan(load_definition("blockwise-vs-elementwise"), "million", CATALOGUE)
    asked = {(run.spec.environment, run.variant, run.spec.seed) for run in made.runs}
    arms = ("fdc", "dcc", "md-0.2", "sd-0.2")
    assert asked == {("pursuit-n6", variant, seed) for variant in arms for seed in (1, 2)}
    assert made.channels == tuple(map(Channel.read, ("none", "half", "all")))


def test_questions_share_the_runs_of_two_million_steps() -> None:
    """A variant that two questions ask for is one run a seed: the ids are the same."""
    ids: dict[tuple[str, str, int], set[str]] = {}
    for question in ("blockwise-vs-elementwise", "broken-links", "dropout-rate"):
        for run in plan(load_definition(question), "two-million", CATALOGUE).runs:
            key = (run.spec.environment, run.variant, run.spec.seed)
            ids.setdefault(key, set()).add(run.run_id)
    assert len(ids) == (8 + 4) * 6
    assert all(len(found) == 1 for found in ids.values())


def test_navigation_is_asked_in_both_orders_of_the_landmarks() -> None:
    """Each scale of `navigation` has a twin that differs in `landmark_order` only."""
    definition = load_definition("navigation")
    for profile in ("quick", "million", "paper"):
        pairs = zip(
            plan(definition, profile, CATALOGUE).runs,
            plan(definition, f"{profile}-nearest", CATALOGUE).runs,
            strict=True,
        )
        for fixed, nearest in pairs:
            rules = replace(fixed.spec.environment_config, landmark_order="nearest")
            assert nearest.spec == replace(fixed.spec, environment_config=rules) != fixed.spec
