"""The loop of the paper's algorithm 1 for a whole cohort: act, step, store, learn.

The loop contains nothing but the loop: logging, checkpoints and stopping consume it (`run.py`).
With E parallel games, E env steps happen at once; the updates per env step stay the paper's.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import torch
from torch import Tensor

from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.definition.spec import RunSpec
from msgdrop_cli.engine.lost_messages import lost_messages_of
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.replay import Replay
from msgdrop_cli.ops.minibatch import Minibatch
from msgdrop_envs import autoreset, registry, waiting


class Training:
    """R runs in lockstep that share every tensor shape; see `definition.cohorts.group`."""

    def __init__(self, specs: Sequence[RunSpec], device: str = "cpu") -> None:
        spec = specs[0]
        config = spec.algorithm_config
        self.runs, self.games_each = len(specs), spec.training.games
        self.streams = Streams([s.seed for s in specs], device)
        self.env = registry.make(spec.environment_config, device)
        make = learner_class(spec.algorithm)
        self.learner = make([s.algorithm_config for s in specs], self.env, device)
        channel = spec.training.channel
        self.lost = lost_messages_of(channel, self.env, make, self.streams, self.games_each)
        """What a channel loses or delays in training; None if there is none."""
        self.replay = Replay(
            runs=self.runs,
            games=self.games_each,
            agents=self.env.agents,
            observation=self.env.observation_size,
            dtype=self.env.observation_dtype,
            capacity=config.replay_capacity,
            time_limit=self.env.time_limit,
            action_size=self.env.action_size,
            encoding=self.learner.encoding,
            loses=self.lost is not None,
            reach=self.lost.reach if self.lost else 0,
            device=device,
        )
        self.env_steps = 0
        self.counted = (*self.env.counts, "finished", "episodes", "return")
        self.sums = torch.zeros(len(self.counted), self.runs, device=device)
        """Since the last log: what is counted in each run, [counts + 3, R]."""
        self.watched = (self.learner.means.sums.view(-1), self.sums.view(-1))
        """Numbers that are finite as long as loss, Q and reward were, those of run r at r + i*R."""
        asked = waiting.can_ask(self.sums)
        self._seen = [each.numpy().data for each in self.watched] if asked else []
        self.odd: dict[int, int] = {}
        """The runs in which one was not, and how many updates had been made when it was seen."""
        self.games: autoreset.Games

    def begin(self, encoder: Mapping[str, Tensor] | None = None) -> None:
        """Initialise the networks and the games (algorithm 1, first lines).

        encoder: the weights of one that has learnt something; KeyError without them.
        """
        self.learner.encoding.fill(encoder or {})
        self.learner.initialise(self.streams.uniforms("init", self.learner.init_uniforms))
        uniforms = self.streams.uniforms("env", self.games_each, self.env.reset_uniforms)
        # The games start spread over an episode, so that they do not all end in one step.
        spread = torch.arange(self.games_each, device=uniforms.device)
        elapsed = spread * self.env.time_limit // self.games_each
        self.games = autoreset.start(self.env, uniforms, elapsed.repeat(self.runs, 1))
        if self.lost:
            self.lost.begin(self.games)
        self.replay.begin(self.games.obs, self.lost.arrives if self.lost else None)

    def advance(self) -> None:
        """One step of every game, and the updates that are due."""
        actions = self.act()
        self.play(actions)
        for _ in range(self.updates_due()):
            self.learn(self.sample())
            for numbers in self._seen:
                if not math.isfinite(sum(numbers)):
                    self.look(numbers, self.learner.progress[0])

    def look(self, numbers: Iterable[float], updates: int) -> None:
        """Note the runs with a number that is not finite; numbers: `watched` after the updates."""
        for place, number in enumerate(numbers):
            if not math.isfinite(number):
                self.odd.setdefault(place % self.runs, updates)

    def act(self) -> Tensor:
        """Each agent acts, and explores (l. 199-207): [R, E, N], or [R, E, N, A] numbers."""
        shape = (self.games_each, self.env.agents, self.learner.act_uniforms)
        uniforms = self.streams.uniforms("explore", *shape)
        clock = self.replay.clock
        now = self.env_steps if clock is None else (clock * self.games_each).double()
        return self.learner.act(self.games.obs, uniforms, now, self.replay.received())

    def play(self, actions: Tensor) -> None:
        """Execute the joint actions and store the transitions (l. 207-213)."""
        env, each = self.env, self.games_each
        uniforms = self.streams.uniforms("env", each, env.step_uniforms + env.reset_uniforms)
        step, reset = uniforms.split([env.step_uniforms, env.reset_uniforms], -1)
        before, transition = autoreset.play(env, self.games, actions, step)
        self.games = autoreset.restart(env, before, transition, reset)
        if self.lost:
            steps = self.replay.added + 1
            last = self.lost.advance(before, self.games, transition.ended, steps)
            self.replay.add(actions, transition, self.games.obs, self.lost.arrives, last)
        else:
            self.replay.add(actions, transition, self.games.obs)
        self.env_steps += each
        counts = [transition.info[name] for name in env.counts]
        finished = transition.ended & (transition.discount == 0)
        returns = transition.reward.sum(-1)
        counts += [finished.float(), transition.ended.float(), returns]
        self.sums += torch.stack(counts).sum(-1)  # [counts + 3, R]

    def sample(self) -> Minibatch:
        """Sample a minibatch for each agent from its memory (l. 215), or one for all (joint)."""
        size = self.learner.config.batch_size
        shape = (size,) if self.learner.joint else (self.env.agents, size)
        rows = self.replay.rows(self.streams.integers("replay", self.replay.held, *shape))
        return self.replay.minibatch(rows, self.learner.shown_agents)

    def learn(self, minibatch: Minibatch) -> None:
        """Generate the binary mask and update every agent's network (l. 217-219)."""
        uniforms = self.streams.uniforms("dropout", self.learner.update_uniforms)
        self.learner.update(minibatch, uniforms)

    def window(self, env_steps: int) -> list[dict[str, float | None]]:
        """Each run's metrics over the `env_steps` since the last call; None where nothing was."""
        rows = []
        for column in self.sums.T.tolist():
            sums = {"steps": float(env_steps), **dict(zip(self.counted, column, strict=True))}
            rows.append({name: metric.ratio(sums) for name, metric in self.env.metrics.items()})
            rows[-1]["episodes"] = sums["episodes"]
        self.sums.zero_()
        return rows

    def updates_due(self) -> int:
        """Updates that the last step calls for: one every `update_every_env_steps`."""
        return self.updates_due_at(self.env_steps)

    def updates_due_at(self, env_steps: int) -> int:
        """Updates that are due after a step that ends at so many env steps."""
        config = self.learner.config
        if env_steps <= config.replay_start_env_steps:
            return 0
        every: int = config.update_every_env_steps
        return env_steps // every - (env_steps - self.games_each) // every
