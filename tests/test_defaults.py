"""The numbers of the paper, and the project's own where it gives none, each with its line.

Source lines are those of `paper.tex`; "ours" is what the paper does not say and PAPER.md decides.
"""

from dataclasses import asdict
from typing import Any

import pytest

from msgdrop_cli.algorithms import dcc, maddpg
from msgdrop_cli.definition.spec import Profile, TrainingSpec
from msgdrop_cli.engine.offers import catalogue
from msgdrop_envs.pursuit import rules as pursuit

LEARNER: dict[str, Any] = {
    "rate": 0.2,  # l. 420: the best rate is around [0.2, 0.3]; ours: the lower end
    "dropout": "message",  # l. 173: blockwise
    "drops_own": False,  # l. 173: not applied to the own observation
    "network": "fgh",  # l. 404
    "topology": "all",  # l. 149
    "encoder": "observation",  # l. 289
    "encoder_samples": 1_000_000,  # l. 790
    "f_units": (64, 48),  # l. 745
    "g_units": 96,  # l. 746
    "h_units": 32,  # l. 748
    "gamma": 0.99,  # l. 753, printed as lambda
    "learning_rate": 1e-4,  # l. 753
    "batch_size": 32,  # ours
    "loss": "mse",  # l. 156, 244
    "max_gradient_norm": 0.0,  # ours: no clipping, since l. 244 has none
    "replay_capacity": 200_000,  # l. 753
    "replay_start_env_steps": 10_000,  # ours
    "update_every_env_steps": 4,  # l. 753
    "target_update_every_updates": 1_000,  # ours; l. 223 only says that it is updated
    "epsilon_start": 1.0,  # l. 753
    "epsilon_final": 0.02,  # l. 753
    "epsilon_anneal_env_steps": 2_000_000,  # l. 753
}
NAMED: dict[str, dict[str, Any]] = {
    "fdc": {"network": "own", "rate": 0.0},  # l. 750; nothing to drop
    "dcc": {"rate": 0.0},  # l. 418
    "dcc-md": {},  # l. 173
    "dcc-sd": {"dropout": "element"},  # l. 464
    "full-md": {"drops_own": True},  # l. 489
    "full-sd": {"dropout": "element", "drops_own": True},  # l. 492
    "concat-dcc": {"network": "concat", "rate": 0.0},  # l. 515
    "concat-md": {"network": "concat"},  # l. 508
}
NAVIGATION = {
    "f_units": (64, 64),  # l. 759
    "g_units": 64,  # l. 759
    "epsilon_anneal_env_steps": 400_000,  # l. 762
}
GAME = {
    "pursuers": 6,  # l. 373
    "evaders": 2,  # l. 373
    "map_size": 15,  # l. 373
    "sight": 3,  # l. 373
    "time_limit": 500,  # l. 373
    "capture_reward": 5.0,  # l. 373
    "step_penalty": 0.05,  # l. 373
    "edge_penalty": 0.5,  # l. 373
    "capture_reward_once": False,  # l. 367 names no limit; ours: paid for each evader
    "may_enter_evaders": True,  # ours; l. 365 blocks evaders only
    "may_share_cells": True,  # ours; nothing is said of pursuers that meet
}


def test_defaults_are_the_decided_ones() -> None:
    """The learner's Config is the paper's pursuit N=6 case, its gaps filled as decided."""
    assert asdict(dcc.Config()) == LEARNER


def test_named_algorithms_change_what_the_paper_changes() -> None:
    """Each name stands for the Config above but for what its line in the paper says."""
    assert set(dcc.NAMED) == set(NAMED)
    for name, changes in NAMED.items():
        assert asdict(dcc.Config(**dcc.NAMED[name])) == LEARNER | changes, name


@pytest.mark.parametrize(
    ("environment", "changes"),
    [
        ("pursuit-n6", {}),
        ("pursuit-n8", {"g_units": 128}),  # l. 751: only g is changed
        ("navigation-n8", NAVIGATION),
        ("navigation-n10", NAVIGATION),
    ],
)
def test_settings_of_an_environment_are_the_papers(
    environment: str, changes: dict[str, Any]
) -> None:
    """The learner's settings for each case of pursuit and navigation, and how long a run is."""
    sizes = catalogue().sizes(environment, "dcc")
    assert asdict(dcc.Config(**sizes.algorithm)) == LEARNER | changes
    # Ours; l. 753 only lets it exceed 2e6 in pursuit, l. 762 exceed 4e5 in navigation.
    length = 5_000_000 if environment.startswith("pursuit") else 1_000_000
    assert TrainingSpec(**sizes.training).train_env_steps == length


MADDPG: dict[str, Any] = {
    "rate": 0.2,  # l. 436: 0.2 and 0.5
    "network": "fgh",  # l. 404, 436
    "masks_actions": False,  # l. 274 masks observations
    "shares_parameters": True,  # l. 772
    "actor_units": 64,  # l. 768
    "f_units": (200, 100),  # l. 770
    "g_units": 100,  # l. 770
    "h_units": 64,  # l. 770
    "gamma": 0.95,  # l. 772
    "learning_rate": 1e-3,  # l. 772
    "batch_size": 32,  # ours
    "max_gradient_norm": 0.5,  # ours
    "tau": 0.01,  # ours
    "noise": 0.15,  # l. 772
    "replay_capacity": 500_000,  # l. 772
    "replay_start_env_steps": 10_000,  # ours
    "update_every_env_steps": 5,  # l. 772
    "actor_update_every_env_steps": 10,  # l. 772
}


def test_maddpgs_defaults_are_the_decided_ones() -> None:
    """The supplement's waterworld, its gaps filled as decided; the names change little."""
    assert asdict(maddpg.Config()) == MADDPG
    changes: dict[str, dict[str, Any]] = {
        "ddpg": {"network": "own", "rate": 0.0},  # l. 435
        "vanilla-maddpg": {"network": "concat", "rate": 0.0},  # l. 436
        "maddpg": {"rate": 0.0},  # l. 436
        "maddpg-md": {},  # l. 274, 279
    }
    assert {name: asdict(maddpg.Config(**each)) for name, each in maddpg.NAMED.items()} == {
        name: MADDPG | each for name, each in changes.items()
    }
    for environment in ("waterworld-n8", "waterworld-n10"):
        sizes = catalogue().sizes(environment, "maddpg")
        assert asdict(maddpg.Config(**sizes.algorithm)) == MADDPG
        assert TrainingSpec(**sizes.training).train_env_steps == 2_000_000  # ours


def test_length_and_games_are_the_decided_ones() -> None:
    """5,000,000 env steps in 8 parallel games, and 1,000 episodes after training."""
    assert asdict(TrainingSpec()) == {
        "train_env_steps": 5_000_000,  # ours
        "games": 8,  # ours
        "log_every_env_steps": 5_000,  # ours
        "checkpoint_every_env_steps": 100_000,  # ours; changes no result
        "channel": "links:0",  # everything arrives in training
    }
    assert Profile(seeds=7).evaluation_episodes == 1_000  # l. 419


@pytest.mark.parametrize(
    ("environment", "changes"),
    [("pursuit-n6", {}), ("pursuit-n8", {"pursuers": 8, "map_size": 17})],  # l. 373
)
def test_pursuit_is_the_papers(environment: str, changes: dict[str, int]) -> None:
    """Both cases of the game, setting by setting."""
    assert asdict(pursuit.PAPER[environment]) == GAME | changes
