"""What a run was trained with, as far as records are read without the Configs of its parts."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from msgdrop_cli.definition.spec import NAME
from msgdrop_cli.definition.strict import build
from msgdrop_cli.errors import DefinitionError


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """The tables of a resolved spec, each with what the program relies on; more may stand there."""

    environment: Mapping[str, Any]
    """`name`, and the rules of the game."""
    algorithm: Mapping[str, Any]
    """`learner`, and its settings."""
    training: Mapping[str, Any]
    """`train_env_steps`, and the rest of the TrainingSpec."""

    def __post_init__(self) -> None:
        for named in (self.environment.get("name"), self.algorithm.get("learner")):
            if not isinstance(named, str) or not NAME.fullmatch(named):
                raise ValueError("the name of a game and of a learner are needed")
        if type(self.training.get("train_env_steps")) is not int or self.train_env_steps < 1:
            raise ValueError("train_env_steps must be a whole number, at least 1")

    @property
    def learner(self) -> str:
        """The file in `algorithms`."""
        return str(self.algorithm["learner"])

    @property
    def train_env_steps(self) -> int:
        """Env steps of the whole run."""
        return int(self.training["train_env_steps"])


def read_setup(spec: Mapping[str, Any]) -> Setup | None:
    """The spec of a record, checked; None for one that another program wrote or somebody damaged.

    Who only lists runs goes on without it.
    """
    known = {field.name for field in fields(Setup)}
    try:
        return build(Setup, {key: spec[key] for key in spec if key in known}, "spec")
    except DefinitionError:
        return None
