"""The replay memories of a cohort (paper l. 213-215): every joint observation stored once.

Agent i's memory D^i holds (o, m, a, r, o', m'); all of them share one ring of *joint*
observations, from which o and m are put together when sampled. Each agent draws its own
minibatch, which is the same as N separate memories. The next observation is not stored again: a
transition knows the row where it stands, as a rule the game's next one. Where the time limit cut
the episode, the last observation stands in an extra row (at most one for every `time_limit`
steps); at a true end the discount is 0 and any row will do. Messages that are no observations are
stored beside them, row by row.
"""

from collections.abc import Iterator, Mapping

import torch
from torch import Tensor

from msgdrop_cli.algorithms.hearing import Encoding
from msgdrop_cli.channels import others
from msgdrop_cli.engine import pages
from msgdrop_cli.messages.received import Heard, Received
from msgdrop_cli.ops.late_messages import rows_said_in, taken, with_late_messages
from msgdrop_cli.ops.minibatch import Minibatch
from msgdrop_envs import waiting
from msgdrop_envs.protocol import Transition


class Replay:
    """R*E*N rings in a few flat tensors; slot t of a game is overwritten `slots` steps later."""

    def __init__(
        self,
        *,
        runs: int,
        games: int,
        agents: int,
        observation: int,
        dtype: torch.dtype,
        capacity: int,
        time_limit: int,
        action_size: int = 0,
        encoding: Encoding | None = None,
        loses: bool = False,
        reach: int = 0,
        device: torch.device | str = "cpu",
    ) -> None:
        """loses: whether a channel loses messages; reach: how old those may be that arrive."""
        self.games, self.agents, self.time_limit = games, agents, time_limit
        self._reach, self._sampled = reach, max(capacity // games, 1)
        # Before what can be sampled, messages that may still arrive; then what is to be acted on.
        self.slots = reach + self._sampled + 1
        self._ends = self.slots // time_limit + 2  # rows of cut episodes, for each game
        rows = self.slots * games
        self.added = 0
        """Steps stored so far by each game."""
        self.clock: Tensor | None = None
        """`added` as an int64 tensor [], while steps are recorded to be repeated (graphs.py)."""
        # The last rows: the ends of cut episodes, then one for what nobody needs.
        shape = (runs, rows + self._ends * games + 1, agents, observation)
        self.obs = pages.zeros(*shape, dtype=dtype, device=device)
        self._encoding = encoding
        self.messages: Tensor | None = None
        if encoding is not None and encoding.apart:
            size = (*shape[:3], encoding.width)
            self.messages = pages.zeros(*size, dtype=torch.float32, device=device)
        self.arrives: Tensor | None = None
        """[R, obs rows, N, N-1] uint8, where a channel loses some: 0, no message; else age + 1."""
        if loses:
            size = (*shape[:3], agents - 1)
            self.arrives = pages.zeros(*size, dtype=torch.uint8, device=device)
        self.action = (
            torch.zeros(runs, rows, agents, action_size, device=device)
            if action_size
            else torch.zeros(runs, rows, agents, dtype=torch.uint8, device=device)
        )
        self.reward = torch.zeros(runs, rows, agents, device=device)
        self.discount = torch.zeros(runs, rows, device=device)
        self.next_row = torch.zeros(runs, rows, dtype=torch.int32, device=device)
        self._first_obs_row = torch.tensor([[r * shape[1]] for r in range(runs)], device=device)
        self._game = _numbers(games, device)

    def __len__(self) -> int:
        """Transitions of one run that can be sampled."""
        return min(self.added, self._sampled) * self.games

    @property
    def held(self) -> int | Tensor:
        """`len(self)`, as a tensor [] where there is a clock."""
        if self.clock is None:
            return len(self)
        return self.clock.clamp(max=self._sampled) * self.games

    def begin(self, obs: Tensor, arrives: Tensor | None = None) -> None:
        """Store what the agents see before their first action, [R, E, N, O], and what arrives."""
        for memory, seen in self._pairs(obs, arrives):
            memory[:, : self.games] = seen

    def add(
        self,
        actions: Tensor,
        transition: Transition,
        next_obs: Tensor,
        next_arrives: Tensor | None = None,
        last_arrives: Tensor | None = None,
    ) -> None:
        """Store one step of every game.

        actions [R, E, N] or [R, E, N, A]; transition [R, E, ...]; next_obs [R, E, N, O] after any
        restart. next_arrives, last_arrives: [R, E, N, N-1] as in `arrives`, what arrives then,
        after any restart and before it.
        """
        now = self.added if self.clock is None else self.clock
        here, there = self._rows(now), self._rows(now + 1)
        next_row = self._game + self._first(now + 1)  # [E]
        self.action[:, here] = actions.to(self.action.dtype)
        self.reward[:, here] = transition.reward
        self.discount[:, here] = transition.discount
        for memory, seen in self._pairs(next_obs, next_arrives):
            memory[:, there] = seen
        cut = transition.ended & (transition.discount > 0)  # [R, E]
        if not waiting.can_ask(cut) or cut.any():  # a shortcut, never another result
            end = self._end_rows(now)
            spare = self.obs.shape[1] - 1
            target = torch.where(cut, end, spare) + self._first_obs_row  # [R, E]
            for memory, seen in self._pairs(transition.obs, last_arrives):
                memory.flatten(0, 1)[target.flatten()] = seen.flatten(0, 1)
            next_row = torch.where(cut, end, next_row)
        self.next_row[:, here] = next_row.int()
        self.added += 1
        if self.clock is not None:
            self.clock += 1

    def rows(self, drawn: Tensor) -> Tensor:
        """The rows of the drawn transitions; drawn: integers below len(self), 0 the oldest."""
        now = self.added if self.clock is None else self.clock
        gone = now - self._sampled
        oldest = gone.clamp(min=0) if isinstance(gone, Tensor) else max(gone, 0)
        return (drawn + oldest * self.games) % (self.slots * self.games)

    def minibatch(self, rows: Tensor, shown: Tensor) -> Minibatch:
        """Minibatches that stay where they are.

        rows: [R, N, B], or [R, B] for all agents at once; shown: [N, 1+S], whom agent i is shown.
        """
        drawn = Minibatch(
            obs=self.obs,
            next_row=self.next_row,
            action=self.action,
            reward=self.reward,
            discount=self.discount,
            rows=rows.contiguous(),
            shown=shown,
            messages=self.messages,
            arrives=self.arrives,
        )
        return with_late_messages(drawn, self.slots, self.games) if self._reach else drawn

    def received(self) -> Heard:
        """What arrives of the others' messages where the agents are to act; None: everything."""
        if self.arrives is None:
            return None
        arrives = self.arrives[:, self._rows(self.added)]  # [R, E, N, N-1]
        if not self._reach:
            return Received((arrives > 0).float())
        game = self._game[:, None]  # [E, 1], of N agents
        row, step = game + self._first(self.added), torch.full_like(game, self.added)
        rows = rows_said_in(arrives, row, game, step, self.slots, self.games)
        senders = others(self.agents, rows.device)
        memory = self.obs if self.messages is None else self.messages
        return Received((arrives > 0).float(), taken(memory, rows, senders))

    def stretch(self, run: int, first: int, last: int) -> dict[str, Tensor]:
        """The steps `first` to `last - 1` of one run, for a checkpoint: [steps, E, ...] each."""
        slots = self._slots(first, last)
        return {name: ring[slots] for name, ring in self._rings(run).items()}

    def restore_stretch(self, run: int, first: int, tensors: Mapping[str, Tensor]) -> None:
        """Put a stretch back; older stretches first, since newer ones may overwrite them."""
        slots = self._slots(first, first + len(tensors["obs"]))
        for name, ring in self._rings(run).items():
            ring[slots] = tensors[name].to(ring.device)

    def put(self, run: int, obs: Tensor, arrives: Tensor | None = None) -> None:
        """Store what the agents of one run see now, [E, N, O], and which messages arrive."""
        runs = len(self.obs)
        arrive = None if arrives is None else arrives.expand(runs, *arrives.shape)
        for memory, seen in self._pairs(obs.expand(runs, *obs.shape), arrive):
            memory[run, self._rows(self.added)] = seen[run]

    def cut_episodes(self, run: int) -> dict[str, Tensor]:
        """What is stored of the ends of cut episodes of one run, as views: [rows, N, ...]."""
        ends = slice(self.slots * self.games, -1)
        memories = {
            "cut_episodes": self.obs,
            "cut_messages": self.messages,
            "cut_arrives": self.arrives,
        }
        return {name: each[run, ends] for name, each in memories.items() if each is not None}

    def _pairs(self, obs: Tensor, arrives: Tensor | None) -> Iterator[tuple[Tensor, Tensor]]:
        """Memories, and what belongs there when the agents see obs [R, E, N, O]."""
        yield self.obs, obs
        if self.arrives is not None and arrives is not None:
            yield self.arrives, arrives
        said = self._encoding.message(obs) if self._encoding else None
        if self.messages is not None and said is not None:
            yield self.messages, said

    def _rings(self, run: int) -> dict[str, Tensor]:
        """Views of one run's memories by slot: [slots, E, ...]."""
        rows = self.slots * self.games
        rings = {
            "obs": self.obs[run, :rows],
            "action": self.action[run],
            "reward": self.reward[run],
            "discount": self.discount[run],
            "next_row": self.next_row[run],
        }
        if self.messages is not None:
            rings["messages"] = self.messages[run, :rows]
        if self.arrives is not None:
            rings["arrives"] = self.arrives[run, :rows]
        return {name: ring.unflatten(0, (self.slots, self.games)) for name, ring in rings.items()}

    def _slots(self, first: int, last: int) -> Tensor:
        return torch.arange(first, last, device=self.obs.device) % self.slots

    def _first(self, step: int | Tensor) -> int | Tensor:
        """The first row of a step."""
        return (step % self.slots) * self.games

    def _rows(self, step: int | Tensor) -> slice | Tensor:
        """The rows of a step, [E] if it is told by the clock."""
        first = self._first(step)
        if isinstance(first, Tensor):
            return first + self._game
        return slice(first, first + self.games)

    def _end_rows(self, step: int | Tensor) -> Tensor:
        """Where a game's cut episode keeps its last observation; two are `time_limit` apart."""
        window = (step // self.time_limit) % self._ends
        return self._game * self._ends + window + self.slots * self.games


def _numbers(count: int, device: torch.device | str) -> Tensor:
    """0, 1, 2, ...: [count] int64; on `meta` only the shape, for to count there is arithmetic.

    What that costs, `commands/parts/shapes.py` says.
    """
    shape = torch.empty(count, dtype=torch.int64, device=device)
    return shape if shape.is_meta else torch.arange(count, device=device)
