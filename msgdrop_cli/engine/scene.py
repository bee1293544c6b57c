"""What a channel is told of the games, in evaluation and in training."""

from msgdrop_cli.channels import Kind, Scene, kind_of
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment


def kind_in(channel: Channel, env: Environment, said: str) -> Kind:
    """What the channel does in this game.

    Raises DefinitionError, beginning with `said`, for a channel that there is not, or if the game
    does not have what it asks for.
    """
    try:
        kind = kind_of(channel)
        kind.check(env.agents)
    except ValueError as error:
        raise DefinitionError(f"{said}: {error}") from error
    if channel.epsilon and not env.actions:
        raise DefinitionError(f"{said}: epsilon is for agents that have a choice of actions")
    if kind.needs_positions and not hasattr(env, "places"):
        raise DefinitionError(f"{said}: this game does not say where its agents are")
    return kind


def scene_of(kind: Kind, env: Environment, games: Games) -> Scene:
    """The games as they stand; positions only if the channel asks for them."""
    positions = env.places(games.state) if kind.needs_positions else None  # type: ignore[attr-defined]
    return Scene(env.agents, games.elapsed, positions)
