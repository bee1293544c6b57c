"""Definitions become runs: what lies over what, which seeds, and one line for every mistake."""

import dataclasses
import random
from typing import Any

import pytest

from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.plan import Plan, ad_hoc_definition, plan
from msgdrop_cli.definition.seeds import parse_seeds
from msgdrop_cli.definition.spec import Claim, PlannedRun, Profile, Variant
from msgdrop_cli.errors import DefinitionError
from tests.definition_samples import CATALOGUE, DEFINITION


def first(made: Plan, environment: str, variant: str) -> PlannedRun:
    """The first seed of a variant in an environment."""
    pair = (environment, variant)
    return next(run for run in made.runs if (run.spec.environment, run.variant) == pair)


def refusal(profile: str = "quick", *overrides: str) -> str:
    """The line with which planning the sample is refused."""
    with pytest.raises(DefinitionError) as caught:
        plan(DEFINITION, profile, CATALOGUE, overrides=overrides)
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_every_variant_runs_in_every_environment_with_every_seed() -> None:
    """2 environments, 3 variants and seeds 1 to 3 are 18 runs in this order."""
    runs = plan(DEFINITION, "paper", CATALOGUE).runs
    asked = [(run.spec.environment, run.variant, run.spec.seed) for run in runs]
    assert asked == [
        (environment, variant, seed)
        for environment in ("tiny-n2", "tiny-n4")
        for variant in ("plain", "low", "high")
        for seed in (1, 2, 3)
    ]


def test_a_profile_restricts_and_replaces() -> None:
    """Environments, variants, seeds, channels and episodes are the profile's where it has them."""
    made = plan(DEFINITION, "quick", CATALOGUE)
    asked = [(run.spec.environment, run.variant, run.spec.seed) for run in made.runs]
    assert asked == [("tiny-n2", v, s) for v in ("high", "low") for s in (4, 2)]
    assert (made.channels, made.evaluation_episodes) == ((Channel.read("half"),), 10)


def test_the_paper_lies_under_the_named_algorithm() -> None:
    """The paper's rate 0.1 holds for `plain`; `dropping` means 0.2; the rest is the paper's."""
    made = plan(DEFINITION, "paper", CATALOGUE)
    plain = first(made, "tiny-n2", "plain").spec.algorithm_config
    assert (plain.rate, plain.epsilon_anneal_env_steps) == (0.1, 100)
    assert first(made, "tiny-n2", "low").spec.algorithm_config.rate == 0.2
    assert first(made, "tiny-n4", "plain").spec.training.train_env_steps == 44


def test_the_profile_lies_over_the_named_algorithm() -> None:
    """The profile's 0.3 replaces the 0.2 that `dropping` means."""
    low = first(plan(DEFINITION, "quick", CATALOGUE), "tiny-n2", "low").spec
    assert (low.algorithm_config.rate, low.algorithm_config.epsilon_anneal_env_steps) == (0.3, 5)
    assert (low.training.games, low.environment_config.time_limit) == (3, 50)


@pytest.mark.parametrize(
    ("profile", "explores"),
    [
        ({"training": {"train_env_steps": 61}}, 30),  # half, rounded down
        ({"training": {"train_env_steps": 1e2}}, 50),
        ({"training": {"train_env_steps": 900}}, 100),  # the paper's, at most
        ({"training": {"games": 2}}, 100),  # the paper's length
        ({"training": {"train_env_steps": 61}, "algorithm": {"epsilon_anneal_env_steps": 9}}, 9),
    ],
)
def test_half_of_a_shorter_training_explores(profile: dict[str, Any], explores: int) -> None:
    """Unless the profile says it, epsilon anneals over half of its training, or as the paper's."""
    scaled = dataclasses.replace(DEFINITION, profiles={"short": Profile(seeds=1, **profile)})
    config = first(plan(scaled, "short", CATALOGUE), "tiny-n2", "plain").spec.algorithm_config
    assert config.epsilon_anneal_env_steps == explores


def test_the_variant_lies_over_the_profile() -> None:
    """The variant's own values replace the profile's, in all three sections."""
    high = first(plan(DEFINITION, "quick", CATALOGUE), "tiny-n2", "high").spec
    assert (high.algorithm_config.rate, high.training.games) == (0.9, 2)
    assert (high.training.train_env_steps, high.environment_config.time_limit) == (9, 20)


