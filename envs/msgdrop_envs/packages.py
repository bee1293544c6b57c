"""Where games stand: the folders beside this file, and the packages of other people.

Nothing is loaded here, so that help and the TAB key can ask without waiting for torch.
"""

import pkgutil
from importlib.metadata import entry_points

import msgdrop_envs

GROUP = "msgdrop.environments"
"""The entry points of other people's games: each is the name of a package with a `rules.py`."""


def packages() -> list[str]:
    """The package of every game: ours, then those that are installed, in alphabetical order."""
    beside = pkgutil.iter_modules(msgdrop_envs.__path__, f"{msgdrop_envs.__name__}.")
    ours = [module.name for module in beside if module.ispkg]
    return ours + theirs()


def theirs() -> list[str]:
    """Those of other people alone."""
    return sorted({point.value for point in entry_points(group=GROUP)})
