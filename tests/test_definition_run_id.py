"""A run's identity: everything that changes a result changes the id, and nothing else does."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.definition.cohorts import group
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.run_id import run_id, run_ids, spec_from_dict, spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun, RunSpec, TrainingSpec
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError
from tests.definition_samples import CATALOGUE, DEFINITION, Learner, World

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = (
    *("fdc-s1-1050138a", "md-0.2-s1-0a902d7b", "md-0.5-s1-797a661b", "sd-0.2-s1-18d5e13c"),
    *("dcc-s1-937be297", "fdc-s1-0ad397c0", "md-0.2-s1-3ff966d9", "md-0.5-s1-0932d351"),
    *("ddpg-s1-b4a72ea0", "maddpg-s1-83d03193", "maddpg-md-0.2-s1-fa87e26c"),
)
"""Of every published folder."""
SPEC = RunSpec(
    environment="tiny-n2",
    environment_config=World(),
    algorithm="lab",
    algorithm_config=Learner(rate=0.2),
    training=TrainingSpec(),
    seed=1,
)


def replaced(**changes: Any) -> RunSpec:
    """SPEC with some fields replaced."""
    return dataclasses.replace(SPEC, **changes)


def test_the_id_is_a_stored_number() -> None:
    """The id of this spec never changes: stored results are found by it."""
    assert run_id(SPEC) == "88a9cf71"


@pytest.mark.parametrize(
    "other",
    [
        replaced(seed=2),
        replaced(environment="tiny-n4"),
        replaced(environment_config=World(agents=3)),
        replaced(algorithm="lab2"),
        replaced(algorithm_config=Learner(rate=0.3)),
        replaced(algorithm_config=Learner(rate=0.2, widths=(48, 64))),
        replaced(training=TrainingSpec(games=9)),
    ],
)
def test_whatever_changes_a_result_changes_the_id(other: RunSpec) -> None:
    """Each part of the spec enters."""
    assert run_id(other) != run_id(SPEC)


@pytest.mark.parametrize(
    "other",
    [
        replaced(training=TrainingSpec(checkpoint_every_env_steps=5)),
        replaced(algorithm_config=Learner(rate=0.2, comment="other words")),
    ],
)
def test_cosmetic_fields_do_not_change_the_id(other: RunSpec) -> None:
    """Fields that say they are cosmetic stand in the record but not in the id."""
    assert run_id(other) == run_id(SPEC)
    assert spec_to_dict(other) != spec_to_dict(SPEC)


def test_ids_of_many_seeds_are_those_of_each_seed() -> None:
    """Whatever is made anew for each of them."""
    seeds = (0, 1, 12, 2**63 - 1)
    assert [*run_ids(SPEC, seeds)] == [run_id(replaced(seed=seed)) for seed in seeds]


def test_a_later_setting_at_its_default_leaves_id_and_record_as_they_were() -> None:
    """What was published before it existed is the same run, and is compared with what is new."""
    assert "neighbours" not in spec_to_dict(SPEC)["algorithm"]
    table = spec_to_dict(replaced(algorithm_config=Learner(rate=0.2, neighbours="ring")))
    assert table["algorithm"]["neighbours"] == "ring"
    changed = spec_from_dict(table, CATALOGUE)
    assert run_id(changed) != run_id(SPEC)
    assert spec_from_dict(spec_to_dict(SPEC), CATALOGUE) == SPEC


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_ids_stay(name: str) -> None:
    """The spec of a published record, read and identified by this program, has the id it had."""
    file, *_ = (ROOT / "results" / "published").glob(f"*/*/{name}/run.json")
    table = json.loads(file.read_text())
    spec = spec_from_dict(table["spec"], catalogue())
    assert run_id(spec) == name.rpartition("-")[2]
    assert spec_to_dict(spec) == table["spec"]


def test_the_id_does_not_depend_on_the_process() -> None:
    """A process with another hash seed computes the same id."""
    program = "from tests.test_definition_run_id import SPEC, run_id; print(run_id(SPEC))"
    path = f"import sys; sys.path[:0] = {sys.path!r}; "
    printed = subprocess.run(
        [sys.executable, "-c", path + program],
        env={"PYTHONHASHSEED": "7"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert printed.stdout.strip() == run_id(SPEC)


def test_one_number_has_one_id_however_it_is_written() -> None:
    """A rate given as `0`, `0.0`, `-0.0` or by an integer default is one run."""
    ids = {
        plan(DEFINITION, "paper", CATALOGUE, overrides=[override]).runs[0].run_id
        for override in (f"variants.plain.algorithm.rate={zero}" for zero in ("0", "0.0", "-0.0"))
    }
    default = next(
        run for run in plan(DEFINITION, "paper", CATALOGUE).runs
        if (run.spec.environment, run.variant, run.spec.seed) == ("tiny-n4", "plain", 1)
    )  # fmt: skip
    written = dataclasses.replace(default.spec, algorithm_config=Learner(rate=0.0))
    assert len(ids) == 1
    assert default.run_id == run_id(written)


def test_the_same_run_in_two_plans_has_one_id() -> None:
    """`plain` with the rate that `low` has by its name is a run of `low`."""
    overrides = ["variants.plain.algorithm.rate=0.2", "variants.low.algorithm.rate=0.4"]
    made = (plan(DEFINITION, "paper", CATALOGUE, overrides=each) for each in (overrides, []))
    overridden, asked = ({run.variant: run.run_id for run in each.runs} for each in made)
    assert overridden["plain"] == asked["low"] != overridden["low"]
    assert overridden["high"] == asked["high"]


def test_the_spec_survives_json() -> None:
    """To a dictionary, through JSON, and back: equal."""
    table = json.loads(json.dumps(spec_to_dict(SPEC), allow_nan=False))
    assert spec_from_dict(table, CATALOGUE) == SPEC


def test_the_stored_spec_has_the_shape_that_readers_expect() -> None:
    """Names beside the fields of the Configs."""
    table = spec_to_dict(SPEC)
    assert table["environment"] == {"name": "tiny-n2", "agents": 2, "time_limit": 500}
    assert table["algorithm"]["learner"] == "lab"
    assert table["algorithm"]["widths"] == [64, 48]
    assert (set(table), table["seed"]) == ({"environment", "algorithm", "training", "seed"}, 1)


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        ("environment", {"name": "tiny-n3"}, "no environment is called"),
        ("environment", {"agnts": 3}, "did you mean 'agents'"),
        ("algorithm", {"learner": "labb"}, "did you mean 'lab'"),
        ("algorithm", {"rate": 3.0}, "rate must lie"),
        ("training", {"games": "x"}, "training.games: expected a whole number"),
    ],
)
def test_a_damaged_spec_is_one_clear_line(section: str, change: Any, message: str) -> None:
    """What a stored spec says wrongly is named."""
    table = spec_to_dict(SPEC)
    table[section] |= change
    with pytest.raises(DefinitionError, match=message):
        spec_from_dict(table, CATALOGUE)


def planned(spec: RunSpec, variant: str = "a") -> PlannedRun:
    """A run for tests of cohorts."""
    return PlannedRun(
        run_id=run_id(spec), variant=variant, label="A", definition="d", profile="p", spec=spec
    )


def test_runs_that_differ_in_seed_and_rate_train_stacked() -> None:
    """Two rates and two seeds are one cohort, in the order given."""
    configs = (Learner(rate=0.2), Learner(rate=0.0))
    runs = [planned(replaced(algorithm_config=c, seed=s)) for c in configs for s in (1, 2)]
    assert group(runs, 4) == [tuple(runs)]


def test_runs_that_differ_elsewhere_do_not() -> None:
    """Another dropout and another training are cohorts of their own."""
    runs = [
        planned(SPEC),
        planned(replaced(algorithm_config=Learner(rate=0.2, dropout="element"))),
        planned(replaced(training=TrainingSpec(train_env_steps=3))),
    ]
    assert group(runs, 4) == [(run,) for run in runs]


def test_large_cohorts_are_split_evenly() -> None:
    """Five runs in cohorts of at most four are three and two, whose times are alike."""
    runs = [planned(replaced(seed=seed)) for seed in range(1, 6)]
    assert group(runs, 4) == [tuple(runs[:2]), tuple(runs[2:])]


def test_one_run_under_two_names_is_trained_once() -> None:
    """The first variant stands for both."""
    runs = [planned(SPEC, "a"), planned(SPEC, "b")]
    assert group(runs, 4) == [(runs[0],)]


def test_a_cohort_of_nobody_is_refused() -> None:
    """Size 0 is a mistake of ours."""
    with pytest.raises(ValueError, match="at least 1 run"):
        group([planned(SPEC)], 0)