def test_set_lies_over_everything() -> None:
    """`--set` replaces the variant's values; of two the last one counts."""
    overrides = [
        "variants.high.algorithm.rate=0.5",
        "variants.high.algorithm.rate = 1",
        "algorithm.dropout=element",
        "algorithm.widths=[3, 4]",
        "variants.high.training.games=7",
        "variants.high.environment.time_limit=8",
    ]
    spec = plan(DEFINITION, "quick", CATALOGUE, overrides=overrides).runs[0].spec
    assert (spec.algorithm_config.rate, spec.algorithm_config.dropout) == (1.0, "element")
    assert spec.algorithm_config.widths == (3, 4)
    assert (spec.training.games, spec.environment_config.time_limit) == (7, 8)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("algorithm.rat=1", "--set: algorithm.rat: unknown key; did you mean 'rate'?"),
        ("algoritm.rate=1", "--set: algoritm: a path begins with algorithm, environment or "
         "training; did you mean 'algorithm'?"),
        ("algorithm.rate=2", "--set: algorithm: rate must lie between 0 and 1, not 2.0"),
        ("algorithm.rate=high", "--set: algorithm.rate: expected a finite number, not 'high'"),
        ("algorithm.rate=nan", "--set: algorithm.rate: expected a finite number, not nan"),
        ("algorithm.rate=", "--set: algorithm.rate: expected a value such as 3, 0.5, true, fgh or "
         "[64, 48], not ''"),
        ("training.games=0", "--set: training: games must be at least 1, not 0"),
        ("training.games=1\nx=2", "--set: training.games: expected a value such as 3, 0.5, true, "
         "fgh or [64, 48], not '1\\nx=2'"),
        ("rate=1", "--set: a setting begins with its section: algorithm.rate"),
        ("speed=1", "--set: expected a path and a value (algorithm.gamma=0.9, "
         "variants.NAME.algorithm.rate=0.3), not 'speed=1'"),
        ("", "--set: expected a path and a value (algorithm.gamma=0.9, "
         "variants.NAME.algorithm.rate=0.3), not ''"),
    ],
)  # fmt: skip
def test_a_bad_override_is_one_clear_line(override: str, message: str) -> None:
    """The line names the path, what was expected and the nearest known name."""
    assert refusal("quick", override) == message


def test_an_unknown_profile_gets_the_nearest() -> None:
    """The file and the profile that was meant are named."""
    assert refusal("quik") == (
        "--profile: no profile of sample.toml is called 'quik'; did you mean 'quick'?"
    )


def test_an_unknown_environment_gets_the_nearest() -> None:
    """The key `environments` is named."""
    wrong = dataclasses.replace(DEFINITION, environments=("tiny-n3",))
    with pytest.raises(DefinitionError, match=r"^sample\.toml: environments: .*mean 'tiny-n"):
        plan(wrong, "paper", CATALOGUE)


def test_an_unknown_algorithm_gets_the_nearest() -> None:
    """The variant and its key are named."""
    variants = {"a": Variant(label="A", algorithm={"name": "plan"})}
    wrong = dataclasses.replace(DEFINITION, variants=variants)
    with pytest.raises(DefinitionError) as caught:
        plan(wrong, "paper", CATALOGUE)
    assert str(caught.value) == (
        "sample.toml: variants.a.algorithm.name: no algorithm is called 'plan'; "
        "did you mean 'plain'?"
    )


def test_a_bad_value_of_a_variant_is_blamed_on_the_variant() -> None:
    """Rate 1.5 stands in the file, and the line says where."""
    variants = {"a-1.5": Variant(label="A", algorithm={"name": "plain", "rate": 1.5})}
    wrong = dataclasses.replace(DEFINITION, variants=variants)
    with pytest.raises(DefinitionError) as caught:
        plan(wrong, "paper", CATALOGUE)
    assert str(caught.value) == (
        'sample.toml: variants."a-1.5".algorithm: rate must lie between 0 and 1, not 1.5'
    )


def test_seeds_are_a_count_or_a_list() -> None:
    """`3` means the first three; `1,5,9` means these; `7,` means the seventh alone."""
    assert parse_seeds("3") == (1, 2, 3)
    assert parse_seeds("1, 5,9") == (1, 5, 9)
    assert parse_seeds("7,") == (7,)
    assert parse_seeds("1e1") == tuple(range(1, 11))
    assert parse_seeds("1_0,1e5") == (10, 100_000)


