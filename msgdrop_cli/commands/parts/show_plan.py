"""A plan as it is shown before anything is trained: in words, and for programs."""

from collections.abc import Sequence
from typing import Any

from msgdrop_cli.analysis.labels import shared_overrides, with_overrides
from msgdrop_cli.analysis.next_looks import NextLook
from msgdrop_cli.analysis.provenance import studies
from msgdrop_cli.commands.parts.auto_seeds import looks_in_words, too_few_seeds
from msgdrop_cli.commands.parts.estimate import Estimate, crowd
from msgdrop_cli.commands.parts.options import TrainOptions
from msgdrop_cli.commands.parts.survey import Survey
from msgdrop_cli.commands.parts.words import about, several, size
from msgdrop_cli.definition.channel import Channel, only_links
from msgdrop_cli.definition.plan import Plan
from msgdrop_cli.definition.readings import all_readings
from msgdrop_cli.definition.spec import PlannedRun
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.records.store import RunRecord


def plan_facts(
    asked: Plan,
    looked_up: Survey,
    cost: Estimate,
    options: TrainOptions,
    looks: Sequence[NextLook] | None = None,
) -> dict[str, str]:
    """The plan in words; the keys are the names beside them. looks: of `--seeds auto`."""
    definition = asked.definition
    shared = shared_overrides([run.overrides for run in asked.runs])  # said in a line of their own
    variants = list(
        dict.fromkeys(
            with_overrides(run.label, run.variant, (o for o in run.overrides if o not in shared))
            for run in asked.runs
        )
    )
    seeds = ", ".join(map(str, sorted({run.spec.seed for run in asked.runs})))
    if looks is not None and definition.registration:
        seeds = looks_in_words(looks, definition.registration)
    environments = list(dict.fromkeys(run.spec.environment for run in asked.runs))
    left = sum(looked_up.env_steps_left(run) for run in looked_up.pending)
    through = "links broken" if only_links(asked.channels) else "channels"
    through += f": {', '.join(channel.word for channel in asked.channels)}"
    busy = crowd() if options.cluster is None and options.device == "cpu" else None
    workers = several(min(options.workers, len(looked_up.pending)), "worker")
    facts = {
        "title": definition.title,
        "question": definition.question,
        "source": definition.source,
        "profile": f"{asked.profile}, on {', '.join(environments)}",
        **({"reading": _readings(options.readings)} if options.readings else {}),
        **({"overridden": one_line(", ".join(options.overrides))} if options.overrides else {}),
        "variants": ", ".join(variants),
        "seeds": seeds,
        **_verdicts(asked, looks),
        "runs": _runs(looked_up),
        **_published(looked_up, asked),
    }
    if looked_up.pending:
        facts |= {
            **_pretraining(looked_up.pending),
            "training": f"{left:,} env steps",
            "evaluation": f"{asked.evaluation_episodes:,} episodes a run, {through}",
            "time": f"{about(cost.seconds, *cost.seconds_range)} with {workers} ({cost.source})"
            + (f"; {busy}" if busy else ""),
            "memory": f"about {size(cost.memory_bytes)}",
            "disk": f"up to {size(cost.disk_bytes)} in {options.results}",
        }
    return facts


def _verdicts(asked: Plan, looks: Sequence[NextLook] | None) -> dict[str, str]:
    """What these seeds can decide; of `--seeds auto`, who is left out since nothing is claimed."""
    if not looks:
        undecided = too_few_seeds(asked)
        return {"verdicts": undecided} if undecided else {}
    planned = {run.variant for run in asked.runs}
    claimed = {name for each in asked.definition.claims for name in (each.better, each.worse)}
    variants = asked.definition.variants.items()
    left = [each.label for name, each in variants if name not in planned | claimed]
    return {"left out": f"{', '.join(left)}: in no claim, --seeds N trains it"} if left else {}


