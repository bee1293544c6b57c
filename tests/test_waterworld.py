"""The batched waterworld equals a slow one in plain Python, reading by reading, step by step.

Both get the same 32-bit numbers; the slow one goes on in 64 bits. Readings and states agree within
1e-6, except where the slow game says that less than `CLOSE` would have decided otherwise.
"""

import dataclasses
import itertools

import pytest
import torch

from msgdrop_envs.waterworld.config import PAPER, Config
from msgdrop_envs.waterworld.places import outside
from msgdrop_envs.waterworld.rules import State
from tests.slow_waterworld import SlowWaterworld
from tests.waterworld_positions import (
    build,
    closing_in,
    random_states,
    sensor_block,
    slow_games,
    state_from_slow,
)

CLOSE = 2e-7
"""Rounding of 32-bit places, and of sums of their products, stays below this."""
VARIANTS = {
    "n8": PAPER["waterworld-n8"],
    "n10": PAPER["waterworld-n10"],
    "options": Config(
        pursuers=3,
        catchers=2,
        food=4,
        poison=3,
        radius=0.03,
        sensors=8,
        sensor_range=0.3,
        sensor_width="object",
        rewards_once=False,
        action_penalty=0.5,
        food_bounce="full",
        sensors_scaled=False,
    ),
    "stopping walls": Config(food=4, object_walls="stop", food_speed=0.1, poison_speed=0.1),
}


def compare_sensors(config: Config, games: int) -> tuple[int, int, int]:
    """Readings in random states: how many were compared, how many of something, how many not."""
    generator = torch.Generator().manual_seed(11)
    env = build(config)
    states = random_states(config, games, generator)
    obs = sensor_block(env.observe(states), config)  # [B, N, 3, 2, S]
    if config.sensors_scaled:
        obs = obs * torch.tensor([config.sensor_range, config.velocity_unit])[:, None]
    readings = itertools.chain.from_iterable(
        itertools.chain.from_iterable(itertools.chain.from_iterable(game.read()))
        for game in slow_games(config, states)
    )
    rows = [(r.distance, r.velocity, r.margin) for r in readings]
    expected = torch.tensor(rows, dtype=torch.float64).unflatten(0, (games, config.pursuers, 3, -1))
    sure = expected[..., 2] > CLOSE
    found = obs.transpose(-1, -2).double()  # [B, N, 3, S, 2]
    torch.testing.assert_close(found[sure], expected[sure][:, :2], rtol=0, atol=1e-6)
    return int(sure.sum()), int((found[sure][:, 0] > 0).sum()), int((~sure).sum())


@pytest.mark.parametrize("config", VARIANTS.values(), ids=VARIANTS)
def test_sensors_equal_slow_sensors(config: Config) -> None:
    """Every reading of some random states; very few hang on rounding."""
    compared, met, close = compare_sensors(config, 200)
    assert met > 0.05 * compared, "the states no longer have things near each other"
    assert close <= 5 + 2e-5 * compared


@pytest.mark.slow
def test_sensors_equal_slow_sensors_in_3000_states() -> None:
    """Nearly two million readings of the paper's N=8 game."""
    compared, met, close = compare_sensors(PAPER["waterworld-n8"], 3_000)
    assert compared + close == 3_000 * 8 * 3 * 25
    assert met > 0.05 * compared
    assert close <= 2e-5 * compared


@pytest.mark.parametrize("config", VARIANTS.values(), ids=VARIANTS)
def test_batched_game_equals_slow_game(config: Config) -> None:
    """4,000 steps of each game: equal states, rewards and counts, step by step."""
    generator = torch.Generator().manual_seed(5)
    env, happened = build(config), dict.fromkeys(("catches", "touches", "poison_met"), 0)
    walls = rims = replaced = skipped = 0
    for _ in range(8):
        state = random_states(config, 50, generator)
        for turn in range(10):
            if turn % 5 == 0:
                state = closing_in(state, config, generator)
            actions = torch.rand(50, env.agents, 2, generator=generator) * 2 - 1
            uniforms = torch.rand(50, env.step_uniforms, generator=generator)
            after, transition = env.step(state, actions, uniforms)
            games = slow_games(config, state)
            outcomes = [
                game.step([(x, y) for x, y in pushes], numbers)
                for game, pushes, numbers in zip(
                    games, actions.tolist(), uniforms.tolist(), strict=True
                )
            ]
            sure = torch.tensor([outcome.margin > CLOSE for outcome in outcomes])
            for found, expected in zip(
                (after.positions, after.velocities), state_from_slow(games), strict=True
            ):
                torch.testing.assert_close(found[sure].double(), expected[sure], rtol=0, atol=1e-6)
            rewards = torch.tensor([outcome.rewards for outcome in outcomes])
            torch.testing.assert_close(transition.reward[sure], rewards[sure], rtol=0, atol=1e-5)
            for name in happened:
                counts = torch.tensor([float(getattr(outcome, name)) for outcome in outcomes])
                assert torch.equal(transition.info[name][sure], counts[sure])
                happened[name] += int(counts.sum())
            skipped += int((~sure).sum())
            walls += int(((after.positions == 0) | (after.positions == 1)).sum())
            rims += int(
                (after.velocities[:, env.agents :] != state.velocities[:, env.agents :]).sum()
            )
            replaced += int(((after.positions - state.positions).abs() > 0.2).any(-1).sum())
            state = after
    assert min(*happened.values(), walls, rims, replaced) > 50, "too little happens in these games"
    assert skipped < 40  # of 4,000 steps


