"""A DQN on CartPole as TorchRL 0.14 shows it, with all that it saves of a training.

From its examples `dqn_trainer` and `dqn_cartpole` and its pages on `torchrl.checkpoint`: a
DQNTrainer with a unified `Checkpoint` and `GlobalRNGState()`, a rotation that keeps two, and
`load_from_file` of the newest. Networks, rates and exploration are theirs, the sizes those of the
tiny study in `tests/faults/study.py`. Two things are as they have to be: the value estimator is
made before a checkpoint is read (it is made late otherwise, and refused), and nothing is saved
before the replay memory has its first steps (an error). All seeds are set before anything draws.
"""

import hashlib
import json
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torchrl.checkpoint import Checkpoint, CheckpointRotation, GlobalRNGState
from torchrl.collectors import Collector
from torchrl.data import Composite, LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import Compose, GymEnv, RewardSum, StepCounter, TransformedEnv
from torchrl.modules import MLP, EGreedyModule, QValueActor
from torchrl.objectives import DQNLoss, HardUpdate
from torchrl.record.loggers import get_logger
from torchrl.trainers.algorithms import DQNTrainer

from tests.faults.study import INTERVAL, LOGGED, STEPS

LOG, CHECKPOINTS = "log", "checkpoints"
LOADED = ("random stream", "network", "target network", "optimiser", "exploration", "replay",
          "environment", "counters")  # fmt: skip
"""Quantities that a checkpoint has to bring back."""
COMPARED = (*LOADED, "metrics", "whole log")
"""Quantities of a finished training."""


def train(folder: Path, watch: Callable[[str, int, dict[str, str]], object]) -> None:
    """Train in a folder, or go on there from the newest checkpoint.

    watch: told "loaded" after loading, "saved" after each checkpoint and "ended" at the end, with
    the env steps and the digests of all quantities.
    """
    trainer = make_trainer(folder)
    game = trainer.collector.env.base_env._env.unwrapped  # the trainer lets go of it at its end

    def tell(moment: str) -> None:
        watch(moment, trainer.collected_frames, quantities(trainer, game, folder))

    if (newest := trainer.checkpoint_rotation.latest()) is not None:
        trainer.load_from_file(newest)
        tell("loaded")
    save = trainer._save_trainer

    def save_and_tell() -> None:
        save()
        tell("saved")

    trainer._save_trainer = save_and_tell
    trainer.train()
    tell("ended")


def make_trainer(folder: Path, seed: int = 1) -> DQNTrainer:
    """The trainer, its game, networks, memory, log and checkpoints."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 (their GlobalRNGState saves this one)
    torch.manual_seed(seed)
    total = RewardSum(in_keys=["reward"], out_keys=["reward_sum"])
    env = TransformedEnv(GymEnv("CartPole-v1"), Compose(total, StepCounter()))
    actions = env.full_action_spec["action"]
    network = MLP(in_features=4, out_features=2, num_cells=[120, 84])
    model = QValueActor(network, spec=Composite(action=actions), in_keys=["observation"])
    explore = EGreedyModule(
        annealing_num_steps=STEPS // 2, eps_init=1.0, eps_end=0.05, spec=actions
    )
    loss = DQNLoss(model, loss_function="l2", delay_value=True)
    loss.make_value_estimator(gamma=0.99)
    collector = Collector(
        env,
        TensorDictSequential(model, explore),
        frames_per_batch=LOGGED,
        total_frames=STEPS,
        init_random_frames=INTERVAL,
    )
    collector.set_seed(seed)
    return DQNTrainer(
        collector=collector,
        total_frames=STEPS,
        frame_skip=1,
        optim_steps_per_batch=10,
        loss_module=loss,
        optimizer=torch.optim.Adam(loss.parameters(), lr=2.5e-4),
        replay_buffer=TensorDictReplayBuffer(storage=LazyTensorStorage(200), batch_size=32),
        target_net_updater=HardUpdate(loss, value_network_update_interval=50),
        greedy_module=explore,
        clip_norm=10.0,
        seed=seed,
        progress_bar=False,
        logger=get_logger("csv", logger_name=str(folder), experiment_name=LOG),
        log_interval=LOGGED,
        save_trainer_interval=INTERVAL - 1,  # theirs saves when it is exceeded
        checkpoint=Checkpoint(rng=GlobalRNGState()),
        checkpoint_rotation=CheckpointRotation(folder / CHECKPOINTS, keep_last=2),
    )


def quantities(trainer: DQNTrainer, game: Any, folder: Path) -> dict[str, str]:
    """A digest of each quantity of a training, by name; game: Gymnasium's, with its state."""
    networks = trainer.loss_module.state_dict()
    memory = trainer.replay_buffer
    log = {file.stem: file.read_text() for file in sorted((folder / LOG).rglob("*.csv"))}
    held: dict[str, Any] = {
        "random stream": GlobalRNGState().state_dict(),
        "network": {name: each for name, each in networks.items() if "target" not in name},
        "target network": {name: each for name, each in networks.items() if "target" in name},
        "optimiser": trainer.optimizer.state_dict(),
        "exploration": trainer.greedy_module.state_dict(),
        "replay": (len(memory), memory[:] if len(memory) else None, memory.writer.state_dict()),
        "environment": (game.state, game.np_random.bit_generator.state),
        "counters": trainer._get_state(),
        "metrics": {name: dict(_rows(text)) for name, text in log.items()},
        "whole log": log,
    }
    assert tuple(held) == COMPARED
    return {name: hashlib.sha256(_bytes(value)).hexdigest() for name, value in held.items()}


def _rows(text: str) -> list[list[str]]:
    """Env steps and value of each row; a later one of the same steps counts."""
    return [line.split(",", 1) for line in text.splitlines()]


def _bytes(value: Any) -> bytes:
    """A value of tensors, tables and lists as bytes; equal values give equal bytes."""
    if isinstance(value, torch.Tensor | np.ndarray):
        array = np.asarray(value)
        return repr((array.shape, array.dtype)).encode() + array.tobytes()
    if isinstance(value, TensorDictBase):
        value = {str(key): value[key] for key in value.keys(True, True)}
    if isinstance(value, Mapping):
        return b"{" + b"".join(_bytes(each) for each in sorted(value.items(), key=str)) + b"}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return b"[" + b"".join(_bytes(each) for each in value) + b"]"
    return json.dumps(value).encode() + b";"
