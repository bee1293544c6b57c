"""Pursuit: the rules are those of `msgdrop_envs.pursuit`, written once more."""

import numpy as np
import numpy.typing as npt

MOVES = ((-1, 0), (0, 1), (0, -1), (1, 0), (0, 0))
SIGHT = 3
WINDOW = 2 * SIGHT + 1

Cell = tuple[int, int]
Obs = npt.NDArray[np.uint8]


class Pursuit:
    """One game."""

    observation = 3 * WINDOW**2
    dtype = np.uint8
    actions = len(MOVES)
    action_size = 0
    time_limit = 500

    def __init__(self, agents: int, size: int, rng: np.random.Generator) -> None:
        self.agents = agents
        self.size = size
        self.rng = rng
        self.pursuers: list[Cell] = []
        self.evaders: list[Cell] = []
        padded = size + 2 * SIGHT
        self.grid = np.zeros((3, padded, padded), np.uint8)  # pursuers, evaders, off the map
        self.grid[2] = 1
        self.grid[2, SIGHT:-SIGHT, SIGHT:-SIGHT] = 0
        # A view: what is written to the grid is seen in the windows. [3, size, size, 7, 7]
        self.windows = np.lib.stride_tricks.sliding_window_view(self.grid, (WINDOW, WINDOW), (1, 2))

    def reset(self) -> Obs:
        """Pursuers anywhere, both evaders at the centre; returns the observations [N, O]."""
        cells = self.rng.integers(self.size, size=(self.agents, 2)).tolist()
        self.pursuers = [(row, column) for row, column in cells]
        self.evaders = [(self.size // 2, self.size // 2)] * 2
        return self.observe()

    def step(self, actions: list[int]) -> tuple[Obs, list[float], bool]:
        """Returns observations [N, O], rewards [N], and whether both evaders are captured."""
        rewards = [-0.05] * self.agents
        for i, action in enumerate(actions):
            goal = self.neighbour(self.pursuers[i], action)
            if self.on_map(goal):
                self.pursuers[i] = goal
            else:
                rewards[i] -= 0.5
        taken = set(self.pursuers)
        escaped = []
        for evader, move in zip(self.evaders, self.rng.integers(5, size=2).tolist(), strict=False):
            goal = self.neighbour(evader, move)
            cell = goal if self.on_map(goal) and goal not in taken else evader
            sides = [self.neighbour(cell, side) for side in range(4)]
            if all(side in taken or not self.on_map(side) for side in sides):
                for i, pursuer in enumerate(self.pursuers):
                    rewards[i] += 5.0 * (pursuer in sides)
            else:
                escaped.append(cell)
        self.evaders = escaped
        return self.observe(), rewards, not escaped

    def observe(self) -> Obs:
        """Other pursuers, evaders, off the map, each 7 x 7 around the agent: [N, 147]."""
        self.grid[:2] = 0
        for row, column in self.pursuers:
            self.grid[0, row + SIGHT, column + SIGHT] += 1
        for row, column in self.evaders:
            self.grid[1, row + SIGHT, column + SIGHT] += 1
        rows, columns = zip(*self.pursuers, strict=True)
        obs = self.windows[:, rows, columns].swapaxes(0, 1).reshape(self.agents, self.observation)
        obs[:, WINDOW**2 // 2] -= 1  # not oneself
        return obs

    def on_map(self, cell: Cell) -> bool:
        """Whether the cell is one of the map's."""
        return 0 <= cell[0] < self.size and 0 <= cell[1] < self.size

    @staticmethod
    def neighbour(cell: Cell, move: int) -> Cell:
        """The cell that a move leads to, on the map or not."""
        return cell[0] + MOVES[move][0], cell[1] + MOVES[move][1]
