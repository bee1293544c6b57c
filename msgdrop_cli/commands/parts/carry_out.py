"""What `ablate` and `train` do: plan, train what is missing, evaluate, report."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from msgdrop_cli.analysis.next_looks import NextLook
from msgdrop_cli.cluster import apart, shared
from msgdrop_cli.cluster.connection import connected
from msgdrop_cli.cluster.control import shared_control
from msgdrop_cli.cluster.workers import check_workers
from msgdrop_cli.commands.parts import console
from msgdrop_cli.commands.parts.auto_seeds import registration_of, to_next_looks
from msgdrop_cli.commands.parts.estimate import (
    check_folder,
    check_memory,
    cohorts,
    estimate,
    finished_runs,
)
from msgdrop_cli.commands.parts.fitting import check_channels_fit, check_fits
from msgdrop_cli.commands.parts.options import TrainOptions, check_device
from msgdrop_cli.commands.parts.play_missing import evaluated
from msgdrop_cli.commands.parts.progress import Watch, Watched, run_name
from msgdrop_cli.commands.parts.shapes import check_claims
from msgdrop_cli.commands.parts.show_plan import outcome_json, plan_facts, plan_json
from msgdrop_cli.commands.parts.show_report import report
from msgdrop_cli.commands.parts.survey import Survey, survey, wanted_of
from msgdrop_cli.commands.parts.words import several
from msgdrop_cli.definition.plan import Plan, plan
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.definition.run_id import short_hash
from msgdrop_cli.definition.spec import Definition, PlannedRun
from msgdrop_cli.errors import RecordError, RunError
from msgdrop_cli.records.ours import delete_leftovers
from msgdrop_cli.records.outcome import Outcome
from msgdrop_cli.records.planned import plan_run
from msgdrop_cli.records.store import RunRecord, run_path
from msgdrop_cli.report.write import figures_folder
from msgdrop_cli.scheduler import Elsewhere, Task, run_tasks
from msgdrop_cli.stopping import Control, Stopped, graceful_stop, in_memory


def carry_out(definition: Definition, options: TrainOptions) -> int:
    """Everything between the definition and its table; returns the exit code.

    Raises DefinitionError before anything is written, RecordError, and Stopped.
    """
    asked, looked_up, looks = _planned(definition, options)
    check_device(options.device)
    check_fits(looked_up.pending)
    games = {run.spec.environment: run.spec.environment_config for run in looked_up.pending}
    check_channels_fit(games, asked.channels)
    check_claims(asked, looked_up.pending)
    tasks = cohorts(looked_up.pending, options.device)
    cost = estimate(
        looked_up,
        tasks,
        finished_runs(options.results),
        workers=options.workers,
        device=options.device,
        episodes=asked.evaluation_episodes,
        evaluations=len(asked.channels),
    )
    if options.dry_run and options.json:
        console.result_json(plan_json(asked, looked_up, cost, looks))
        return 0
    facts = plan_facts(asked, looked_up, cost, options, looks)
    console.facts(facts, is_result=options.dry_run)
    if options.dry_run:
        return 0
    outcomes: list[Outcome] = []
    delete_leftovers(looked_up.own)
    if tasks:
        if options.cluster is None:  # of other machines we know nothing
            check_memory(cost.memory_bytes, options.device)
            _say_what_is_slow(options.device)
        check_folder(options.results, cost.disk_bytes)
        _write_down(looked_up, options.results)
        outcomes = _train(asked, looked_up, tasks, options)
    else:
        console.note("nothing to train")
    broken = _report(asked, options, outcomes)
    return max(broken, *(outcome.exit_code for outcome in outcomes), 0)


def _planned(
    definition: Definition, options: TrainOptions
) -> tuple[Plan, Survey, list[NextLook] | None]:
    """What is shown, what is there of the runs to be trained, and the looks that `auto` goes to."""
    from msgdrop_cli.engine.offers import catalogue

    seeds: Sequence[int] | None = options.seeds
    if options.to_next_look:
        seeds = range(1, registration_of(definition).looks[-1] + 1)
    asked = plan(
        definition,
        options.profile,
        catalogue(),
        overrides=options.overrides,
        readings=options.readings,
        seeds=seeds,
    )
    # Looks are at what is on record: what a published policy would play is in none.
    plays = not options.to_next_look
    looked_up = survey(wanted_of(asked), options.results, plays=plays)
    if not options.to_next_look:
        return asked, looked_up, None
    asked, runs, looks = to_next_looks(asked, _as_asked(asked, looked_up.records))
    return asked, survey(wanted_of(asked, runs), options.results, plays=plays), looks


def _say_what_is_slow(device: str) -> None:
    """Nothing fails without a C compiler, so nobody would wonder."""
    from msgdrop_cli.kernels.build import why_torch

    if device == "cpu" and (reason := why_torch()):
        console.note(f"updates are computed by torch, several times slower ({reason})")


def _write_down(looked_up: Survey, root: Path) -> None:
    """Make a record of every run that has none, so that `status` shows what is still to come."""
    for run in looked_up.pending:
        if run.run_id not in looked_up.records:
            with suppress(RecordError):  # whoever is faster, or in the way: training will say so
                plan_run(run_path(root, run), run)


def _train(
    asked: Plan,
    looked_up: Survey,
    tasks: Sequence[tuple[PlannedRun, ...]],
    options: TrainOptions,
) -> list[Outcome]:
    todo = [
        Task(
            root=options.results.resolve() if options.cluster else options.results,
            train=cohort,
            channels=asked.channels,
            episodes=asked.evaluation_episodes,
            device=options.device,
        )
        for cohort in tasks
    ]
    watched = [
        Watched(
            run_id=run.run_id,
            name=run_name(run.spec.environment, run.label, run.spec.seed),
            path=looked_up.place(run, options.results),
            train_env_steps=run.spec.training.train_env_steps,
            env_steps=looked_up.env_steps(run),
        )
        for cohort in tasks
        for run in cohort
    ]
    with _workplace(options) as (made, elsewhere), graceful_stop(made) as control:
        with Watch(watched, control) as watch:
            outcomes = run_tasks(
                todo,
                control,
                workers=options.workers,
                finished=watch.finished,
                elsewhere=elsewhere,
            )
        if control.signal is not None:
            raise Stopped(control.signal)
    if stopped := sum(each.status == "interrupted" for each in outcomes):
        raise RunError(
            f"{several(stopped, 'run')} stopped, and nobody here asked for it: their workers heard"
            " nothing of this command (suspended, or cut off?); ask again, and they go on"
        )
    return outcomes


@contextmanager
def _workplace(
    options: TrainOptions,
) -> Iterator[tuple[Callable[[], AbstractContextManager[Control]], Elsewhere | None]]:
    """What makes the control, and what does the tasks where that is not this machine's workers."""
    if options.cluster is None:
        yield in_memory, None
        return
    root = options.results.resolve()
    with connected(options.cluster, options.cluster_tls) as client:
        found = check_workers(client, root)
        for words in (f"{options.cluster}: {found.words}", *found.notes):
            console.note(words)
        if found.share:
            yield partial(shared_control, root), shared.on(client)
        else:
            yield in_memory, apart.on(client)


