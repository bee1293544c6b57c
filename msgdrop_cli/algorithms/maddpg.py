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

from msgdrop_cli.algorithms.cohort import check_ranges, shared_config, shown_agents
from msgdrop_cli.algorithms.soft_target import SoftTarget
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.kernels.maddpg import NAME, MADDPGKernel, serves
from msgdrop_cli.networks.critic import Critic, critic_of
from msgdrop_cli.networks.perceptron import Perceptron
from msgdrop_cli.networks.shared_others import Blocks, SharedOthers
from msgdrop_cli.networks.stacked import Stacked, parameter_count
from msgdrop_cli.ops.exploration import noisy_action, random_action
from msgdrop_cli.ops.message_dropout import apply_keep, keep_mask
from msgdrop_cli.ops.minibatch import Batch, Minibatch
from msgdrop_cli.ops.td import loss_gradient
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
    """Joint transitions in the memory (l. 772)."""
    replay_start_env_steps: int = 10_000
    """Env steps of random actions before the first update (ours)."""
    update_every_env_steps: int = 5
    """Env steps between two updates of the critic (l. 772)."""
    actor_update_every_env_steps: int = 10
    """Env steps between two updates of the actor (l. 772); a multiple of the critic's."""

    def __post_init__(self) -> None:
        counts = ("actor_units", "actor_update_every_env_steps")
        check_ranges(self, shares=("tau",), amounts=("noise",), counts=counts)
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

PAPER: Mapping[str, Mapping[str, Any]] = {"waterworld-n8": {}, "waterworld-n10": {}}
"""What the supplement changes for each environment: nothing."""

TRAINING: Mapping[str, Mapping[str, Any]] = {name: {"train_env_steps": 2_000_000} for name in PAPER}
"""How long the paper's runs are (ours: not in the paper)."""


