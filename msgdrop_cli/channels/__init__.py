"""What becomes of messages on their way, one file a kind: its name in channels is its file's.

The file `one_way.py` holds the frozen dataclass `OneWay`, the kind `one-way`; its fields, all
numbers, are the settings in their order. Training dropout is none of these: see `ops`.
"""

import importlib
import pkgutil
from typing import Any, ClassVar, NamedTuple, Protocol

from torch import Tensor

from msgdrop_cli.definition.channel import Channel, build_channel


class Arriving(NamedTuple):
    """What one step's messages come to."""

    keep: Tensor
    """[..., N, S] float32, 1 where a message arrives; sender k of agent i is agent k, or k + 1
    from i on."""
    state: Tensor
    """What the channel needs to know in the next step."""


class Kind(Protocol):
    """One channel with its settings, in any number of games [...]; it draws no numbers itself.

    A dataclass that raises ValueError for settings out of range.
    """

    example: ClassVar[tuple[float, ...]]
    """Settings that it takes, for error messages and for the tests of every kind."""

    def episode_uniforms(self, agents: int) -> int:
        """Numbers that the start of an episode takes."""

    def step_uniforms(self, agents: int) -> int:
        """Numbers that each step of an episode takes."""

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """The state before the first step [..., any], from [..., episode_uniforms]."""

    def step(self, state: Tensor, uniforms: Tensor, agents: int) -> Arriving:
        """The messages of one step, from [..., step_uniforms]."""


def kinds() -> dict[str, type[Any]]:
    """The dataclass of every kind, by the kind's name."""
    found = {}
    for name in sorted(module.name for module in pkgutil.iter_modules(__path__)):
        module = importlib.import_module(f"{__name__}.{name}")
        found[name.replace("_", "-")] = getattr(module, name.title().replace("_", ""))
    return found


def kind_of(channel: Channel) -> Kind:
    """What a channel does. Raises DefinitionError: an unknown kind, or settings that do not fit."""
    kind: Kind = build_channel(channel, kinds())
    return kind
