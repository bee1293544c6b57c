"""The claims that a profile can judge, from its name in the records alone."""

from dataclasses import replace

import pytest

from msgdrop_cli.definition.judged import judged_at
from msgdrop_cli.definition.load import list_askable, load_definition
from msgdrop_cli.definition.plan import plan
from msgdrop_cli.definition.spec import Profile
from msgdrop_cli.engine.offers import catalogue
from msgdrop_cli.errors import DefinitionError


@pytest.mark.parametrize("name", list_askable())
def test_they_are_those_of_the_plan(name: str) -> None:
    """In every profile of every question, and under a reading."""
    definition = load_definition(name)
    for profile in definition.profiles:
        asked = plan(definition, profile, catalogue(), seeds=[1])
        assert judged_at(definition, asked.profile) == asked.claims
        assert judged_at(definition, f"{profile}-capture-once") == asked.claims


def test_the_longest_profile_that_fits_is_meant() -> None:
    """`quick-all-capture-once` is the profile quick-all under a reading, not quick under two."""
    definition = load_definition("broken-links")
    few, every = Profile(seeds=1, variants=("dcc",)), Profile(seeds=1)
    two = replace(definition, profiles={"quick": few, "quick-all": every})
    assert judged_at(two, "quick-capture-once") == ()
    assert judged_at(two, "quick-all-capture-once") == definition.claims


def test_a_profile_that_the_question_has_not_is_refused() -> None:
    """The records of another question may lie in its folder."""
    with pytest.raises(DefinitionError, match="no profile is called 'mine'"):
        judged_at(load_definition("broken-links"), "mine")


def test_what_goes_on_with_no_reading_is_no_profile() -> None:
    """As everywhere else where a profile's name is read: `quick-mine` is not `quick`."""
    with pytest.raises(DefinitionError, match="no profile is called 'quick-mine'"):
        judged_at(load_definition("broken-links"), "quick-mine")
