"""The pursuit game once more, slowly, in plain Python: the yardstick of `test_pursuit.py`.

Written from the rules alone (paper l. 360-373, where they leave something open the docstring of
`pursuit.py`), one game at a time, with loops and lists, and fed the same uniform numbers as the
batched game. Speed and elegance do not matter here; that each line
can be held against a sentence of the rules does.
"""

from collections import Counter
from dataclasses import dataclass

Cell = tuple[int, int]
"""(row, column); row 0 is the northern edge, column 0 the western one."""

STEPS: dict[str, Cell] = {
    "North": (-1, 0),
    "East": (0, +1),
    "West": (0, -1),
    "South": (+1, 0),
    "Stay": (0, 0),
}
SIDES = ("North", "East", "West", "South")
ACTIONS = ("North", "East", "West", "South", "Stay")


@dataclass
class Outcome:
    """What one step gives: one list entry for each pursuer, one number for each game."""

    observations: list[list[int]]
    rewards: list[float]
    discount: float
    catches: int


@dataclass
class SlowPursuit:
    """One game; `evaders` holds None for an evader that was captured."""

    size: int
    sight: int
    capture_reward: float
    step_penalty: float
    edge_penalty: float
    capture_reward_once: bool
    may_enter_evaders: bool
    may_share_cells: bool
    pursuers: list[Cell]
    evaders: list[Cell | None]

    def on_the_map(self, cell: Cell) -> bool:
        """Whether the map has such a cell."""
        return 0 <= cell[0] < self.size and 0 <= cell[1] < self.size

    def start(self, pursuers: int, evaders: int, uniforms: list[float]) -> None:
        """Begin anew: evaders in the centre, each pursuer on the cell its uniform number picks."""
        self.pursuers = []
        board = [(row, column) for row in range(self.size) for column in range(self.size)]
        for pursuer in range(pursuers):
            free = [c for c in board if self.may_share_cells or c not in self.pursuers]
            self.pursuers.append(free[int(uniforms[pursuer] * len(free))])
        middle = (self.size - 1) // 2
        self.evaders = [(middle, middle) for _ in range(evaders)]

    def step(self, actions: list[int], uniforms: list[float]) -> Outcome:
        """Play one step: pursuers, then evaders, then captures, then the bill."""
        rewards = [-self.step_penalty for _ in self.pursuers]
        self._move_pursuers(actions, rewards)
        self._move_evaders(uniforms)
        catches = self._capture(rewards)
        over = all(evader is None for evader in self.evaders)
        return Outcome(self.observe(), rewards, 0.0 if over else 1.0, catches)

    def _move_pursuers(self, actions: list[int], rewards: list[float]) -> None:
        for number, action in enumerate(actions):
            goal = neighbour(self.pursuers[number], ACTIONS[action])
            if not self.on_the_map(goal):
                rewards[number] -= self.edge_penalty
            elif goal == self.pursuers[number]:
                pass
            elif not self.may_enter_evaders and goal in self.evaders:
                pass  # the evader, still where it was before this step, is in the way
            elif not self.may_share_cells and goal in self.pursuers:
                pass  # another pursuer is there: one that has moved, or one that has yet to
            else:
                self.pursuers[number] = goal

    def _move_evaders(self, uniforms: list[float]) -> None:
        for number, evader in enumerate(self.evaders):
            if evader is None:
                continue
            goal = neighbour(evader, ACTIONS[int(uniforms[number] * 5)])
            if self.on_the_map(goal) and goal not in self.pursuers:
                self.evaders[number] = goal

    def _capture(self, rewards: list[float]) -> int:
        paid: set[int] = set()
        catches = 0
        for number, evader in enumerate(self.evaders):
            if evader is None:
                continue
            sides = [neighbour(evader, side) for side in SIDES]
            if not all(side in self.pursuers or not self.on_the_map(side) for side in sides):
                continue
            self.evaders[number] = None
            catches += 1
            for pursuer, cell in enumerate(self.pursuers):
                if cell in sides and not (self.capture_reward_once and pursuer in paid):
                    rewards[pursuer] += self.capture_reward
                    paid.add(pursuer)
        return catches

    def observe(self) -> list[list[int]]:
        """For each pursuer the three windows, one after the other, each row by row."""
        return [self._windows(pursuer) for pursuer in range(len(self.pursuers))]

    def _windows(self, observer: int) -> list[int]:
        row, column = self.pursuers[observer]
        others = Counter(self.pursuers)
        others[row, column] -= 1  # not myself
        evaders = Counter(evader for evader in self.evaders if evader is not None)
        reach = range(-self.sight, self.sight + 1)
        window = [(row + down, column + right) for down in reach for right in reach]
        return (
            [others.get(cell, 0) for cell in window]
            + [evaders.get(cell, 0) for cell in window]
            + [0 if self.on_the_map(cell) else 1 for cell in window]
        )


def neighbour(cell: Cell, direction: str) -> Cell:
    """The cell one step away."""
    down, right = STEPS[direction]
    return cell[0] + down, cell[1] + right
