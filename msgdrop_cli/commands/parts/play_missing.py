"""Evaluates trained runs where something is missing; shared by every command that needs numbers."""

import shutil
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from msgdrop_cli.analysis.summary import Summary
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.fitting import check_channels_fit
from msgdrop_cli.commands.parts.listing import runs_in
from msgdrop_cli.commands.parts.options import check_device
from msgdrop_cli.commands.parts.progress import Watch, Watched, run_name
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.records.files import write_json_atomic
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.packed import packed_name
from msgdrop_cli.records.store import EPISODES, METRICS, POLICY, RUN, RunRecord, list_runs
from msgdrop_cli.scheduler import Task, run_tasks
from msgdrop_cli.signals import scratch_folder
from msgdrop_cli.stopping import Stopped, graceful_stop

_COPIED = (POLICY, METRICS, EPISODES, packed_name(METRICS), packed_name(EPISODES))


_TO_PLAY_IT = "name a run's own folder to do so, or MSGDROP_FACTORIES=module:factory for all"


class Evaluated(NamedTuple):
    """What came of the runs that were to be evaluated."""

    records: list[RunRecord]
    """The runs that have every episode."""
    exit_code: int
    """Of the worst of the others, each of which has been named on stderr; 0 without any."""


def measurable_runs(
    root: Path, channels: Sequence[Channel], episodes: int, *, listeners_only: bool = False
) -> list[RunRecord]:
    """The finished runs in a folder that left a policy, or every episode that is asked for.

    Our own, or the published ones if there are no others; who is left out is counted in a note.
    listeners_only: without runs whose agents hear nobody when they act.
    Raises DefinitionError if none is there.
    """
    done = [run for run in runs_in(root) if run.status == "done"]
    unasked = [run for run in done if not _may_play(run, root, channels, episodes)]
    _note_left_out(len(unasked), f"they play other people's code: {_TO_PLAY_IT}")
    done = [run for run in done if run not in unasked]
    if listeners_only:
        listeners = [run for run in done if not _is_deaf(run)]
        _note_left_out(len(done) - len(listeners), "they hear nobody, so no link can break")
        done = listeners
    if any(run.is_own for run in unasked) and not any(run.is_own for run in done):
        raise DefinitionError(
            f"{root}: all of your own policies play other people's code: {_TO_PLAY_IT}"
        )
    for candidates in ([run for run in done if run.is_own], done):
        runs = [
            run
            for run in candidates
            if (run.path / POLICY).is_file() or run.has_episodes(channels, episodes)
        ]
        if runs:
            others = {run.run_id for run in done} - {run.run_id for run in candidates}
            published = "they are published, and there are your own: name their folder to ask them"
            _note_left_out(len(others), published)
            reason = f"they have neither a policy nor {episodes:,} episodes of each channel"
            _note_left_out(len(candidates) - len(runs), reason)
            return runs
    raise DefinitionError(f"{root}: holds no trained policy (train one: msgdrop ablate)")


def evaluated(
    records: Sequence[RunRecord],
    channels: Sequence[Channel],
    episodes: int,
    *,
    device: str,
    workers: int,
    keep: ExitStack,
) -> Evaluated:
    """The records with at least `episodes` episodes for each channel.

    Published runs are never written to: what they lack is played in a copy that lives as long as
    `keep`. Raises DefinitionError for channels that mean nothing in one of the games, Stopped if a
    signal asks for it.
    """
    sound, missing, worst = _sorted_out(records, channels, episodes)
    if not missing:
        return Evaluated(sound, worst)
    check_device(device)
    games = _games([record for record in sound if record.run_id in missing])
    check_channels_fit(games, channels)
    console.note(f"{len(missing):,} of {several(len(sound), 'run')} lack episodes: played anew")
    places = [
        record if record.run_id not in missing or record.is_own else _copy(record, keep)
        for record in sound
    ]
    tasks = [
        Task(
            root=place.path,
            trained=(place,),
            channels=tuple(channels),
            episodes=episodes,
            device=device,
        )
        for place in places
        if place.run_id in missing
    ]
    with graceful_stop() as control:
        watched = [_watched(place) for place in places if place.run_id in missing]
        with Watch(watched, control) as watch:
            told = _by_their_names(sound, watch.finished)
            outcomes = run_tasks(tasks, control, workers=workers, finished=told)
        if control.signal is not None:
            raise Stopped(control.signal)
    bad = {outcome.run_id: outcome.exit_code for outcome in outcomes if outcome.status != "done"}
    whole = [place for place in places if place.run_id not in bad]
    found = [list_runs(each.path)[0] if each.run_id in missing else each for each in whole]
    return Evaluated(found, max(worst, *bad.values(), 0))


