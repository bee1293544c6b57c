"""Episodes of a trained policy, apart from training, through a channel; greedy, if not asked else.

Every episode is played once by a game of its own and counted whole: nothing favours the short
ones. Games, starts and the channel's numbers come from evaluation streams of the run's seed, so
variants with the same seed meet the same episodes, and evaluating more cannot change training.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from torch import Tensor

from msgdrop_cli.algorithms.learner import Learner
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.spec import MOST_LOG_ROWS
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.delivery import Delivery
from msgdrop_cli.engine.playing import play_episodes
from msgdrop_cli.engine.policy import read_trained
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.scene import kind_in
from msgdrop_cli.engine.worst_links import worst_links
from msgdrop_cli.errors import RecordError
from msgdrop_cli.messages.received import Heard
from msgdrop_cli.ops.exploration import explored
from msgdrop_cli.records.files import jsonl_bytes, run_lock
from msgdrop_cli.records.own_sums import write_listed
from msgdrop_cli.records.store import EPISODES, list_runs
from msgdrop_envs import autoreset
from msgdrop_envs.protocol import Environment

BLOCK = 1_000
"""Episodes that are drawn together (paper l. 419): more of them leave those before as they are."""
_Act = Callable[[autoreset.Games, Tensor], Tensor]
_Watch = Callable[[autoreset.Games, Heard], Heard]
_APART = 2**40
"""Numbers of each stream that a block may take; none takes a thousandth."""


@arithmetic.settled()
def evaluate(
    run_path: Path,
    *,
    channel: Channel,
    episodes: int,
    first: int = 0,
    device: str = "cpu",
    stop: Callable[[], bool] = lambda: False,
    seed: int | None = None,
    scored: Callable[[Tensor], None] = lambda table: None,
    watch: _Watch = lambda games, heard: heard,
) -> list[dict[str, Any]]:
    """Play `episodes` episodes whose messages go through `channel`, at its epsilon (0: greedy).

    Returns a row an episode: the channel's entry, episode, steps, finished (it ended by itself),
    return (summed over agents and steps), and the environment's counts. first: the number to begin
    with, a multiple of BLOCK; those before it were played earlier. `stop` is asked twice a second;
    if it says so, there are no rows. seed: of other episodes than the run's own. Before each step
    `scored` is shown what there is so far, as `play_episodes` says, and `watch` the games and what
    arrives; it returns what the agents hear of it.
    Raises RecordError if the policy cannot be read or does not fit, DefinitionError for a channel
    that does not exist, or not in this game.
    """
    spec, env, learner = read_trained(run_path, device)
    lost = None
    if found := kind_in(channel, env, f"channel {channel.key}").links_to_find:
        lost = worst_links(learner.act_greedily, env, spec.seed, found, device)
    rows: list[dict[str, Any]] = []
    for start in range(first, episodes, BLOCK):
        count = min(BLOCK, episodes - start)
        seeds = [spec.seed if seed is None else seed]
        streams = Streams(seeds, device, first=start // BLOCK * _APART)
        delivery = None
        if replace(channel, epsilon=0.0) != NONE_BROKEN:
            delivery = Delivery(channel, env, streams, count, lost)
        act = _acting(learner, delivery, watch)
        if channel.epsilon:
            act = _exploring(act, channel.epsilon, streams, count, env)
        table = play_episodes(env, act, streams, count, stop, scored)
        if table is None:
            return []
        rows += [_row(env, channel, n, values) for n, values in enumerate(table.tolist(), start)]
    return rows


def _acting(learner: Learner, delivery: Delivery | None, watch: _Watch) -> _Act:
    """What the agents do at each step, hearing what the delivery brings; None: everything."""

    def act(games: autoreset.Games, playing: Tensor) -> Tensor:
        heard: Heard = None
        if delivery is not None:
            message = learner.encoding.message(games.obs)
            heard = delivery(games, playing, games.obs if message is None else message)
        return learner.act_greedily(games.obs, watch(games, heard))

    return act


def _exploring(act: _Act, epsilon: float, streams: Streams, games: int, env: Environment) -> _Act:
    """The same, but with this probability any action."""

    def explore(now: autoreset.Games, playing: Tensor) -> Tensor:
        uniforms = streams.uniforms("epsilon", games, env.agents, 2)[:, playing]
        return explored(act(now, playing), env.actions, uniforms, epsilon)

    return explore


def evaluate_run(
    run_path: Path,
    *,
    channel: Channel,
    episodes: int,
    device: str = "cpu",
    stop: Callable[[], bool] = lambda: False,
) -> int:
    """Evaluate, and put the rows into the run's `episodes.jsonl` in one atomic step.

    Does nothing if the run has that many already; whole blocks of it stay, a part of one is played
    again, since a block is drawn as a whole. For the same reason a channel is played as often as
    any other of the run, if that is more: episode by episode they then meet the same games. Returns
    the number of episodes played, 0 if `stop` said so. Raises RecordError, (75) if another process
    trains or evaluates the run, or began to meanwhile: one of them would lose its rows.
    """
    if list_runs(run_path)[0].has_episodes([channel], episodes):
        return 0
    with run_lock(run_path) as epoch:
        record = list_runs(run_path)[0]  # again: somebody may have played them meanwhile
        if record.has_episodes([channel], episodes):
            return 0
        played = record.episodes()
        others = sum(len(each) for known, each in played.items() if known != channel)
        episodes = max(episodes, *map(len, played.values()), 0)
        if others + episodes > MOST_LOG_ROWS:
            problem = f"has {others:,} episodes of other channels; no more than"
            raise RecordError(
                f"{run_path / EPISODES}: {problem} {MOST_LOG_ROWS:,} are kept of a run"
            )
        kept = sorted(played.get(channel, ()), key=lambda row: row["episode"])
        del kept[len(kept) // BLOCK * BLOCK :]
        rows = evaluate(
            run_path,
            channel=channel,
            episodes=episodes,
            first=len(kept),
            device=device,
            stop=stop,
        )
        if not rows:
            return 0
        played[channel] = [*kept, *rows]
        for each in played.values():
            each.sort(key=lambda row: row["episode"])
        content = jsonl_bytes(chain(*(played[each] for each in sorted(played))))
        epoch.check()
        write_listed(run_path / EPISODES, content)
        return len(rows)


def _row(env: Environment, channel: Channel, episode: int, values: list[float]) -> dict[str, Any]:
    steps, finished, total, *counts = values
    return {
        **channel.entry,
        "episode": episode,
        "steps": int(steps),
        "finished": bool(finished),
        "return": round(total, 4),
        **{name: int(count) for name, count in zip(env.counts, counts, strict=True)},
    }
