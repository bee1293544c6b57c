"""Run folders that answer shipped questions: with the ids that the questions plan."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.run_id import spec_to_dict
from msgdrop_cli.engine.offers import catalogue
from tests.fake_runs import write_run

CATCHES = {"fdc": 10, "dcc": 2, "md-0.2": 6, "md-0.5": 6}
"""With all links broken, as the paper says."""


def write_answers(
    root: Path,
    question: str = "broken-links",
    *,
    profile: str = "quick",
    readings: Sequence[str] = (),
    seeds: int = 2,
    catches: Mapping[str, int] = CATCHES,
    **changes: object,
) -> list[Path]:
    """Runs of one question; catches: of each variant, the same through every channel."""
    asked = plan(
        load_definition(question),
        profile,
        catalogue(),
        readings=readings,
        seeds=range(1, seeds + 1),
    )
    written = []
    for run in asked.runs:
        count = catches[run.variant] + run.spec.seed % 2
        named = {
            "run_id": run.run_id,
            "label": run.label,
            "definition": question,
            "environment": run.spec.environment,
            "overrides": list(run.overrides),
            "spec": spec_to_dict(run.spec),
        }
        training = run.spec.training
        rows = training.train_env_steps // training.log_every_env_steps
        record = write_run(
            root,
            run.variant,
            run.spec.seed,
            curve=[1.0 + 4 * row // rows for row in range(rows)],
            catches=dict.fromkeys((0.0, 0.5, 1.0), count),
            profile=asked.profile,
            train_env_steps=training.train_env_steps,
            **{**named, **changes},  # type: ignore[arg-type]
        )
        written.append(record.path)
    return written