def _report(asked: Plan, options: TrainOptions, outcomes: Sequence[Outcome]) -> int:
    """The numbers of this plan's runs, whoever trained them, under this plan's names.

    Returns the exit code: 3 if some of them failed or diverged, the code of the worst that could
    not be evaluated, or 0.
    """
    looked_up = survey(wanted_of(asked), options.results)
    done = [record for record in looked_up.records.values() if record.status == "done"]
    lost = {outcome.run_id for outcome in outcomes if outcome.status != "done"}
    with ExitStack() as keep:
        complete, exit_code = evaluated(
            [record for record in done if record.run_id not in lost],
            asked.channels,
            asked.evaluation_episodes,
            device=options.device,
            workers=options.workers,
            keep=keep,
        )
        current = dict(looked_up.records) | {record.run_id: record for record in complete}
        # Who could not be evaluated has been named; a table that counts its seed would be wrong.
        left_out = {record.run_id for record in done} - {record.run_id for record in complete}
        shown = {run_id: each for run_id, each in current.items() if run_id not in left_out}
        records = _as_asked(asked, shown)
        if records or options.json:
            report(
                records,
                options.results,
                episodes=asked.evaluation_episodes,
                question=asked.definition,
                claims=asked.claims,
                channels=asked.channels,
                figures=figures_folder(options.results, _figures_of(asked, options)),
                as_json=options.json,
                about={
                    "definition": asked.definition.name,
                    "profile": asked.profile,
                    "runs": [
                        outcome_json(run, looked_up.records.get(run.run_id))
                        for run in looked_up.runs
                    ],
                },
            )
    words = {looked_up.status(run) for run in asked.runs}
    return max(exit_code, 3 if words & {"failed", "diverged"} else 0)


def _as_asked(asked: Plan, records: Mapping[str, RunRecord]) -> list[RunRecord]:
    """Those of the plan's runs that are among the records, by its names."""
    return [as_planned(records[run.run_id], run) for run in asked.runs if run.run_id in records]


def as_planned(record: RunRecord, planned: PlannedRun) -> RunRecord:
    """A run that another question may have trained first, by the names of this one."""
    names = {
        "variant": planned.variant,
        "label": planned.label,
        "overrides": list(planned.overrides),
        "definition": planned.definition,
        "profile": planned.profile,
    }
    return RunRecord(record.path, record.run | names, record.derived)


def _figures_of(asked: Plan, options: TrainOptions) -> str:
    """The folder's name; what was overridden has one of its own, and writes over no other.

    So has what was evaluated otherwise, which the profile's name does not tell.
    """
    evaluated = [each for each in options.readings if all_readings()[each].evaluation_epsilon]
    name = "-".join((asked.definition.name, asked.profile, *sorted(evaluated)))
    if not options.overrides:
        return name
    return f"{name}-{short_hash({'overrides': list(options.overrides)})}"
