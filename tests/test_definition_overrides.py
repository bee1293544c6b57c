"""`--set`: of all variants or of one, and never of what makes a variant the one that it is."""

import dataclasses
import itertools
import shlex

import pytest

from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import Plan, ad_hoc_definition, plan
from msgdrop_cli.definition.spec import Definition, Profile, Variant
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from tests.definition_samples import CATALOGUE, DEFINITION

KNOWN = catalogue()
DOTTED = dataclasses.replace(
    DEFINITION,
    variants={
        "low": Variant(label="Low", algorithm={"name": "dropping"}),
        "md-0.9": Variant(
            label="High",
            algorithm={"name": "dropping", "rate": 0.9},
            training={"games": 2},
            environment={"time_limit": 20},
        ),
        "v.algorithm.rate": Variant(label="Odd", algorithm={"name": "dropping", "rate": 0.8}),
    },
    profiles={"quick": Profile(seeds=1, environments=("tiny-n2",))},
)


def asked(*overrides: str, definition: Definition = DOTTED) -> Plan:
    """The sample with dots in its names, overridden."""
    return plan(definition, "quick", CATALOGUE, overrides=overrides)


def rates(made: Plan) -> dict[str, float]:
    """Each variant's rate."""
    return {run.variant: run.spec.algorithm_config.rate for run in made.runs}


def refusal(*overrides: str, definition: Definition = DOTTED) -> str:
    """The line with which an override is refused."""
    with pytest.raises(DefinitionError) as caught:
        asked(*overrides, definition=definition)
    assert str(caught.value).isprintable()
    return str(caught.value)


@pytest.mark.parametrize("name", ["md-0.9", '"md-0.9"', "'md-0.9'"])
def test_one_variant_is_overridden_by_its_name(name: str) -> None:
    """Dots in a name need no quotes, and quotes do no harm; the others stay as they are."""
    before = rates(asked())
    assert rates(asked(f"variants.{name}.algorithm.rate=0.5")) == before | {"md-0.9": 0.5}


def test_a_variant_may_be_called_like_a_path() -> None:
    """The section and its key are the last two words, all before them is the name."""
    override = "variants.v.algorithm.rate.algorithm.rate=0.5"
    assert rates(asked(override))["v.algorithm.rate"] == 0.5


def test_what_is_set_for_one_variant_lies_over_what_is_set_for_all() -> None:
    """In whichever order the two are given."""
    both = ["algorithm.widths=[3]", "variants.low.algorithm.widths=[5]"]
    for overrides in itertools.permutations(both):
        widths = [run.spec.algorithm_config.widths for run in asked(*overrides).runs]
        assert widths == [(5,), (3,), (3,)]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("algorithm.rate=0.5", "--set: algorithm.rate: variants low, md-0.9 and v.algorithm.rate "
         "set this themselves; to change one alone: --set variants.md-0.9.algorithm.rate=0.5"),
        ("training.games=4", "--set: training.games: variant md-0.9 sets this itself; to change "
         "it: --set variants.md-0.9.training.games=4"),
        ("environment.time_limit=4", "--set: environment.time_limit: variant md-0.9 sets this "
         "itself; to change it: --set variants.md-0.9.environment.time_limit=4"),
    ],
)  # fmt: skip
def test_what_a_variant_sets_is_not_overridden_for_all(override: str, message: str) -> None:
    """By itself or by the name of its algorithm: the line says who, and how to mean one."""
    assert refusal(override) == message


def test_many_variants_are_counted_not_listed() -> None:
    """Seven that set a rate make no line of seven names."""
    variants = {
        f"v{n}": Variant(label="V", algorithm={"name": "plain", "rate": n / 10}) for n in range(7)
    }
    said = refusal("algorithm.rate=0.5", definition=dataclasses.replace(DOTTED, variants=variants))
    assert "variants v0, v1, v2 and 4 more set this themselves" in said


def test_what_a_refusal_proposes_can_be_pasted() -> None:
    """Also a value that a shell would take apart."""
    variants = {"wide-0.1": Variant(label="W", algorithm={"name": "plain", "widths": [1, 2]})}
    definition = dataclasses.replace(DOTTED, variants=variants)
    said = refusal("algorithm.widths=[7, 8]", definition=definition)
    option, override = shlex.split(said.partition("to change it: ")[2])
    assert option == "--set"
    [run] = asked(override, definition=definition).runs
    assert run.spec.algorithm_config.widths == (7, 8)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("variants.md-0.8.algorithm.rate=0.5", '--set: variants."md-0.8": this profile has no such '
         "variant; did you mean 'md-0.9'?"),
        ("variants.low.algoritm.rate=0.5", "--set: variants.low.algoritm: a path goes on with "
         "algorithm, environment or training; did you mean 'algorithm'?"),
        ("variants.low.algorithm.rat=0.5", "--set: variants.low.algorithm.rat: unknown key; "
         "did you mean 'rate'?"),
        ("variants.low.algorithm.rate=7", "--set: variants.low.algorithm: rate must lie between 0 "
         "and 1, not 7.0"),
        ("variants.low.rate=1", "--set: expected a path and a value (algorithm.gamma=0.9, "
         "variants.NAME.algorithm.rate=0.3), not 'variants.low.rate=1'"),
    ],
)  # fmt: skip
def test_a_bad_override_of_one_variant_is_one_clear_line(override: str, message: str) -> None:
    """The line names the variant, the path, what was expected and the nearest known name."""
    assert refusal(override) == message


