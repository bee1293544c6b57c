"""Centralised training, decentralised execution: DDPG, MADDPG, MADDPG-MD (l. 89-100, 267-279).

One learner for all of them; actors see their own observation only. What tells them apart are
values of the Config:

* MADDPG is MADDPG-MD at rate 0: the critic is h(f(o, a), g(the others)) (l. 404-407);
* MADDPG-MD drops the observation of each other agent from the critic's input with probability
  `rate`, in x and x' alike (l. 274); nothing is scaled, since the critic is never executed;
* vanilla MADDPG feeds everything to one perceptron (network "concat");
* DDPG's critic sees its own observation and action only (network "own").

Letters: `R` runs, `E` games, `N` agents, `G` networks (R if shared by the agents, else R*N), `B`
batch, `rows` N*B if shared, else B; `S` senders, `O` observation, `A` numbers of an action.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import torch
from torch import Tensor

from msgdrop_cli.algorithms import cohort
from msgdrop_cli.algorithms.hearing import Encoding
from msgdrop_cli.algorithms.soft_target import SoftTarget
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.kernels.maddpg import NAME, MADDPGKernel, serves
from msgdrop_cli.messages.encoders import OBSERVATION
from msgdrop_cli.messages.received import Heard
from msgdrop_cli.messages.topologies.all import senders as all_others
from msgdrop_cli.networks.critic import Critic, critic_of
from msgdrop_cli.networks.perceptron import Perceptron
from msgdrop_cli.networks.stacked import Stacked, parameter_count
from msgdrop_cli.ops.exploration import noisy_action, random_action
from msgdrop_cli.ops.message_dropout import apply_keep, keep_mask
from msgdrop_cli.ops.minibatch import Batch, Minibatch
from msgdrop_cli.ops.td import td_loss
from msgdrop_envs.protocol import Environment


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The learner's settings; the defaults are the paper's for waterworld."""

    rate: float = 0.2
    """Probability of dropping another agent's observation in training (paper l. 274)."""
    network: Literal["fgh", "concat", "own"] = "fgh"
    """The critic: h(f, g) (l. 404), one perceptron on everything, or on the own only."""
    masks_actions: bool = False
    """Drop the action of an agent with its observation (ours: no; l. 274 masks observations)."""
    shares_parameters: bool = True
    """All agents share one actor and one critic (l. 772)."""
    actor_units: int = 64
    """The hidden layer of the actor (l. 768)."""
    f_units: tuple[int, int] = (200, 100)
    """Layers of f; also the first layers of the perceptron (l. 770)."""
    g_units: int = 100
    """The layer of g (l. 770)."""
    h_units: int = 64
    """The hidden layer of h (l. 770)."""
    gamma: float = 0.95
    """Discount (l. 772)."""
    learning_rate: float = 1e-3
    """Adam's step size, of actor and critic (l. 772)."""
    batch_size: int = 32
    """Joint transitions an update, each of which serves all agents (ours)."""
    max_gradient_norm: float = 0.5
    """Clip each network's gradient to this norm (ours, OpenAI's MADDPG); 0 does not clip."""
    tau: float = 0.01
    """How far a target network follows at each update of its own (ours, OpenAI's MADDPG)."""
    noise: float = 0.15
    """Standard deviation of the Gaussian noise on actions (l. 772)."""
    replay_capacity: int = 500_000
    """Joint transitions in the memory (l. 772), of all parallel games together."""
    replay_start_env_steps: int = 10_000
    """Env steps of random actions before the first update (ours)."""
    update_every_env_steps: int = 5
    """Env steps between two updates of the critic (l. 772)."""
    actor_update_every_env_steps: int = 10
    """Env steps between two updates of the actor (l. 772); a multiple of the critic's."""

    def __post_init__(self) -> None:
        counts = ("actor_units", "actor_update_every_env_steps")
        cohort.check_ranges(self, shares=("tau",), amounts=("noise",), counts=counts)
        if self.actor_update_every_env_steps % self.update_every_env_steps:
            raise ValueError(
                "actor_update_every_env_steps must be a multiple of update_every_env_steps, not"
                f" {self.actor_update_every_env_steps} of {self.update_every_env_steps}"
            )


NAMED: Mapping[str, Mapping[str, Any]] = {
    "ddpg": {"network": "own", "rate": 0.0},
    "vanilla-maddpg": {"network": "concat", "rate": 0.0},
    "maddpg": {"rate": 0.0},
    "maddpg-md": {},
}
"""The names that definitions and `--algorithm` use, and what each changes in the Config."""