def _runs(looked_up: Survey) -> str:
    """`8 runs: 2 finished, 1 published, 5 new`."""
    pending, resumable = len(looked_up.pending), len(looked_up.resumable)
    runs = several(len(looked_up.runs), "run")
    diverged = sum(looked_up.status(run) == "diverged" for run in looked_up.runs)
    published = len(looked_up.published)
    states = {
        "finished": len(looked_up.runs) - pending - diverged - published,
        "published": published,
        "diverged": diverged,
        "to go on with": resumable,
        "new": pending - resumable,
    }
    told = ", ".join(f"{count} {word}" for word, count in states.items() if count)
    return f"{runs}: {told}" if told else runs


def _published(looked_up: Survey, asked: Plan) -> dict[str, str]:
    """Which studies the published runs are of, and what becomes of those that lack episodes."""
    told = []
    if looked_up.published:
        told.append(
            f"counted as they are: {studies(looked_up.published)}; to train all yourself:"
            " --results NEW-FOLDER"
        )
    through = ", ".join(channel.word for channel in asked.channels)
    asks = f"{asked.evaluation_episodes:,} episodes each through {through}"
    if count := len(looked_up.to_play):
        told.append(f"{count:,} of them with fewer than {asks}: their policies are played")
    if count := len(looked_up.short):
        told.append(
            f"{several(count, 'run')} more published with fewer than {asks}, and no policy to"
            " play: to be trained"
        )
    return {"published": "; ".join(told)} if told else {}


def _readings(names: Sequence[str]) -> str:
    """`capture-once: two evaders captured in one step pay once`, one after the other."""
    return "; ".join(f"{name}: {all_readings()[name].says}" for name in names)


def _pretraining(pending: Sequence[PlannedRun]) -> dict[str, str]:
    """What encoders learn before runs begin, where they learn."""
    configs = [run.spec.algorithm_config for run in pending]
    learning = {c.encoder: c.encoder_samples for c in configs if _says_other_things(c)}
    words = (f"{name}, once, on {count:,} observations" for name, count in learning.items())
    return {"encoder": "; ".join(words)} if learning else {}


def _says_other_things(config: Any) -> bool:
    return getattr(config, "encoder", "observation") != "observation"


def plan_json(
    asked: Plan, looked_up: Survey, cost: Estimate, looks: Sequence[NextLook] | None = None
) -> dict[str, Any]:
    """The same for programs (`--dry-run --json`)."""
    return {
        "definition": asked.definition.name,
        "profile": asked.profile,
        **({} if looks is None else {"looks": [each._asdict() for each in looks]}),
        "runs": [
            outcome_json(run, looked_up.records.get(run.run_id))
            | {"env_steps_left": looked_up.env_steps_left(run)}
            for run in looked_up.runs
        ],
        "env_steps": sum(looked_up.env_steps_left(run) for run in looked_up.pending),
        **entries(asked.channels),
        "evaluation_episodes": asked.evaluation_episodes,
        "seconds": round(cost.seconds),
        "seconds_range": [round(seconds) for seconds in cost.seconds_range],
        "seconds_source": cost.source,
        "memory_bytes": cost.memory_bytes,
        "disk_bytes": cost.disk_bytes,
    }


def entries(channels: Sequence[Channel]) -> dict[str, list[float | str]]:
    """The channels by the words that rows name them with."""
    entries: dict[str, list[float | str]] = {}
    for channel in channels:
        for name, value in channel.entry.items():
            entries.setdefault(name, []).append(value)
    return entries


def outcome_json(run: PlannedRun, record: RunRecord | None) -> dict[str, Any]:
    """A planned run, and how far it has come."""
    return {
        "run_id": run.run_id,
        "variant": run.variant,
        "environment": run.spec.environment,
        "seed": run.spec.seed,
        "overrides": list(run.overrides),
        "status": record.status if record else "planned",
        "published": bool(record and not record.is_own),
        "reason": record.reason if record else None,
        "env_steps": record.env_steps if record else 0,
        "train_env_steps": run.spec.training.train_env_steps,
        "path": str(record.path) if record else None,
    }
