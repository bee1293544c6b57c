"""A trained policy, apart from any training: numpy in, numpy out.

policy = msgdrop_cli.load_policy("results/runs/pursuit-n6/md-0.2-s1-0a902d7b")
actions = policy.act(observations)
"""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from torch import Tensor

from msgdrop_cli.algorithms.discovery import learner_class
from msgdrop_cli.algorithms.learner import Learner
from msgdrop_cli.definition.run_id import spec_from_dict
from msgdrop_cli.definition.spec import RunSpec
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.engine.tensors import check_finite, copy_into, read_tensors
from msgdrop_cli.errors import DefinitionError, RecordError
from msgdrop_cli.messages.received import Received
from msgdrop_cli.records.store import POLICY, RUN, list_runs
from msgdrop_envs import registry
from msgdrop_envs.foreign.rules import Foreign
from msgdrop_envs.protocol import Environment

_Array = np.ndarray[Any, Any]
ObservationsT = TypeVar("ObservationsT", bound=Mapping[str, Any] | _Array)


class Trained(NamedTuple):
    """What a run's folder holds of a trained policy."""

    spec: RunSpec
    env: Environment
    learner: Learner
    """With the run's weights; `act_greedily` is the policy."""


def read_trained(run_path: Path, device: str = "cpu") -> Trained:
    """Read the policy of a finished run; RecordError if it cannot be read or does not fit."""
    record = list_runs(run_path)[0]
    try:
        spec = spec_from_dict(record.spec, catalogue(), f"{run_path / RUN}: spec")
        env = registry.make(spec.environment_config, device)
        learner = learner_class(spec.algorithm)([spec.algorithm_config], env, device)
    except DefinitionError as error:
        raise RecordError(str(error)) from error
    file, policy = run_path / POLICY, learner.policy(0)
    weights = read_tensors(file, policy)
    copy_into(policy, weights, file)
    check_finite(weights, file)
    return Trained(spec, env, learner)


class Policy:
    """The trained agents of one run; they act greedily, as in `msgdrop eval`."""

    def __init__(self, trained: Trained) -> None:
        self.environment = trained.spec.environment
        """The name of the setting that it was trained in, e.g. `pursuit-n6`."""
        self._env, self._learner = trained.env, trained.learner
        config = trained.spec.environment_config
        view = registry.view(config)
        names = view.agent_names if view else getattr(config, "agent_names", None)
        self.agents: tuple[str, ...] | None = names
        """Their names in the order of the networks; None for a game that names nobody."""

    def act(self, observations: ObservationsT, keep: Any = None) -> ObservationsT:
        """The actions of all agents; what is given by name is answered by name.

        observations: [..., N, O] for any number of games, or the dictionary of a PettingZoo
        environment, agent to what it sees in any shape. keep: which messages arrive, [..., N, S] of
        0 and 1 (sender k of agent i is agent k, or k + 1 from i on); None: all.
        Returns int64 [..., N], or float32 [..., N, A]: in [-1, 1], or in the bounds of the game of
        other people that it was trained in. Raises ValueError for other shapes, agents, or numbers
        that this game does not show, such as NaN.
        """
        if isinstance(observations, Mapping):
            rows = self._actions(self._rows(observations), keep)
            named = zip(self.agents or observations, rows, strict=True)
            answered = {name: row for name, row in named if name in observations}
            return answered  # type: ignore[return-value]
        return self._actions(observations, keep)  # type: ignore[return-value]

    def _rows(self, observations: Mapping[str, Any]) -> _Array:
        """What each agent sees, flat; zeros for who has left a game of other people, as trained."""
        names = self.agents or tuple(observations)
        missing, unknown = set(names) - set(observations), set(observations) - set(names)
        if unknown or (missing and not isinstance(self._env, Foreign)):
            raise ValueError(f"observations are needed of {list(names)}, not {list(observations)}")
        nothing = np.zeros(self._env.observation_size, np.float32)
        return np.stack([np.ravel(observations.get(name, nothing)) for name in names])

    def _actions(self, observations: Any, keep: Any) -> _Array:
        env = self._env
        obs = self._games(observations, "observations", env.observation_size)
        shown = obs.to(env.observation_dtype)
        if not shown.is_floating_point() and not torch.equal(shown.to(obs.dtype), obs):
            raise ValueError(f"observations of {self.environment} are {env.observation_dtype}")
        arrives = None if keep is None else self._games(keep, "keep", env.agents - 1).float()
        if arrives is not None and len(arrives[0]) != len(obs[0]):
            raise ValueError("keep must have the leading dimensions of observations")
        if arrives is not None and not ((arrives == 0) | (arrives == 1)).all():
            raise ValueError("keep must be 0 or 1 for each message")
        with torch.inference_mode():
            received = None if arrives is None else Received(arrives)
            actions = self._learner.act_greedily(shown, received)[0]  # [E, N] or [E, N, A]
            if isinstance(self._env, Foreign):
                actions = self._env.in_its_units(actions)
        found: _Array = actions.cpu().numpy()
        return found.reshape(*np.shape(observations)[:-2], *found.shape[1:])

    def _games(self, given: Any, name: str, width: int) -> Tensor:
        """One row of games, [1, E, N, width]; given: [..., N, width]."""
        numbers = np.asarray(given)
        if numbers.shape[-2:] != (self._env.agents, width):
            expected = f"[..., {self._env.agents}, {width}]"
            raise ValueError(f"{name} must be {expected}, not {list(numbers.shape)}")
        if numbers.dtype.kind not in "biuf" or not np.isfinite(numbers).all():
            raise ValueError(f"{name} must be finite numbers")
        return torch.as_tensor(numbers.reshape(1, -1, *numbers.shape[-2:]))


def load_policy(run_dir: str | PathLike[str]) -> Policy:
    """Load the policy of a finished run from its folder, e.g. one of those below results/published.

    Raises RecordError, in one line, for a folder that is none, or whose policy is missing or
    damaged.
    """
    path = Path(run_dir)
    check_trained(path)
    return Policy(read_trained(path))


def check_trained(path: Path) -> None:
    """RecordError, which says what it is instead, unless this is a run's folder with a policy."""
    if not (path / RUN).is_file():
        raise RecordError(f"{path}: is no run's folder: there is no {RUN} in it")
    [record] = list_runs(path)
    if not (path / POLICY).is_file():
        raise RecordError(f"{path}: has no {POLICY}: the run is {record.status}")
