"""A small world for the tests of planning: two environments and a few algorithms, no torch."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from msgdrop_cli.definition.catalogue import Catalogue, NamedAlgorithm, PaperSizes
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.definition.spec import Definition, Profile, Variant


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """An environment's Config."""

    agents: int = 2
    time_limit: int = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Learner:
    """A learner's Config."""

    rate: float = 0  # written as an int on purpose: the run id must not care
    dropout: Literal["message", "element"] = "message"
    epsilon_anneal_env_steps: int = 7
    widths: tuple[int, ...] = (64, 48)
    comment: str = field(default="none", metadata={"cosmetic": True})
    neighbours: str = field(default="all", metadata={"later": True})

    def __post_init__(self) -> None:
        if not 0 <= self.rate <= 1:
            raise ValueError(f"rate must lie between 0 and 1, not {self.rate}")


@dataclass(frozen=True, slots=True)
class Share:
    """A channel's dataclass."""

    example: ClassVar[tuple[float, ...]] = (0.5,)
    rate: float

    def __post_init__(self) -> None:
        if not 0 <= self.rate <= 1:
            raise ValueError(f"rate must lie between 0 and 1, not {self.rate}")


CATALOGUE = Catalogue(
    environments={"tiny-n2": World(), "tiny-n4": World(agents=4)},
    algorithms={
        "plain": NamedAlgorithm(learner="lab", config_class=Learner, overrides={}),
        "dropping": NamedAlgorithm(learner="lab", config_class=Learner, overrides={"rate": 0.2}),
    },
    paper={
        ("tiny-n2", "lab"): PaperSizes(
            algorithm={"epsilon_anneal_env_steps": 100, "rate": 0.1}, training={}
        ),
        ("tiny-n4", "lab"): PaperSizes(algorithm={}, training={"train_env_steps": 44}),
    },
    channels={"links": Share, "loss": Share},
)

DEFINITION = Definition(
    name="sample",
    file="sample.toml",
    title="A sample",
    question="Why?",
    source="nowhere",
    environments=("tiny-n2", "tiny-n4"),
    channels=(NONE_BROKEN,),
    variants={
        "plain": Variant(label="Plain", algorithm={"name": "plain"}),
        "low": Variant(label="Low", algorithm={"name": "dropping"}),
        "high": Variant(
            label="High",
            algorithm={"name": "dropping", "rate": 0.9},
            training={"games": 2},
            environment={"time_limit": 20},
        ),
    },
    profiles={
        "paper": Profile(seeds=3),
        "quick": Profile(
            seeds=(4, 2),
            evaluation_episodes=10,
            environments=("tiny-n2",),
            variants=("high", "low"),
            channels=(Channel.read("half"),),
            algorithm={"rate": 0.3, "epsilon_anneal_env_steps": 5},
            training={"games": 3, "train_env_steps": 9},
            environment={"time_limit": 50},
        ),
    },
    claims=(),
)
