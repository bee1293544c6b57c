"""Whether a finished run is what its record says: id, place, logs and policy fit each other."""

from msgdrop_cli.commands.parts.shapes import on_no_device
from msgdrop_cli.definition.run_id import run_id
from msgdrop_cli.definition.spec import RunSpec
from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.packed import log_bytes, log_file
from msgdrop_cli.records.store import EPISODES, METRICS, POLICY, RUN, RunRecord


def check_record(record: RunRecord, spec: RunSpec) -> None:
    """RecordError unless the run has been trained to its end, and is the one it says it is."""
    facts = {
        f"its status is {record.status}, expected done": record.status == "done",
        "its run id is not the one of its settings": run_id(spec) == record.run_id,
        "environment or seed are not those of its settings": (
            (spec.environment, spec.seed) == (record.environment, record.seed)
        ),
        "it has not been trained to its end": (spec.training.train_env_steps <= record.env_steps),
        "it stands in another run's place": (
            record.path.parent.name == record.environment
            and record.path.name.endswith(f"-s{record.seed}-{record.run_id}")
        ),
    }
    for problem, is_fine in facts.items():
        if not is_fine:
            raise RecordError(f"{record.path / RUN}: {problem}")


def check_windows(record: RunRecord) -> None:
    """RecordError unless the log of the training is whole, and curves can be drawn of it.

    One log that cannot be read would cost those of all runs.
    """
    from msgdrop_cli.analysis.curves import windows_of
    from msgdrop_cli.analysis.metrics import UNKNOWN, metrics_of

    metrics = metrics_of(record)
    if metrics is UNKNOWN:
        raise RecordError(f"{record.path / RUN}: metrics are missing")
    _check_end(record, METRICS)
    for metric in metrics.all:
        windows_of(record, metric.name)


def check_episodes(record: RunRecord) -> None:
    """RecordError unless every evaluation is whole, and tables can be made of it."""
    from msgdrop_cli.analysis.summary import summarise

    _check_end(record, EPISODES)
    played = [[row["episode"] for row in rows] for rows in record.episodes().values()]
    if not played or any(sorted(each) != [*range(len(each))] for each in played):
        file = log_file(record.path / EPISODES)
        raise RecordError(f"{file}: is empty, or an episode is missing or doubled")
    summarise([record])


def check_policy(record: RunRecord, spec: RunSpec) -> None:
    """RecordError unless its tensors have the run's names and shapes, and are numbers."""
    from msgdrop_cli.algorithms.discovery import learner_class
    from msgdrop_cli.engine.tensors import check_finite, copy_into, read_tensors
    from msgdrop_envs import registry

    file = record.path / POLICY
    with on_no_device("its settings"):
        env = registry.make(spec.environment_config, "meta")
        policy = learner_class(spec.algorithm)([spec.algorithm_config], env, "meta").policy(0)
    weights = read_tensors(file, policy)
    copy_into(policy, weights, file)
    check_finite(weights, file)


def _check_end(record: RunRecord, log: str) -> None:
    """A reader leaves out a torn line; a finished run has none."""
    if not (log_bytes(record.path / log) or b"\n").endswith(b"\n"):
        raise RecordError(f"{log_file(record.path / log)}: its last line is torn")
