"""The values that say what is to be trained; made by `load` and `plan`, read by everybody."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from msgdrop_cli.definition.channel import NONE_BROKEN, Channel, check_each_once

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
"""Names of definitions, variants, profiles and environments: they become names of folders."""
FOREIGN = "foreign"
"""What files of sizes call all games of other people that are named by a factory."""
MOST_LOG_ROWS = 100_000
"""Rows of a log: more are refused before they are written, and when they are read."""
MOST_EPISODES = 10_000
"""Of one evaluation; a log has room for ten of them."""

MOST_LOOKS, MOST_IN_FAMILY = 12, 10
"""Of a registration; all 2^n sets of the claims of a family are tested."""

MOST_SEEDS = 1_000
"""Of a plan, so of a look."""


def is_factory(environment: str) -> bool:
    """Whether it is `package.module:factory`, which makes a game of other people."""
    return ":" in environment


def record_name(environment: str) -> str:
    """What records and folders call an environment: a factory with a dot for its colon."""
    return environment.replace(":", ".")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSpec:
    """How long a run trains and how many games feed it. Cosmetic fields do not enter the run id."""

    train_env_steps: int = 5_000_000
    """Environment steps of the whole run, all parallel games counted (ours, PAPER.md)."""
    games: int = 8
    """Parallel games that fill one replay memory; updates per env step stay the paper's (ours)."""
    log_every_env_steps: int = 5_000
    """Window of one row of `metrics.jsonl` (ours)."""
    checkpoint_every_env_steps: int = field(default=100_000, metadata={"cosmetic": True})
    """Env steps between two checkpoints; never changes a result (ours)."""
    channel: str = field(default="links:0", metadata={"later": True})
    """What messages go through in training, if it loses or delays them: loss:0.2, delay:3 (ours).
    """

    def __post_init__(self) -> None:
        try:  # `half` and `links:0.5` are one
            through = Channel.read(self.channel)
            if through.file is not None:
                raise ValueError("a recorded trace is for eval")
            object.__setattr__(self, "channel", through.key)
        except ValueError as error:
            raise ValueError(f"channel: {error}") from error
        for name in (
            "train_env_steps",
            "games",
            "log_every_env_steps",
            "checkpoint_every_env_steps",
        ):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        if self.train_env_steps > MOST_LOG_ROWS * self.log_every_env_steps:
            raise ValueError(
                f"log_every_env_steps must be at least train_env_steps / {MOST_LOG_ROWS:,}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSpec:
    """One run, completely: the result depends on nothing else (test_independence)."""

    environment: str
    """Name of the paper's setting, e.g. `pursuit-n6`."""
    environment_config: Any
    """The environment's own frozen Config."""
    algorithm: str
    """Name of the learner's file in `algorithms`, e.g. `dcc`."""
    algorithm_config: Any
    """The learner's own frozen Config."""
    training: TrainingSpec
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedRun:
    """One variant with one seed, and the words people know it by (cosmetic, not in the id)."""

    run_id: str
    """First 8 hex digits of the SHA-256 of the resolved spec (`run_id.py`)."""
    variant: str
    label: str
    definition: str
    profile: str
    spec: RunSpec
    overrides: tuple[str, ...] = ()
    """What `--set` changed: `algorithm.gamma=0.9`, `variants.md-0.2.algorithm.rate=0.3`."""
    registration: str | None = None
    """What had been registered when it was planned, by `registered_as` (cosmetic)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One ordering that is stated: `better` beats `worse` on `metric`."""

    says: str
    source: str
    better: str
    worse: str
    environment: str
    metric: str
    channel: Channel = NONE_BROKEN
    """Of the evaluation that is compared."""
    measure: Literal["evaluation", "learning"] = "evaluation"
    """`evaluation`: after training; `learning`: the mean of the whole training curve."""

    @property
    def family(self) -> tuple[str, str]:
        """Claims that share it are judged together: those of one figure, as a rule."""
        return self.environment, self.measure


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration:
    """What decides the claims of a question, settled before their runs are looked at."""

    looks: tuple[int, ...]
    """Numbers of seeds, each of them seeds 1 to n, at which there is a verdict, e.g. `[6, 10]`."""
    alpha_spent: tuple[float, ...]
    """Of all studies of wrong claims the share that may have decided one, by each of the looks,
    e.g. `[0.015, 0.05]`."""
    sides: Literal[1, 2] = 2
    """2: a claim may be contradicted; 1: it may not, e.g. `2`."""
    margin: Mapping[str, float] = field(default_factory=dict)
    """By metric: a difference that is surely smaller is called level, e.g.
    `{ catches_per_500 = 1.0 }`."""
    seen: int = 0
    """Seeds that had been looked at before this was registered; the alpha of that look is spent,
    e.g. `0`."""
    seen_in: Mapping[str, int] = field(default_factory=dict)
    """The games in which it was another number of seeds, e.g. `{ pursuit-n6 = 0 }`."""

    def __post_init__(self) -> None:
        increasing = all(0 < a < b for a, b in pairwise((1, *self.looks, MOST_SEEDS + 1)))
        if not increasing or not 1 <= len(self.looks) <= MOST_LOOKS:
            raise ValueError(
                f"looks needs 1 to {MOST_LOOKS} rising numbers of seeds, from 2 to {MOST_SEEDS:,}"
            )
        if len(self.alpha_spent) != len(self.looks):
            raise ValueError("alpha_spent must have a number for each of the looks")
        if not all(0 < a <= b < 1 for a, b in pairwise((self.alpha_spent[0], *self.alpha_spent))):
            raise ValueError("alpha_spent adds up: numbers between 0 and 1 that do not decrease")
        if any(margin <= 0.0 for margin in self.margin.values()):
            raise ValueError("a margin must be above 0")
        if min(self.seen, *self.seen_in.values(), 0) < 0:
            raise ValueError("seen cannot be negative")

    def in_game(self, environment: str) -> "Registration":
        """What decides the claims of one game: what was seen in others is nothing to it.

        environment: as records call it.
        """
        known = {record_name(game): seeds for game, seeds in self.seen_in.items()}
        return replace(self, seen=known.get(environment, self.seen), seen_in={})

    @property
    def alpha(self) -> float:
        """What is spent by the last look."""
        return self.alpha_spent[-1]

    @property
    def looks_gone(self) -> int:
        """How many looks had been seen, the last one whole or in part."""
        return sum(before < self.seen for before in (0, *self.looks[:-1]))

    @property
    def gone(self) -> float:
        """What is spent by the looks that had been seen, whether it could be used or not."""
        return (0.0, *self.alpha_spent)[self.looks_gone]

    def share(self, look: int) -> float:
        """What look number 0, 1, ... may spend at least, whatever was left before it."""
        return self.alpha_spent[look] - (self.alpha_spent[look - 1] if look else 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One arm of an ablation."""

    label: str
    """What tables and figures call it, e.g. `"DCC-MD 0.2"`."""
    algorithm: Mapping[str, Any]
    """The `name` that `--algorithm` takes; every other key is a setting that the variant changes,
    e.g. `{ name = "dcc-md", rate = 0.2 }`."""
    training: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the training that it changes, e.g. `{ games = 4 }`."""
    environment: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the game that it changes, e.g. `{ sight = 2 }`."""

    def __post_init__(self) -> None:
        if not isinstance(self.algorithm.get("name"), str):
            raise ValueError('algorithm needs the name of an algorithm, e.g. { name = "dcc" }')


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """One scale of an ablation: how much is trained and measured."""

    seeds: int | tuple[int, ...]
    """A count n means seeds 1 to n; a list means exactly these, e.g. `2`."""
    evaluation_episodes: int = 1_000
    """Episodes of each evaluation after training (paper l. 419: 1000), e.g. `200`."""
    environments: tuple[str, ...] | None = None
    """Only these of the question's games, e.g. `["pursuit-n6"]`."""
    variants: tuple[str, ...] | None = None
    """Only these of the question's variants, e.g. `["dcc", "md-0.2"]`."""
    channels: tuple[Channel, ...] | None = field(default=None, metadata={"also": "broken_links"})
    """An evaluation through each of these instead of the question's, e.g. `["none", "half"]`."""
    algorithm: Mapping[str, Any] = field(default_factory=dict)
    """Settings of every variant's algorithm, e.g. `{ batch_size = 64 }`."""
    training: Mapping[str, Any] = field(default_factory=dict, metadata={"advised": True})
    """Settings of every variant's training, e.g. `{ train_env_steps = 100_000 }`."""
    environment: Mapping[str, Any] = field(default_factory=dict)
    """Settings of every variant's game, e.g. `{ time_limit = 100 }`."""

    def __post_init__(self) -> None:
        if self.evaluation_episodes < 1:
            raise ValueError(
                f"evaluation_episodes must be at least 1, not {self.evaluation_episodes}"
            )
        if self.evaluation_episodes > MOST_EPISODES:
            raise ValueError(
                f"evaluation_episodes must be at most {MOST_EPISODES:,},"
                f" not {self.evaluation_episodes}"
            )
        if self.channels is not None:
            check_each_once(self.channels)


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """A question about message-dropout: what is compared, at which scales, and what is claimed."""

    name: str
    file: str
    """Where it came from; the first words of every error about it."""
    title: str
    question: str
    source: str
    environments: tuple[str, ...]
    """By the names that `--env` takes; records and claims have their `record_name`."""
    channels: tuple[Channel, ...]
    """One evaluation after training through each."""
    variants: Mapping[str, Variant]
    profiles: Mapping[str, Profile]
    claims: tuple[Claim, ...]
    registration: Registration | None = None
    """None: there are estimates, and no verdicts."""
    shipped: bool = False
    """It came with the program, so its claims are the paper's."""

    @property
    def traces(self) -> set[Path]:
        """The files of the recorded links that its channels name."""
        asked = {*self.channels, *(claim.channel for claim in self.claims)}
        for profile in self.profiles.values():
            asked |= {*(profile.channels or ())}
        return {each.file.path for each in asked if each.file and each.file.path}

    def games(self, profile: str) -> tuple[str, ...]:
        """The games of one of its profiles, by the names that `--env` takes."""
        return self.profiles[profile].environments or self.environments
