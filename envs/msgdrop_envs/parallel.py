"""One game of any environment as a PettingZoo `ParallelEnv`, to play with, to watch, to reuse.

Needs the extra `pettingzoo`. Training never comes here: it plays batches of games directly. What
belongs to one environment (names, plain positions, pictures) stands in that environment's view.
"""

from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches
from operator import index
from typing import Any

import torch
from torch import Tensor

from msgdrop_envs import registry
from msgdrop_envs.protocol import Environment, View

try:
    import numpy as np
    from gymnasium.spaces import Box, Discrete
    from pettingzoo import ParallelEnv
except ImportError as error:
    hint = "in msgdrop's checkout: pip install -c constraints.txt -e '.[pettingzoo]'"
    raise ImportError(f"{error}; {hint}") from error

RENDER_MODES = ("human", "rgb_array", "ansi")
ByAgent = dict[str, Any]


def parallel_env(name: Any, render_mode: str | None = None) -> "ParallelGame":
    """One game, e.g. `parallel_env("pursuit-n6")`; `name` may also be an environment's Config.

    render_mode: "rgb_array" and "ansi" are what `render()` returns; "human" prints the text of
    "ansi" on stdout at every reset and step, which needs no display, and opens no window.
    Raises: ValueError for an unknown name or mode, or a game without a `view.py`.
    """
    settings = registry.settings()
    if isinstance(name, str) and name not in settings:
        near = get_close_matches(name, settings, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(sorted(settings))}"
        raise ValueError(f"unknown environment {name!r}; {hint}")
    if render_mode not in (None, *RENDER_MODES):
        raise ValueError(f"render_mode must be one of {RENDER_MODES} or None, not {render_mode!r}")
    config = settings[name] if isinstance(name, str) else name
    view = registry.view(config)
    if view is None:
        raise ValueError(f"{registry.game(config)} cannot be shown: there is no view.py beside it")
    title = name if isinstance(name, str) else registry.game(config)
    return ParallelGame(registry.make(config), view, title, render_mode)


