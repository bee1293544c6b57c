"""What becomes of messages on their way, one file a kind: its name in channels is its file's.

The file `one_way.py` holds the frozen dataclass `OneWay`, the kind `one-way`; its fields, numbers
but for the file of `trace`, are the settings in their order. Training dropout is none of these: see
`ops`. What a channel does is mostly said by how old the message is that arrives: 0, it is this
step's; 3, of three steps ago; LOST, none arrives. `engine/delivery.py` hands over the messages of
that age.
"""

from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor

from msgdrop_cli.definition import traces
from msgdrop_cli.definition.channel import Channel, build_channel
from msgdrop_cli.definition.modules import modules_in

LOST = traces.LOST
"""The age of a message that does not arrive."""


class Scene(NamedTuple):
    """What a channel may know of the games [...] in a step."""

    agents: int
    elapsed: Tensor
    """[...] int64: steps since the episode began."""
    positions: Tensor | None = None
    """[..., N, 2] float32 in the game's unit; only for kinds that ask for them."""


class Arriving(NamedTuple):
    """What one step's messages come to; sender k of agent i is agent k, or k + 1 from i on."""

    age: Tensor
    """[..., N, S] uint8: how many steps ago what arrives was said; LOST if nothing arrives."""
    state: Tensor
    """What the channel needs to know in the next step."""
    speaker: Tensor | None = None
    """[..., N, S] int64: who said what arrives, if not the sender."""
    game: Tensor | None = None
    """[...] int64: in which of the games of the last dimension it was said, if not in this."""


class Kind:
    """One channel with its settings, in any number of games [...]; it draws no numbers itself.

    A dataclass that raises ValueError for settings out of range. What follows is a channel that
    needs no numbers and remembers nothing; a kind says at least `step` and `example`.
    """

    example: ClassVar[tuple[float, ...]]
    """Settings that it takes, for error messages and for the tests of every kind."""
    needs_positions: ClassVar[bool] = False
    """Whether it hangs on where the agents are."""

    whole: ClassVar[bool] = True
    """Whether what arrives is what its own sender said in the same game."""

    def check(self, agents: int) -> None:
        """ValueError for settings that have no meaning in a game of so many agents."""

    @property
    def oldest(self) -> int:
        """The greatest age that it gives."""
        return 0

    @property
    def links_to_find(self) -> int:
        """How many links are to be found that hurt the policy most (engine/worst_links.py)."""
        return 0

    def episode_uniforms(self, agents: int) -> int:
        """Numbers that the start of an episode takes."""
        return 0

    def step_uniforms(self, agents: int) -> int:
        """Numbers that each step of an episode takes."""
        return 0

    def message_uniforms(self, size: int) -> int:
        """Numbers that `alter` takes for each message of so many numbers; 0 if it alters none."""
        return 0

    def start(self, uniforms: Tensor, agents: int) -> Tensor:
        """The state before the first step [..., any], from [..., episode_uniforms]."""
        return uniforms

    def step(self, state: Tensor, uniforms: Tensor, scene: Scene) -> Arriving:
        """What arrives in one step, from [..., step_uniforms]."""
        raise NotImplementedError

    def alter(self, messages: Tensor, uniforms: Tensor) -> Tensor:
        """What becomes of the numbers of messages [..., M], from [..., message_uniforms]."""
        return messages


def lost_where(lost: Tensor) -> Tensor:
    """Ages of messages of which those [...] bool are lost and the others arrive at once."""
    return lost.to(torch.uint8) * LOST


def nothing_lost(scene: Scene) -> Tensor:
    """Ages [..., N, S] where every message arrives at once."""
    shape = (*scene.elapsed.shape, scene.agents, scene.agents - 1)
    return torch.zeros(shape, dtype=torch.uint8, device=scene.elapsed.device)


def by_message(numbers: Tensor, agents: int) -> Tensor:
    """One number for each directed message: [..., N, S], from the first N*S of [..., any]."""
    return numbers[..., : agents * (agents - 1)].view(*numbers.shape[:-1], agents, agents - 1)


def others(agents: int, device: torch.device | str = "cpu") -> Tensor:
    """Sender k of agent i, [N, S] int64."""
    rows = [[j for j in range(agents) if j != i] for i in range(agents)]
    return torch.tensor(rows, device=device)


def check_share(name: str, value: float) -> None:
    """ValueError unless it lies between 0 and 1; NaN never does."""
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{name} must lie between 0 and 1, not {value:g}")


def check_whole(name: str, value: float, least: int, most: int) -> None:
    """ValueError unless it is a whole number from `least` to `most`."""
    if not (least <= value <= most and value == int(value)):
        raise ValueError(f"{name} must be a whole number from {least} to {most}, not {value:g}")


def check_at_most(name: str, value: float, most: int, agents: int) -> None:
    """ValueError if it is more than there can be among so many agents."""
    if value > most:
        raise ValueError(f"{name} is at most {most} among {agents} agents, not {value:g}")


def kinds() -> dict[str, type[Any]]:
    """The dataclass of every kind, by the kind's name."""
    return {
        name.replace("_", "-"): getattr(module, name.title().replace("_", ""))
        for name, module in modules_in(__name__, __path__).items()
    }


def kind_of(channel: Channel) -> Kind:
    """What a channel does. Raises ValueError: an unknown kind, or settings that do not fit."""
    kind: Kind = build_channel(channel, kinds())
    return kind
