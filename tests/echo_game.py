"""A game of somebody else, as a package that is installed: rules and sizes, nothing besides."""

from pathlib import Path

RULES = '''
"""Echo: every agent says what its left neighbour sees."""

from dataclasses import dataclass

import torch

from msgdrop_envs.protocol import Metric, Transition


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a game."""

    agents: int = 3
    """N (ours)."""
    time_limit: int = 10
    """T, steps."""


PAPER = {"echo-n3": Config(), "echo-n4": Config(agents=4)}


@dataclass(frozen=True, slots=True)
class State:
    """What everybody sees."""

    bits: torch.Tensor
    """[..., N]"""


class Echo:
    """The batched game."""

    observation_dtype = torch.float32
    observation_size = 1
    actions, action_size = 2, 0
    counts = ("right",)
    final_counts = ()
    metrics = {"right_per_step": Metric("right", "steps", 1.0, "higher", "agents who echo")}

    def __init__(self, config, device):
        self.config, self.agents, self.time_limit = config, config.agents, config.time_limit
        self.reset_uniforms = self.step_uniforms = config.agents

    def reset(self, uniforms):
        return State((uniforms > 0.5).float())

    def step(self, state, actions, uniforms):
        right = (actions == state.bits.roll(1, -1)).float()
        over = torch.zeros(right.shape[:-1], dtype=torch.bool, device=right.device)
        state = self.reset(uniforms)
        info = {"right": right.sum(-1)}
        return state, Transition(self.observe(state), right, (~over).float(), over, info)

    def observe(self, state):
        return state.bits[..., None]
'''
SIZES = """
[echo-n3.dcc]
algorithm = { f_units = [8, 8], g_units = 8, h_units = 8, replay_start_env_steps = 40 }
training = { train_env_steps = 400, games = 4, log_every_env_steps = 100 }
"""


def install(folder: Path, package: str = "somebodys.echo", rules: str = RULES) -> Path:
    """Write the package into `folder` as pip installs it; returns the package's own folder."""
    inside = folder.joinpath(*package.split("."))
    inside.mkdir(parents=True)
    for level in (inside, *inside.parents):
        if level == folder:
            break
        (level / "__init__.py").touch()
    (inside / "rules.py").write_text(rules)
    (inside / "sizes.toml").write_text(SIZES)
    info = folder / f"{package.replace('.', '_')}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[msgdrop.environments]\necho = {package}\n")
    return inside
