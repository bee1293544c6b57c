"""Numbers that are not finite: in which agent's network, and in which layer of it."""

import torch

from msgdrop_cli.engine.checkpoint import state_of
from msgdrop_cli.engine.training import Training


def not_finite(training: Training, run: int) -> str | None:
    """What of a run's state is not finite, `agent 2, layer h1: online weight`; None if all is.

    Agents count from 0. Of several places the first in the order of `Learner.tensors`.
    """
    state = {name: t for name, t in state_of(training, run).items() if t.is_floating_point()}
    # A sum reads each number once, and is finite only if all are; it may overflow without a fault.
    if bool(torch.stack([tensor.sum() for tensor in state.values()]).isfinite().all()):
        return None
    name = next((name for name, t in state.items() if not bool(t.isfinite().all())), None)
    if name is None:
        return None
    if name in ("learner.metric_sums", "sums"):
        of = ("loss", "q") if name == "learner.metric_sums" else training.counted
        return next(
            word for word, sound in zip(of, state[name].isfinite(), strict=True) if not sound
        )
    owner, *words = name.split(".")
    if owner != "learner" or len(words) < 3:
        return name
    *part, layer, kind = words
    networks = state[name].isfinite().flatten(1).all(1)  # one for all agents, or one each
    who = f"agent {int(networks.int().argmin())}" if len(networks) > 1 else "all agents"
    return f"{who}, layer {layer}: {' '.join((*part, kind))}"
