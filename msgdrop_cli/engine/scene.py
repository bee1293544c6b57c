"""What a channel is told of the games, in evaluation and in training."""

from msgdrop_cli.channels import Kind, Scene
from msgdrop_cli.errors import DefinitionError
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Environment


def check_places(kind: Kind, env: Environment, channel: str) -> None:
    """DefinitionError, which names the channel, if it needs places that the game does not tell."""
    if kind.needs_positions and not hasattr(env, "places"):
        raise DefinitionError(f"{channel}: this game does not say where its agents are")


def scene_of(kind: Kind, env: Environment, games: Games) -> Scene:
    """The games as they stand; positions only if the channel asks for them."""
    positions = env.places(games.state) if kind.needs_positions else None  # type: ignore[attr-defined]
    return Scene(env.agents, games.elapsed, positions)
