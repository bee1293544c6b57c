"""Pursuit: pursuers surround evaders on an empty square grid (paper, l. 360-373).

The rules of one step, in order:
1. Every pursuer moves North, East, West, South or stays. A move off the map costs `edge_penalty`
   and the pursuer stays. Pursuers may share a cell, and may stand on an evader. Those that may not
   share one move in the order of their numbers, and stay if another stands where they want to go.
2. Every evader draws one of the same five moves; it stays if a pursuer's new cell or the edge of
   the map is in the way. Evaders may share a cell.
3. An evader whose four sides are all taken by pursuers or the edge is removed. Every pursuer on
   one of its sides receives `capture_reward`.
4. Every pursuer pays `step_penalty`. The game ends when no evader is left.

All evaders start at the centre, every pursuer on a cell of its own draw, one that is free if cells
are not shared. A pursuer sees a window of (2D+1) x (2D+1) cells around itself in three channels:
how many *other* pursuers, how many evaders, and 1 where the map has ended.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from msgdrop_envs.protocol import Metric, Transition

MOVES = ((-1, 0), (0, 1), (0, -1), (1, 0), (0, 0))
"""(row, column) of North, East, West, South, Stay: the paper's order (l. 366)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a game; the defaults are the paper's N=6 case (l. 373)."""

    pursuers: int = 6
    """N (paper l. 373)."""
    evaders: int = 2
    """M (paper l. 373)."""
    map_size: int = 15
    """Cells on a side of the map (paper l. 373)."""
    sight: int = 3
    """D, cells seen in each direction (paper l. 373)."""
    time_limit: int = 500
    """T, steps (paper l. 373)."""
    capture_reward: float = 5.0
    """R+, to every pursuer beside a captured evader (paper l. 373)."""
    step_penalty: float = 0.05
    """R1-, every step (paper l. 373)."""
    edge_penalty: float = 0.5
    """R2-, for a move off the map (paper l. 373)."""
    capture_reward_once: bool = False
    """Pay R+ once a step even for two captured evaders, as MADRL does (ours: for each)."""
    may_enter_evaders: bool = True
    """Pursuers may step onto an evader's cell, as in MADRL (the paper does not say)."""
    may_share_cells: bool = field(default=True, metadata={"later": True})
    """Several pursuers may stand in one cell, as in MADRL (the paper does not say)."""

    def __post_init__(self) -> None:
        for name in ("pursuers", "evaders", "sight", "time_limit"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        if max(self.pursuers, self.evaders) > 255:  # counts are bytes
            raise ValueError("pursuers and evaders must be at most 255")
        if self.map_size < 3:
            raise ValueError(f"map_size must be at least 3, not {self.map_size}")
        if not self.may_share_cells and self.pursuers > self.map_size**2:
            raise ValueError(f"{self.pursuers} pursuers need more cells or may_share_cells")


PAPER = {
    "pursuit-n6": Config(),
    "pursuit-n8": Config(pursuers=8, map_size=17),
}


@dataclass(frozen=True, slots=True)
class State:
    """Positions are (row, column), int64; a captured evader keeps its last cell."""

    pursuers: Tensor
    """[..., N, 2]"""
    evaders: Tensor
    """[..., M, 2]"""
    free: Tensor
    """[..., M] bool: not captured yet."""


class Pursuit:
    """The batched game; holds lookup tables only, all state is passed in and out."""

    observation_dtype = torch.uint8
    observation_channels = ("others", "evaders", "boundary")
    actions = len(MOVES)
    action_size = 0
    counts: tuple[str, ...] = ("catches", "edge_hits")
    final_counts: tuple[str, ...] = ()
    metrics: Mapping[str, Metric] = {
        "catches_per_500": Metric(
            "catches", "steps", 500.0, "higher", "evader catches in 500 env steps"
        ),
        "catches_per_episode": Metric("catches", "episodes", 1.0, "higher", "of M evaders"),
        "capture_rate": Metric(
            "finished", "episodes", 1.0, "higher", "episodes that end with every evader captured"
        ),
        "steps_to_finish": Metric(
            "steps", "episodes", 1.0, "lower", "mean episode length; the time limit if unfinished"
        ),
        "return_per_episode": Metric(
            "return", "episodes", 1.0, "higher", "reward summed over agents and steps"
        ),
    }

    def __init__(self, config: Config, device: torch.device) -> None:
        self.config = config
        self.agents = config.pursuers
        self.time_limit = config.time_limit
        self.reset_uniforms = config.pursuers
        self.step_uniforms = config.evaders
        self._window = 2 * config.sight + 1
        self.observation_size = 3 * self._window**2
        self._moves = torch.tensor(MOVES, device=device)
        self._sides = self._moves[:4]
        self._edges = self._edge_table(device)
        self._slots, self._others = self._entity_tables(device)

    def reset(self, uniforms: Tensor) -> State:
        """Start games (paper l. 365-366). uniforms: [..., N], one cell for each pursuer."""
        size = self.config.map_size
        cells = self._start_cells(uniforms)
        pursuers = torch.stack((cells // size, cells % size), -1)
        batch = uniforms.shape[:-1]
        evaders = torch.full((*batch, self.config.evaders, 2), size // 2, device=uniforms.device)
        free = torch.ones(evaders.shape[:-1], dtype=torch.bool, device=uniforms.device)
        return State(pursuers, evaders, free)

    def step(self, state: State, actions: Tensor, uniforms: Tensor) -> tuple[State, Transition]:
        """Play one step (paper l. 365-369; the order of things is the module's docstring).

        actions: [..., N] int64, indices of MOVES; uniforms: [..., M], one move for each evader.
        """
        pursuers, hits_edge = self._move_pursuers(state, actions)
        evaders = self._move_evaders(state, pursuers, uniforms)
        captured, flanks = self._captures(evaders, state.free, pursuers)
        state = State(pursuers, evaders, state.free & ~captured)
        catches = (captured[..., None] & flanks).sum(-2)  # [..., N]
        paid = catches.clamp(max=1) if self.config.capture_reward_once else catches
        reward = (
            self.config.capture_reward * paid
            - self.config.step_penalty
            - self.config.edge_penalty * hits_edge
        )
        goes_on = state.free.any(-1)
        happened = {"catches": captured, "edge_hits": hits_edge}
        info = {name: each.sum(-1, dtype=torch.float32) for name, each in happened.items()}
        return state, Transition(self.observe(state), reward, goes_on.float(), ~goes_on, info)

    def places(self, state: State) -> Tensor:
        """Where the pursuers are, in cells: [..., N, 2] float32."""
        return state.pursuers.float()

    def observe(self, state: State) -> Tensor:
        """Counts of other pursuers and of evaders, and the edge (paper l. 370-372).

        Returns [..., N, 3 * (2D+1)**2] uint8, channel by channel, rows from North to South.
        """
        obs = self._edges[state.pursuers.unbind(-1)]  # [..., N, O]
        entities = torch.cat((state.pursuers, state.evaders), -2)  # [..., N+M, 2]
        away = entities[..., None, :, :] - state.pursuers[..., :, None, :]  # [..., N, N+M, 2]
        seen = (away.abs() <= self.config.sight).all(-1) & self._others  # [..., N, N+M]
        seen.narrow(-1, self.agents, self.config.evaders).logical_and_(state.free[..., None, :])
        south, east = away.unbind(-1)
        slot = torch.add(east, south, alpha=self._window).add_(self._slots)
        slot.mul_(seen)  # the unseen add 0 to slot 0
        return obs.scatter_add_(-1, slot, seen.to(torch.uint8))

    def _move_pursuers(self, state: State, actions: Tensor) -> tuple[Tensor, Tensor]:
        goal = state.pursuers + self._moves[actions]
        moved = goal.clamp(0, self.config.map_size - 1)
        hits_edge = (goal != moved).any(-1)  # [..., N]
        if not self.config.may_enter_evaders:
            meets = (moved[..., :, None, :] == state.evaders[..., None, :, :]).all(-1)
            blocked = (meets & state.free[..., None, :]).any(-1)
            moved = torch.where(blocked[..., None], state.pursuers, moved)
        if not self.config.may_share_cells:
            moved = self._one_by_one(state.pursuers, moved)
        return moved, hits_edge

    def _start_cells(self, uniforms: Tensor) -> Tensor:
        """The number of each pursuer's first cell [..., N]; where none is shared, of a free one."""
        count = self.config.map_size**2
        if self.config.may_share_cells:
            return (uniforms * count).long()
        drawn = uniforms[..., :0].long()
        for number in range(self.agents):
            cell = (uniforms[..., number] * (count - number)).long()  # among those that are free
            for taken in drawn.sort(-1).values.unbind(-1):
                cell = cell + (cell >= taken)
            drawn = torch.cat((drawn, cell[..., None]), -1)
        return drawn

    def _one_by_one(self, pursuers: Tensor, goals: Tensor) -> Tensor:
        """Move in the order of numbers; who would meet another stays. [..., N, 2] each."""
        cells = pursuers.clone()
        for number in range(self.agents):
            goal = goals[..., number, :]
            meets = (cells == goal[..., None, :]).all(-1)  # [..., N]
            meets[..., number] = False
            stays = meets.any(-1, keepdim=True)
            cells[..., number, :] = torch.where(stays, cells[..., number, :], goal)
        return cells

    def _move_evaders(self, state: State, pursuers: Tensor, uniforms: Tensor) -> Tensor:
        choice = (uniforms * len(MOVES)).long()
        goal = (state.evaders + self._moves[choice]).clamp(0, self.config.map_size - 1)
        meets = (goal[..., :, None, :] == pursuers[..., None, :, :]).all(-1)  # [..., M, N]
        stays = meets.any(-1) | ~state.free
        return torch.where(stays[..., None], state.evaders, goal)

    def _captures(self, evaders: Tensor, free: Tensor, pursuers: Tensor) -> tuple[Tensor, Tensor]:
        """Which evaders are surrounded [..., M], and who is beside which [..., M, N]."""
        sides = evaders[..., None, :] + self._sides  # [..., M, 4, 2]
        taken = (sides[..., None, :] == pursuers[..., None, None, :, :]).all(-1)  # [..., M, 4, N]
        beyond = (sides != sides.clamp(0, self.config.map_size - 1)).any(-1)  # [..., M, 4]
        surrounded = (taken.any(-1) | beyond).all(-1)
        return surrounded & free, taken.any(-2)

    def _edge_table(self, device: torch.device) -> Tensor:
        """The third channel for each cell, the first two empty: [rows, columns, O] uint8."""
        size, sight = self.config.map_size, self.config.sight
        padded = torch.ones(size + 2 * sight, size + 2 * sight, dtype=torch.uint8)
        padded[sight:-sight, sight:-sight] = 0
        windows = padded.unfold(0, self._window, 1).unfold(1, self._window, 1)
        table = torch.zeros(size**2, 3, self._window**2, dtype=torch.uint8)
        table[:, 2] = windows.reshape(size**2, self._window**2)
        return table.view(size, size, -1).to(device)

    def _entity_tables(self, device: torch.device) -> tuple[Tensor, Tensor]:
        """Where an entity at distance (0, 0) is counted [N+M]; who is another entity [N, N+M]."""
        centre = self._window**2 // 2
        slots = [centre] * self.agents + [self._window**2 + centre] * self.config.evaders
        others = torch.ones(self.agents, len(slots), dtype=torch.bool)
        others[:, : self.agents].fill_diagonal_(False)
        return torch.tensor(slots, device=device), others.to(device)
