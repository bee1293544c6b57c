"""What is lost of the messages in training, where it is done through a channel.

A channel that only loses messages, in the step in which they are said; what is older or altered is
for evaluation. Letters: `R` runs, `E` games.
"""

import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, Kind
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.scene import kind_in, scene_of
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.received import Heard, Received
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment


class LostMessages:
    """Which messages arrive in the games that are trained in."""

    def __init__(self, kind: Kind, env: Environment, streams: Streams, games: int) -> None:
        """kind: a channel that only loses messages."""
        self._kind, self._env, self._streams, self._games = kind, env, streams, games
        self.state: Tensor
        """The channel's, [R, E, any]."""
        self.arrives: Tensor
        """[R, E, N, N-1] uint8: which of this step's messages arrive."""

    def begin(self, games: Games) -> None:
        """The first step of every game."""
        self.arrives, self.state = self._fresh(games)

    def advance(self, before: Games, after: Games, ended: Tensor) -> Tensor:
        """The next step: of `after`, whose games begin anew where they have ended [R, E].

        Returns what arrives in `before`, where they have not yet begun anew, [R, E, N, N-1].
        """
        last, state = self._step(self.state, before)
        fresh, begun = self._fresh(after)
        self.arrives = _chosen(ended, fresh, last)
        self.state = _chosen(ended, begun, state)
        return last

    @property
    def received(self) -> Heard:
        """For who acts."""
        return Received(self.arrives.float())

    def _fresh(self, games: Games) -> tuple[Tensor, Tensor]:
        count = self._kind.episode_uniforms(self._env.agents)
        uniforms = self._streams.uniforms("losses", self._games, count)
        return self._step(self._kind.start(uniforms, self._env.agents), games)

    def _step(self, state: Tensor, games: Games) -> tuple[Tensor, Tensor]:
        kind, env = self._kind, self._env
        uniforms = self._streams.uniforms("losses", self._games, kind.step_uniforms(env.agents))
        found = kind.step(state, uniforms, scene_of(kind, env, games))
        return (found.age != LOST).to(torch.uint8), found.state


def lost_messages_of(
    text: str, env: Environment, streams: Streams, games: int
) -> LostMessages | None:
    """What is lost in training through the channel that is called so; None if nothing is.

    Raises DefinitionError for a channel that training cannot go through.
    """
    channel = Channel.read(text)
    if channel == NONE_BROKEN:
        return None
    kind = kind_in(channel, env, "training.channel")
    size = env.observation_size
    only_loses = kind.oldest == 0 and not kind.message_uniforms(size) and not kind.links_to_find
    if not (only_loses and kind.whole and channel.plain):
        raise DefinitionError(
            f"training.channel: {channel.key} does more than lose messages, which is for eval"
        )
    return LostMessages(kind, env, streams, games)


def _chosen(choose: Tensor, yes: Tensor, no: Tensor) -> Tensor:
    return torch.where(choose.view(*choose.shape, *[1] * (no.dim() - choose.dim())), yes, no)
