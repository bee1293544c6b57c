"""docs/environments.md: its code runs, its tables are the protocol's."""

from dataclasses import fields
from typing import Any

import pytest
import torch

from msgdrop_envs import registry
from msgdrop_envs.protocol import Environment, Transition
from tests.markdown import named, page

PAGE = page("environments.md")


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the page's blocks of code have made, one after the other."""
    found: dict[str, Any] = {}
    for code in PAGE.code("python"):
        exec(code, found)
    return found


def test_the_first_steps_are_the_same_wherever_they_are_played(names: dict[str, Any]) -> None:
    """In the shapes that stand there; the seed is all that they depend on."""
    env = registry.make("pursuit-n6")
    other: dict[str, Any] = {}
    assert names["seen"].shape == (3, 4, env.agents, env.observation_size)
    exec(PAGE.code("python")[0], other)
    for field in fields(names["after"]):
        assert torch.equal(getattr(names["after"], field.name), getattr(other["after"], field.name))
        assert getattr(names["again"][0], field.name).shape[:2] == (3, 4)


def test_episodes_end_and_start_anew(names: dict[str, Any]) -> None:
    """Two time limits of eight games lie in a thousand steps."""
    assert names["ended"] >= 16
    assert bool((names["games"].elapsed < names["env"].time_limit).all())


def test_baselines_act(names: dict[str, Any]) -> None:
    """One action for each agent of each game."""
    assert names["actions"].shape == (5, names["env"].agents)
    assert names["actions"].dtype == torch.int64


def test_the_tables_are_the_protocol() -> None:
    """Every attribute and call of an environment, every field of a transition."""
    rows = PAGE.section("An environment").rows()
    attributes = [n for row in rows for n in named(row[0]) if "(" not in n]
    calls = [n.partition("(")[0] for row in rows for n in named(row[0]) if "(" in n]
    assert attributes == list(Environment.__annotations__)
    public = {name for name, value in vars(Environment).items() if callable(value)}
    assert set(calls) == {name for name in public if not name.startswith("_")}
    assert [named(row[0])[0] for row in PAGE.section("A Transition").rows()] == list(
        Transition._fields
    )


def test_what_is_whole_numbers_and_what_is_not() -> None:
    """As the table says of `observation_dtype`."""
    found = {name: registry.make(name).observation_dtype for name in registry.settings()}
    for name, dtype in found.items():
        assert dtype.is_floating_point != name.startswith("pursuit")
        assert dtype in (torch.float32, torch.uint8, torch.int8)
