"""Carries the messages of whole episodes through a channel, to receivers that may fill gaps.

The channel says how old the message is that arrives on each link, 0 or LOST as a rule; the messages
of as many steps as it may go back are kept. Letters: `P` episodes still in play, of E.
"""

import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, Arriving, Scene, kind_of, others
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.received import Received
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment


class Delivery:
    """What a channel delivers to the agents of E episodes, of one run, step by step.

    Every channel reads the same numbers, which are no game's: all of them meet the same games.
    """

    def __init__(
        self,
        channel: Channel,
        env: Environment,
        streams: Streams,
        episodes: int,
        lost: Tensor | None = None,
    ) -> None:
        """lost: [N, S] bool, the messages of the links that the channel asked to be found.

        Raises DefinitionError: there is no such channel, or not in this game.
        """
        self._channel, self._env, self._streams = channel, env, streams
        self._kind = kind = kind_of(channel)
        if kind.needs_positions and not hasattr(env, "places"):
            raise DefinitionError(
                f"channel {channel.key}: this game does not say where its agents are"
            )
        self._episodes, self._step = episodes, 0
        uniforms = streams.uniforms("links", episodes, kind.episode_uniforms(env.agents))
        if lost is not None:
            uniforms = lost.float().flatten().expand_as(uniforms)
        self._state = kind.start(uniforms, env.agents)
        self._senders = others(env.agents, streams.device)  # [N, S]
        self._said: list[Tensor] = []
        """[E, N, M] each: the messages of the last steps, this step's first."""
        self._filled: _Filled | None = None

    def arriving(self, games: Games, playing: Tensor) -> Arriving:
        """How old what arrives in the next step is; games [1, P], playing [P]: which they are."""
        kind, agents = self._kind, self._env.agents
        uniforms = self._streams.uniforms("links", self._episodes, kind.step_uniforms(agents))
        positions = self._env.places(games.state) if kind.needs_positions else None  # type: ignore[attr-defined]
        scene = Scene(agents, games.elapsed, positions)
        found = kind.step(self._state[:, playing], uniforms[:, playing], scene)
        self._state[:, playing] = found.state
        # Before an episode's beginning nothing was said.
        early = found.age > games.elapsed[..., None, None]
        return found._replace(age=found.age.masked_fill(early, LOST))

    def __call__(self, games: Games, playing: Tensor) -> Received:
        """What the receivers make of it; the messages are what the agents see."""
        found = self.arriving(games, playing)
        keep = (found.age != LOST).float()
        plain = found.speaker is None and found.game is None and self._channel.missing == "zero"
        altered = self._kind.message_uniforms(games.obs.shape[-1]) > 0
        scale = self._channel.scale
        if plain and not altered and self._kind.oldest == 0:
            return Received(keep, scale=scale)  # type: ignore[arg-type]
        messages = self._messages(games.obs[0], found, playing)
        if self._channel.missing != "zero":
            if self._filled is None:
                self._filled = _Filled(self._channel, self._episodes, messages)
            messages, keep = self._filled.fill(messages, keep[0], playing)
        return Received(keep, messages[None], scale)  # type: ignore[arg-type]

    def _messages(self, said: Tensor, found: Arriving, playing: Tensor) -> Tensor:
        """The messages themselves, [P, N, S, M]; anything where none arrives. said: [P, N, M]."""
        numbers = self._kind.message_uniforms(said.shape[-1])
        if numbers:
            shape = (self._episodes, self._env.agents, numbers)
            uniforms = self._streams.uniforms("noise", *shape)[0, playing]
            said = self._kind.alter(said.float(), uniforms)
        everybody = said.new_zeros(self._episodes, *said.shape[1:])
        everybody[playing] = said
        self._said = [everybody, *self._said[: self._kind.oldest]]
        age, games = found.age[0], playing[:, None, None]
        speaker = self._senders if found.speaker is None else found.speaker[0]
        if found.game is not None:
            games = playing[found.game[0]][:, None, None]
        if self._kind.oldest == 0:
            return everybody[games, speaker]
        kept = torch.stack(self._said)  # [ages, E, N, M]
        return kept[age.clamp(max=len(kept) - 1).long(), games, speaker]


class _Filled:
    """Receivers that put something where no message arrives: the last one, or their mean."""

    def __init__(self, channel: Channel, episodes: int, like: Tensor) -> None:
        self._hold = channel.hold
        shape, device = (episodes, *like.shape[1:]), like.device
        dtype = like.dtype if self._hold else torch.float32
        self._last = torch.zeros(shape, dtype=dtype, device=device)
        """The last message of each link, or the sum of all, [E, N, S, M]."""
        self._count = torch.zeros(shape[:-1], dtype=torch.long, device=device)
        """Steps since it arrived, or how many arrived, [E, N, S]; -1: none has."""
        if self._hold:
            self._count.fill_(-1)

    def fill(self, messages: Tensor, keep: Tensor, playing: Tensor) -> tuple[Tensor, Tensor]:
        """What the receivers have, [P, N, S, M], and where, [1, P, N, S]; keep [P, N, S]."""
        arrives = keep > 0
        last, count = self._last[playing], self._count[playing]
        if self._hold:
            last = torch.where(arrives[..., None], messages, last)
            count = torch.where(arrives, 0, count + (count >= 0))
            there = (count >= 0) & (count <= self._hold)
        else:
            last = last + messages * keep[..., None]
            count = count + arrives
            there = count > 0
        self._last[playing], self._count[playing] = last, count
        if not self._hold:
            mean = last / count.clamp(min=1)[..., None]
            last = torch.where(arrives[..., None], messages.float(), mean)
        return last, there.float()[None]
