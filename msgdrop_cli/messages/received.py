"""What has reached the agents of one step's messages: what a channel makes, and a learner hears."""

from typing import NamedTuple

from torch import Tensor

from msgdrop_cli.definition.channel import Scale


class Received(NamedTuple):
    """In a step of the games [R, E]: of all others, in increasing order."""

    keep: Tensor
    """[R, E, N, S] float32: 1 where there is a message, 0 where the receiver has a zero vector."""
    messages: Tensor | None = None
    """[R, E, N, S, M], the messages themselves; None: what everybody says in this step."""
    scale: Scale = "trained"
    """By what messages are multiplied: 1 - rate (paper l. 248), 1, or `delivered`: 1 - rate times S
    over the number of messages that are there, so that their sum is as in training."""

    def factors(self, trained: Tensor, links: Tensor) -> Tensor:
        """The factors of all blocks, [G, E, 1+S, 1]; trained [G, 1, 1+S, 1], those of Q_exec.

        links: [N, S], where those who are heard stand among all others.
        """
        runs, games = self.keep.shape[:2]
        arrives = self.keep.gather(-1, links.expand(runs, games, -1, -1))
        arrives = arrives.transpose(1, 2).flatten(0, 1)  # [G, E, S]
        factors = trained.expand(-1, games, -1, -1).clone()
        messages = factors[:, :, 1:, 0]
        if self.scale == "one":
            messages.fill_(1.0)
        elif self.scale == "delivered":
            messages *= arrives.shape[-1] / arrives.sum(-1, keepdim=True).clamp(min=1.0)
        messages *= arrives
        return factors


Heard = Received | None
"""None: everything that is said in this step."""
