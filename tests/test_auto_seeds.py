"""`--seeds auto`: trains to the next registered look where a claim is open, and nowhere else."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from msgdrop_cli.commands.parts.auto_seeds import too_few_seeds
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.engine.offers import catalogue
from tests.cli_runs import QUESTION, Said, msgdrop
from tests.fake_runs import write_run

RULE = """
[registration]
looks = [6, 8, 12]
alpha_spent = [0.04, 0.045, 0.05]
"""
THIRD = """
[variants.fdc]
label = "FDC"
algorithm = { name = "fdc" }
[[claims]]
says = "Without messages it is worse"
source = "l. 2"
better = "md-0.2"
worse = "fdc"
environment = "pursuit-n6"
metric = "catches_per_500"
"""
LOW, HIGH = [1, 2, 1, 2, 1, 2], [11, 12, 12, 11, 12, 11]
MIXED = [18, 1, 17, 2, 18, 1]


def asked(folder: Path, *arguments: str, more: str = RULE + THIRD) -> Said:
    """Ask the tiny question, with a registration and two claims of three arms."""
    question = folder / "tiny.toml"
    folder.mkdir(exist_ok=True)
    question.write_text(
        QUESTION.replace("evaluation_episodes = 8", "evaluation_episodes = 2") + more
    )
    where = ("--results", folder / "results", "--workers", "1")
    return msgdrop("ablate", question, "--seeds", "auto", *where, *arguments)


def looks(folder: Path, **arms: Any) -> Any:
    """What it would train, the arms having these catches; as `--dry-run --json` says it."""
    asked(folder, "--dry-run")
    trained(folder, {name.replace("md", "md-0.2"): values for name, values in arms.items()})
    said = asked(folder, "--dry-run", "--json")
    assert said.code == 0, said.err
    return json.loads(said.out)


def trained(folder: Path, arms: Mapping[str, Sequence[int | str]]) -> None:
    """Records of the question's runs, seed by seed: catches, or the word of how it ended."""
    question = load_definition(str(folder / "tiny.toml"))
    for run in plan(question, "quick", catalogue(), seeds=range(1, 13)).runs:
        values = arms.get(run.variant, ())
        if run.spec.seed <= len(values):
            value = values[run.spec.seed - 1]
            ended: dict[str, Any] = {"status": value, "catches": {}}
            if not isinstance(value, str):
                ended = {"catches": {0.0: value}}
            write_run(folder / "results", run.variant, run.spec.seed, run_id=run.run_id, **ended)


def to_train(document: Any) -> dict[str, int]:
    """How many new runs of each variant."""
    new = [run["variant"] for run in document["runs"] if run["status"] == "planned"]
    return {variant: new.count(variant) for variant in dict.fromkeys(new)}


def test_nothing_trained_yet_waits_for_the_first_look(tmp_path: Path) -> None:
    """Every arm of a claim, and seeds 1 to 6."""
    assert to_train(looks(tmp_path)) == {"dcc": 6, "md-0.2": 6, "fdc": 6}


def test_arms_of_open_claims_alone_go_on(tmp_path: Path) -> None:
    """DCC is beaten at the first look; FDC, and DCC-MD which it is compared with, are wanted."""
    document = looks(tmp_path, dcc=LOW, md=HIGH, fdc=MIXED)
    assert to_train(document) == {"md-0.2": 2, "fdc": 2}
    assert document["looks"] == [
        {
            "environment": "pursuit-n6",
            "look": 2,
            "seeds": 8,
            "variants": ["fdc", "md-0.2"],
            "claims": 1,
        }
    ]


def test_nothing_is_looked_at_between_looks(tmp_path: Path) -> None:
    """Seven seeds that all agree wait for the eighth as seven that do not."""
    agree = looks(tmp_path / "1", dcc=[*MIXED, 1], md=[*HIGH, 40], fdc=[*MIXED, 1])
    differ = looks(tmp_path / "2", dcc=[*MIXED, 40], md=[*HIGH, 1], fdc=[*MIXED, 40])
    assert to_train(agree) == to_train(differ) == {"dcc": 1, "md-0.2": 1, "fdc": 1}


def test_a_gap_is_closed_first(tmp_path: Path) -> None:
    """A look is of seeds 1 to n: who lacks the sixth has not reached it, whoever has seven."""
    document = looks(tmp_path, dcc=LOW[:5], md=[*HIGH, 12], fdc=LOW)
    assert to_train(document) == {"dcc": 1}


def test_everything_decided_trains_nothing(tmp_path: Path) -> None:
    """Both claims are supported at the first look."""
    assert to_train(looks(tmp_path, dcc=LOW, md=HIGH, fdc=LOW)) == {}


def test_after_the_last_look_nothing_is_trained(tmp_path: Path) -> None:
    """Open as it is: more seeds could decide nothing that was registered."""
    assert to_train(looks(tmp_path, dcc=MIXED * 2, md=HIGH * 2, fdc=MIXED * 2)) == {}


def test_a_lost_run_of_a_decided_claim_stays_in_its_verdict(tmp_path: Path) -> None:
    """It is not tried again, which might turn the verdict, and still counts as the worst."""
    assert to_train(looks(tmp_path, dcc=["diverged", *LOW[1:]], md=HIGH, fdc=LOW)) == {}
    said = asked(tmp_path)
    assert "auto: no claim is open at a look that is left" in said.err
    assert "nothing to train" in said.err
    assert said.out.count("supported") == 2
    assert "1 lost to failed or diverged runs, which count as the worst" in " ".join(
        said.out.split()
    )
    assert said.code == 3