def test_a_variant_that_the_profile_leaves_out_is_not_overridden() -> None:
    """It would change nothing, which nobody would notice."""
    with pytest.raises(DefinitionError, match="this profile has no such variant"):
        plan(DEFINITION, "quick", CATALOGUE, overrides=["variants.plain.algorithm.rate=0.5"])


def test_a_run_says_what_was_overridden() -> None:
    """What can change its result, by its final value; run ids know the values alone."""
    overrides = ["algorithm.widths=[3]", "algorithm.comment=x", "variants.low.algorithm.rate=0"]
    low, high, _ = asked(*overrides, "training.checkpoint_every_env_steps=9").runs
    assert low.overrides == ("algorithm.widths=[3]", "variants.low.algorithm.rate=0.0")
    assert high.overrides == ("algorithm.widths=[3]",)
    written = Variant(label="-", algorithm={"name": "plain", "rate": 0.0, "widths": [3]})
    [same] = asked(definition=dataclasses.replace(DOTTED, variants={"x": written})).runs
    assert (same.run_id, same.overrides) == (low.run_id, ())


def test_two_variants_that_are_one_run_are_refused() -> None:
    """They would be compared as two; the line names both and says where they are alike."""
    variants = {**DOTTED.variants, "twin": Variant(label="T", algorithm={"name": "dropping"})}
    assert refusal(definition=dataclasses.replace(DOTTED, variants=variants)) == (
        "sample.toml: profiles.quick: variants low and twin are one run on tiny-n2: "
        "all their settings are equal; change or leave out one"
    )


def test_variants_that_are_alike_in_one_environment_are_refused() -> None:
    """What differs in tiny-n2 is the paper's own setting in tiny-n4."""
    variants = {
        "paper": Variant(label="P", algorithm={"name": "plain"}),
        "own": Variant(label="O", algorithm={"name": "plain"}, training={"train_env_steps": 44}),
    }
    profiles = {"quick": Profile(seeds=1)}
    twins = dataclasses.replace(DOTTED, variants=variants, profiles=profiles)
    assert "variants paper and own are one run on tiny-n4: all" in refusal(definition=twins)


def test_an_override_that_makes_two_variants_one_is_refused() -> None:
    """And the line says that the file is not to blame."""
    said = refusal("variants.md-0.9.algorithm.rate=0.2", "variants.md-0.9.training.games=8",
                   "variants.md-0.9.environment.time_limit=500")  # fmt: skip
    assert "low and md-0.9 are one run on tiny-n2: with this --set all their settings" in said


def trained(algorithm: str, override: str) -> Plan:
    """What `msgdrop train` plans."""
    made = ad_hoc_definition("pursuit-n6", [algorithm], "p", Profile(seeds=1))
    return plan(made, "p", KNOWN, overrides=[override])


@pytest.mark.parametrize(
    ("algorithm", "override"),
    [
        ("dcc", "algorithm.rate=0.3"),
        ("fdc", "algorithm.network=fgh"),
        ("dcc-md", "algorithm.dropout=element"),
        ("full-md", "algorithm.drops_own=false"),
    ],
)
def test_the_name_of_an_algorithm_fixes_what_it_means(algorithm: str, override: str) -> None:
    """DCC with a rate would be DCC-MD, and DCC-MD by elements DCC-SD."""
    with pytest.raises(DefinitionError, match=f"variant {algorithm} sets this itself"):
        trained(algorithm, override)


@pytest.mark.parametrize(
    ("algorithm", "override"),
    [
        ("dcc-md", "algorithm.rate=0.3"),
        ("full-md", "algorithm.rate=0.3"),
        ("dcc", "algorithm.loss=huber"),
        ("dcc", "algorithm.g_units=7"),
    ],
)
def test_what_the_name_of_an_algorithm_leaves_open_is_free(algorithm: str, override: str) -> None:
    """DCC-MD has any rate, and nobody is called by the size of a layer."""
    [run] = trained(algorithm, override).runs
    assert run.overrides == (override,)


@pytest.mark.parametrize("name", list_definitions())
def test_no_shipped_question_lets_its_arms_become_one(name: str) -> None:
    """The rate is what they compare, in every profile."""
    definition = load_definition(name)
    for profile in definition.profiles:
        with pytest.raises(DefinitionError, match=r"algorithm\.rate: variant"):
            plan(definition, profile, KNOWN, overrides=["algorithm.rate=0.5"])
