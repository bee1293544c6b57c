"""What a critic that all agents share is shown of the others, in a quarter of the products.

Slot k of agent i holds agent k, or agent k + 1 from i = k on. So only two agents ever stand in a
slot, and the 2S products of their blocks with the slot's weights serve all N agents: each adds up
S of them, and block dropout is a matrix of 0 and 1 over these sums instead of a masked copy.
"""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Blocks:
    """One block of each agent, and which of the S others' blocks each agent is shown.

    Letters: `R` runs, `B` batch, `N` agents, `S = N-1` senders, `U` numbers of a block, `H` units.
    """

    slots: Tensor
    """[R*S, 2*B, U]: of every slot the rows of agent k, then those of agent k + 1."""
    units: int
    """U"""
    choice: Tensor
    """[R*B, N, 2*S]: how much of each product an agent adds up."""

    @classmethod
    def of(cls, joint: Tensor, keep: Tensor) -> "Blocks":
        """The blocks of all agents, joint [R, B, N, U]; keep [R, B, N, S]."""
        runs, batch, agents, units = joint.shape
        pairs = joint.unfold(2, 2, 1)  # [R, B, S, U, 2]: agents k and k + 1, a view
        slots = pairs.permute(0, 2, 4, 1, 3).reshape(runs * (agents - 1), 2 * batch, units)
        slot = torch.arange(agents - 1, device=keep.device)
        agent = torch.arange(agents, device=keep.device)[:, None]
        fed = torch.stack((slot < agent, slot >= agent), -1)  # [N, S, 2]
        choice = (keep[..., None] * fed).flatten(3).flatten(0, 1)  # [R*B, N, 2S]
        return cls(slots, units, choice)

    def times(self, weight: Tensor, rows: int) -> Tensor:
        """The sums of products, [R, rows, H] with rows = B*N; weight [R, S*U, H]."""
        products = torch.bmm(self.slots, weight.reshape(-1, self.units, weight.shape[-1]))
        by_sample = products.unflatten(0, (len(weight), -1)).unflatten(2, (2, -1))
        each = by_sample.permute(0, 3, 1, 2, 4).flatten(2, 3).flatten(0, 1)  # [R*B, 2S, H]
        return torch.bmm(self.choice, each).view(len(weight), rows, -1)

    def gradient(self, grad_output: Tensor, out: Tensor) -> None:
        """Write dL/dweight [R, S*U, H] into `out`; grad_output [R, B*N, H]."""
        runs, outputs = len(grad_output), grad_output.shape[-1]
        games, agents, doubled = self.choice.shape
        grads = grad_output.reshape(games, agents, outputs)
        each = torch.bmm(self.choice.mT, grads)  # [R*B, 2S, H]
        slots = each.view(runs, -1, doubled // 2, 2, outputs).permute(0, 2, 3, 1, 4)
        rows = slots.reshape(runs * (doubled // 2), -1, outputs)  # [R*S, 2B, H]
        out.copy_(torch.bmm(self.slots.mT, rows).view_as(out))


@dataclass(frozen=True, slots=True)
class SharedOthers:
    """The others' masked observations and their actions, not multiplied out; rows as [B, N]."""

    observations: Blocks
    actions: Blocks

    def times(self, weight: Tensor, bias: Tensor) -> Tensor:
        """[R, B*N, S*(O+A)] times weight [R, S*(O+A), H] plus bias [R, 1, H]: [R, B*N, H]."""
        rows = self.observations.choice.shape[:2].numel() // len(weight)
        first, second = self._split(weight)
        return self.observations.times(first, rows) + self.actions.times(second, rows) + bias

    def gradient(self, grad_output: Tensor, out: Tensor) -> None:
        """Write dL/dweight [R, S*(O+A), H] into `out`; grad_output [R, B*N, H]."""
        first, second = self._split(out)
        self.observations.gradient(grad_output, first)
        self.actions.gradient(grad_output, second)

    def _split(self, weight: Tensor) -> tuple[Tensor, Tensor]:
        """The rows of the weight that observations and actions meet."""
        senders = self.observations.choice.shape[-1] // 2
        observed = senders * self.observations.units
        return weight[:, :observed], weight[:, observed:]


@dataclass(frozen=True, slots=True)
class WithOthers:
    """Own rows and the others in one layer, for a critic that is fed everything at once."""

    own: Tensor
    """[R, B*N, O+A]"""
    units: int
    """O+A"""
    others: SharedOthers

    def times(self, weight: Tensor, bias: Tensor) -> Tensor:
        """[R, B*N, N*(O+A)] times weight [R, N*(O+A), H] plus bias [R, 1, H]: [R, B*N, H]."""
        rest = self.others.times(weight[:, self.units :], bias)
        return torch.bmm(self.own, weight[:, : self.units]).add_(rest)

    def gradient(self, grad_output: Tensor, out: Tensor) -> None:
        """Write dL/dweight [R, N*(O+A), H] into `out`; grad_output [R, B*N, H]."""
        out[:, : self.units] = torch.bmm(self.own.mT, grad_output)
        self.others.gradient(grad_output, out[:, self.units :])
