"""What rliable takes: an array of runs x games an algorithm (Agarwal et al., NeurIPS 2021)."""

from collections.abc import Sequence
from typing import Any

from msgdrop_cli.analysis.summary import Summary
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.report.export_studies import Study, studies_of


def rliable_data(summary: Summary) -> list[dict[str, Any]]:
    """One table a study and channel; its `scores` are `{algorithm: [[score, game by game], ...]}`.

    `numpy.array` makes rliable's `score_dict` of them. Scores are the headline after training, as
    they are: neither normalised nor turned, so higher_is_better has to be looked at.
    """
    return [
        table
        for study in studies_of(summary)
        for channel in _channels(study)
        if (table := _table(study, channel))["scores"]
    ]


def _channels(study: Study) -> Sequence[Channel]:
    arms = [arm for sizes in study.algorithms.values() for arm in sizes.values()]
    return sorted({row.channel for arm in arms for row in arm.rows})


def _table(study: Study, channel: Channel) -> dict[str, Any]:
    scores: dict[str, list[list[float]]] = {}
    seeds: dict[str, list[int]] = {}
    for name, arms in study.algorithms.items():
        rows = [arms[size].row(study.metric, channel) for size in study.sizes]
        found = [row.by_seed for row in rows if row]
        there = [s for s in study.seeds[name] if all(s in values for values in found)]
        if there and len(found) == len(rows):
            scores[name] = [[values[seed] for values in found] for seed in there]
            seeds[name] = there
    return {
        "game": study.game,
        "profile": study.profile,
        "train_env_steps": study.train_env_steps,
        "channel": channel.key,
        "metric": study.metric,
        "higher_is_better": study.higher_is_better,
        "games": list(study.sizes),
        "seeds": seeds,
        "scores": scores,
        "left_out": list(study.left_out),
    }
