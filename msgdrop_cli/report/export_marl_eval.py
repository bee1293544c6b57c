"""marl-eval's raw data: environment, task, algorithm, run, step (Gorsane et al., NeurIPS 2022).

Its steps are evaluations; ours are the windows of training, of the exploring policy, with one value
each. Its absolute metrics are the greedy evaluation after training, all links whole: one value,
for our metrics are ratios of sums over episodes, which no mean over episodes gives.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from msgdrop_cli.analysis.summary import Arm, Summary
from msgdrop_cli.records.store import RunRecord
from msgdrop_cli.report.export_studies import Study, studies_of

Windows = dict[int, Mapping[str, Any]]


class _Run(NamedTuple):
    windows: Windows
    """The log by env step."""
    absolute: Mapping[str, float]


def marl_eval_data(summary: Summary) -> dict[str, dict[str, Any]]:
    """The nested tables, by the study's name: marl-eval wants the same numbers of runs in a file.

    In all of a study's runs are the same seeds, steps and metrics, those that all of them have.
    """
    found = {study.name: _study(study) for study in studies_of(summary)}
    return {name: table for name, table in found.items() if table}


def _study(study: Study) -> dict[str, Any]:
    seeds = sorted(set.intersection(*map(set, study.seeds.values()))) if study.seeds else []
    runs = {
        (size, name, record.seed): _Run(_windows(record), _absolute(arm, record.seed))
        for name, arms in study.algorithms.items()
        for size, arm in arms.items()
        for record in arm.done
        if record.seed in seeds
    }
    if not runs:
        return {}
    steps = sorted(set.intersection(*(set(run.windows) for run in runs.values())))
    metrics = [
        name
        for name in next(iter(runs.values())).absolute
        if all(_has(run, name, steps) for run in runs.values())
    ]
    if not steps or not metrics:
        return {}
    table: dict[str, Any] = {}
    for (size, name, seed), run in runs.items():
        algorithms = table.setdefault(size, {})
        algorithms.setdefault(name, {})[f"seed_{seed}"] = _steps(run, steps, metrics)
    return {study.game: table}


def _windows(record: RunRecord) -> Windows:
    return {int(row["env_steps"]): row for row in record.metrics()}


def _absolute(arm: Arm, seed: int) -> dict[str, float]:
    """Every metric of a run after training, with all messages."""
    rows = {metric.name: arm.row(metric.name) for metric in arm.metrics.all}
    return {name: row.by_seed[seed] for name, row in rows.items() if row and seed in row.by_seed}


def _has(run: _Run, metric: str, steps: list[int]) -> bool:
    values = [run.windows[step].get(metric) for step in steps]
    return metric in run.absolute and all(type(value) in (int, float) for value in values)


def _steps(run: _Run, steps: list[int], metrics: list[str]) -> dict[str, Any]:
    table: dict[str, Any] = {
        f"step_{rank}": {
            "step_count": step,
            **{metric: [run.windows[step][metric]] for metric in metrics},
        }
        for rank, step in enumerate(steps, start=1)
    }
    return {**table, "absolute_metrics": {metric: [run.absolute[metric]] for metric in metrics}}
