"""The ring of joint observations is what N plain lists of transitions would be."""

from typing import NamedTuple

import pytest
import torch
from torch import Tensor

from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.replay import Replay
from msgdrop_cli.ops.minibatch import Batch
from msgdrop_envs.protocol import Transition

RUNS, AGENTS = 2, 3
BLOCKS = torch.tensor([[0, 1, 2], [1, 0, 2], [2, 0, 1]])
"""Agent i itself, then the senders in increasing order (paper l. 149)."""


class Remembered(NamedTuple):
    """One joint transition of one game; observations stand for themselves by a serial number."""

    seen: int
    actions: list[int]
    rewards: list[float]
    discount: float
    seen_next: int


class ListMemory:
    """A game with random ends, and the plain list of what happened in it."""

    def __init__(self, time_limit: int, elapsed: int, generator: torch.Generator) -> None:
        self.time_limit, self.elapsed, self.generator = time_limit, elapsed, generator
        self.seen = self._serial()
        self.transitions: list[Remembered] = []

    def play(self) -> tuple[Remembered, bool]:
        """Play one step at random; the transition, and whether the episode is over."""
        terminal = float(torch.rand((), generator=self.generator)) < 0.15
        self.elapsed += 1
        ended = terminal or self.elapsed >= self.time_limit
        rewards = torch.rand(AGENTS, generator=self.generator).tolist()
        actions = torch.randint(5, (AGENTS,), generator=self.generator).tolist()
        after = self._serial()
        step = Remembered(self.seen, actions, rewards, 0.0 if terminal else 1.0, after)
        self.transitions.append(step)
        self.seen = self._serial() if ended else after
        self.elapsed = 0 if ended else self.elapsed
        return step, ended

    def _serial(self) -> int:
        return int(torch.randint(2**40, (), generator=self.generator))


def _observation(serials: list[list[int]]) -> Tensor:
    """What the agents see, [R, E, N, 2]: the serial number, and who sees it."""
    numbers = torch.tensor(serials)[..., None].expand(-1, -1, AGENTS)
    return torch.stack((numbers, torch.arange(AGENTS).expand_as(numbers)), -1)