@pytest.mark.parametrize("text", ["0", "-1", "1,1", "1,0", "", ",", "x", "1.5", "٣", "9" * 99])
def test_bad_seeds_are_refused(text: str) -> None:
    """Zero, negative, twice the same, huge, or no number at all."""
    with pytest.raises(DefinitionError, match=r"^--seeds: "):
        parse_seeds(text)


@pytest.mark.parametrize("seeds", [(), (0,), (-3,), (5, 5), (2**31,)])
def test_seeds_from_elsewhere_are_checked_too(seeds: tuple[int, ...]) -> None:
    """`plan` trusts no caller with seeds."""
    with pytest.raises(DefinitionError, match=r"^--seeds: "):
        plan(DEFINITION, "paper", CATALOGUE, seeds=seeds)


def test_given_seeds_replace_those_of_the_profile() -> None:
    """`--seeds` wins."""
    made = plan(DEFINITION, "quick", CATALOGUE, seeds=[8])
    assert {run.spec.seed for run in made.runs} == {8}


def test_zero_seeds_in_a_file_are_refused() -> None:
    """The line names the file and the key."""
    wrong = dataclasses.replace(DEFINITION, profiles={"none": Profile(seeds=0)})
    with pytest.raises(DefinitionError) as caught:
        plan(wrong, "none", CATALOGUE)
    assert str(caught.value) == (
        "sample.toml: profiles.none.seeds: expected 1 to 1000 seeds, not 0"
    )


def test_a_plan_judges_only_the_claims_that_its_runs_and_channels_allow() -> None:
    """Other environments, absent variants and channels that are not evaluated drop out."""

    def claim(environment: str, better: str, share: float) -> Claim:
        return Claim(
            says="-", source="-", better=better, worse="low", environment=environment,
            metric="score", channel=Channel.read(share),
        )  # fmt: skip

    good = claim("tiny-n2", "high", 0.5)
    learning = dataclasses.replace(claim("tiny-n2", "high", 0.0), measure="learning")
    others = (
        claim("tiny-n4", "high", 0.5),
        claim("tiny-n2", "plain", 0.5),
        claim("tiny-n2", "high", 0.0),
    )
    definition = dataclasses.replace(DEFINITION, claims=(good, *others, learning))
    assert plan(definition, "quick", CATALOGUE).claims == (good, learning)


def test_train_compares_named_algorithms_without_a_file() -> None:
    """An ad-hoc definition has one variant per algorithm and the profile that was made for it."""
    made = ad_hoc_definition("tiny-n2", ["plain", "dropping"], "paper", Profile(seeds=(5,)))
    runs = plan(made, "paper", CATALOGUE).runs
    assert [(run.variant, run.spec.seed) for run in runs] == [("plain", 5), ("dropping", 5)]


@pytest.mark.parametrize("algorithms", [[], ["plain", "plain"], ["../x"]])
def test_train_refuses_names_that_are_none(algorithms: list[str]) -> None:
    """Nothing, the same twice, and a path."""
    with pytest.raises(DefinitionError, match=r"^msgdrop train: "):
        ad_hoc_definition("tiny-n2", algorithms, "paper", Profile(seeds=1))


def test_random_overrides_never_raise_anything_else() -> None:
    """2,000 random overrides are taken or refused with one printable line."""
    rng = random.Random(3)
    paths = ["variants.low.algorithm.rate", "training.train_env_steps", "environment.agents"]
    paths += ["algorithm", "a.b.c", "algorithm.dropout", ".", "", "algorithm.\x00", "training.x"]
    paths += ["algorithm.widths", "algorithm.rate", "variants", "variants.high.algorithm.widths"]
    bits = (
        ["1"] * 20
        + ["0.5"] * 20
        + ["-", "e", "[", "]", "{a=1}", '"', "'", "nan", "true", "\n", "#", ",", "x"]
    )
    bits += ["9" * 5000, "0x" + "f" * 9000, "[" * 3000, "\udc80", "\x1b", "1979-05-27", "="]
    refusals = []
    for _ in range(2_000):
        value = "".join(rng.choice(bits) for _ in range(rng.randrange(4)))
        override = f"{rng.choice(paths)}{rng.choice(['=', '=', ''])}{value}"
        try:
            plan(DEFINITION, "quick", CATALOGUE, overrides=[override])
        except DefinitionError as error:
            refusals.append(str(error))
    assert all(line.isprintable() for line in refusals)
    assert 1_000 < len(refusals) < 1_980
