"""One greedy episode of a trained policy, step by step, to be looked at."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple

from torch import Tensor

from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.errors import RecordError
from msgdrop_envs import autoreset, registry
from msgdrop_envs.drawing import Disc


class Link(NamedTuple):
    """Two agents of whom one at least listens to the other."""

    first: int
    second: int
    works: bool
    """Whether all that is said over it arrives."""


class Frame(NamedTuple):
    """What there was before one step."""

    discs: list[Disc]
    """The agents first."""
    links: list[Link]
    lost: int
    """Messages that did not arrive in it."""


class Episode(NamedTuple):
    """An episode from its first step to its last."""

    title: str
    agents: tuple[str, ...]
    frames: list[Frame]
    outcome: str
    """What came of it: steps, return and counts."""


def play_episode(run_path: Path, *, channel: Channel, seed: int | None = None) -> Episode:
    """Play the first evaluation episode of a run, or that of another seed, through a channel.

    The same policy, seed and channel give the same episode. Raises RecordError if the policy cannot
    be read or its game cannot be drawn, DefinitionError for a channel that does not exist.
    """
    spec, _, learner = read_trained(run_path)
    view = registry.view(spec.environment_config)
    if view is None or not hasattr(view, "scene"):
        problem = f"{spec.environment} cannot be drawn: it has no view.py with a scene"
        raise RecordError(f"{run_path}: {problem}")
    listens = learner_class(spec.algorithm).listens
    heard = [row[1:] if listens else [] for row in learner.shown_agents.tolist()]
    frames = list[Frame]()

    def watch(games: autoreset.Games, keep: Tensor | None) -> None:
        frames.append(Frame(view.scene(_alone(games.state)), *_links(heard, keep)))

    [row] = evaluate(run_path, channel=channel, episodes=1, seed=seed, watch=watch)
    counts = {name: value for name, value in row.items() if name not in {*channel.entry, "episode"}}
    outcome = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in counts.items())
    title = f"{spec.environment}, {run_path.resolve().name}, {channel.label}"
    return Episode(title, view.agent_names, frames, outcome)


def _links(heard: list[list[int]], keep: Tensor | None) -> tuple[list[Link], int]:
    """The links of the first game, and how many messages are lost; keep [1, 1, N, S]."""
    works: dict[tuple[int, int], bool] = {}
    lost = 0
    for i, senders in enumerate(heard):
        for j in senders:
            arrives = keep is None or bool(keep[0, 0, i, j - (j > i)] > 0)
            pair = (min(i, j), max(i, j))
            works[pair] = works.get(pair, True) and arrives
            lost += not arrives
    return [Link(*pair, each) for pair, each in works.items()], lost


def _alone(state: Any) -> Any:
    """The first game of a batch [1, 1], as views draw it."""
    return replace(state, **{each.name: getattr(state, each.name)[0, 0] for each in fields(state)})
