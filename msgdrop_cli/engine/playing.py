"""Plays whole episodes, whoever acts: what evaluation, baselines and the worst links count."""

import time
from collections.abc import Callable

import torch
from torch import Tensor

from msgdrop_cli.engine.randomness import Streams
from msgdrop_envs import autoreset
from msgdrop_envs.protocol import Environment


def play_episodes(
    env: Environment,
    act: Callable[[autoreset.Games, Tensor], Tensor],
    streams: Streams,
    episodes: int,
    stop: Callable[[], bool] = lambda: False,
    scored: Callable[[Tensor], None] = lambda table: None,
) -> Tensor | None:
    """Play whole episodes, each in a game of its own; None if `stop` said so.

    act: the games still in play [1, E, ...] and which episodes [E] they are, to actions
    [1, E, N, ...]. Returns [episodes, 3 + counts]: steps, finished, return and the environment's
    counts of each; `scored` is shown what it has so far, before each step.
    """
    looked_up = time.monotonic()
    games = autoreset.start(
        env,
        streams.uniforms("evaluate", episodes, env.reset_uniforms),
        torch.zeros(1, episodes, dtype=torch.long, device=streams.device),
    )
    table = torch.zeros(episodes, 3 + len(env.counts), device=streams.device)
    playing = torch.arange(episodes, device=streams.device)
    while len(playing):
        if time.monotonic() - looked_up > 0.5:
            looked_up = time.monotonic()
            if stop():
                return None
        scored(table)
        actions = act(games, playing)
        uniforms = streams.uniforms("evaluate", episodes, env.step_uniforms)[:, playing]
        games, transition = autoreset.play(env, games, actions, uniforms)
        ended = transition.ended[0]
        finished = (ended & (transition.discount[0] == 0)).float()
        counts = [transition.info[name][0] for name in env.counts]
        columns = [torch.ones_like(finished), finished, transition.reward[0].sum(-1), *counts]
        table[playing] += torch.stack(columns, -1)
        if ended.any():
            on = ~ended
            games, playing = autoreset.take(games, on), playing[on]
    return table
