"""Adam over stacked networks (paper l. 753), with moments that can be taken out run by run."""

import torch

from msgdrop_cli.networks.stacked import Stacked
from msgdrop_cli.ops.td import clip_factors


class Adam:
    """torch's fused Adam on the one flat tensor of `weights`; `gradient` is filled by a network."""

    def __init__(
        self,
        weights: Stacked,
        *,
        learning_rate: float,
        max_gradient_norm: float,
        device: torch.device | str,
    ) -> None:
        self._max_gradient_norm = max_gradient_norm
        self.gradient = Stacked(weights.layers, weights.networks, device)
        weights.flat.grad = self.gradient.flat
        # On a GPU the step may be captured in a graph, and may as well not be: both are meant.
        capturable = weights.flat.is_cuda
        self._adam = torch.optim.Adam(
            [weights.flat], lr=learning_rate, fused=True, capturable=capturable
        )
        vars(self._adam)["_warned_capturable_if_run_uncaptured"] = True
        # Moments that are Stacked too, so that a run's share can be taken out.
        self.moments = {
            name: Stacked(weights.layers, weights.networks, device)
            for name in ("exp_avg", "exp_avg_sq")
        }
        self._step = torch.zeros((), device=device)
        flats = {name: stacked.flat for name, stacked in self.moments.items()}
        self._adam.state[weights.flat] = {"step": self._step, **flats}

    def step(self) -> None:
        """Clip each network's gradient if asked, and move the weights."""
        if self._max_gradient_norm > 0:
            self._clip()
        self._adam.step()

    def resume_at(self, steps: int) -> None:
        """Set how many steps the moments have seen."""
        self._step.fill_(steps)

    def _clip(self) -> None:
        views = self.gradient.of_networks(0, self.gradient.networks).values()
        rows = torch.cat([view.flatten(1) for view in views], 1)  # [G, parameters]
        factors = clip_factors(rows, self._max_gradient_norm)
        for view in views:
            view.mul_(factors[:, None, None])
