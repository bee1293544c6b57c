"""The seeds of a plan: what `--seeds` says, and what a profile says."""

from msgdrop_cli.definition.spec import MOST_SEEDS
from msgdrop_cli.definition.strict import Where, shown
from msgdrop_cli.definition.typed_numbers import whole_number

_LARGEST_SEED = 2**31 - 1


def parse_seeds(text: str, option: str = "--seeds") -> tuple[int, ...]:
    """The seeds that `--seeds` asks for: `3` means 1, 2 and 3; `1,5,9` exactly these; `7,` just 7.

    Raises DefinitionError for anything but different whole numbers from 1 to 2**31 - 1.
    """
    where = Where(option)
    try:
        numbers = tuple(whole_number(word) for word in text.removesuffix(",").split(","))
    except ValueError:
        expected = "expected a count (3) or a list of seeds (1,5,9)"
        raise where.error(f"{expected}, not {shown(text)}") from None
    return checked_seeds(numbers if "," in text else numbers[0], where)


def checked_seeds(seeds: int | tuple[int, ...], where: Where) -> tuple[int, ...]:
    """A count n as 1 to n, a list as it is; DefinitionError for too many, or what is no seed."""
    if isinstance(seeds, int):
        if not 1 <= seeds <= MOST_SEEDS:
            raise where.error(f"expected 1 to {MOST_SEEDS} seeds, not {shown(seeds)}")
        return tuple(range(1, seeds + 1))
    if not 1 <= len(seeds) <= MOST_SEEDS or len(set(seeds)) < len(seeds):
        raise where.error(f"expected 1 to {MOST_SEEDS} seeds, all different")
    for seed in seeds:
        if not 1 <= seed <= _LARGEST_SEED:
            raise where.error(f"a seed lies between 1 and {_LARGEST_SEED}, not {shown(seed)}")
    return seeds
