"""A folder of modules in which a file's name is the name that definitions call its content by."""

import importlib
import pkgutil
from collections.abc import Iterable
from functools import lru_cache
from types import ModuleType


def modules_in(package: str, path: Iterable[str]) -> dict[str, ModuleType]:
    """The modules of a package by name, in alphabetical order; each is loaded.

    path: the package's `__path__`, in which other people may have more folders.
    """
    return {name: importlib.import_module(f"{package}.{name}") for name in _names(tuple(path))}


@lru_cache  # a plan of a hundred runs asks hundreds of times
def _names(path: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted({found.name for found in pkgutil.iter_modules(path)}))
