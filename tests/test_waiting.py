"""What a GPU does instead of asking gives the bits that asking gives (msgdrop_envs/waiting.py)."""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import torch
from torch import Tensor

from msgdrop_envs import autoreset, registry
from msgdrop_envs.protocol import Transition
from msgdrop_envs.waterworld.config import PAPER, Config
from tests.test_environments import random_actions
from tests.waterworld_positions import build, closing_in, random_states

WATERWORLDS = {
    "n8": PAPER["waterworld-n8"],
    "alone": Config(pursuers=1, catchers=1, radius=0.05),
    "wide objects, no poison": Config(poison=0, sensors=7, sensor_width="object"),
    "raw, paid for each": Config(sensors_scaled=False, rewards_once=False, catchers=1),
    "all that can be shown": Config(senses_obstacle=True, senses_touch=True, sensor_range=0.4),
}


@contextmanager
def _unasked() -> Iterator[None]:
    """Here nothing may be asked."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("msgdrop_envs.waiting.can_ask", lambda tensor: False)
        yield


def _bits(tensor: Tensor) -> Tensor:
    """Equal only for equal bits: -0 is not 0."""
    return tensor.view(torch.int32) if tensor.is_floating_point() else tensor


def _assert_same(one: tuple[object, Transition], other: tuple[object, Transition]) -> None:
    (state, transition), (state2, transition2) = one, other
    for field in dataclasses.fields(state):  # type: ignore[arg-type]
        found, expected = getattr(state2, field.name), getattr(state, field.name)
        if isinstance(found, Tensor):
            assert torch.equal(_bits(found), _bits(expected)), field.name
    tensors = [(t.obs, t.reward, t.ended, *t.info.values()) for t in (transition, transition2)]
    assert all(torch.equal(_bits(a), _bits(b)) for a, b in zip(*tensors, strict=True))


@pytest.mark.parametrize("config", WATERWORLDS.values(), ids=WATERWORLDS)
def test_waterworld_is_the_same_unasked(config: Config) -> None:
    """Sensors over all pairs, and a new place for everything, of which the gone take theirs."""
    env, generator = build(config), torch.Generator().manual_seed(3)
    state, happened = random_states(config, 120, generator), 0
    for turn in range(12):
        state = closing_in(state, config, generator) if turn % 4 == 0 else state
        actions = torch.rand(120, env.agents, 2, generator=generator) * 2 - 1
        uniforms = torch.rand(120, env.step_uniforms, generator=generator)
        asked = env.step(state, actions, uniforms)
        with _unasked():
            _assert_same(asked, env.step(state, actions, uniforms))
        state, transition = asked
        happened += int((transition.obs[..., 2:] != 0).sum() > 0)
        happened += int(transition.info["catches"].sum() > 0)
    assert happened > 12


def test_what_is_met_at_distance_0_is_the_same_unasked() -> None:
    """A product with a negative cosine makes -0, which neither way shows."""
    config = PAPER["waterworld-n8"]
    env, state = build(config), random_states(config, 40, torch.Generator().manual_seed(3))
    state.positions[:, -1] = state.positions[:, 0]
    asked = env.observe(state)
    with _unasked():
        assert torch.equal(_bits(env.observe(state)), _bits(asked))


@pytest.mark.parametrize("name", sorted(registry.settings()))
def test_a_restart_is_the_same_unasked(name: str) -> None:
    """Games of which none, some or all end: equal games, whoever looks first."""
    config = dataclasses.replace(registry.settings()[name], time_limit=4)
    env, generator = registry.make(config), torch.Generator().manual_seed(4)
    shape, ends = (2, 6), 0
    elapsed = torch.tensor([[0, 1, 1, 1, 3, 3]] * 2)
    games = autoreset.start(
        env, torch.rand(*shape, env.reset_uniforms, generator=generator), elapsed
    )
    for _ in range(8):
        actions = random_actions(env, shape, generator)
        numbers = torch.rand(*shape, env.step_uniforms, generator=generator)
        fresh = torch.rand(*shape, env.reset_uniforms, generator=generator)
        asked = autoreset.step(env, games, actions, numbers, fresh)
        with _unasked():
            unasked = autoreset.step(env, games, actions, numbers, fresh)
        _assert_same(asked, unasked)
        assert torch.equal(asked[0].obs, unasked[0].obs)
        ends += int(asked[1].ended.sum())
        games = asked[0]
    assert ends == 2 * 6 * 2
