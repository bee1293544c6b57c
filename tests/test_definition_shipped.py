"""The contract of every shipped definition: it plans, in each profile, with what really exists."""

import pytest

from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.catalogue import catalogue

CATALOGUE = catalogue()
NAMES = list_definitions()


@pytest.mark.parametrize("name", NAMES)
def test_every_profile_plans(name: str) -> None:
    """All names, keys and values of the definition exist and are in range."""
    definition = load_definition(name)
    for profile in definition.profiles:
        assert plan(definition, profile, CATALOGUE).runs


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


@pytest.mark.parametrize("name", NAMES)
def test_the_papers_scale_is_the_papers(name: str) -> None:
    """7 seeds and 1000 episodes (paper l. 419), nothing else changed."""
    profile = load_definition(name).profiles["paper"]
    assert (profile.seeds, profile.evaluation_episodes) == (7, 1_000)
    assert (profile.training, profile.algorithm, profile.environment) == ({}, {}, {})


@pytest.mark.parametrize("name", NAMES)
def test_a_shorter_training_explores_for_half_of_it(name: str) -> None:
    """Epsilon kept at the paper's 2,000,000 steps would leave short runs at random play."""
    for profile in ("quick", "million"):
        for run in plan(load_definition(name), profile, CATALOGUE).runs:
            anneal = run.spec.algorithm_config.epsilon_anneal_env_steps
            assert anneal == run.spec.training.train_env_steps // 2


def test_the_first_command_of_the_readme_trains_600_000_env_steps() -> None:
    """`msgdrop ablate blockwise-vs-elementwise` stays under 10 minutes on 2 cores."""
    runs = plan(load_definition("blockwise-vs-elementwise"), "quick", CATALOGUE).runs
    assert sum(run.spec.training.train_env_steps for run in runs) == 600_000


def test_the_published_question_is_what_the_issue_asks() -> None:
    """Its `million` profile is FDC, DCC, MD-0.2 and SD-0.2 with 2 seeds each, on pursuit-n6."""
    made = plan(load_definition("blockwise-vs-elementwise"), "million", CATALOGUE)
    asked = {(run.spec.environment, run.variant, run.spec.seed) for run in made.runs}
    arms = ("fdc", "dcc", "md-0.2", "sd-0.2")
    assert asked == {("pursuit-n6", variant, seed) for variant in arms for seed in (1, 2)}
    assert made.broken_links == (0.0, 0.5, 1.0)
