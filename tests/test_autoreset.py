"""Time limit and restart, on pursuit: what a learner stores and what the game goes on with."""

import torch

from msgdrop_envs import autoreset
from msgdrop_envs.navigation import rules as navigation
from msgdrop_envs.protocol import Transition
from msgdrop_envs.pursuit.rules import Config, Pursuit, State
from tests.pursuit_positions import RING, STAY, position, stack, uniform, windows


def start_from(state: State, config: Config, elapsed: int = 0) -> tuple[Pursuit, autoreset.Games]:
    """Games in play from this position."""
    env = Pursuit(config, torch.device("cpu"))
    steps = torch.full(state.free.shape[:-1], elapsed)
    return env, autoreset.Games(state, steps, env.observe(state))


def advance(env: Pursuit, games: autoreset.Games) -> tuple[autoreset.Games, Transition]:
    """One step in which everybody stays; new episodes put all pursuers on cell (0, 0)."""
    batch = games.elapsed.shape
    return autoreset.step(
        env,
        games,
        torch.full((*batch, env.agents), STAY),
        torch.full((*batch, env.step_uniforms), uniform(STAY)),
        torch.zeros(*batch, env.reset_uniforms),
    )


def test_time_limit_ends_the_episode_but_keeps_discount_one() -> None:
    """Step 500 of 500 restarts the game without calling it a true end; step 499 does not."""
    config = Config(pursuers=2)
    state = position([(7, 7), (9, 9)], [(5, 5), (5, 5)])
    env, games = start_from(state, config, elapsed=498)
    games, transition = advance(env, games)
    assert (transition.ended.item(), games.elapsed.item()) == (False, 499)
    games, transition = advance(env, games)
    assert (transition.ended.item(), transition.discount.item()) == (True, 1.0)
    assert games.elapsed.item() == 0
    assert games.state.pursuers.tolist() == [[0, 0], [0, 0]]
    assert games.state.evaders.tolist() == [[7, 7], [7, 7]]


def test_true_end_has_discount_zero_and_shows_the_last_observation() -> None:
    """The transition holds what was seen at the end, the games what is seen after the restart."""
    env, games = start_from(position(RING, [(5, 5), None]), Config(pursuers=4))
    after, transition = advance(env, games)
    assert (transition.ended.item(), transition.discount.item()) == (True, 0.0)
    assert windows(transition.obs[0]) == {(0, 4, 2): 1, (0, 4, 4): 1, (0, 5, 3): 1}
    assert windows(after.obs[0]) == {(0, 3, 3): 3}
    assert torch.equal(after.obs, env.observe(after.state))
    assert (after.elapsed.item(), after.state.free.all().item()) == (0, True)


def test_only_games_that_end_restart() -> None:
    """In a batch, a captured game begins anew while its neighbour plays on."""
    states = [position(RING, [(5, 5), None]), position(RING, [(9, 9), (8, 8)])]
    env, games = start_from(stack(states), Config(pursuers=4), elapsed=10)
    games, transition = advance(env, games)
    assert transition.ended.tolist() == [True, False]
    assert games.elapsed.tolist() == [0, 11]
    assert games.state.pursuers[1].tolist() == [list(cell) for cell in RING]
    assert torch.equal(games.obs[1], transition.obs[1])


def test_final_counts_count_in_the_last_step_only() -> None:
    """Landmarks covered are 0 until the time limit ends the episode; collisions count always."""
    config = navigation.Config(agents=2, landmarks=2, time_limit=3, cover_radius=0.2)
    env = navigation.Navigation(config, torch.device("cpu"))
    numbers = torch.full((1, env.reset_uniforms), 0.5)  # everything on one point, for ever
    games = autoreset.start(env, numbers, torch.zeros(1, dtype=torch.int64))
    rows = []
    for _ in range(4):
        still = torch.zeros(1, 2, dtype=torch.int64)
        games, transition = autoreset.step(env, games, still, torch.zeros(1, 0), numbers)
        rows.append([transition.info["covered"].item(), transition.info["collisions"].item()])
    assert rows == [[0, 1], [0, 1], [2, 1], [0, 1]]
