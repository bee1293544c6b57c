"""Hand-made minibatches, laid into memories of which every row is drawn once, in order."""

import torch

from msgdrop_cli.ops.minibatch import Batch, Minibatch


def in_memory(batch: Batch) -> Minibatch:
    """A memory for each network, as of one agent that is shown all blocks; joint, for each run."""
    joint = batch.reward.dim() == 3
    memories, size = batch.discount.shape
    after = torch.arange(size, 2 * size, dtype=torch.int32).expand(memories, -1)
    rows = torch.arange(size).expand(memories, -1)
    blocks = batch.obs.shape[2]
    choice = not batch.action.is_floating_point()
    action = batch.action.to(torch.uint8) if choice else batch.action
    return Minibatch(
        obs=batch.obs.contiguous(),
        next_row=after.contiguous(),
        action=(action if joint else action[..., None]).contiguous(),
        reward=(batch.reward if joint else batch.reward[..., None]).contiguous(),
        discount=batch.discount.contiguous(),
        rows=(rows if joint else rows[:, None]).contiguous(),
        shown=torch.arange(blocks)[:, None] if joint else torch.arange(blocks)[None],
    )
