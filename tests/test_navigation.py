"""The batched navigation game equals a slow one in plain Python, step by step."""

import pytest
import torch

from msgdrop_envs.navigation.rules import PAPER, Config, Navigation, State
from tests.navigation_positions import slow_games

GAMES, STEPS = 400, 26

VARIANTS = {
    "n8": PAPER["navigation-n8"],
    "n10": PAPER["navigation-n10"],
    "options": Config(
        agents=5,
        landmarks=3,
        landmark_order="nearest",
        absolute_locations=True,
        collision_penalty_once=True,
        moves_first=True,
    ),
    "one agent": Config(agents=1, landmarks=2, landmark_order="nearest"),
}


def crowded(config: Config, generator: torch.Generator) -> State:
    """Games that start with the agents on a patch of 1 to 0.05 of the world's width, moving."""
    env = Navigation(config, torch.device("cpu"))
    state = env.reset(torch.rand(GAMES, env.reset_uniforms, generator=generator))
    patch = torch.logspace(0, -1.3, GAMES)[:, None, None]
    velocities = 2.0 * torch.rand(state.velocities.shape, generator=generator) - 1.0
    return State(state.positions * patch, velocities, state.landmarks * patch)


@pytest.mark.parametrize("name", VARIANTS)
def test_batched_game_equals_slow_game(name: str) -> None:
    """Within 1e-5 in each of 10,400 steps, from where the batch stands: contact is chaotic.

    With 10 agents and with other options in each of 2,000 steps.
    """
    config = VARIANTS[name]
    generator = torch.Generator().manual_seed(7)
    env = Navigation(config, torch.device("cpu"))
    state, collisions, covered = crowded(config, generator), 0, 0
    for _ in range(STEPS if name == "n8" else 5):
        slow = slow_games(config, state)
        actions = torch.randint(5, (GAMES, config.agents), generator=generator)
        state, transition = env.step(state, actions, torch.zeros(GAMES, 0))
        outcomes = [game.step(each) for game, each in zip(slow, actions.tolist(), strict=True)]
        for found, expected in (
            (state.positions, [game.positions for game in slow]),
            (state.velocities, [game.velocities for game in slow]),
            (transition.obs, [outcome.observations for outcome in outcomes]),
            (transition.reward, [outcome.rewards for outcome in outcomes]),
        ):
            torch.testing.assert_close(found, torch.tensor(expected), rtol=0, atol=1e-5)
        assert transition.info["collisions"].tolist() == [o.collisions for o in outcomes]
        assert transition.info["covered"].tolist() == [o.covered for o in outcomes]
        collisions += sum(outcome.collisions for outcome in outcomes)
        covered += sum(outcome.covered for outcome in outcomes)
    assert covered > 100
    assert collisions > 1_000 or config.agents == 1, "too few contacts: this compares too little"


@pytest.mark.parametrize("name", ["n8", "n10"])
def test_whole_episodes_equal_the_slow_game(name: str) -> None:
    """From the paper's starts both play 25 steps on their own and end within 1e-3."""
    config = VARIANTS[name]
    generator = torch.Generator().manual_seed(3)
    env = Navigation(config, torch.device("cpu"))
    state = env.reset(torch.rand(40, env.reset_uniforms, generator=generator))
    slow, apart = slow_games(config, state), []
    for _ in range(config.time_limit):
        actions = torch.randint(5, (40, config.agents), generator=generator)
        state, _ = env.step(state, actions, torch.zeros(40, 0))
        for game, each in zip(slow, actions.tolist(), strict=True):
            game.step(each)
    for places, game in zip(state.positions, slow, strict=True):
        apart.append((places - torch.tensor(game.positions)).abs().max().item())
    assert sorted(apart)[len(apart) * 9 // 10] < 1e-3  # a few games are chaotic even so


@pytest.mark.parametrize("batch", [(1,), (3,), (7,), (64,), (2, 3), (2, 1, 3), (500,)])
@pytest.mark.parametrize("name", VARIANTS)
def test_a_game_is_the_same_in_any_batch(name: str, batch: tuple[int, ...]) -> None:
    """Bit for bit what it is alone, contacts included, whatever it is stacked with."""
    config = VARIANTS[name]
    env = Navigation(config, torch.device("cpu"))
    generator = torch.Generator().manual_seed(1)
    start = env.reset(0.4 + 0.2 * torch.rand(*batch, env.reset_uniforms, generator=generator))
    actions = torch.randint(5, (*batch, env.agents), generator=generator)
    state, transition = env.step(start, actions, torch.zeros(*batch, 0))
    assert transition.obs.shape == (*batch, env.agents, env.observation_size)
    assert transition.reward.shape == (*batch, env.agents)
    games = state.positions.flatten(0, len(batch) - 1)
    obs = transition.obs.flatten(0, len(batch) - 1)
    reward = transition.reward.flatten(0, len(batch) - 1)
    parts = [part.flatten(0, len(batch) - 1) for part in (start.positions, start.landmarks)]
    for game, (places, landmarks, each) in enumerate(
        zip(*parts, actions.reshape(-1, env.agents), strict=True)
    ):
        one = State(places, torch.zeros_like(places), landmarks)
        alone_state, alone = env.step(one, each, torch.zeros(0))
        assert torch.equal(alone_state.positions, games[game])
        assert torch.equal(alone.obs, obs[game])
        assert torch.equal(alone.reward, reward[game])
