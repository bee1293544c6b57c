"""The scale that a question is asked at, by its name."""

from msgdrop_cli.definition.spec import Definition, Profile
from msgdrop_cli.definition.strict import Where
from msgdrop_cli.errors import nearest


def profile_called(definition: Definition, name: str) -> Profile:
    """The profile of that name; DefinitionError where the question has none."""
    if name not in definition.profiles:
        problem = f"no profile of {definition.file} is called {name[:64]!r}"
        raise Where("--profile").error(f"{problem}; {nearest(name[:64], definition.profiles)}")
    return definition.profiles[name]