def test_a_failed_run_is_tried_again_before_anything_is_decided(tmp_path: Path) -> None:
    """It says nothing of its arm, so five seeds that agree and a crash are no look at six."""
    document = looks(tmp_path, dcc=["failed", *LOW[1:]], md=HIGH, fdc=LOW)
    assert [look["seeds"] for look in document["looks"]] == [6]
    said = " ".join(asked(tmp_path, "--dry-run").out.split())
    assert "18 runs: 17 finished, 1 to go on with" in said


def test_the_plan_says_what_it_does(tmp_path: Path) -> None:
    """In words, before anything is trained."""
    looks(tmp_path, dcc=LOW, md=HIGH, fdc=MIXED)
    said = " ".join(asked(tmp_path, "--dry-run").out.split())
    assert "auto: pursuit-n6 to look 2 of 3, seeds 1 to 8 of fdc, md-0.2 (1 open claim)" in said
    assert "16 runs: 12 finished, 4 new" in said


def test_the_plan_names_whom_no_claim_is_about(tmp_path: Path) -> None:
    """An arm of one's own would be missing without a word; a decided one is not left out."""
    mine = '[variants.mine]\nlabel = "Mine"\nalgorithm = { name = "dcc-md", rate = 0.05 }\n'
    looks(tmp_path, dcc=LOW, md=HIGH, fdc=MIXED)
    said = asked(tmp_path, "--dry-run", more=f"{RULE}{THIRD}{mine}").out
    assert " ".join(said.split()).count("left out Mine: in no claim, --seeds N trains it") == 1
    assert "left out" not in asked(tmp_path, "--dry-run").out


@pytest.mark.parametrize(
    ("rule", "look"),
    [
        (f"{RULE}seen = 6\n", "look 3 of 3, seeds 1 to 12"),
        (f"{RULE}seen = 6\nseen_in = {{ pursuit-n6 = 0 }}\n", "look 1 of 3, seeds 1 to 6"),
        (RULE.replace("0.04,", "0.03,"), "look 2 of 3, seeds 1 to 8"),
        (RULE.replace("[6, 8, 12]", "[3, 4, 5]"), "no claim is open at a look that is left"),
    ],
    ids=["seen", "seen elsewhere", "no p so small", "never"],
)
def test_a_look_that_can_decide_nothing_is_passed_over(
    tmp_path: Path, rule: str, look: str
) -> None:
    """It had been seen, or so few seeds cannot have a p that it may spend."""
    said = asked(tmp_path, "--dry-run", more=f"{rule}{THIRD}")
    assert look in " ".join(f"{said.out} {said.err}".split())


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ("", "tiny.toml: --seeds auto trains to the next look of a [registration], and there is"),
        (f"{RULE}[profiles.one]\nseeds = 1\nvariants = ['dcc']\n", "no claim is about the runs"),
    ],
)
def test_without_a_look_or_a_claim_it_is_refused(tmp_path: Path, more: str, problem: str) -> None:
    """In one line that says what to do instead."""
    said = asked(tmp_path, "--profile", "one" if "one" in more else "quick", more=more)
    assert said.code == 2
    assert problem in said.err
    assert "give a number of seeds" in said.err
    assert len(said.err.strip().splitlines()) == 1
    assert not (tmp_path / "results").exists()


def test_train_has_no_looks() -> None:
    """Nothing is claimed there."""
    said = msgdrop("train", "--seeds", "auto", "--dry-run")
    assert said.code == 2
    assert "msgdrop train: --seeds auto trains to the next look of a [registration]" in said.err


@pytest.mark.parametrize(
    ("question", "profile", "seeds", "said"),
    [
        ("dropout-rate", "paper", None, "none is possible with 7 seeds: the first registered look "
         "that can decide is at 10 (--seeds auto)"),
        ("broken-links", "two-million", (1,), "none is possible with 1 seed: the first registered "
         "look that can decide is at 10 (--seeds auto)"),
        ("broken-links", "two-million", range(1, 11), ""),
        ("broken-links", "two-million", range(7, 11), ""),
    ],
)  # fmt: skip
def test_a_plan_that_can_decide_nothing_says_so(
    question: str, profile: str, seeds: Sequence[int] | None, said: str
) -> None:
    """The paper's seven seeds are hours and no verdict; a piece of a study is not told so."""
    made = plan(load_definition(question), profile, catalogue(), seeds=seeds)
    assert too_few_seeds(made) == said


def test_of_two_games_the_one_that_can_decide_nothing_is_named() -> None:
    """Here of N = 6 six seeds had been seen, and of N = 8 all looks."""
    question = load_definition("broken-links")
    assert question.registration
    seen = replace(question.registration, seen_in={"pursuit-n8": 20})
    made = plan(replace(question, registration=seen), "paper", catalogue(), seeds=range(1, 11))
    assert too_few_seeds(made) == (
        "none is possible with 10 seeds on pursuit-n8: no registered look can decide anything"
    )


def test_where_nothing_is_registered_nothing_is_said(tmp_path: Path) -> None:
    """There are no verdicts at all."""
    (tmp_path / "tiny.toml").write_text(QUESTION)
    made = plan(load_definition(str(tmp_path / "tiny.toml")), "quick", catalogue())
    assert too_few_seeds(made) == ""
    (tmp_path / "tiny.toml").write_text(QUESTION + RULE)
    made = plan(load_definition(str(tmp_path / "tiny.toml")), "quick", catalogue())
    assert "with 2 seeds" in too_few_seeds(made)