class ParallelGame(ParallelEnv):  # type: ignore[misc]  # it ships no types
    """One game; `reset(seed)` seeds a NumPy generator, from which every later number is drawn."""

    def __init__(
        self, environment: Environment, view: View, title: str, render_mode: str | None = None
    ) -> None:
        self._env, self._view = environment, view
        self.render_mode = render_mode
        self.metadata = {
            "name": f"{title.replace('-', '_')}_v{self._view.version}",
            "render_modes": list(RENDER_MODES),
            "render_fps": 5,
            "is_parallelizable": True,
        }
        self.possible_agents = list(self._view.agent_names)
        self.agents: list[str] = []
        low, high = self._view.observation_bounds
        shape = (environment.observation_size,)
        dtype = torch.empty(0, dtype=environment.observation_dtype).numpy().dtype
        self.observation_spaces = {
            agent: Box(low, high, shape, dtype.type) for agent in self.possible_agents
        }
        start = environment.reset(torch.zeros(environment.reset_uniforms))  # any, for its shape
        low, high = self._view.state_bounds
        self.state_space = Box(low, high, _flat(start).shape, np.float32)
        size = environment.action_size
        self.action_spaces: dict[str, Box | Discrete] = {
            agent: Box(-1.0, 1.0, (size,), np.float32) if size else Discrete(environment.actions)
            for agent in self.possible_agents
        }
        self._rng = np.random.default_rng()
        self._state: Any = None
        self._elapsed = 0

    def observation_space(self, agent: str) -> Box:
        """What this agent may see: a flat vector, as the networks get it."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box | Discrete:
        """What this agent may do."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[ByAgent, dict[str, ByAgent]]:
        """Begin a game, at random or from `options["state"]` as `state_dict()` writes it.

        With a seed everything from here on repeats; without, the generator goes on.
        Raises: ValueError for a state that this game cannot be in, or a seed that is none.
        """
        given = (options or {}).get("state")
        state = None if given is None else self._view.state_from_dict(given)
        if seed is not None:
            self._rng = np.random.default_rng(_seed(seed))
        # Drawn even if a state is given: the rest of the game then has the same random numbers.
        fresh = self._env.reset(self._uniforms(self._env.reset_uniforms))
        self._state = fresh if state is None else state
        self._elapsed = 0
        self.agents = list(self.possible_agents)
        self._show()
        return self._by_agent(self._env.observe(self._state).numpy()), {a: {} for a in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[ByAgent, ByAgent, ByAgent, ByAgent, dict[str, ByAgent]]:
        """Play one step: observations, rewards, terminations, truncations, infos.

        A true end terminates all agents, the time limit truncates them. Each info holds the counts
        of the whole game in this step. Raises: ValueError for missing, unknown or wrong actions.
        """
        if not self.agents:
            self._require_state()
            return {}, {}, {}, {}, {}
        self._state, transition = self._env.step(
            self._state, self._actions(actions), self._uniforms(self._env.step_uniforms)
        )
        self._elapsed += 1
        terminated = bool(transition.ended)
        truncated = not terminated and self._elapsed >= self._env.time_limit
        counts = {name: float(count) for name, count in transition.info.items()}
        result = (
            self._by_agent(transition.obs.numpy()),
            dict(zip(self.agents, transition.reward.tolist(), strict=True)),
            dict.fromkeys(self.agents, terminated),
            dict.fromkeys(self.agents, truncated),
            {agent: dict(counts) for agent in self.agents},
        )
        if terminated or truncated:
            self.agents = []
        self._show()
        return result

    def state_dict(self) -> dict[str, Any]:
        """The position as plain lists and numbers; `reset(options={"state": ...})` takes it."""
        return self._view.state_to_dict(self._require_state())

    def state(self) -> np.ndarray[Any, Any]:
        """Everything there is, the fields of the environment's State in order: [S] float32."""
        return _flat(self._require_state())

    def render(self) -> np.ndarray[Any, Any] | str | None:
        """The picture [height, width, 3] uint8 or the text that `render_mode` asks for.

        None without a mode, and for "human", which has been shown already.
        """
        state = self._require_state()
        if self.render_mode == "rgb_array":
            picture: np.ndarray[Any, Any] = self._view.render_rgb(state).numpy()
            return picture
        return self._view.render_text(state) if self.render_mode == "ansi" else None

    def close(self) -> None:
        """Nothing is held open."""

    def _show(self) -> None:
        if self.render_mode == "human":
            print(self._view.render_text(self._state), flush=True)

    def _require_state(self) -> Any:
        if self._state is None:
            raise RuntimeError("no game has begun; call reset() first")
        return self._state

    def _uniforms(self, count: int) -> Tensor:
        return torch.from_numpy(self._rng.random(count, dtype=np.float32))

    def _by_agent(self, rows: np.ndarray[Any, Any]) -> ByAgent:
        return dict(zip(self.possible_agents, rows, strict=True))

    def _actions(self, actions: Mapping[str, Any]) -> Tensor:
        if set(actions) != set(self.agents):
            raise ValueError(f"actions are needed for exactly {self.agents}, not {list(actions)}")
        read = self._numbers if self._env.action_size else self._choice
        return torch.stack([read(agent, actions[agent]) for agent in self.agents])

    def _choice(self, agent: str, action: Any) -> Tensor:
        try:
            number = _whole(action)
        except TypeError:
            raise ValueError(f"{agent}: {action!r} is not an action number") from None
        if not 0 <= number < self._env.actions:
            raise ValueError(f"{agent}: action {number} is not in 0..{self._env.actions - 1}")
        return torch.tensor(number)

    def _numbers(self, agent: str, action: Any) -> Tensor:
        size = self._env.action_size
        try:
            numbers = np.asarray(action, np.float32)
        except (TypeError, ValueError):
            raise ValueError(f"{agent}: {action!r} is not {size} numbers") from None
        if numbers.shape != (size,) or not (abs(numbers) <= 1).all():
            raise ValueError(f"{agent}: action {action!r} is not {size} numbers in [-1, 1]")
        return torch.from_numpy(numbers.copy())


def _seed(given: Any) -> int:
    try:
        if (seed := _whole(given)) >= 0:
            return seed
    except TypeError:
        pass
    raise ValueError(f"a seed is a whole number from 0 on, not {given!r}")


def _whole(given: Any) -> int:
    """As an int; TypeError for what is no whole number, and for True, which Python counts by."""
    if isinstance(given, bool):
        raise TypeError
    return index(given)


def _flat(state: Any) -> np.ndarray[Any, Any]:
    parts = [getattr(state, field.name).reshape(-1) for field in fields(state)]
    return torch.cat([part.to(torch.float32) for part in parts]).numpy()
