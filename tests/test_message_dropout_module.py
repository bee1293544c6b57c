"""`msgdrop_cli.MessageDropout`: the paper's rule as a module for other people's networks."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

import msgdrop_cli
from msgdrop_cli import MessageDropout, message_dropout

DOCS = Path(__file__).resolve().parents[1] / "docs" / "message-dropout.md"


def ones(*shape: int) -> Tensor:
    """Blocks whose numbers show what became of them; the masks repeat."""
    torch.manual_seed(1)
    return torch.ones(*shape)


def test_training_drops_whole_messages_and_scales_nothing() -> None:
    """Every message is all there or all gone, at the rate, each sample's for itself."""
    kept = MessageDropout(0.2)(ones(4_000, 1 + 3, 5))
    assert bool((kept[:, 0] == 1).all())
    messages = kept[:, 1:]
    assert set(messages.unique().tolist()) == {0.0, 1.0}
    assert bool((messages == messages[..., :1]).all())
    assert messages.mean((0, 2)).tolist() == pytest.approx([0.8] * 3, abs=0.02)


def test_evaluation_scales_messages_and_drops_nothing() -> None:
    """By 1 - rate; the own observation stays as it is."""
    scaled = MessageDropout(0.2).eval()(ones(7, 1 + 3, 5))
    assert bool((scaled[:, 0] == 1).all())
    assert bool((scaled[:, 1:] == 0.8).all())


def test_elements_are_dropped_one_by_one() -> None:
    """With kind "element"; the own observation is kept then, too."""
    kept = MessageDropout(0.5, "element")(ones(500, 1 + 3, 5))
    assert bool((kept[:, 0] == 1).all())
    assert set(kept[:, 1:].sum(-1).unique().tolist()) == {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}


def test_the_own_observation_may_be_dropped_too() -> None:
    """With keeps_own=False it is one block more, in training and in evaluation."""
    drop = MessageDropout(0.5, keeps_own=False)
    assert 0.4 < float(drop(ones(2_000, 1 + 3, 5))[:, 0].mean()) < 0.6
    assert bool((drop.eval()(ones(2, 1 + 3, 5)) == 0.5).all())


@pytest.mark.parametrize("keeps_own", [True, False])
def test_separate_blocks_may_have_different_sizes(keeps_own: bool) -> None:
    """They are treated as the joint ones would be, drawn from the same numbers."""
    drop = MessageDropout(0.5, keeps_own=keeps_own)
    joint = drop(ones(50, 1 + 3, 5))
    messages = ones(50, 3, 5)
    own, heard = drop(torch.ones(50, 9), messages)
    assert torch.equal(heard, joint[:, 1:])
    assert torch.equal(own, joint[:, 0, :1].expand(50, 9))


@pytest.mark.parametrize(("size", "width"), [(9, 5), (5, 9)])
def test_elements_of_separate_blocks_have_a_draw_each(size: int, width: int) -> None:
    """Own observation and messages take what is theirs of the widest mask, new or given."""
    drop = MessageDropout(0.5, "element", keeps_own=False)
    keep = drop.mask(500, 1 + 3, max(size, width))
    assert keep.shape == (500, 1 + 3, 9)
    own, heard = drop(torch.ones(500, size), torch.ones(500, 3, width), keep=keep)
    assert torch.equal(own, keep[:, 0, :size])
    assert torch.equal(heard, keep[:, 1:, :width])
    own, heard = drop(torch.ones(500, size), torch.ones(500, 3, width))
    assert (own.shape, heard.shape) == ((500, size), (500, 3, width))
    assert 0.45 < float(own.mean()) < 0.55
    assert set(own.sum(-1).unique().tolist()) > {1.0, 2.0, 3.0, 4.0}


def test_one_mask_serves_two_calls() -> None:
    """As for m and m' in the paper's loss; evaluation takes none."""
    drop = MessageDropout(0.5)
    blocks = ones(50, 1 + 3, 5)
    keep = drop.mask(*blocks.shape)
    assert torch.equal(drop(blocks, keep=keep), drop(blocks, keep=keep))
    assert torch.equal(drop(blocks, keep=keep)[..., :1], keep)
    assert bool((drop.eval()(blocks, keep=keep)[:, 1:] == 0.5).all())


