"""The contract of every environment that the registry finds."""

import dataclasses
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_envs import autoreset, registry
from msgdrop_envs.protocol import Environment, Transition

SETTINGS = sorted(registry.settings())
GAMES, STEPS = 5, 40


def random_actions(env: Environment, batch: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Any actions: numbers of choices, or numbers in [-1, 1)."""
    if env.action_size:
        shape = (*batch, env.agents, env.action_size)
        return torch.rand(shape, generator=generator) * 2 - 1
    return torch.randint(env.actions, (*batch, env.agents), generator=generator)


class Player:
    """Plays games of one environment with random actions, all from one seed."""

    def __init__(self, env: Environment, batch: tuple[int, ...] = (GAMES,), seed: int = 1) -> None:
        self.env, self.batch = env, batch
        self.generator = torch.Generator().manual_seed(seed)
        elapsed = torch.zeros(batch, dtype=torch.int64)
        self.games = autoreset.start(env, self.uniforms(env.reset_uniforms), elapsed)

    def uniforms(self, count: int) -> Tensor:
        """Uniform numbers in [0, 1) for all games."""
        return torch.rand(*self.batch, count, generator=self.generator)

    def step(self) -> Transition:
        """One step of all games."""
        env = self.env
        actions = random_actions(env, self.batch, self.generator)
        self.games, transition = autoreset.step(
            env,
            self.games,
            actions,
            self.uniforms(env.step_uniforms),
            self.uniforms(env.reset_uniforms),
        )
        return transition


def tensors(state: Any) -> list[Tensor]:
    """The fields of a State."""
    return [getattr(state, field.name) for field in dataclasses.fields(state)]


def assert_same(one: Transition, other: Transition) -> None:
    """Two transitions are equal bit for bit."""
    for name in ("obs", "reward", "discount", "ended"):
        assert torch.equal(getattr(one, name), getattr(other, name)), name
    assert all(torch.equal(one.info[key], other.info[key]) for key in one.info)


def test_registry_finds_the_papers_pursuit_games() -> None:
    """Both sizes are registered, with the numbers of the paper (l. 373)."""
    found = registry.settings()
    six, eight = found["pursuit-n6"], found["pursuit-n8"]
    assert (six.pursuers, six.map_size, six.evaders, six.sight) == (6, 15, 2, 3)
    assert (eight.pursuers, eight.map_size, eight.evaders, eight.sight) == (8, 17, 2, 3)
    for config in (six, eight):
        assert config.time_limit == 500
        assert (config.capture_reward, config.step_penalty, config.edge_penalty) == (5, 0.05, 0.5)


@pytest.mark.parametrize("name", SETTINGS)
def test_config_is_frozen_and_builds_its_environment(name: str) -> None:
    """A setting is a frozen dataclass; `make` takes it or its name."""
    config = registry.settings()[name]
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.time_limit = 1
    for env in (registry.make(name), registry.make(config)):
        assert env.time_limit == config.time_limit
        assert min(env.agents, env.observation_size, env.reset_uniforms) >= 1
        assert sorted([env.actions > 0, env.action_size > 0]) == [False, True]
        assert env.step_uniforms >= 0


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("batch", [(), (GAMES,), (2, 3)])
def test_shapes_and_types(name: str, batch: tuple[int, ...]) -> None:
    """Every tensor has the shape and type that the protocol promises, for any batch."""
    env = registry.make(name)
    player = Player(env, batch)
    for _ in range(3):
        transition = player.step()
        for obs in (transition.obs, player.games.obs, env.observe(player.games.state)):
            assert obs.shape == (*batch, env.agents, env.observation_size)
            assert obs.dtype == env.observation_dtype
        assert transition.reward.shape == (*batch, env.agents)
        assert transition.discount.shape == transition.ended.shape == batch
        assert transition.reward.dtype == transition.discount.dtype == torch.float32
        assert transition.ended.dtype == torch.bool
        assert set(transition.info) == set(env.counts)
        for count in transition.info.values():
            assert (count.shape, count.dtype) == (batch, torch.float32)
        assert all(field.shape[: len(batch)] == batch for field in tensors(player.games.state))


@pytest.mark.parametrize("name", SETTINGS)
def test_everything_lives_on_the_environments_device(name: str) -> None:
    """On torch's `meta` device, where any tensor left on the CPU is an error."""
    device = torch.device("meta")
    env = registry.make(name, device)
    state = env.reset(torch.zeros(GAMES, env.reset_uniforms, device=device))
    actions = random_actions(env, (GAMES,), torch.Generator()).to(device)
    numbers = torch.zeros(GAMES, env.step_uniforms, device=device)
    try:
        state, transition = env.step(state, actions, numbers)
    except NotImplementedError:
        pytest.skip("it asks how many pairs are near each other, which `meta` cannot know")
    found = (*tensors(state), *transition[:-1], *transition.info.values())
    assert {tensor.device for tensor in found} == {device}


@pytest.mark.parametrize("name", SETTINGS)
def test_metrics_are_ratios_of_things_that_are_counted(name: str) -> None:
    """Each metric divides a count, the return, steps or finished games by steps or episodes."""
    env = registry.make(name)
    assert env.metrics
    assert set(env.final_counts) <= set(env.counts)
    for metric in env.metrics.values():
        assert metric.count in {*env.counts, "return", "steps", "finished"}
        assert metric.per in {"steps", "episodes"}
        assert metric.scale > 0
        assert metric.better in {"higher", "lower"}
        assert metric.meaning


@pytest.mark.parametrize("name", SETTINGS)
def test_discount_is_zero_exactly_at_true_ends(name: str) -> None:
    """Discount 0 comes only with an end; an end with discount 1 is the time limit."""
    config = registry.settings()[name]
    env = registry.make(dataclasses.replace(config, time_limit=7))
    player = Player(env)
    limits = 0
    for _ in range(STEPS):
        elapsed = player.games.elapsed
        transition = player.step()
        assert set(transition.discount.tolist()) <= {0.0, 1.0}
        assert not ((transition.discount == 0) & ~transition.ended).any()
        limit = transition.ended & (transition.discount == 1)
        assert torch.equal(limit, (elapsed == 6) & (transition.discount == 1))
        assert torch.equal(player.games.elapsed == 0, transition.ended)
        limits += int(limit.sum())
    assert limits > 0


@pytest.mark.parametrize("name", SETTINGS)
def test_observation_is_a_function_of_the_state(name: str) -> None:
    """What a step shows is what `observe` sees in the state it returns."""
    env = registry.make(name)
    player = Player(env)
    for _ in range(STEPS):
        actions = random_actions(env, (GAMES,), player.generator)
        state, transition = env.step(
            player.games.state, actions, player.uniforms(env.step_uniforms)
        )
        assert torch.equal(transition.obs, env.observe(state))
        player.step()


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize(
    ("extreme", "ordinary"), [(0.0, 2.0**-10), (1 - 2.0**-24, 1 - 2.0**-10)], ids=["0", "below 1"]
)
def test_any_uniform_number_can_be_used(name: str, extreme: float, ordinary: float) -> None:
    """0 and the largest float32 below 1 play the games of the ordinary numbers beside them."""
    env = registry.make(name)
    slack = 0.2 if env.action_size else 0.0  # a sensor's ray, or a touch, just hits or misses
    reset = torch.tensor([extreme, ordinary])[:, None].expand(2, env.reset_uniforms)
    numbers = torch.tensor([extreme, ordinary])[:, None].expand(2, env.step_uniforms)
    state = env.reset(reset)
    generator = torch.Generator().manual_seed(1)
    for _ in range(STEPS):
        one, other = env.observe(state).float()
        differs = ((one - other).abs() > 0.1).float().mean()
        assert differs <= slack
        actions = random_actions(env, (1,), generator)
        state, transition = env.step(state, torch.cat((actions, actions)), numbers)
        assert transition.reward.isfinite().all()
        one, other = transition.reward
        assert ((one - other).abs() > 0.1).float().mean() <= slack


@pytest.mark.parametrize("name", SETTINGS)
def test_every_uniform_number_of_a_reset_is_used(name: str) -> None:
    """Each of the numbers that a reset asks for changes how the game starts."""
    env = registry.make(name)
    base = torch.full((env.reset_uniforms,), 0.1)
    start = tensors(env.reset(base))
    for place in range(env.reset_uniforms):
        other = base.clone()
        other[place] = 0.9
        changed = tensors(env.reset(other))
        assert any(not torch.equal(a, b) for a, b in zip(start, changed, strict=True)), place


@pytest.mark.parametrize("name", SETTINGS)
def test_equal_numbers_give_equal_games(name: str) -> None:
    """Two environments fed the same numbers agree bit for bit, whatever torch's own seed is."""
    torch.manual_seed(1)
    first = Player(registry.make(name))
    expected = [first.step() for _ in range(STEPS)]
    torch.manual_seed(2)
    second = Player(registry.make(name))
    for transition in expected:
        assert_same(transition, second.step())


@pytest.mark.parametrize("name", SETTINGS)
def test_interleaved_games_do_not_touch_each_other(name: str) -> None:
    """One environment plays two series of games in turns as it plays each alone."""
    env = registry.make(name)
    alone = Player(env, seed=1)
    expected = [alone.step() for _ in range(STEPS)]
    one, other = Player(env, seed=1), Player(env, seed=2)
    for transition in expected:
        other.step()
        assert_same(transition, one.step())


@pytest.mark.parametrize("name", SETTINGS)
def test_games_of_a_batch_do_not_touch_each_other(name: str) -> None:
    """A game of a batch is the game that is played alone with the same numbers."""
    env = registry.make(name)
    generator = torch.Generator().manual_seed(4)
    start = torch.rand(GAMES, env.reset_uniforms, generator=generator)
    batch, alone = env.reset(start), env.reset(start[2])
    for _ in range(STEPS):
        actions = random_actions(env, (GAMES,), generator)
        numbers = torch.rand(GAMES, env.step_uniforms, generator=generator)
        batch, together = env.step(batch, actions, numbers)
        alone, single = env.step(alone, actions[2], numbers[2])
        assert torch.equal(together.obs[2], single.obs)
        assert torch.equal(together.reward[2], single.reward)


@pytest.mark.parametrize("name", SETTINGS)
def test_step_changes_nothing_in_place(name: str) -> None:
    """State, actions and numbers are as before after a step: a state can be played from again."""
    env = registry.make(name)
    player = Player(env)
    player.step()
    state, actions = player.games.state, random_actions(env, (GAMES,), player.generator)
    numbers = player.uniforms(env.step_uniforms)
    given = [*tensors(state), actions, numbers]
    before = [tensor.clone() for tensor in given]
    env.step(state, actions, numbers)
    env.observe(state)
    assert all(torch.equal(a, b) for a, b in zip(before, given, strict=True))


@pytest.mark.parametrize("name", SETTINGS)
def test_select_takes_whole_games(name: str) -> None:
    """Chosen games come from the first state, all others from the second, in every field."""
    env = registry.make(name)
    one, other = Player(env, seed=1), Player(env, seed=2)
    for _ in range(3):
        one.step()
        other.step()
    choose = torch.tensor([True, False, True, False, False])
    picked = autoreset.select(choose, one.games.state, other.games.state)
    fields = zip(tensors(picked), tensors(one.games.state), tensors(other.games.state), strict=True)
    for mixed, yes, no in fields:
        assert torch.equal(mixed[choose], yes[choose])
        assert torch.equal(mixed[~choose], no[~choose])
