"""Decentralised control with communication: FDC, simple DCC, DCC-MD and its ablations.

One double deep Q-learner for all of them (paper, algorithm 1 and the loss of l. 244): N independent
networks, each on a minibatch of its own. What tells them apart are values of the Config:

* FDC sees its own observation only (network "own"); simple DCC is rate 0 (l. 263);
* DCC-MD drops whole messages with probability `rate` (dropout "message");
* SD drops single elements of the messages (dropout "element", l. 464);
* Full MD and Full SD drop the own observation too (`drops_own`, l. 489);
* Concat feeds everything to one perceptron (network "concat", l. 515).

Letters: `R` runs, `E` games, `N` agents, `G = R*N`, `B` batch, `S` senders, `O` observation, `M`
message, `W` the wider of the two.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import torch
from torch import Tensor, cat

from msgdrop_cli.algorithms import cohort
from msgdrop_cli.algorithms.adam import Adam
from msgdrop_cli.algorithms.hearing import encoding_of, heard, said
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.kernels.dcc import NAME, DCCKernel, serves
from msgdrop_cli.messages.encoders import OBSERVATION, encoder_of
from msgdrop_cli.messages.received import Heard
from msgdrop_cli.messages.topologies import check_topology
from msgdrop_cli.networks.q_network import q_network
from msgdrop_cli.networks.stacked import Network, Stacked, initialise, parameter_count
from msgdrop_cli.ops.exploration import annealed_epsilon, epsilon_greedy
from msgdrop_cli.ops.message_dropout import InputFactors, execution_scale, inputs_of, keep_mask
from msgdrop_cli.ops.minibatch import Blocks, Minibatch, links_heard, seen_in_games
from msgdrop_cli.ops.td import double_q_target, td_loss
from msgdrop_envs.protocol import Environment


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The learner's settings; the defaults are the paper's for pursuit N=6."""

    rate: float = 0.2
    """Probability of dropping a message (or an element) in training (paper l. 173)."""
    dropout: Literal["message", "element"] = "message"
    """What is dropped as one: a whole message (l. 173) or single elements (SD, l. 464)."""
    drops_own: bool = False
    """Drop the own observation as well (Full MD, Full SD, l. 489)."""
    network: Literal["fgh", "concat", "own"] = "fgh"
    """The architecture: h(f, g) (l. 404), one perceptron on everything, or on the own only."""
    topology: str = field(default="all", metadata={"later": True})
    """Who hears whom: a file in `messages/topologies` (all: l. 149; limited pairs: l. 561)."""
    encoder: str = field(default="observation", metadata={"later": True})
    """What is said: a file in `messages/encoders` (observation: l. 289; autoencoder: l. 786)."""
    encoder_samples: int = field(default=1_000_000, metadata={"later": True})
    """Observations that an encoder learns from before the training, if it learns (l. 790)."""
    f_units: tuple[int, int] = (64, 48)
    """Layers of f; also the first layers of FDC and Concat (l. 745, 750)."""
    g_units: int = 96
    """The layer of g (l. 746; 128 for N=8, l. 751)."""
    h_units: int = 32
    """The hidden layer of h (l. 748)."""
    gamma: float = 0.99
    """Discount (l. 753, printed as lambda)."""
    learning_rate: float = 1e-4
    """Adam's step size (l. 753)."""
    batch_size: int = 32
    """Transitions an agent and update (ours: not in the paper)."""
    loss: Literal["mse", "huber"] = "mse"
    """Squared error (paper l. 244); Huber with delta 1 as in OpenAI baselines."""
    max_gradient_norm: float = 0.0
    """Clip each network's gradient to this norm; 0 does not clip (ours)."""
    replay_capacity: int = 200_000
    """Transitions in each agent's memory (l. 753), of all parallel games together."""
    replay_start_env_steps: int = 10_000
    """Env steps before the first update (ours: not in the paper)."""
    update_every_env_steps: int = 4
    """Env steps between two updates (l. 753)."""
    target_update_every_updates: int = 1_000
    """Updates between two copies to the target network (ours: not in the paper)."""
    epsilon_start: float = 1.0
    """Exploration at the start (l. 753)."""
    epsilon_final: float = 0.02
    """Exploration in the end (l. 753)."""
    epsilon_anneal_env_steps: int = 2_000_000
    """Env steps from the start value to the final one (l. 753)."""

    def __post_init__(self) -> None:
        check_topology(self.topology)
        encoder_of(self.encoder)
        shares, amounts = ("epsilon_start", "epsilon_final"), ("epsilon_anneal_env_steps",)
        counts = ("target_update_every_updates", "encoder_samples")
        cohort.check_ranges(self, shares=shares, amounts=amounts, counts=counts)


NAMED: Mapping[str, Mapping[str, Any]] = {
    "fdc": {"network": "own", "rate": 0.0},
    "dcc": {"rate": 0.0},
    "dcc-md": {},
    "dcc-sd": {"dropout": "element"},
    "full-md": {"drops_own": True},
    "full-sd": {"dropout": "element", "drops_own": True},
    "concat-dcc": {"network": "concat", "rate": 0.0},
    "concat-md": {"network": "concat"},
}
"""The names that definitions and `--algorithm` use, and what each changes in the Config."""