def test_rate_nothing_and_rate_everything() -> None:
    """Rate 0 is simple DCC, rate 1 is FDC (l. 263)."""
    blocks = ones(50, 1 + 3, 5)
    for training in (True, False):
        assert torch.equal(message_dropout(blocks, 0.0, training=training), blocks)
        assert float(message_dropout(blocks, 1.0, training=training).sum()) == 50 * 5


def test_the_function_is_the_module() -> None:
    """From the same numbers it gives the same."""
    module = MessageDropout(0.3, "element")(ones(20, 4, 5))
    assert torch.equal(message_dropout(ones(20, 4, 5), 0.3, kind="element"), module)


def test_types_and_gradients_pass() -> None:
    """Half precision stays that, and what was dropped has no gradient."""
    blocks = ones(20, 4, 5).half().requires_grad_()
    kept = MessageDropout(0.5)(blocks)
    assert kept.dtype == torch.float16
    kept.sum().backward()
    assert torch.equal(blocks.grad, kept.detach())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("own", "messages", "keep", "said"),
    [
        (torch.ones(5), None, None, r"blocks must be \[\.\.\., 1\+S, M\], not \[5\]"),
        (torch.ones(2, 0, 5), None, None, r"blocks must be .*, not \[2, 0, 5\]"),
        (torch.ones(2, 4, 5).long(), None, None, r"own must be floating-point .* torch\.int64"),
        (torch.ones(2, 5), torch.ones(3, 4, 5), None, r"expected own .*\[2, 5\] and \[3, 4, 5\]"),
        (torch.ones(2, 5), torch.ones(5), None, r"expected own \[\.\.\., O\] and messages"),
        (torch.ones(2, 4, 5), None, torch.ones(3, 4, 1), r"keep must be \[2, 4, '1 or M'\], not"),
        (torch.ones(2, 5), torch.ones(2, 3, 5), torch.ones(2, 3, 1), r"keep must be \[2, 4, "),
    ],
)
def test_tensors_that_do_not_belong_together_are_refused(
    own: Tensor, messages: Tensor | None, keep: Tensor | None, said: str
) -> None:
    """With what was expected, and what was given."""
    with pytest.raises(ValueError, match=said):
        MessageDropout()(own, messages, keep=keep)


@pytest.mark.parametrize("shape", [(), (3,), (0, 5), (2, -1, 3)])
def test_a_mask_needs_the_shape_of_blocks(shape: tuple[int, ...]) -> None:
    """At least own observation and numbers."""
    with pytest.raises(ValueError, match="a mask needs the shape of blocks"):
        MessageDropout().mask(*shape)


@pytest.mark.parametrize("rate", [float("nan"), "0.2", None, torch.tensor(0.2), True])
def test_a_rate_is_a_number(rate: Any) -> None:
    """Nothing else."""
    with pytest.raises(ValueError, match="rate must be between 0 and 1, not "):
        MessageDropout(rate)


def test_what_cannot_be_is_refused() -> None:
    """A rate that is no probability, and a kind that is none."""
    with pytest.raises(ValueError, match=r"rate must be between 0 and 1, not 1\.2"):
        MessageDropout(1.2)
    with pytest.raises(ValueError, match="kind must be one of message, element, not 'block'"):
        message_dropout(torch.ones(2, 3), 0.2, kind="block")  # type: ignore[arg-type]


def test_the_page_says_what_runs() -> None:
    """Its blocks of code, one after the other; the actor's messages are scaled in the end."""
    names: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", DOCS.read_text(), re.DOTALL):
        exec(code, names)
    assert isinstance(names["best"], Tensor)
    assert names["best"].shape == (32,)


def test_the_package_itself_stays_cold() -> None:
    """Its version is read without torch; what it does not have is an AttributeError."""
    code = "import sys, msgdrop_cli; msgdrop_cli.__version__; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
    with pytest.raises(AttributeError, match="has no attribute 'Dropout'"):
        getattr(msgdrop_cli, "Dropout")  # noqa: B009 - mypy knows that it is not there


def test_type_checkers_know_every_public_name() -> None:
    """What is loaded late stands in the stub as well."""
    stub = Path(msgdrop_cli.__file__).with_suffix(".pyi").read_text()
    assert set(re.findall(r"import (\w+) as", stub)) == set(vars(msgdrop_cli)["_PUBLIC"])
