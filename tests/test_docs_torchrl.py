"""docs/torchrl.md: its code, run where torchrl is installed."""

from typing import Any

import pytest
import torch

from msgdrop_cli import MessageDropout
from tests.markdown import page

PAGE = page("torchrl.md")


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the page's code has made."""
    pytest.importorskip("torchrl")
    found: dict[str, Any] = {}
    [code] = PAGE.code("python")
    exec(code, found)
    return found


@pytest.mark.filterwarnings("default")  # TorchRL warns of newer versions of PettingZoo
def test_one_update_is_made(names: dict[str, Any]) -> None:
    """Of actor and critic, from the losses of 25 steps of 8 agents."""
    assert names["played"]["all", "action"].shape == (25, 8)
    gradients = [each.grad for each in names["loss"].parameters() if each.requires_grad]
    assert gradients
    assert all(gradient is not None and bool(gradient.any()) for gradient in gradients)


@pytest.mark.filterwarnings("default")
def test_train_and_eval_reach_message_dropout_through_the_networks_only(
    names: dict[str, Any],
) -> None:
    """As the page warns: losses differ from call to call in train() of actor and critic."""
    actor, critic, loss = names["actor"], names["critic"], names["loss"]
    assert not any(isinstance(each, MessageDropout) for each in loss.modules())
    actor.eval()
    critic.eval()
    loss.train()
    once, twice = (loss(names["played"].clone())["loss_critic"] for _ in range(2))
    assert torch.equal(once, twice)
    critic.train()
    loss.eval()
    once, twice = (loss(names["played"].clone())["loss_critic"] for _ in range(2))
    assert not torch.equal(once, twice)


@pytest.mark.filterwarnings("default")
def test_value_targets_in_train_are_an_error(names: dict[str, Any]) -> None:
    """And not some numbers."""
    names["critic"].train()
    with pytest.raises(RuntimeError, match="random operation"):
        names["gae"](names["played"].clone())
