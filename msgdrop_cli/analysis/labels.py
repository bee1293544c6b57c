"""What tells an arm from others of its group, in the words that stand behind its label."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def shared_overrides(arms: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Of the overrides of each arm those that all have; what was set for one alone is not shared.

    They are said of the group, once.
    """
    return tuple(
        each
        for each in (arms[0] if arms else ())
        if not each.startswith("variants.") and all(each in arm for arm in arms)
    )


def without_variant(override: str, variant: str) -> str:
    """`variants.md-0.2.algorithm.rate=0.3` as `algorithm.rate=0.3`."""
    return override.removeprefix(f"variants.{variant}.")


def with_overrides(label: str, variant: str, overrides: Iterable[str]) -> str:
    """A label with what was overridden, all of it: `DCC-MD 0.2 (rate=0.3)`."""
    return label + remarks(variant, overrides, {}, ())


def remarks(
    variant: str,
    overrides: Iterable[str],
    setup: Mapping[str, Any],
    setups: Iterable[Mapping[str, Any]],
) -> str:
    """What follows a label, ` (gamma=0.9, rate=0.3)`: overrides, and where set-ups differ.

    setups: all of the variant in the group, each a nested table as `setup`, the arm's own.
    """
    others, mine = [dict(leaves(each)) for each in setups], dict(leaves(setup))
    differing = [key for key in mine if len({str(other.get(key)) for other in others}) > 1]
    paths = [without_variant(each, variant) for each in overrides]
    paths += [f"{path}={mine[path]}" for path in differing]
    words = dict.fromkeys(path.partition(".")[2] for path in paths)
    return f" ({', '.join(words)})" if words else ""


def leaves(table: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """The values of a nested table by their paths: `algorithm.rate`, 0.2."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