class MADDPG:
    """The stacked actors and critics of a cohort: R runs of N agents each."""

    joint, listens = True, False

    def __init__(
        self, configs: Sequence[Config], env: Environment, device: torch.device | str = "cpu"
    ) -> None:
        self.config = config = shared_config(configs, env.agents)
        if env.action_size == 0:
            raise DefinitionError("maddpg acts by numbers; this environment has single actions")
        self._runs, self._agents, self._size = len(configs), env.agents, config.batch_size
        self._networks_each = 1 if config.shares_parameters else env.agents
        self._networks = self._runs * self._networks_each
        self.actor, self.critic = _networks(config, env)
        settings = (config.learning_rate, config.max_gradient_norm, config.tau)
        self.actors = SoftTarget(self.actor.layers, self._networks, *settings, device)
        self.critics = SoftTarget(self.critic.layers, self._networks, *settings, device)
        self.updates = 0

        self._senders = senders = self.critic.hears
        compiled = self.kernel(config, env, device) == NAME
        self._kernel = self._compiled() if compiled else None
        self.shown_agents = shown_agents(env.agents, senders, device)
        self.rate = torch.tensor([c.rate for c in configs], device=device)  # [R]
        self.init_uniforms = self._networks_each * sum(
            parameter_count(network.layers) for network in (self.actor, self.critic)
        )
        self.act_uniforms = 2 * env.action_size
        self.update_uniforms = env.agents * self._size * senders
        self._sums = torch.zeros(2, self._runs, device=device)
        self._summed = 0

    @classmethod
    def kernel(cls, config: Config, env: Environment, device: torch.device | str) -> str:
        """`kernels/maddpg.c`, which knows no subclass's rule, or torch."""
        actor, critic = _networks(config, env)
        if cls is MADDPG and serves(
            actor.layers,
            critic.layers,
            observation=env.observation_size,
            action=env.action_size,
            dtype=env.observation_dtype,
            shared=config.shares_parameters,
            device=device,
        ):
            return NAME
        return "torch"

    def _compiled(self) -> MADDPGKernel:
        config = self.config
        return MADDPGKernel(
            self.actors.parts(),
            self.critics.parts(),
            agents=self._agents,
            senders=self._senders,
            masks_actions=config.masks_actions,
            batch_size=config.batch_size,
            learning_rate=config.learning_rate,
            gamma=config.gamma,
            tau=config.tau,
            max_gradient_norm=config.max_gradient_norm,
        )

    def initialise(self, uniforms: Tensor) -> None:
        """New weights, online and target alike; uniforms [R, init_uniforms]."""
        count = self._networks_each * parameter_count(self.actor.layers)
        self.actors.initialise(uniforms[:, :count])
        self.critics.initialise(uniforms[:, count:])

    def act(self, obs: Tensor, uniforms: Tensor, env_steps: int | Tensor) -> Tensor:
        """The actor's action with Gaussian noise (l. 772); random ones before learning begins.

        obs: [R, E, N, O]; uniforms: [R, E, N, 2*A]. Returns [R, E, N, A] float32.
        """
        if isinstance(env_steps, int) and env_steps < self.config.replay_start_env_steps:
            return random_action(uniforms)
        return noisy_action(self.act_greedily(obs), uniforms, self.config.noise)

    def act_greedily(self, obs: Tensor, keep: Tensor | None = None) -> Tensor:
        """The actor's action without noise, [R, E, N, A]; obs [R, E, N, O].

        An actor hears nobody, so broken links (keep) mean nothing to it.
        """
        if self._kernel is not None:
            return self._kernel.actions(obs)
        return self._mu(self.actors.online, obs)

    def update(self, minibatch: Minibatch, uniforms: Tensor) -> None:
        """Improve the critic, and the actor if it is due, on one minibatch with one mask.

        uniforms: [R, update_uniforms], for the binary mask. The actor's first update comes with
        the critic's first.
        """
        shape = (self._runs, self._agents, self._size, self._senders, 1)
        keep = keep_mask(uniforms.view(shape), self.rate)  # for x and x' (l. 274)
        due, each = self.does_more(self.updates), self._critic_updates_each
        if self._kernel is not None:  # the same up to rounding
            steps = (self.updates + 1, self.updates // each + 1 if due else None)
            loss, q = self._kernel.update(minibatch, keep, *steps)
        else:
            loss, q = self._improve(minibatch.copied(), keep.transpose(1, 2), due)
        self.updates += 1
        self._sums += torch.stack((loss, q)).view(2, self._runs, -1).mean(2)
        self._summed += 1

    def does_more(self, update: int) -> bool:
        """Whether the actor improves, too."""
        return update % self._critic_updates_each == 0

    def metrics(self, env_steps: int) -> list[dict[str, float | None]]:
        """Each run's means of loss and Q since the last call; None without an update."""
        learnt = self._summed > 0
        means = (self._sums / max(self._summed, 1)).T.tolist()
        self._sums.zero_()
        self._summed = 0
        return [{"loss": loss if learnt else None, "q": q if learnt else None} for loss, q in means]

    def tensors(self, run: int) -> dict[str, Tensor]:
        """Online and target weights and Adam's moments of one run, as views."""
        first, last = run * self._networks_each, (run + 1) * self._networks_each
        found = {
            f"{half}.{part}.{name}": view
            for half, networks in (("actor", self.actors), ("critic", self.critics))
            for part, stacked in networks.parts().items()
            for name, view in stacked.of_networks(first, last).items()
        }
        found["metric_sums"] = self._sums[:, run]
        return found

    def policy(self, run: int) -> dict[str, Tensor]:
        """The actors' weights of one run, as views: [1 or N, inputs, outputs], [.., 1, outputs]."""
        first = run * self._networks_each
        return self.actors.online.of_networks(first, first + self._networks_each)

    @property
    def progress(self) -> tuple[int, int]:
        """Counters that a checkpoint keeps: critic updates done, updates in the running means."""
        return self.updates, self._summed

    def resume_at(self, *counters: int) -> None:
        """Set the counters of `progress` again."""
        self.updates, self._summed = counters
        self.critics.adam.resume_at(self.updates)
        self.actors.adam.resume_at(-(-self.updates // self._critic_updates_each))

    @property
    def _critic_updates_each(self) -> int:
        """Updates of the critic for each of the actor."""
        return self.config.actor_update_every_env_steps // self.config.update_every_env_steps

    def _improve(self, batch: Batch, keep: Tensor, actor_too: bool) -> tuple[Tensor, Tensor]:
        """The critic's losses and Q before its step, [G, rows, 1]; keep [R, B, N, S, 1]."""
        obs, next_obs = batch.obs.split(self._size, 1)  # [R, B, N, O]
        own, action, others = self._seen(obs, batch.action, keep)
        next_action = self._mu(self.actors.target, next_obs)
        next_q, _ = self.critic.forward(
            self.critics.target, *self._seen(next_obs, next_action, keep)
        )
        reward = self._rows(batch.reward[..., None])  # [G, rows, 1]
        discount = batch.discount[..., None].expand(-1, -1, self._agents)  # [R, B, N]
        target = reward + self.config.gamma * self._rows(discount[..., None]) * next_q

        q, trace = self.critic.forward(self.critics.online, own, action, others)
        loss, slope = loss_gradient(q - target, "mse")
        grad_q = slope / q.shape[1]
        self.critic.backward(self.critics.online, trace, grad_q, self.critics.adam.gradient)
        self.critics.step()
        if actor_too:
            self._improve_actor(own, others)
        return loss, q

    def _improve_actor(self, own: Tensor, others: Tensor | SharedOthers) -> None:
        """Follow the policy gradient (l. 277): own action from the actor, the rest as replayed."""
        numbers, actor_trace = self.actor.forward(self.actors.online, own)
        action = numbers.tanh()  # [G, rows, A]
        q, trace = self.critic.forward(self.critics.online, own, action, others)
        descent = torch.full_like(q, -1.0 / q.shape[1])
        grad_action = self.critic.action_gradient(self.critics.online, trace, descent)
        grad_numbers = grad_action * (1.0 - action * action)
        self.actor.backward(
            self.actors.online, actor_trace, grad_numbers, self.actors.adam.gradient
        )
        self.actors.step()

    def _mu(self, weights: Stacked, obs: Tensor) -> Tensor:
        """Every agent's action, [R, B, N, A]; obs [R, B, N, O]."""
        numbers, _ = self.actor.forward(weights, self._rows(obs))
        if self.config.shares_parameters:
            return numbers.view(*obs.shape[:3], -1).tanh()
        split = numbers.view(self._runs, self._agents, obs.shape[1], -1)  # [R, N, B, A]
        return split.transpose(1, 2).tanh()

    def _seen(
        self, obs: Tensor, action: Tensor, keep: Tensor
    ) -> tuple[Tensor, Tensor, Tensor | SharedOthers]:
        """The critic's inputs: own o, own a and the others, [G, rows, ...].

        obs: [R, B, N, O]; action: [R, B, N, A]; keep: [R, B, N, S, 1].
        """
        own, acts = self._rows(obs), self._rows(action)
        action_keep = keep if self.config.masks_actions else torch.ones_like(keep)
        if self.config.shares_parameters and self._senders:  # as below, not multiplied out
            masked = ((obs, keep), (action, action_keep))
            return own, acts, SharedOthers(*(Blocks.of(x, k[..., 0]) for x, k in masked))
        seen, acted = (x[:, :, self.shown_agents[:, 1:]] for x in (obs, action))  # [R, B, N, S, U]
        others = (apply_keep(seen, keep).flatten(3), apply_keep(acted, action_keep).flatten(3))
        return own, acts, self._rows(torch.cat(others, -1))

    def _rows(self, each: Tensor) -> Tensor:
        """Rows by network, [G, rows, U]; each [R, B, N, U]."""
        if self.config.shares_parameters:
            return each.flatten(1, 2)
        return each.transpose(1, 2).reshape(self._networks, each.shape[1], each.shape[-1])


def _networks(config: Config, env: Environment) -> tuple[Perceptron, Critic]:
    observation, action = env.observation_size, env.action_size
    actor = Perceptron(observation, 0, (config.actor_units,), action)
    units = (config.f_units, config.g_units, config.h_units)
    return actor, critic_of(config.network, observation, action, env.agents, *units)
