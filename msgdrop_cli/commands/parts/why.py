"""Why a run is not what its question asks for today, and which command makes it so."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from msgdrop_cli.analysis.labels import leaves
from msgdrop_cli.commands.parts.once_more import once_more
from msgdrop_cli.commands.parts.options import WORKERS
from msgdrop_cli.commands.parts.paces import Paces
from msgdrop_cli.commands.parts.words import about, several
from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.plan import AD_HOC_NAME, Plan, plan
from msgdrop_cli.definition.readings import apart
from msgdrop_cli.definition.registration import registered_as
from msgdrop_cli.definition.run_id import spec_from_dict, spec_to_dict
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.records.counted import by_run_id, preferred
from msgdrop_cli.records.files import LOCK
from msgdrop_cli.records.holders import is_held, locked_files
from msgdrop_cli.records.ours import CHECKPOINTS
from msgdrop_cli.records.store import RunRecord

_CURRENT = ""
_NEVER_AGAIN = "it would diverge again, and counts as the worst value"
_SHOWN = 3
"""Settings that are named where more have changed."""


@dataclass(frozen=True, slots=True)
class Why:
    """What keeps some runs from being finished and up to date."""

    word: str
    """`planned`, `interrupted`, `failed`, `diverged`, `stale` or `incomplete`."""
    reason: str
    records: tuple[RunRecord, ...]
    command: str
    """What to type; empty where nothing helps."""
    lacks: str = ""
    """What has to be put into the command first, in words."""

    @property
    def is_to_be_trained(self) -> bool:
        """Whether the command trains these runs, as far as they have not come yet."""
        return self.word in ("planned", "killed", "interrupted", "failed")


def times(found: Iterable[Why], records: Iterable[RunRecord], catalogue: Catalogue) -> list[str]:
    """How long each command takes here with as many workers as it has by itself, in words.

    Empty where nothing is trained, or where it is not known what: a game or learner that is not
    here. records: whose speed may be known. Loads torch.
    """
    finished = [record for record in records if record.status == "done"]
    paces = Paces(finished, workers=WORKERS, device="cpu")
    return [_time(each, paces, catalogue) for each in found]


def _time(found: Why, paces: Paces, catalogue: Catalogue) -> str:
    if not found.is_to_be_trained:
        return ""
    try:
        tasks = [[_left(record, catalogue)] for record in found.records]
        spent, source = paces.of(tasks)
    except DefinitionError:  # of a game that is not here, or that nobody has asked for
        return ""
    return f"{about(*spent)} with {several(min(WORKERS, len(tasks)), 'worker')} ({source})"


def _left(record: RunRecord, catalogue: Catalogue) -> tuple[PlannedRun, int]:
    spec = spec_from_dict(record.spec, catalogue)
    run = PlannedRun(
        run_id=record.run_id,
        variant=record.variant,
        label=record.label,
        definition=record.definition,
        profile=record.profile,
        spec=spec,
    )
    return run, max(0, spec.training.train_env_steps - record.env_steps)


def reasons(records: Iterable[RunRecord], catalogue: Catalogue) -> list[Why]:
    """Every run that is missing or stale, those of one question and reason together.

    Those at work are not among them, nor a copy of which another one is finished, own or published.
    Raises RecordError for damaged episodes.
    """
    found: dict[tuple[Any, ...], list[RunRecord]] = {}
    asked, held = _Asked(catalogue), locked_files()
    records = list(records)
    counted = _counted(records)
    for record in records:
        is_there = counted[record.run_id] != record and counted[record.run_id].status == "done"
        if is_there and record.status != "done":
            continue
        if record.status == "running" and is_held(record.path / LOCK, held):
            continue
        word, reason = _why(record, asked)
        if word != _CURRENT and not (is_there and word == "incomplete"):
            key = (word, reason, *_question(record), *_trained_alone(record))
            found.setdefault(key, []).append(record)
    return [
        Why(key[0], key[1], tuple(runs), *(("",) if key[0] == "diverged" else once_more(runs)))
        for key, runs in found.items()
    ]


def _counted(records: Iterable[RunRecord]) -> dict[str, RunRecord]:
    """By run id the copy that every command counts."""
    return {run_id: preferred(each)[0] for run_id, each in by_run_id(records).items()}


def _why(record: RunRecord, asked: "_Asked") -> tuple[str, str]:
    """The word and the reason; both empty for a run that is finished and up to date."""
    match record.status:
        case "planned":
            return "planned", "not begun"
        case "running":
            return "killed", f"nobody works at it; {_goes_on(record)}"
        case "interrupted":
            return "interrupted", f"stopped on the way; {_goes_on(record)}"
        case "failed":
            return "failed", f"{record.reason or 'no reason is recorded'}; tried again when asked"
        case "diverged":
            return "diverged", f"{record.reason or 'no reason is recorded'}; {_NEVER_AGAIN}"
    try:
        today = asked.plan_of(record)
    except DefinitionError as error:
        return "stale", f"cannot be asked so any more: {error}"
    return _compared(record, today) if today else (_CURRENT, "")


def _goes_on(record: RunRecord) -> str:
    if any((record.path / CHECKPOINTS).glob("*")):
        return "it goes on from its checkpoint"
    return "it has no checkpoint yet and begins anew"


def _compared(record: RunRecord, today: Plan) -> tuple[str, str]:
    """A finished run beside what its question plans in its place."""
    arm = (record.environment, record.variant, record.seed)
    same = [r for r in today.runs if (r.spec.environment, r.variant, r.spec.seed) == arm]
    if not same:
        return "stale", "its question has no such variant or game any more"
    if same[0].run_id != record.run_id:
        changes = _changes(record.spec, spec_to_dict(same[0].spec))
        return "stale", f"settings have changed: {changes}"
    played, asked_for = record.episodes(), today.evaluation_episodes
    missing = [c.word for c in today.channels if len(played.get(c, ())) < asked_for]
    if missing:
        return "incomplete", f"fewer than {asked_for:,} episodes through {', '.join(missing)}"
    then, now = record.registration or "", registered_as(today.definition, record.environment)
    if then != now and then.partition(":")[0] == today.definition.name:
        return "stale", "trained under another registration, as its verdicts will say"
    return _CURRENT, ""


def _changes(then: dict[str, Any], now: dict[str, Any]) -> str:
    """`algorithm.gamma 0.9 -> 0.95, ...`, those that differ."""
    old, new = dict(leaves(then)), dict(leaves(now))
    names = [n for n in dict.fromkeys((*old, *new)) if old.get(n) != new.get(n)]
    words = [f"{n} {old.get(n, 'not set')} -> {new.get(n, 'not set')}" for n in names[:_SHOWN]]
    more = len(names) - _SHOWN
    return ", ".join(words) + (f" and {more} more" if more > 0 else "")


class _Asked:
    """What questions plan today, each asked once."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._plans: dict[tuple[Any, ...], Plan] = {}

    def plan_of(self, record: RunRecord) -> Plan | None:
        """The plan that the run is of; None for a question that is not shipped.

        Raises DefinitionError if the question no longer takes its profile or settings.
        """
        name, called, overrides = _question(record)
        if name not in list_definitions():
            return None
        key = (name, called, overrides, record.seed)
        if key not in self._plans:
            question = load_definition(name)
            self._plans[key] = plan(
                question,
                apart(called, question.profiles)[0],  # what readings set, its overrides have
                self._catalogue,
                overrides=overrides,
                seeds=(record.seed,),
            )
        return self._plans[key]


def _trained_alone(record: RunRecord) -> tuple[Any, ...]:
    """What a `train` can ask for only one of; a question asks for all its arms at once."""
    if record.definition != AD_HOC_NAME:
        return ()
    steps = record.setup.train_env_steps if record.setup else None
    return record.environment, record.variant, steps


def _question(record: RunRecord) -> tuple[str, str, tuple[str, ...]]:
    return record.definition, record.profile, record.overrides
