"""Runs as tools for several tasks want them: the same algorithms and seeds in each size of a game.

What does not fit is left out, and told.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from msgdrop_cli.analysis.labels import with_overrides
from msgdrop_cli.analysis.summary import Arm, Group, Summary


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """The sizes of one game (`pursuit-n6`, `pursuit-n8`) at one scale."""

    game: str
    """What they have in common: `pursuit`."""
    profile: str
    train_env_steps: int
    metric: str
    """The headline, the same in all."""
    higher_is_better: bool
    sizes: tuple[str, ...]
    algorithms: Mapping[str, Mapping[str, Arm]]
    """By their names, then by size; each has been in all of them."""
    seeds: Mapping[str, tuple[int, ...]]
    """Of each algorithm: finished in all sizes."""
    left_out: tuple[str, ...]
    """Runs that are not in it, in words."""

    @property
    def name(self) -> str:
        """For a file."""
        return f"{self.game}-{self.profile}-{self.train_env_steps}"


def studies_of(summary: Summary) -> list[Study]:
    """Every game at every scale that has a finished run."""
    found: dict[tuple[str, str, int, str], dict[str, dict[str, Arm]]] = defaultdict(dict)
    for group in summary.groups:
        metric = summary.metrics(group.environment).headline.name
        for name, arm in _named(summary, group).items():
            game = group.environment.rpartition("-")[0] or group.environment
            key = (game, group.profile, group.train_env_steps, metric)
            found[key].setdefault(group.environment, {})[name] = arm
    return [_study(summary, *key, games) for key, games in sorted(found.items())]


def _named(summary: Summary, group: Group) -> dict[str, Arm]:
    """The arms with finished runs by names that differ, without commas, which marl-eval forbids.

    What was overridden of all is said: in another size of the game it may be otherwise.
    """
    arms = [arm for arm in summary.arms_of(group) if arm.done]
    shared = summary.overrides_of(group)
    labels = [with_overrides(arm.label, arm.variant, shared).replace(",", ";") for arm in arms]
    times = Counter(labels)
    return {
        label if times[label] == 1 else f"{arm.variant}: {label}": arm
        for label, arm in zip(labels, arms, strict=True)
    }


def _study(
    summary: Summary,
    game: str,
    profile: str,
    steps: int,
    metric: str,
    sizes: Mapping[str, Mapping[str, Arm]],
) -> Study:
    everywhere = [name for name in next(iter(sizes.values())) if _in_all(name, sizes)]
    seeds = {
        name: tuple(
            sorted(
                set.intersection(
                    *({run.seed for run in arms[name].done} for arms in sizes.values())
                )
            )
        )
        for name in everywhere
    }
    left_out = [
        f"{size}: {name}, which is not in every size of the game"
        for size, arms in sizes.items()
        for name in arms
        if name not in everywhere
    ]
    for size, arms in sizes.items():
        for name in everywhere:
            others = [run.seed for run in arms[name].done if run.seed not in seeds[name]]
            left_out += _others(size, name, others)
    first = summary.metrics(next(iter(sizes))).headline
    return Study(
        game=game,
        profile=profile,
        train_env_steps=steps,
        metric=metric,
        higher_is_better=first.higher_is_better,
        sizes=tuple(sizes),
        algorithms={
            name: {size: arms[name] for size, arms in sizes.items()} for name in everywhere
        },
        seeds=seeds,
        left_out=tuple(left_out),
    )


def _in_all(name: str, sizes: Mapping[str, Mapping[str, Arm]]) -> bool:
    return all(name in arms for arms in sizes.values())


def _others(size: str, name: str, seeds: Sequence[int]) -> list[str]:
    numbers = ", ".join(map(str, seeds))
    return [f"{size}: seeds {numbers} of {name}, which are not in every size"] if seeds else []