def _by_their_names(
    records: Sequence[RunRecord], finished: Callable[[Outcome], None]
) -> Callable[[Outcome], None]:
    """The same, that says of a copy the name of the run that it is a copy of."""
    named = {record.run_id: str(record.path) for record in records}

    def told(outcome: Outcome) -> None:
        reason = outcome.reason and outcome.reason.replace(str(outcome.path), named[outcome.run_id])
        finished(replace(outcome, reason=reason))

    return told


def only(summary: Summary, channels: Sequence[Channel]) -> Summary:
    """The summary without the rows of other channels."""
    return replace(
        summary,
        arms=tuple(
            replace(arm, rows=tuple(row for row in arm.rows if row.channel in channels))
            for arm in summary.arms
        ),
    )


def _sorted_out(
    records: Sequence[RunRecord], channels: Sequence[Channel], episodes: int
) -> tuple[list[RunRecord], set[str], int]:
    """The sound records, the ids of those that lack episodes, and the others' worst exit code."""
    sound, missing, worst = [], set[str](), 0
    for record in records:
        try:
            if not record.has_episodes(channels, episodes):
                if not (record.path / POLICY).is_file():
                    raise RecordError(
                        f"{record.path}: lacks episodes, and its {POLICY} is gone; "
                        "delete this folder and train the run again"
                    )
                missing.add(record.run_id)
            sound.append(record)
        except RecordError as error:
            console.error(str(error))
            worst = max(worst, error.exit_code)
    return sound, missing, worst


def _games(records: Sequence[RunRecord]) -> dict[str, Any]:
    """The Configs of the games that they were trained in, by name; without damaged ones."""
    from msgdrop_cli.engine.offers import catalogue

    known, games = catalogue(), dict[str, Any]()
    for record in records:
        with suppress(DefinitionError):  # whoever reads its policy says so
            games[record.environment] = spec_from_dict(record.spec, known).environment_config
    return games


def _may_play(record: RunRecord, root: Path, channels: Sequence[Channel], episodes: int) -> bool:
    """Whether no factory of other people is called for it, or the user means just this run."""
    game = record.spec.get("environment")
    named = game.get("factory") if isinstance(game, dict) else None
    if named is None or record.has_episodes(channels, episodes):
        return True
    from msgdrop_envs.foreign import factory

    if (root / RUN).is_file():
        factory.allow(str(named))
    return factory.is_allowed(str(named))


def _is_deaf(record: RunRecord) -> bool:
    """Whether messages went to critics only, which play no part when a trained agent acts.

    FDC hears nobody either, but it is what the paper compares those who do with (l. 525).
    """
    from msgdrop_cli.algorithms.discovery import learner_class, learners

    learner = record.setup.learner if record.setup else None
    return learner in learners() and not learner_class(learner).listens


def _note_left_out(runs: int, reason: str) -> None:
    if runs:
        console.note(f"{several(runs, 'finished run')} left out: {reason}")


def _copy(record: RunRecord, keep: ExitStack) -> RunRecord:
    """The run in a folder of its own, which says as the first one does which study it is of.

    By the names of the study that is asked, which may be another one.
    """
    place = record.path.resolve().parts[-3:]
    folder = keep.enter_context(scratch_folder()).joinpath(*place)
    folder.mkdir(parents=True)
    write_json_atomic(folder / RUN, record.run)
    for name in _COPIED:
        if (record.path / name).is_file():
            shutil.copyfile(record.path / name, folder / name)
    return list_runs(folder)[0]


def _watched(record: RunRecord) -> Watched:
    return Watched(
        run_id=record.run_id,
        name=run_name(record.environment, record.label, record.seed),
        path=record.path,
        train_env_steps=record.env_steps,
        env_steps=record.env_steps,
    )
