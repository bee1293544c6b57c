"""What policies that learn nothing get in a game: the lines that a learner has to cross."""

from typing import Any

from torch import Tensor

from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.engine import arithmetic
from msgdrop_cli.engine.facts import commit
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.playing import play_episodes
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs import autoreset, registry
from msgdrop_envs.protocol import Baseline, Environment

EPISODES = 200
"""Of each policy; they start as the evaluation of a run with this seed does."""
SEED = 1
_LONGEST_GAME = 5_000
"""Steps; ten times the paper's."""
_LARGEST_GAME, _LARGEST_STEP = 2**26, 2**32
"""Bytes of a game's tables, and of a step if all that is seen met all that is drawn: the paper's
largest games take 43 kB and 220 MB."""


def play_references(spec: dict[str, Any], where: str) -> dict[str, Any]:
    """Play every reference policy of the game of a run's spec.

    Returns what `records.references` keeps: episodes, seed, commit and, by the policies' names,
    their meaning and the environment's metrics. Raises DefinitionError, naming `where`, for a
    spec that cannot be read, or a game that would fill the memory or take for ever, or is other
    people's and was not asked for.
    """
    config = spec_from_dict(spec, catalogue(), where).environment_config
    if not _is_playable(config):
        raise DefinitionError(f"{where}: spec.environment: the game is too large to be played here")
    env = registry.make(config)
    try:
        policies = {
            name: {"meaning": baseline.meaning, "metrics": _play(env, baseline)}
            for name, baseline in registry.baselines(env).items()
        }
    except registry.GameError as error:
        raise DefinitionError(f"{where}: {error}") from error
    return {"episodes": EPISODES, "seed": SEED, "commit": commit(), "policies": policies}


def _is_playable(config: Any) -> bool:
    """Whether a game, which may be of somebody else's record, has sizes that a machine can play."""
    try:
        env = registry.make(config, "meta")  # has shapes and takes no memory
    except (ArithmeticError, RuntimeError, TypeError, ValueError):  # beyond 64 bits
        return False
    tables = sum(part.nbytes for part in vars(env).values() if isinstance(part, Tensor))
    drawn = env.reset_uniforms + env.step_uniforms
    a_step = 4 * EPISODES * env.agents * env.observation_size * drawn
    return env.time_limit <= _LONGEST_GAME and tables <= _LARGEST_GAME and a_step <= _LARGEST_STEP


@arithmetic.settled()
def _play(env: Environment, baseline: Baseline) -> dict[str, float | None]:
    streams = Streams([SEED])
    shape = (EPISODES, env.agents, max(1, env.action_size))

    def act(games: autoreset.Games, playing: Tensor) -> Tensor:
        return baseline.act(games.state, streams.uniforms("explore", *shape)[:, playing])

    table = play_episodes(env, act, streams, EPISODES)
    assert table is not None  # nobody stops it
    names = ("steps", "finished", "return", *env.counts)
    sums = dict(zip(names, table.sum(0).tolist(), strict=True)) | {"episodes": float(EPISODES)}
    return {name: metric.ratio(sums) for name, metric in env.metrics.items()}