@pytest.mark.parametrize("config", VARIANTS.values(), ids=VARIANTS)
def test_batched_reset_equals_slow_reset(config: Config) -> None:
    """Equal places and velocities from equal uniform numbers; pursuers rest."""
    env = build(config)
    uniforms = torch.rand(50, env.reset_uniforms, generator=torch.Generator().manual_seed(2))
    state = env.reset(uniforms)
    games = [SlowWaterworld(config) for _ in range(50)]
    for game, numbers in zip(games, uniforms.tolist(), strict=True):
        game.start(numbers)
    for found, expected in zip(
        (state.positions, state.velocities), state_from_slow(games), strict=True
    ):
        torch.testing.assert_close(found.double(), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("radius", [0.0, 0.23, 0.28, 0.45])
def test_replacement_is_exact(radius: float) -> None:
    """Places are spread evenly over what is outside the disc: as many in any cell as its area."""
    generator = torch.Generator().manual_seed(8)
    count, cells = 400_000, 20
    points = outside(torch.rand(count, 2, generator=generator), torch.tensor(radius))
    assert points.min() >= 0
    assert points.max() <= 1
    assert (points - 0.5).norm(dim=-1).min() > radius - 1e-6
    fine = (torch.arange(cells * 50) + 0.5) / (cells * 50) - 0.5
    free = (torch.hypot(fine[:, None], fine) > radius).float()
    share = free.view(cells, 50, cells, 50).sum((1, 3)).flatten() / free.sum()
    number = (points * cells).long().clamp(max=cells - 1)
    found = (number[:, 0] * cells + number[:, 1]).bincount(minlength=cells**2)
    expected = share * count
    some = expected > 20  # the rim's smallest slivers are known too roughly
    chi_squared = ((found - expected) ** 2 / expected)[some].sum()
    freedom = int(some.sum()) - 1
    assert chi_squared < freedom + 5 * (2 * freedom) ** 0.5
    assert found[share == 0].sum() == 0


@pytest.mark.parametrize("batch", [(), (4,), (2, 3), (2, 1, 3), (0,)])
def test_leading_dimensions_change_nothing(batch: tuple[int, ...]) -> None:
    """Any batch shape gives the games that are played one by one, bit for bit, and its shape."""
    env = build(PAPER["waterworld-n8"])
    generator = torch.Generator().manual_seed(1)
    config = PAPER["waterworld-n8"]
    flat = random_states(config, int(torch.tensor(batch).prod()), generator)
    state = State(*(getattr(flat, f.name).view(*batch, 28, 2) for f in dataclasses.fields(State)))
    actions = torch.rand(*batch, 8, 2, generator=generator) * 2 - 1
    uniforms = torch.rand(*batch, env.step_uniforms, generator=generator)
    after, transition = env.step(state, actions, uniforms)
    assert transition.obs.shape == (*batch, 8, 152)
    assert transition.reward.shape == (*batch, 8)
    assert transition.discount.shape == transition.ended.shape == batch
    assert after.positions.shape == after.velocities.shape == (*batch, 28, 2)
    pushes, numbers = actions.reshape(-1, 8, 2), uniforms.reshape(-1, env.step_uniforms)
    for game in range(len(flat.positions)):
        alone = State(flat.positions[game], flat.velocities[game])
        single, shown = env.step(alone, pushes[game], numbers[game])
        assert torch.equal(single.positions, after.positions.reshape(-1, 28, 2)[game])
        assert torch.equal(single.velocities, after.velocities.reshape(-1, 28, 2)[game])
        assert torch.equal(shown.obs, transition.obs.reshape(-1, 8, 152)[game])
        assert torch.equal(shown.reward, transition.reward.reshape(-1, 8)[game])
