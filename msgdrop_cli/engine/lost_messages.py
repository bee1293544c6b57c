"""What is lost of the messages in training, or late, where it is done through a channel.

A channel that says how old what arrives is, no more; what is altered or of others is for
evaluation. The memory stores a byte a link: see `ops/late_messages.py`.
Letters: `R` runs, `E` games, `K` all other agents.
"""

import torch
from torch import Tensor

from msgdrop_cli.algorithms.learner import LearnerFactory
from msgdrop_cli.channels import LOST, Kind
from msgdrop_cli.definition.channel import NONE_BROKEN, Channel
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.engine.scene import kind_in, scene_of
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment


class LostMessages:
    """Which messages arrive in the games that are trained in, and how old they are."""

    def __init__(
        self, kind: Kind, hold: int, env: Environment, streams: Streams, games: int
    ) -> None:
        """kind: a channel that only tells ages; hold: how long the last one stands in for none."""
        self._kind, self._hold = kind, hold
        self._env, self._streams, self._games = env, streams, games
        self.reach = kind.oldest + hold
        """How old a message may be that is heard."""
        self.state: Tensor
        """The channel's, [R, E, any]."""
        self.arrives: Tensor
        """[R, E, N, K] uint8: 0, no message of the others is there; else 1 more than its age."""
        self.waited: Tensor
        """[R, E, N, K] uint8: steps since that one arrived."""

    def begin(self, games: Games) -> None:
        """The first step of every game."""
        self.arrives, self.waited, self.state = self._fresh(games, 0)

    def advance(self, before: Games, after: Games, ended: Tensor, steps: int) -> Tensor:
        """The next step: of `after`, whose games begin anew where they have ended [R, E].

        steps: that have been played since `begin`; no message is older.
        Returns what arrives in `before`, where they have not yet begun anew, [R, E, N, K].
        """
        last, *there = self._step(self.state, before, steps, (self.arrives, self.waited))
        fresh = self._fresh(after, steps)
        found = (_chosen(ended, new, old) for new, old in zip(fresh, (last, *there), strict=True))
        self.arrives, self.waited, self.state = found
        return last

    def _fresh(self, games: Games, steps: int) -> tuple[Tensor, Tensor, Tensor]:
        count, agents = self._kind.episode_uniforms(self._env.agents), self._env.agents
        uniforms = self._streams.uniforms("losses", self._games, count)
        shape = (*uniforms.shape[:2], agents, agents - 1)
        nothing = torch.zeros(shape, dtype=torch.uint8, device=uniforms.device)
        return self._step(self._kind.start(uniforms, agents), games, steps, (nothing, nothing))

    def _step(
        self, state: Tensor, games: Games, steps: int, last: tuple[Tensor, Tensor]
    ) -> tuple[Tensor, Tensor, Tensor]:
        """What arrives, since when, and the channel's state; last: the first two a step before."""
        kind, env = self._kind, self._env
        uniforms = self._streams.uniforms("losses", self._games, kind.step_uniforms(env.agents))
        found = kind.step(state, uniforms, scene_of(kind, env, games))
        # Nothing was said before an episode's beginning, nor before the first step of the training.
        said = games.elapsed.clamp(max=min(steps, LOST - 1))[..., None, None]
        arrives = torch.where(found.age <= said, found.age + 1, 0)
        before, waited = last
        waited = torch.where(arrives > 0, 0, waited + 1)
        stands = (arrives == 0) & (before > 0) & (waited <= self._hold)
        return torch.where(stands, before + 1, arrives), waited, found.state


def lost_messages_of(
    text: str, env: Environment, learner: LearnerFactory, streams: Streams, games: int
) -> LostMessages | None:
    """What is lost or late in training through the channel that is called so; None if nothing is.

    Raises DefinitionError for a channel that training cannot go through.
    """
    channel = Channel.read(text)
    if channel == NONE_BROKEN:
        return None
    kind = training_kind(text, env, learner, "training.channel")
    return LostMessages(kind, channel.hold, env, streams, games)


def training_kind(text: str, env: Environment, learner: LearnerFactory, said: str) -> Kind:
    """What the channel that is called so does in training.

    Raises DefinitionError, beginning with `said`, for one that training cannot go through.
    """
    channel = Channel.read(text)
    kind = kind_in(channel, env, said)
    if not learner.listens:
        raise DefinitionError(f"{said}: these agents hear nobody when they act")
    if why := _refusal(kind, channel, env.observation_size):
        raise DefinitionError(f"{said}: {channel.key} {why}, which is for eval")
    return kind


def _refusal(kind: Kind, channel: Channel, size: int) -> str | None:
    """Why a memory of ages is not enough for it; None if it is. size: numbers of a message."""
    if kind.message_uniforms(size) or channel.missing == "mean":
        return "changes the numbers of messages"
    if not kind.whole:
        return "hands over other messages than the sender's"
    if kind.links_to_find:
        return "needs a trained policy"
    if channel.scale != "trained" or channel.epsilon:
        return "says how trained agents act"
    if kind.oldest + channel.hold >= LOST:
        return f"hands over messages of {LOST} and more steps ago"
    return None


def _chosen(choose: Tensor, yes: Tensor, no: Tensor) -> Tensor:
    return torch.where(choose.view(*choose.shape, *[1] * (no.dim() - choose.dim())), yes, no)
