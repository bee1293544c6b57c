"""The batched pursuit game equals a slow one in plain Python, step by step."""

import random

import pytest
import torch

from msgdrop_envs.pursuit.rules import PAPER, Config, Pursuit
from tests.pursuit_positions import assert_equal_state, position, slow_game, stack
from tests.slow_pursuit import Cell

TRIALS, GAMES, STEPS = 16, 64, 22  # 22,528 steps of each size


def crowd(config: Config, rng: random.Random) -> tuple[list[Cell], list[Cell | None]]:
    """A random position in which much happens: all within few cells, anywhere on the map."""
    last = config.map_size - 1
    row, column = rng.choice((0, last, rng.randint(0, last))), rng.choice((0, rng.randint(0, last)))

    def near(spread: int) -> Cell:
        def one(middle: int) -> int:
            return min(max(middle + rng.randint(-spread, spread), 0), last)

        return one(row), one(column)

    evaders: list[Cell | None] = [near(1) for _ in range(config.evaders)]
    if rng.random() < 0.1:
        evaders[rng.randrange(config.evaders)] = None
    pursuers: list[Cell] = []
    while len(pursuers) < config.pursuers:
        cell = near(rng.choice((1, 2, 4, last)))
        if config.may_share_cells or cell not in pursuers:
            pursuers.append(cell)
    return pursuers, evaders


VARIANTS = {
    "n6": PAPER["pursuit-n6"],
    "n8": PAPER["pursuit-n8"],
    "options": Config(capture_reward_once=True, may_enter_evaders=False, evaders=3),
    "small": Config(pursuers=5, evaders=3, map_size=4, sight=2, may_enter_evaders=False),
    "apart": Config(may_share_cells=False),
    "crowded and apart": Config(
        pursuers=7, map_size=5, may_share_cells=False, may_enter_evaders=False
    ),
}


@pytest.mark.parametrize("config", VARIANTS.values(), ids=VARIANTS)
def test_batched_game_equals_slow_game(config: Config) -> None:
    """Over 22,528 steps of each size: equal state, observation, reward, discount and counts."""
    paper = config in PAPER.values()
    rng, generator = random.Random(7), torch.Generator().manual_seed(7)
    env = Pursuit(config, torch.device("cpu"))
    catches = 0
    for _ in range(TRIALS if paper else 4):
        crowds = [crowd(config, rng) for _ in range(GAMES)]
        slow = [slow_game(config, *cells) for cells in crowds]
        state = stack([position(*cells) for cells in crowds])
        for _ in range(STEPS):
            actions = torch.randint(5, (GAMES, config.pursuers), generator=generator)
            # On a grid of 1/4096 the products are exact in float32, as they are in Python.
            uniforms = torch.randint(4096, (GAMES, config.evaders), generator=generator) / 4096
            state, transition = env.step(state, actions, uniforms)
            outcomes = [
                game.step(*given)
                for game, *given in zip(slow, actions.tolist(), uniforms.tolist(), strict=True)
            ]
            assert_equal_state(state, slow)
            assert torch.equal(
                transition.obs,
                torch.tensor([o.observations for o in outcomes], dtype=torch.uint8),
            )
            torch.testing.assert_close(
                transition.reward, torch.tensor([o.rewards for o in outcomes]), rtol=0, atol=1e-6
            )
            assert transition.discount.tolist() == [o.discount for o in outcomes]
            assert transition.info["catches"].tolist() == [o.catches for o in outcomes]
            catches += sum(o.catches for o in outcomes)
    assert catches > 50, "the positions no longer lead to captures: this test compares too little"


@pytest.mark.parametrize("name", ["n6", "n8", "apart", "crowded and apart"])
def test_batched_reset_equals_slow_reset(name: str) -> None:
    """Equal starting positions and first observations from equal uniform numbers."""
    config = VARIANTS[name]
    generator = torch.Generator().manual_seed(3)
    uniforms = torch.randint(4096, (500, config.pursuers), generator=generator) / 4096
    env = Pursuit(config, torch.device("cpu"))
    state = env.reset(uniforms)
    slow = [slow_game(config, [], []) for _ in range(500)]
    for game, numbers in zip(slow, uniforms.tolist(), strict=True):
        game.start(config.pursuers, config.evaders, numbers)
    assert_equal_state(state, slow)
    expected = torch.tensor([game.observe() for game in slow], dtype=torch.uint8)
    assert torch.equal(env.observe(state), expected)


@pytest.mark.parametrize("batch", [(), (4,), (2, 3), (2, 1, 3)])
def test_leading_dimensions_change_nothing(batch: tuple[int, ...]) -> None:
    """Any batch shape gives the games that are played one by one, and keeps its shape."""
    env = Pursuit(PAPER["pursuit-n6"], torch.device("cpu"))
    generator = torch.Generator().manual_seed(1)
    start = torch.rand(*batch, env.reset_uniforms, generator=generator)
    actions = torch.randint(5, (*batch, env.agents), generator=generator)
    uniforms = torch.rand(*batch, env.step_uniforms, generator=generator)
    state, transition = env.step(env.reset(start), actions, uniforms)
    assert transition.obs.shape == (*batch, 6, 147)
    assert transition.reward.shape == (*batch, 6)
    assert transition.discount.shape == transition.ended.shape == batch
    assert all(count.shape == batch for count in transition.info.values())
    rows = [(t.reshape(-1, t.shape[-1])) for t in (start, actions, uniforms)]
    obs, reward = transition.obs.reshape(-1, 6, 147), transition.reward.reshape(-1, 6)
    pursuers = state.pursuers.reshape(-1, 6, 2)
    for game, (one, two, three) in enumerate(zip(*rows, strict=True)):
        alone_state, alone = env.step(env.reset(one), two, three)
        assert torch.equal(alone_state.pursuers, pursuers[game])
        assert torch.equal(alone.obs, obs[game])
        assert torch.equal(alone.reward, reward[game])
