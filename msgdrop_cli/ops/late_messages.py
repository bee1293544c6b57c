"""Messages of earlier steps, found in the memory in which all joint observations stand in order.

A message k steps old is the row k steps earlier in the same game, so a byte a link says all: 0,
nothing arrives; else 1 more than the age of what does. Letters: as in `minibatch`, and `K` all
other agents, of whom S are heard.
"""

from dataclasses import replace

import torch
from torch import Tensor

from msgdrop_cli.ops.minibatch import Minibatch, links_heard


def rows_said_in(
    arrives: Tensor, row: Tensor, game: Tensor, step: Tensor, slots: int, games: int
) -> Tensor:
    """The row in which each message was said, [..., K]; any row where none arrives.

    arrives: [..., K] uint8; row: [...], where this step's observation stands; game: which of the
    games it is, [...]; step: [...], of which all earlier ones stand in slot `step % slots`.
    """
    age = (arrives.long() - 1).clamp(min=0)
    earlier = (step[..., None] - age) % slots * games + game[..., None]
    return torch.where(age == 0, row[..., None], earlier)


def taken(memory: Tensor, rows: Tensor, agents: Tensor) -> Tensor:
    """What agents said (or saw) in rows of the memory of their run, [R, ..., U].

    memory: [R, obs rows, N, U]; rows: [R, ...]; agents: to go with them.
    """
    run = torch.arange(len(memory), device=memory.device).view(-1, *[1] * (rows.dim() - 1))
    places = (rows + run * memory.shape[1]) * memory.shape[2] + agents
    found = memory.view(-1, memory.shape[-1]).index_select(0, places.flatten())
    return found.view(*places.shape, memory.shape[-1])


def with_late_messages(drawn: Minibatch, slots: int, games: int) -> Minibatch:
    """The same minibatch in a memory of its own, in which every block lies where it is looked for.

    drawn: [R, N, B], of a memory as in `rows_said_in`, whose `arrives` tells ages. What every
    network sees has rows of its own there, the B observations before the B next ones.
    """
    (runs, agents, size), shown, arrives = drawn.rows.shape, drawn.shown, drawn.arrives
    assert arrives is not None
    heard = links_heard(shown)  # [N, S], among all others

    def of_rows(memory: Tensor) -> Tensor:  # of transitions: [R, N*B, ...]
        run = torch.arange(runs, device=shown.device)[:, None]
        return memory[run, drawn.rows.flatten(1)]

    after = of_rows(drawn.next_row).view_as(drawn.rows).long()
    row = torch.stack((drawn.rows, after), 1)  # [R, 2, N, B]
    step = torch.stack((drawn.rows // games, drawn.rows // games + 1), 1)
    game = torch.stack((drawn.rows % games,) * 2, 1)  # a cut episode's end stands apart
    everything = taken(arrives.flatten(2)[:, :, None], row, torch.zeros_like(row))
    known = everything.unflatten(-1, arrives.shape[2:])  # [R, 2, N, B, N, K]
    mine = known.diagonal(dim1=2, dim2=4).movedim(-1, 2)  # [R, 2, N, B, K]
    mine = mine.gather(-1, heard[:, None].expand(runs, 2, -1, size, -1))
    said = rows_said_in(mine, row, game, step, slots, games)
    rows = torch.cat((row[..., None], said), -1)  # [R, 2, N, B, 1+S]

    def laid_out(memory: Tensor) -> Tensor:
        return taken(memory, rows, shown[:, None]).flatten(1, 3)  # [R, 2*N*B, 1+S, U]

    numbers = torch.arange(agents * size, device=shown.device)
    return replace(
        drawn,
        obs=laid_out(drawn.obs),
        messages=None if drawn.messages is None else laid_out(drawn.messages),
        arrives=known.flatten(1, 3).contiguous(),
        next_row=(numbers + agents * size).int().repeat(runs, 1),
        action=of_rows(drawn.action).contiguous(),
        reward=of_rows(drawn.reward).contiguous(),
        discount=of_rows(drawn.discount).contiguous(),
        rows=numbers.view(agents, size).repeat(runs, 1, 1),
        shown=torch.arange(shown.shape[1], device=shown.device).repeat(agents, 1),
    )
