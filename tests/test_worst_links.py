"""The worst links, on a policy of which we know whom it needs."""

import pytest
import torch
from torch import Tensor

from msgdrop_cli.channels import others
from msgdrop_cli.engine import worst_links as engine
from msgdrop_cli.engine.worst_links import without_each, worst_links
from msgdrop_cli.messages.received import Received
from msgdrop_envs import registry

ENV = registry.make(registry.settings()["navigation-n8"], "cpu")
AGENTS = 8
WORTH = {(1, 4): 3.0, (2, 3): 2.0, (0, 7): 1.0}
"""Links, and at how much of the time those who need them push east when they are broken."""


def act(obs: Tensor, received: Received) -> Tensor:
    """Everybody stays, but for those who miss somebody: they leave the square."""
    actions = torch.zeros(obs.shape[:3], dtype=torch.long)
    for (one, other), worth in WORTH.items():
        for listener, sender in ((one, other), (other, one)):
            slot = others(AGENTS)[listener].tolist().index(sender)
            missing = received.keep[..., listener, slot] == 0
            leaves = torch.arange(obs.shape[1]) % 3 < worth
            actions[..., listener] += missing.long() * leaves.long()
    return actions


def test_links_are_found_in_the_order_of_their_worth() -> None:
    """The first two are those whose loss costs most, both ways, and nothing else is broken."""
    lost = worst_links(act, ENV, 3, 2)
    links = {
        (min(i, int(j)), max(i, int(j)))
        for i in range(AGENTS)
        for j, gone in zip(others(AGENTS)[i], lost[i], strict=True)
        if gone
    }
    assert links == {(1, 4), (2, 3)}
    assert lost.sum() == 4


def test_every_link_is_tried_on_the_same_games() -> None:
    """Those that nobody needs are worth exactly the same."""
    found = without_each(act, ENV, 3, torch.zeros(28, dtype=torch.bool), "cpu")
    assert [link.agents for link in found[:3]] == [(1, 4), (2, 3), (0, 7)]
    assert len({link.returns for link in found[3:]}) == 1
    assert len(found) == 28


def test_all_links_are_all_links() -> None:
    """However many are asked for."""
    assert worst_links(act, ENV, 3, 0).sum() == 0
    small = registry.make(registry.settings()["navigation-n8"], "cpu")
    assert worst_links(lambda obs, _: torch.zeros(obs.shape[:3]).long(), small, 1, 99).all()


def test_more_episodes_than_fit_side_by_side_are_played_in_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Link by link, of the same games: the same numbers."""
    none = torch.zeros(28, dtype=torch.bool)
    together = without_each(act, ENV, 3, none, "cpu", 6)
    monkeypatch.setattr(engine, "_AT_ONCE", 13)
    assert without_each(act, ENV, 3, none, "cpu", 6) == together
