"""One greedy episode of a trained policy, step by step, to be looked at."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.evaluation import evaluate
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.errors import RecordError
from msgdrop_cli.messages.received import Heard, Received
from msgdrop_envs import autoreset, registry
from msgdrop_envs.drawing import Disc

Pair = tuple[int, int]
"""Two agents, the lesser number first."""
ByHand = Mapping[Pair, bool]
"""Links that somebody has broken (False) or mended (True), whatever the channel does to them."""


class Link(NamedTuple):
    """Two agents of whom one at least listens to the other."""

    first: int
    second: int
    works: bool
    """Whether all that is said over it arrives."""

    @property
    def pair(self) -> Pair:
        """The two."""
        return self.first, self.second


class Frame(NamedTuple):
    """What there was before one step."""

    discs: list[Disc]
    """The agents first."""
    links: list[Link]
    lost: int
    """Messages that did not arrive in it."""
    said: int = 0
    """Messages that should have."""
    score: tuple[tuple[str, float], ...] = ()
    """Return and counts of the episode so far, by name."""
    cells: int = 0
    """On a side of the map; 0 where it is a plane."""


class Episode(NamedTuple):
    """An episode from its first step to its last."""

    title: str
    agents: tuple[str, ...]
    frames: list[Frame]
    outcome: str
    """What came of it: steps, return and counts."""


Show = Callable[[Callable[[ByHand], Frame]], ByHand]
"""Is called before each step with what the frame would be with links broken and mended by hand, and
returns those which are."""


def play_episode(
    run_path: Path,
    *,
    channel: Channel,
    seed: int | None = None,
    show: Show = lambda frame_with: {},
) -> Episode:
    """Play the first evaluation episode of a run, or that of another seed, through a channel.

    The same policy, seed, channel and hand give the same episode. Raises RecordError if the policy
    cannot be read or its game cannot be drawn, DefinitionError for a channel that does not exist.
    """
    spec, env, learner = read_trained(run_path)
    view = registry.view(spec.environment_config)
    if view is None or not hasattr(view, "scene"):
        problem = f"{spec.environment} cannot be drawn: it has no view.py with a scene"
        raise RecordError(f"{run_path}: {problem}")
    listens = learner_class(spec.algorithm).listens
    senders = [row[1:] if listens else [] for row in learner.shown_agents.tolist()]
    names = ("return", *env.counts)
    frames, tables = list[Frame](), list[Tensor]()

    def watch(games: autoreset.Games, heard: Heard) -> Heard:
        score = tuple(zip(names, tables.pop()[0, 2:].tolist(), strict=True))
        discs, cells = view.scene(_alone(games.state)), getattr(view, "cells", 0)

        def frame_with(hand: ByHand) -> Frame:
            links, lost = _links(senders, _keep(by_hand(heard, hand, env.agents)))
            return Frame(discs, links, lost, sum(map(len, senders)), score, cells)

        hand = show(frame_with)
        frames.append(frame_with(hand))
        return by_hand(heard, hand, env.agents)

    [row] = evaluate(
        run_path, channel=channel, episodes=1, seed=seed, scored=tables.append, watch=watch
    )
    counts = {name: value for name, value in row.items() if name not in {*channel.entry, "episode"}}
    outcome = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in counts.items())
    title = f"{spec.environment}, {run_path.resolve().name}, {channel.label}"
    return Episode(title, view.agent_names, frames, outcome)


def by_hand(heard: Heard, hand: ByHand, agents: int) -> Heard:
    """What agents hear where links are broken and mended.

    Over a mended link arrives what is said in this step; where the channel alters or delays
    messages there is none of this step, so nothing is mended.
    """
    if not hand:
        return heard
    if heard is None:
        heard = Received(torch.ones(1, 1, agents, agents - 1))
    keep = heard.keep.clone()
    for pair, works in hand.items():
        if works and heard.messages is not None:
            continue
        for i, j in (pair, pair[::-1]):
            keep[..., i, j - (j > i)] = float(works)
    return heard._replace(keep=keep)


def _keep(heard: Heard) -> Tensor | None:
    return None if heard is None else heard.keep


def _links(heard: list[list[int]], keep: Tensor | None) -> tuple[list[Link], int]:
    """The links of the first game, and how many messages are lost; keep [1, 1, N, S]."""
    works: dict[Pair, bool] = {}
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