class DCC:
    """The stacked double deep Q-learners of a cohort: R runs of N agents each."""

    joint, listens = False, True

    def __init__(
        self, configs: Sequence[Config], env: Environment, device: torch.device | str = "cpu"
    ) -> None:
        self.config = config = cohort.shared_config(configs, env.agents)
        if env.actions == 0:
            raise DefinitionError("dcc picks one of several actions; this environment has none")
        self._runs, self._agents = len(configs), env.agents
        self.network = network = _network(config, env)
        self.encoding = encoding_of(config, env.observation_size, self._runs, device)
        self.online, self.target = (
            Stacked(network.layers, self._runs * self._agents, device) for _ in range(2)
        )
        rates = {name: getattr(config, name) for name in ("learning_rate", "max_gradient_norm")}
        self.adam = Adam(self.online, **rates, device=device)
        self._parts = {"online": self.online, "target": self.target, **self.adam.moments}
        shown = cohort.shown_agents(heard(config, env.agents), "cpu")  # meta cannot reckon
        links = links_heard(shown)
        self.shown_agents, self._links = shown.to(device), links.to(device)  # [N, 1+S], [N, S]
        self._shown_received = cohort.shown_received(links).to(device)
        rate, senders = torch.tensor([c.rate for c in configs], device="cpu"), network.senders
        scale = execution_scale(rate, senders, drops_own=config.drops_own).to(device)
        self.rate = rate.to(device)  # [R]
        self.scale = scale.repeat_interleave(self._agents, 0)[:, None]  # [G, 1, 1+S, 1]
        unit = max(env.observation_size, self.encoding.width) if config.dropout == "element" else 1
        self._mask_shape = (self._agents, config.batch_size, senders + config.drops_own, unit)
        self.init_uniforms = self._agents * parameter_count(network.layers)
        self._keeps_own = scale.new_ones(len(self.scale), config.batch_size, 1, unit)
        self.act_uniforms, self.update_uniforms = 2, math.prod(self._mask_shape)
        self.updates, self.means = 0, cohort.RunningMeans(self._runs, device)
        self._computes = self._computed_by(env, device)

    # Algorithm 1, as the paper writes it.

    def initialise(self, uniforms: Tensor) -> None:
        """Initialise theta and theta-minus alike (algorithm 1); uniforms [R, init_uniforms]."""
        initialise(self.online, uniforms)
        self.target.flat.copy_(self.online.flat)

    def epsilon(self, env_steps: float | Tensor) -> float | Tensor:
        """The share of random actions after `env_steps` (l. 753)."""
        c, over = self.config, self.config.epsilon_anneal_env_steps
        return annealed_epsilon(env_steps, c.epsilon_start, c.epsilon_final, over)

    def act(
        self, obs: Tensor, uniforms: Tensor, env_steps: int | Tensor, received: Heard = None
    ) -> Tensor:
        """With probability epsilon a random action, otherwise the policy's (l. 201-203).

        obs: [R, E, N, O]; uniforms: [R, E, N, 2]. Returns [R, E, N] int64.
        """
        return epsilon_greedy(self.q_exec(obs, received), uniforms, self.epsilon(env_steps))

    def act_greedily(self, obs: Tensor, received: Heard = None) -> Tensor:
        """The policy pi: argmax of Q_exec (paper l. 251), [R, E, N]; obs [R, E, N, O]."""
        return self.q_exec(obs, received).argmax(-1)

    def q_exec(self, obs: Tensor, received: Heard = None) -> Tensor:
        """Q_exec of the online networks: all messages, scaled by 1 - rate (l. 248): [R, E, N, A].

        obs: [R, E, N, O]; received: what arrives, None if it is everything; nothing is 0 (l. 525).
        """
        (runs, games), shown, computes = obs.shape[:2], self.shown_agents, self._computes
        factor, old = self.scale.expand(-1, games, -1, -1), None
        if received is not None:
            factor, old = received.factors(self.scale, self._links), received.messages
        if old is not None:
            shown = self._shown_received
            computes = self if self.encoding.turned_to_numbers(obs, old) else computes
        q = computes.q_values(*self.encoding.with_messages(obs, old), factor, shown)  # [G, E, A]
        return q.view(runs, self._agents, games, -1).transpose(1, 2)

    def update(self, minibatch: Minibatch, uniforms: Tensor) -> None:
        """Update every agent once, on its own minibatch; uniforms [R, update_uniforms]."""
        b = self.binary_mask(uniforms)
        factors = InputFactors(now=b, after=b, executed=self.scale).arriving(minibatch, self._links)
        self.means.add(*self._computes.minimise(minibatch, factors, self.updates + 1))
        if self.does_more(self.updates):  # update the target network (l. 223)
            self.target.flat.copy_(self.online.flat)
        self.updates += 1

    def binary_mask(self, uniforms: Tensor) -> Tensor:
        """Generate b, which drops each message with probability `rate` (l. 217, 235-241).

        uniforms: [R, update_uniforms]. Returns the keep mask [G, B, 1+S, 1 or W]: one for each
        sample, agent and sender; the own observation is kept, unless `drops_own`.
        """
        keep = keep_mask(uniforms.view(len(uniforms), *self._mask_shape), self.rate).flatten(0, 1)
        return keep if self.config.drops_own else cat((self._keeps_own, keep), 2)

    def minimise(self, drawn: Minibatch, by: InputFactors, step: int) -> tuple[Tensor, Tensor]:
        """Minimise DCC-MD's loss (paper l. 244) by one step of Adam.

        Returns the losses [G, B] and Q of the online networks [G, 2B, A] before the step.
        """
        with self.adam.descent() as theta:
            batch = drawn.copied()
            om, next_om = batch.seen()  # (o, m), (o', m')
            q = self.q(theta, om, by.now)  # Q(o, m~; theta)
            with torch.no_grad():
                q_exec = self.q(self.online, next_om, by.executed)  # Q_exec(o', m'; theta)
                next_q = self.q(self.target, next_om, by.after)  # Q(o', m~'; theta-), the same mask
                discount = self.config.gamma * batch.discount
                y = double_q_target(batch.reward, discount, next_q, q_exec)
            taken = q.gather(-1, batch.action[..., None]).squeeze(-1)  # Q(o, m~, a; theta)
            loss = td_loss(taken, y, self.config.loss)
            loss.mean(1).sum().backward()
        return loss.detach(), cat((q.detach(), q_exec), 1)

    def q(self, weights: Stacked, om: Blocks, factor: Tensor) -> Tensor:
        """Q [G, B, A] of observations and messages times factors of them [G, B, 1+S, 1 or W]."""
        return self.network.forward(weights, inputs_of(om, factor))

    def q_values(
        self, obs: Tensor, messages: Tensor | None, factor: Tensor, shown: Tensor
    ) -> Tensor:
        """Q of the online networks [G, E, A]; obs [R, E, K, O], factor [G, E, 1+S, 1].

        messages: [R, E, K, M]; None: the observations. shown: [N, 1+S], which of the K are agent
        i's own and its messages.
        """
        return self.q(self.online, seen_in_games(obs, messages, shown), factor)

    # What the engine asks for.

    def _computed_by(self, env: Environment, device: torch.device | str) -> "DCC | DCCKernel":
        """Who computes `minimise` and `q_values`: a kernel, the same up to rounding, or this."""
        config = self.config
        if self.kernel(config, env, device) != NAME:
            return self
        return DCCKernel(
            self._parts,
            self.shown_agents,
            observation=env.observation_size,
            message=self.encoding.width if self.encoding.apart else None,
            dtype=env.observation_dtype,
            batch_size=config.batch_size,
            learning_rate=config.learning_rate,
            gamma=config.gamma,
            huber=config.loss == "huber",
        )

    @classmethod
    def kernel(cls, config: Config, env: Environment, device: torch.device | str) -> str:
        """What computes it: `kernels/dcc.c`, which knows no subclass's rule, or torch."""
        network, clips = _network(config, env), config.max_gradient_norm > 0
        inputs = (env.observation_size, env.observation_dtype)
        apart = said(config) != OBSERVATION
        known = cls is DCC and serves(network.layers, *inputs, apart, clips=clips, device=device)
        return NAME if known else cohort.TORCH

    def does_more(self, update: int) -> bool:
        """Whether the target network is updated (l. 223) at the end of this update, from 0."""
        return (update + 1) % self.config.target_update_every_updates == 0

    def metrics(self, env_steps: int) -> list[dict[str, float | None]]:
        """Each run's epsilon now, and the means of loss and Q since the last call (None: none)."""
        return [{"epsilon": float(self.epsilon(env_steps)), **m} for m in self.means.take()]

    def tensors(self, run: int) -> dict[str, Tensor]:
        """Online and target weights and Adam's moments of one run, as views."""
        found = cohort.tensors_of(self._parts, run * self._agents, (run + 1) * self._agents)
        return {**found, **self.encoding.tensors(run), "metric_sums": self.means.sums[:, run]}

    def policy(self, run: int) -> dict[str, Tensor]:
        """The online weights of one run, as views: [N, inputs, outputs] and [N, 1, outputs]."""
        online = self.online.of_networks(run * self._agents, (run + 1) * self._agents)
        return {**online, **self.encoding.tensors(run)}

    @property
    def progress(self) -> tuple[int, int]:
        """Counters that a checkpoint keeps: updates done, updates in the running means."""
        return self.updates, self.means.updates

    def resume_at(self, *counters: int) -> None:
        """Set the counters of `progress` again."""
        self.updates, self.means.updates = counters
        self.adam.resume_at(self.updates)


def _network(c: Config, env: Environment) -> Network:
    observation, senders = env.observation_size, len(heard(c, env.agents)[0])
    sizes = (observation, encoder_of(said(c)).width(observation), senders, env.actions)
    return q_network(c.network, *sizes, c.f_units, c.g_units, c.h_units)
