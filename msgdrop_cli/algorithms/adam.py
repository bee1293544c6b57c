"""Adam over stacked networks (paper l. 753), with moments that can be taken out run by run."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

import torch
from torch import Tensor

from msgdrop_cli.networks.stacked import Stacked
from msgdrop_cli.ops.td import clip_factors


class Adam:
    """torch's fused Adam on the one flat tensor of `weights`."""

    def __init__(
        self,
        weights: Stacked,
        *,
        learning_rate: float,
        max_gradient_norm: float,
        device: torch.device | str,
    ) -> None:
        self._weights = weights
        self._learning_rate, self._max_gradient_norm = learning_rate, max_gradient_norm
        # Moments that are Stacked too, so that a run's share can be taken out.
        self.moments = {
            name: Stacked(weights.layers, weights.networks, device)
            for name in ("exp_avg", "exp_avg_sq")
        }
        self._steps = torch.zeros((), device=device)

    @contextmanager
    def descent(self) -> Iterator[Stacked]:
        """Yields the weights for a loss whose backward pass the caller runs, then steps down.

        Everything else runs in inference mode, whose tensors autograd refuses: what the loss needs
        is made within the block.
        """
        with torch.inference_mode(False), torch.enable_grad():
            theta = self._weights.leaf()
            yield theta
        gradient = theta.flat.grad
        assert gradient is not None
        if self._max_gradient_norm > 0:
            self._clip(gradient)
        self._weights.flat.grad = gradient
        self._adam.step()
        self._weights.flat.grad = None

    def resume_at(self, steps: int) -> None:
        """Set how many steps the moments have seen."""
        self._steps.fill_(steps)

    @cached_property
    def _adam(self) -> torch.optim.Adam:
        """Made at the first step: it imports 70 MB, and a compiled run needs none of it."""
        weights = self._weights.flat
        # On a GPU the step may be captured in a graph, and may as well not be: both are meant.
        adam = torch.optim.Adam(
            [weights], lr=self._learning_rate, fused=True, capturable=weights.is_cuda
        )
        vars(adam)["_warned_capturable_if_run_uncaptured"] = True
        flats = {name: stacked.flat for name, stacked in self.moments.items()}
        adam.state[weights] = {"step": self._steps, **flats}
        return adam

    def _clip(self, gradient: Tensor) -> None:
        stacked = Stacked(self._weights.layers, self._weights.networks, flat=gradient)
        views = stacked.of_networks(0, stacked.networks).values()
        rows = torch.cat([view.flatten(1) for view in views], 1)  # [G, parameters]
        factors = clip_factors(rows, self._max_gradient_norm)
        for view in views:
            view.mul_(factors[:, None, None])
