"""Carries the messages of whole episodes through a channel, to receivers that may fill gaps.

The channel says how old the message is that arrives on each link, 0 or LOST as a rule; the messages
of as many steps as it may go back are kept. Letters: `P` episodes still in play, of E.
"""

import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, Arriving, others
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.scene import kind_in, scene_of
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
        self._kind = kind = kind_in(channel, env, f"channel {channel.key}")
        self._episodes, self._playing = episodes, torch.arange(episodes, device=streams.device)
        uniforms = streams.uniforms("links", episodes, kind.episode_uniforms(env.agents))
        if lost is not None:
            uniforms = lost.float().flatten().expand_as(uniforms)
        self._state = kind.start(uniforms, env.agents)
        self._senders = others(env.agents, streams.device)  # [N, S]
        self._said: list[Tensor] = []
        """[P, N, M] each: the messages of the last steps, this step's first."""
        self._filled: _Filled | None = None

    def arriving(self, games: Games, playing: Tensor) -> Arriving:
        """How old what arrives in the next step is; games [1, P], playing [P]: which they are."""
        self._forget_all_but(playing)
        kind, env = self._kind, self._env
        uniforms = self._streams.uniforms("links", self._episodes, kind.step_uniforms(env.agents))
        found = kind.step(self._state, uniforms[:, playing], scene_of(kind, env, games))
        self._state = found.state
        if kind.oldest == 0:
            return found
        # Before an episode's beginning nothing was said.
        early = found.age > games.elapsed[..., None, None]
        return found._replace(age=found.age.masked_fill(early, LOST))

    def _forget_all_but(self, playing: Tensor) -> None:
        """Drop what is remembered of episodes that have ended."""
        if len(playing) == len(self._playing):
            return
        place = torch.empty(self._episodes, dtype=torch.long, device=playing.device)
        place[self._playing] = torch.arange(len(self._playing), device=playing.device)
        kept, self._playing = place[playing], playing
        self._state = self._state[:, kept]
        self._said = [said[kept] for said in self._said]
        if self._filled is not None:
            self._filled.keep_only(kept)

    def __call__(self, games: Games, playing: Tensor, said: Tensor) -> Received:
        """What the receivers make of it; said: [1, P, N, M], what the agents say in this step."""
        found = self.arriving(games, playing)
        keep = (found.age != LOST).float()
        plain = found.speaker is None and found.game is None and self._channel.missing == "zero"
        altered = self._kind.message_uniforms(said.shape[-1]) > 0
        scale = self._channel.scale
        if plain and not altered and self._kind.oldest == 0:
            return Received(keep, scale=scale)
        messages = self._messages(said[0], found)
        if self._channel.missing != "zero":
            if self._filled is None:
                self._filled = _Filled(self._channel.hold, messages)
            messages, keep = self._filled.fill(messages, found.age[0] != LOST)
        return Received(keep, messages[None], scale)

    def _messages(self, said: Tensor, found: Arriving) -> Tensor:
        """The messages themselves, [P, N, S, M]; anything where none arrives. said: [P, N, M]."""
        numbers = self._kind.message_uniforms(said.shape[-1])
        if numbers:
            shape = (self._episodes, self._env.agents, numbers)
            uniforms = self._streams.rows("noise", self._playing, *shape)[0]
            said = self._kind.alter(said.float(), uniforms)
        speaker = self._senders if found.speaker is None else found.speaker[0]
        if self._kind.oldest:
            self._said = [said, *self._said[: self._kind.oldest]]
            said = torch.cat(self._said)  # [ages * P, N, M]
        # The row of each message among all that have been said.
        games, agents = len(self._playing), self._env.agents
        game = torch.arange(games, device=said.device) if found.game is None else found.game[0]
        age = found.age[0].clamp(max=len(said) // games - 1).long()
        rows = (age * games + game[:, None, None]) * agents + speaker  # [P, N, S]
        messages = said.flatten(0, 1).index_select(0, rows.flatten())
        return messages.view(*rows.shape, -1)


class _Filled:
    """Receivers that put something where no message arrives: the last one, or their mean."""

    def __init__(self, hold: int, like: Tensor) -> None:
        """hold: for how many steps a message stands in, 0 for the mean; like: [P, N, S, M]."""
        self._hold = hold
        self._last = torch.zeros_like(like, dtype=None if hold else torch.float32)
        """The last message of each link, or the sum of all, [P, N, S, M]."""
        self._count = torch.full_like(like[..., 0], -1 if hold else 0, dtype=torch.long)
        """Steps since it arrived (-1: none has), or how many have arrived, [P, N, S]."""

    def keep_only(self, episodes: Tensor) -> None:
        """Forget the others."""
        self._last, self._count = self._last[episodes], self._count[episodes]

    def fill(self, messages: Tensor, arrives: Tensor) -> tuple[Tensor, Tensor]:
        """What the receivers have, [P, N, S, M], and where, [1, P, N, S]; arrives [P, N, S]."""
        count, here = self._count, arrives[..., None]
        if self._hold:
            self._last = messages = torch.where(here, messages, self._last)
            self._count = count = torch.where(arrives, 0, count + (count >= 0))
            return messages, ((count >= 0) & (count <= self._hold)).float()[None]
        self._last += messages * here
        self._count = count = count + arrives
        mean = self._last / count.clamp(min=1)[..., None]
        return torch.where(here, messages, mean), (count > 0).float()[None]
