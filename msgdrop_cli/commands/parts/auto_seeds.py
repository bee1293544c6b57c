"""`--seeds auto`: the runs up to the next registered look, for claims that are open, and no others.

Whoever trains until the numbers please decides something else than what was registered. So nothing
here looks at seeds between looks: only verdicts say what is open.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.next_looks import NextLook, next_looks
from msgdrop_cli.analysis.sequential import deciding_looks
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.plan import Plan
from msgdrop_cli.definition.spec import Definition, PlannedRun, Registration
from msgdrop_cli.definition.strict import Where
from msgdrop_cli.records.store import RunRecord

_ENDED = ("done", "failed", "diverged")


class Ahead(NamedTuple):
    """What `--seeds auto` makes of a plan with the seeds of the last look."""

    asked: Plan
    """Its runs are those that are shown: to the next look, and what has ended of decided arms."""
    train: tuple[PlannedRun, ...]
    """Those of them that are wanted at the next look."""
    looks: list[NextLook]


def registration_of(definition: Definition) -> Registration:
    """The looks that `--seeds auto` goes by; DefinitionError without any."""
    if definition.registration is None:
        raise Where(definition.file).error(
            "--seeds auto trains to the next look of a [registration], and there is none here;"
            " give a number of seeds"
        )
    return definition.registration


def to_next_looks(asked: Plan, records: Sequence[RunRecord]) -> Ahead:
    """The part of a plan that the next looks need, judged by what is finished.

    asked: with the seeds of the last look. records: those of its runs that there are, by its names.
    Raises DefinitionError without a registration, or a claim that the plan could judge.
    """
    rule = registration_of(asked.definition)
    if not asked.claims:
        raise Where(asked.definition.file).error(
            f"--seeds auto: no claim is about the runs of profile {asked.profile};"
            " give a number of seeds"
        )
    summary = summarise(records, episodes=asked.evaluation_episodes)
    looks = next_looks(judge_claims(asked.claims, summary, asked.definition), rule)
    last = {(each.environment, name): each.seeds for each in looks for name in each.variants}
    ended = {record.run_id for record in records if record.status in _ENDED}

    def is_wanted(run: PlannedRun) -> bool:
        return run.spec.seed <= last.get((run.spec.environment, run.variant), 0)

    def is_shown(run: PlannedRun) -> bool:
        decided = (run.spec.environment, run.variant) not in last
        return run.run_id in ended if decided else is_wanted(run)

    shown = replace(asked, runs=tuple(filter(is_shown, asked.runs)))
    return Ahead(shown, tuple(filter(is_wanted, asked.runs)), looks)


def looks_in_words(looks: Sequence[NextLook], rule: Registration) -> str:
    """`auto: pursuit-n6 to look 2 of 4, seeds 1 to 10, of dcc and fdc (3 claims are open)`."""
    if not looks:
        return "auto: no claim is open at a look that is left"
    words = []
    for each in looks:
        words.append(
            f"{each.environment} to look {each.look} of {len(rule.looks)}, seeds 1 to {each.seeds}"
            f" of {', '.join(each.variants)} ({several(each.claims, 'open claim')})"
        )
    return f"auto: {'; '.join(words)}"


def too_few_seeds(asked: Plan) -> str:
    """What seeds 1 to n cannot decide, and how many could; empty if they can decide something.

    Other lists of seeds are pieces of a study, of which more may be there.
    """
    rule = asked.definition.registration
    seeds = {run.spec.seed for run in asked.runs}
    if rule is None or seeds != {*range(1, len(seeds) + 1)}:
        return ""
    told: dict[str, list[str]] = {}
    games = dict.fromkeys(claim.environment for claim in asked.claims)
    for game in games:
        looks = deciding_looks(rule.in_game(game))
        if not looks:
            told.setdefault("no registered look can decide anything", []).append(game)
        elif looks[0] > len(seeds):
            first = f"the first registered look that can decide is at {looks[0]} (--seeds auto)"
            told.setdefault(first, []).append(game)
    none = f"none is possible with {several(len(seeds), 'seed')}"
    alike = [*told.values()] == [[*games]]
    places = {why: "" if alike else f" on {', '.join(on)}" for why, on in told.items()}
    return "; ".join(f"{none}{place}: {why}" for why, place in places.items())
