"""Time limit and restart, once for all environments; games never reset themselves."""

import dataclasses
from dataclasses import dataclass
from typing import Any, TypeVar

import torch
from torch import Tensor

from msgdrop_envs import waiting
from msgdrop_envs.protocol import Environment, Transition

StateT = TypeVar("StateT")


@dataclass(frozen=True, slots=True)
class Games:
    """Games in play: the environment's state, the steps played, and what the agents see now."""

    state: Any
    elapsed: Tensor
    """[...] int64: steps since the episode began."""
    obs: Tensor
    """[..., N, O]: of `state`, after any restart."""


def start(env: Environment, uniforms: Tensor, elapsed: Tensor) -> Games:
    """Begin games that count their time limit from `elapsed` on.

    uniforms: [..., reset_uniforms]; elapsed: [...] int64, steps. Parallel games that start at
    different `elapsed` do not all meet the time limit in the same step.
    """
    state = env.reset(uniforms)
    return Games(state, elapsed, env.observe(state))


def play(
    env: Environment, games: Games, actions: Tensor, uniforms: Tensor
) -> tuple[Games, Transition]:
    """Play one step without any restart.

    actions: [..., N] int64; uniforms: [..., step_uniforms]. A time limit ends the episode but keeps
    the discount 1, so what ended by itself is what has the discount 0. The environment's
    `final_counts` are 0 in every step that ends no episode.
    """
    state, transition = env.step(games.state, actions, uniforms)
    elapsed = games.elapsed + 1
    ended = transition.ended | (elapsed >= env.time_limit)
    final = {name: transition.info[name] * ended for name in env.final_counts}
    transition = transition._replace(ended=ended, info={**transition.info, **final})
    return Games(state, elapsed, transition.obs), transition


def step(
    env: Environment, games: Games, actions: Tensor, uniforms: Tensor, reset_uniforms: Tensor
) -> tuple[Games, Transition]:
    """Play one step; an episode that ends starts anew in the same call.

    reset_uniforms: [..., reset_uniforms], used only by the games that end; the rest as in `play`.
    The Transition holds the last observation of the old episode, the Games the first of the new.
    """
    games, transition = play(env, games, actions, uniforms)
    return restart(env, games, transition, reset_uniforms), transition


def restart(
    env: Environment, games: Games, transition: Transition, reset_uniforms: Tensor
) -> Games:
    """Start the games anew that ended in this transition; reset_uniforms [..., reset_uniforms]."""
    ended = transition.ended
    if waiting.can_ask(ended) and not ended.any():  # a shortcut, never another result
        return games
    # Chosen before they are seen: a game of other people begins only when somebody looks at it.
    state = select(ended, env.reset(reset_uniforms), games.state)
    obs = torch.where(ended[..., None, None], env.observe(state), games.obs)
    return Games(state, torch.where(ended, 0, games.elapsed), obs)


def take(games: Games, chosen: Tensor) -> Games:
    """The games [R, E, ...] for which `chosen` [E] holds: [R, chosen, ...]."""
    fields = [field.name for field in dataclasses.fields(games.state)]
    state = dataclasses.replace(
        games.state, **{name: getattr(games.state, name)[:, chosen] for name in fields}
    )
    return Games(state, games.elapsed[:, chosen], games.obs[:, chosen])


def select(choose: Tensor, yes: StateT, no: StateT) -> StateT:
    """Take whole games from `yes` where `choose` [...] holds, else from `no`; both are States."""
    picked = {}
    for field in dataclasses.fields(yes):  # type: ignore[arg-type]
        there, here = getattr(yes, field.name), getattr(no, field.name)
        shape = choose.shape + (1,) * (there.dim() - choose.dim())
        picked[field.name] = torch.where(choose.view(shape), there, here)
    return dataclasses.replace(yes, **picked)  # type: ignore[type-var]
