"""What a channel is told of the games, in evaluation and in training."""

from msgdrop_cli.channels import Kind, Scene
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment


def check_means_something(kind: Kind, env: Environment, channel: str) -> None:
    """DefinitionError, which names the channel, if this game does not have what it asks for."""
    if kind.needs_positions and not hasattr(env, "places"):
        raise DefinitionError(f"{channel}: this game does not say where its agents are")
    try:
        kind.check(env.agents)
    except ValueError as error:
        raise DefinitionError(f"{channel}: {error}") from error


def scene_of(kind: Kind, env: Environment, games: Games) -> Scene:
    """The games as they stand; positions only if the channel asks for them."""
    positions = env.places(games.state) if kind.needs_positions else None  # type: ignore[attr-defined]
    return Scene(env.agents, games.elapsed, positions)