class MADDPG:
    """The stacked actors and critics of a cohort: R runs of N agents each."""

    joint, listens = True, False

    def __init__(
        self, configs: Sequence[Config], env: Environment, device: torch.device | str = "cpu"
    ) -> None:
        self.config = config = cohort.shared_config(configs, env.agents)
        if env.action_size == 0:
            raise DefinitionError("maddpg acts by numbers; this environment has single actions")
        self._runs, self._agents, self._size = len(configs), env.agents, config.batch_size
        self.encoding = Encoding(OBSERVATION, env.observation_size, self._runs, device)
        self._networks_each = 1 if config.shares_parameters else env.agents
        self.actor, self.critic = _networks(config, env)
        settings = (config.learning_rate, config.max_gradient_norm, config.tau, device)
        networks = self._runs * self._networks_each
        self.actors = SoftTarget(self.actor.layers, networks, *settings)
        self.critics = SoftTarget(self.critic.layers, networks, *settings)
        self._senders = senders = self.critic.senders
        heard = all_others(env.agents) if senders else [[]] * env.agents
        self.shown_agents = cohort.shown_agents(heard, device)
        self.rate = torch.tensor([c.rate for c in configs], device=device)  # [R]
        counts = (parameter_count(network.layers) for network in (self.actor, self.critic))
        self.init_uniforms = self._networks_each * sum(counts)
        self.act_uniforms = 2 * env.action_size
        self.update_uniforms = env.agents * self._size * senders
        every = (config.actor_update_every_env_steps, config.update_every_env_steps)
        self._critic_updates_each = every[0] // every[1]  # for each of the actor
        self.updates, self.means = 0, cohort.RunningMeans(self._runs, device)
        self._computes = self._computed_by(env, device)

    # The rule, as the paper writes it.

    def binary_mask(self, uniforms: Tensor) -> Tensor:
        """Generate b, which drops the observation of each other agent with `rate` (l. 274).

        uniforms: [R, update_uniforms]. Returns the keep mask [R, N, B, S, 1], for x and x' alike.
        """
        shape = (self._runs, self._agents, self._size, self._senders, 1)
        return keep_mask(uniforms.view(shape), self.rate)

    def improve(
        self, minibatch: Minibatch, keep: Tensor, critic_step: int, actor_step: int | None
    ) -> tuple[Tensor, Tensor]:
        """Improve the critics, and the actors too unless their step is None.

        keep: [R, N, B, S, 1]; the steps are Adam's, from 1.
        Returns the losses and Q of the online critics before their step, [G, rows, 1].
        """
        keep = keep.transpose(1, 2)  # [R, B, N, S, 1]
        with self.critics.descent() as theta:
            batch = minibatch.copied()
            obs, next_obs = batch.obs.split(self._size, 1)  # [R, B, N, O]
            seen = self._seen(obs, batch.action, keep)  # x~, a
            y = self._target(batch, next_obs, keep)
            q = self.critic.forward(theta, *seen)  # Q_mu(x~, a; theta)
            loss = td_loss(q, y, "mse")
            loss.mean((1, 2)).sum().backward()
        if actor_step is not None:
            self._improve_actors(*seen)
        return loss.detach(), q.detach()

    def _target(self, batch: Batch, next_obs: Tensor, keep: Tensor) -> Tensor:
        """Y = r + gamma Q_mu'(x~', mu'(o'); theta-), with the mask of x~ (l. 273-274)."""
        with torch.no_grad():
            next_action = self.actions(next_obs, self.actors.target)  # mu'(o')
            next_seen = self._seen(next_obs, next_action, keep)  # x~', a'
            next_q = self.critic.forward(self.critics.target, *next_seen)
            discount = batch.discount[..., None].expand(-1, -1, self._agents)  # [R, B, N]
            reward, discount = (self._rows(x[..., None]) for x in (batch.reward, discount))
            return reward + self.config.gamma * discount * next_q  # [G, rows, 1]

    def _improve_actors(self, own: Tensor, _: Tensor, others: Tensor) -> None:
        """Follow the policy gradient at a = mu(o), the others' actions as replayed (l. 277)."""
        with self.actors.descent() as theta_mu:
            action = self.actor.forward(theta_mu, own).tanh()
            q_mu = self.critic.forward(self.critics.online, own, action, others)
            (-q_mu.mean((1, 2)).sum()).backward()

    def actions(self, obs: Tensor, weights: Stacked | None = None) -> Tensor:
        """Every agent's mu(o), [R, B, N, A], by the online actors or others; obs [R, B, N, O]."""
        numbers = self.actor.forward(weights or self.actors.online, self._rows(obs))
        if self.config.shares_parameters:
            return numbers.view(*obs.shape[:3], -1).tanh()
        split = numbers.view(self._runs, self._agents, obs.shape[1], -1)  # [R, N, B, A]
        return split.transpose(1, 2).tanh()

    def _seen(self, obs: Tensor, action: Tensor, keep: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The critic's inputs: own o, own a and the others, [G, rows, ...].

        obs: [R, B, N, O]; action: [R, B, N, A]; keep: [R, B, N, S, 1].
        """
        action_keep = keep if self.config.masks_actions else torch.ones_like(keep)
        senders = self.shown_agents[:, 1:]
        masked = apply_keep(obs[:, :, senders], keep).flatten(3)  # [R, B, N, S*O]
        acted = apply_keep(action[:, :, senders], action_keep).flatten(3)
        others = torch.cat((masked, acted), -1)
        return self._rows(obs), self._rows(action), self._rows(others)

    def _rows(self, each: Tensor) -> Tensor:
        """Rows by network, [G, rows, U]; each [R, B, N, U]."""
        if self.config.shares_parameters:
            return each.flatten(1, 2)
        return each.transpose(1, 2).flatten(0, 1)

    # What the engine asks for.

    def _computed_by(self, env: Environment, device: torch.device | str) -> "MADDPG | MADDPGKernel":
        """Who computes `improve` and `actions`: a kernel, the same up to rounding, or this."""
        config = self.config
        if self.kernel(config, env, device) != NAME:
            return self
        halves = (self.actors.parts(), self.critics.parts())
        names = ("masks_actions", "batch_size", "learning_rate", "gamma", "tau")
        settings = {name: getattr(config, name) for name in (*names, "max_gradient_norm")}
        return MADDPGKernel(*halves, agents=self._agents, senders=self._senders, **settings)

    @classmethod
    def kernel(cls, config: Config, env: Environment, device: torch.device | str) -> str:
        """What computes it: `kernels/maddpg.c`, which knows no subclass's rule, or torch."""
        layers = tuple(network.layers for network in _networks(config, env))
        inputs = (env.observation_size, env.action_size, env.observation_dtype)
        shared = config.shares_parameters
        known = cls is MADDPG and serves(layers, *inputs, shared=shared, device=device)
        return NAME if known else cohort.TORCH

    def initialise(self, uniforms: Tensor) -> None:
        """New weights, online and target alike; uniforms [R, init_uniforms]."""
        count = self._networks_each * parameter_count(self.actor.layers)
        self.actors.initialise(uniforms[:, :count])
        self.critics.initialise(uniforms[:, count:])

    def act(
        self, obs: Tensor, uniforms: Tensor, env_steps: int | Tensor, received: Heard = None
    ) -> Tensor:
        """The actor's action with Gaussian noise (l. 772); random ones before learning begins.

        obs: [R, E, N, O]; uniforms: [R, E, N, 2*A]. Returns [R, E, N, A] float32.
        """
        if isinstance(env_steps, int) and env_steps < self.config.replay_start_env_steps:
            return random_action(uniforms)
        return noisy_action(self.act_greedily(obs), uniforms, self.config.noise)

    def act_greedily(self, obs: Tensor, received: Heard = None) -> Tensor:
        """The actor's action without noise; it hears nobody, so no channel changes anything."""
        return self._computes.actions(obs)

    def update(self, minibatch: Minibatch, uniforms: Tensor) -> None:
        """Improve the critic, and the actor if it is due, on one minibatch with one mask.

        uniforms: [R, update_uniforms]. The actor's first update comes with the critic's first.
        """
        actor_step = self.updates // self._critic_updates_each + 1
        steps = (self.updates + 1, actor_step if self.does_more(self.updates) else None)
        keep = self.binary_mask(uniforms)
        self.means.add(*self._computes.improve(minibatch, keep, *steps))
        self.updates += 1

    def does_more(self, update: int) -> bool:
        """Whether the actors improve, too, every second time (l. 772); update: from 0."""
        return update % self._critic_updates_each == 0

    def metrics(self, env_steps: int) -> list[dict[str, float | None]]:
        """Each run's means of loss and Q since the last call; None without an update."""
        return self.means.take()

    def tensors(self, run: int) -> dict[str, Tensor]:
        """Online and target weights and Adam's moments of one run, as views."""
        halves = {"actor": self.actors.parts(), "critic": self.critics.parts()}
        parts = {f"{half}.{name}": part for half in halves for name, part in halves[half].items()}
        first, last = run * self._networks_each, (run + 1) * self._networks_each
        return {**cohort.tensors_of(parts, first, last), "metric_sums": self.means.sums[:, run]}

    def policy(self, run: int) -> dict[str, Tensor]:
        """The actors' weights of one run, as views: [1 or N, inputs, outputs], [.., 1, outputs]."""
        first = run * self._networks_each
        return self.actors.online.of_networks(first, first + self._networks_each)

    @property
    def progress(self) -> tuple[int, int]:
        """Counters that a checkpoint keeps: critic updates done, updates in the running means."""
        return self.updates, self.means.updates

    def resume_at(self, *counters: int) -> None:
        """Set the counters of `progress` again."""
        self.updates, self.means.updates = counters
        self.critics.adam.resume_at(self.updates)
        self.actors.adam.resume_at(-(-self.updates // self._critic_updates_each))


def _networks(config: Config, env: Environment) -> tuple[Perceptron, Critic]:
    observation, action = env.observation_size, env.action_size
    actor = Perceptron(observation, 0, (config.actor_units,), action)
    units = (config.f_units, config.g_units, config.h_units)
    return actor, critic_of(config.network, observation, action, env.agents, *units)
