"""Matplotlib under settings of our own, so that a figure depends on its records and on this room.

Nobody's matplotlibrc, MPLBACKEND, style or home directory can change a figure or prevent one.
"""

import gc
import logging
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

FONT = "DejaVu Sans"
"""Comes with matplotlib, so every machine has it."""
_RARELY = 100
"""Times as many objects as else are made before Python looks for garbage: some 10 MB more."""
_OURS: Mapping[str, Any] = MappingProxyType(
    {
        "font.family": [FONT],
        "text.parse_math": False,  # a label is what its author typed, with its dollars
        "svg.hashsalt": "msgdrop",  # else the names of parts are drawn anew by every process
        "pdf.fonttype": 42,  # whole letters, which printers and journals ask for
    }
)


@contextmanager
def own_settings() -> Iterator[None]:
    """Inside, matplotlib has its own defaults and ours; afterwards what it had before.

    What it has to say about files of the user's that it would like to have is not for the user.
    """
    logger = logging.getLogger("matplotlib")
    level, threshold = logger.level, gc.get_threshold()
    logger.setLevel(logging.ERROR)
    # Letters and axes are made by the million, and looking for garbage goes through all records.
    gc.set_threshold(_RARELY * threshold[0], *threshold[1:])
    try:
        _load()
        import matplotlib

        with matplotlib.rc_context():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", matplotlib.MatplotlibDeprecationWarning)
                defaults: Any = matplotlib.rcParamsDefault  # Any: its keys are typed one by one
                # What draws is chosen by the file's format, never by the setting `backend`.
                ours: Any = {k: v for k, v in dict.items(defaults) if k != "backend"}
                ours.update(_OURS)
                matplotlib.rcParams.update(ours)
            yield
    finally:
        gc.set_threshold(*threshold)
        logger.setLevel(level)


def _load() -> None:
    """Load matplotlib where it finds no settings: it stumbles over bad ones even if unused.

    It looks into the working directory first, whatever the environment says.
    """
    if "matplotlib" in sys.modules:
        return
    here = os.open(".", os.O_PATH)
    before = {name: os.environ.pop(name, None) for name in ("MPLBACKEND", "MATPLOTLIBRC")}
    try:
        os.chdir("/")
        os.environ["MATPLOTLIBRC"] = os.devnull
        import matplotlib  # noqa: F401
    finally:
        del os.environ["MATPLOTLIBRC"]
        os.environ.update({name: value for name, value in before.items() if value is not None})
        os.fchdir(here)
        os.close(here)