class Pair:
    """The replay and the plain lists, fed with the same steps."""

    def __init__(self, games: int, capacity: int, time_limit: int, seed: int = 0) -> None:
        generator = torch.Generator().manual_seed(seed)
        self.replay = Replay(
            runs=RUNS,
            games=games,
            agents=AGENTS,
            observation=2,
            dtype=torch.int64,
            capacity=capacity,
            time_limit=time_limit,
        )
        self.lists = [
            [ListMemory(time_limit, e * time_limit // games, generator) for e in range(games)]
            for _ in range(RUNS)
        ]
        self.replay.begin(self._seen())

    def play(self) -> None:
        """One step of every game."""
        played = [[game.play() for game in run] for run in self.lists]
        steps = [[step for step, _ in run] for run in played]
        transition = Transition(
            obs=_observation([[s.seen_next for s in run] for run in steps]),
            reward=torch.tensor([[s.rewards for s in run] for run in steps]),
            discount=torch.tensor([[s.discount for s in run] for run in steps]),
            ended=torch.tensor([[ended for _, ended in run] for run in played]),
            info={},
        )
        actions = torch.tensor([[s.actions for s in run] for run in steps])
        self.replay.add(actions, transition, self._seen())

    def everything(self) -> Batch:
        """Every transition that can be drawn, once for each agent, the oldest first."""
        drawn = torch.arange(len(self.replay)).expand(RUNS, AGENTS, -1)
        return self.replay.minibatch(self.replay.rows(drawn), BLOCKS).copied()

    def expected(self, last: int) -> list[list[Remembered]]:
        """The lists' last steps of every game, in order of time, then of game, for each run."""
        return [
            [
                step
                for steps in zip(*(g.transitions[-last:] for g in run), strict=True)
                for step in steps
            ]
            for run in self.lists
        ]

    def _seen(self) -> Tensor:
        return _observation([[game.seen for game in run] for run in self.lists])


def _check(pair: Pair, last: int) -> None:
    """The replay holds, for every agent, exactly the last steps of the lists."""
    batch, size = pair.everything(), len(pair.replay)
    obs = batch.obs
    for run, steps in enumerate(pair.expected(last)):
        assert len(steps) == size
        seen = torch.tensor([step.seen for step in steps])
        after = torch.tensor([step.seen_next for step in steps])
        discount = torch.tensor([step.discount for step in steps])
        for agent in range(AGENTS):
            n = run * AGENTS + agent
            now, then = obs[n, :size], obs[n, size:]  # [size, 1+S, 2]
            assert (now[..., 0] == seen[:, None]).all()
            assert ((then[..., 0] == after[:, None]) | (discount == 0)[:, None]).all()
            assert (now[..., 1] == BLOCKS[agent]).all()
            assert (then[..., 1] == BLOCKS[agent]).all()
            assert batch.action[n].tolist() == [step.actions[agent] for step in steps]
            reward = torch.tensor([step.rewards[agent] for step in steps])
            assert torch.equal(batch.reward[n], reward)
            assert torch.equal(batch.discount[n], discount)


@pytest.mark.parametrize(
    ("games", "capacity", "time_limit"),
    [(1, 10, 4), (3, 40, 5), (4, 64, 64), (2, 7, 1), (5, 5, 3), (8, 100, 30)],
)
def test_replay_holds_exactly_the_last_steps(games: int, capacity: int, time_limit: int) -> None:
    """After every one of many steps, with true ends, time limits and wrap-around."""
    pair = Pair(games, capacity, time_limit)
    for step in range(1, 400):
        pair.play()
        _check(pair, min(step, capacity // games))


def test_the_lists_saw_everything() -> None:
    """The test above met time limits, true ends, both at once nowhere counted as a time limit."""
    pair = Pair(3, 40, 5)
    cut = true_ends = 0
    for _ in range(400):
        before = [[game.elapsed for game in run] for run in pair.lists]
        pair.play()
        for run, elapsed in zip(pair.lists, before, strict=True):
            for game, steps in zip(run, elapsed, strict=True):
                true_ends += game.transitions[-1].discount == 0.0
                cut += steps == 4 and game.transitions[-1].discount == 1.0
    assert cut > 100
    assert true_ends > 100


def test_capacity_counts_transitions_of_all_games() -> None:
    """200,000 transitions of 8 games are 25,000 steps of each; a full replay does not grow."""
    pair = Pair(4, 42, 9)
    sizes = []
    for _ in range(12):
        pair.play()
        sizes.append(len(pair.replay))
    assert sizes == [4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 40, 40]


def test_agents_and_runs_draw_their_own_minibatches() -> None:
    """Rows are gathered for each run and agent apart: each gets the transition that it drew."""
    pair = Pair(3, 60, 6)
    for _ in range(50):
        pair.play()
    drawn = Streams([1, 2]).integers("replay", len(pair.replay), AGENTS, 16)
    batch = pair.replay.minibatch(pair.replay.rows(drawn), BLOCKS).copied()
    steps = pair.expected(20)
    for run in range(RUNS):
        for agent in range(AGENTS):
            seen = batch.obs[run * AGENTS + agent, :16, 0, 0].tolist()
            assert seen == [steps[run][k].seen for k in drawn[run, agent].tolist()]
    assert len({tuple(row) for row in drawn.flatten(0, 1).tolist()}) == RUNS * AGENTS


def test_only_the_own_block_is_gathered_for_fdc() -> None:
    """With one block an agent each batch holds its own observation and nothing else."""
    pair = Pair(2, 20, 5)
    for _ in range(5):
        pair.play()
    rows = pair.replay.rows(torch.zeros(RUNS, AGENTS, 1, dtype=torch.int64))
    batch = pair.replay.minibatch(rows, BLOCKS[:, :1]).copied()
    obs = batch.obs
    assert obs.shape == (RUNS * AGENTS, 2, 1, 2)
    assert obs[:, 0, 0, 1].tolist() == [0, 1, 2, 0, 1, 2]
