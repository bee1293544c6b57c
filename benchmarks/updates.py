"""What the updates of a training must cost, and what they take."""

import time

from benchmarks import engine
from benchmarks.counting import Cost, Shares, Sizes, maddpg_update, q_update
from benchmarks.plain.stopwatch import PARTS
from msgdrop_cli.algorithms.dcc import DCC
from msgdrop_cli.algorithms.maddpg import MADDPG
from msgdrop_cli.engine.training import Training
from msgdrop_cli.networks.stacked import parameter_count

CASES = {
    "pursuit-n6": "dcc-md",
    "pursuit-n8": "dcc-md",
    "navigation-n8": "dcc-md",
    "waterworld-n8": "maddpg-md",
}
"""Environment: the learner that is measured."""


def shares(training: Training) -> Shares:
    """What of the first layers' inputs is not 0 in the replay and under the mask."""
    obs = training.replay.obs[0, : len(training.replay)]
    return Shares((obs != 0).float().mean().item(), 1.0 - learner(training).config.rate)


def update_cost(training: Training, left: Shares) -> Cost:
    """What one update of this training must cost."""
    one, env = learner(training), training.env
    sizes = Sizes(
        env.agents,
        one.config.batch_size,
        env.observation_size,
        env.observation_dtype.itemsize,
        env.action_size,
    )
    if isinstance(one, DCC):
        return q_update(one.network.layers, sizes, one.network.senders, left)
    each = one.config.update_every_env_steps / one.config.actor_update_every_env_steps
    return maddpg_update(one.actor.layers, one.critic.layers, sizes, left, each)


def parameters(training: Training) -> int:
    """What Adam moves."""
    one = learner(training)
    if isinstance(one, DCC):
        return training.env.agents * parameter_count(one.network.layers)
    return parameter_count(one.actor.layers) + parameter_count(one.critic.layers)


def learner(training: Training) -> DCC | MADDPG:
    """One whose products are counted here."""
    found = training.learner
    assert isinstance(found, DCC | MADDPG)
    return found


def update_ms(training: Training, seconds: float) -> dict[str, float]:
    """The parts in ms of this process per update, measured for so long."""
    row = engine.measure(training, seconds, clock=time.process_time)
    each: int = training.learner.config.update_every_env_steps
    return {part: row[part] * each for part in PARTS}


def learning_ms(ms: dict[str, float]) -> float:
    """An update with its minibatch."""
    return ms["sample"] + ms["update"]
