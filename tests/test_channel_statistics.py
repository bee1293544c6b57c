"""What each channel promises, counted over many games: independent of how it is computed."""

import pytest
import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, Scene, kind_of, others
from msgdrop_cli.definition.channel import NAMED, Channel

AGENTS, GAMES = 5, 400
TMC = [name for name in NAMED if name.startswith("tmc")]


def ages(text: str, steps: int, positions: Tensor | None = None) -> Tensor:
    """Of every message of many games: [steps, GAMES, N, S] int64."""
    kind = kind_of(Channel.read(text))
    generator = torch.Generator().manual_seed(7)
    start = torch.rand(GAMES, kind.episode_uniforms(AGENTS), generator=generator)
    state, found = kind.start(start, AGENTS), []
    for step in range(steps):
        uniforms = torch.rand(GAMES, kind.step_uniforms(AGENTS), generator=generator)
        scene = Scene(AGENTS, torch.full((GAMES,), step), positions)
        arriving = kind.step(state, uniforms, scene)
        state = arriving.state
        found.append(arriving.age.long())
    return torch.stack(found)


def lost(text: str, steps: int, positions: Tensor | None = None) -> Tensor:
    """Which messages do not arrive, [steps, GAMES, N, S] bool."""
    return ages(text, steps, positions) == LOST


def backwards(messages: Tensor) -> Tensor:
    """Of each message [..., N, S] the one that goes the other way."""
    square = messages.new_zeros(*messages.shape[:-1], AGENTS)
    square.scatter_(-1, others(AGENTS).expand(messages.shape), messages)
    return square.mT.gather(-1, others(AGENTS).expand(messages.shape))


@pytest.mark.parametrize("rate", [0.0, 0.2, 0.7, 1.0])
def test_loss_is_as_frequent_as_it_says_and_has_no_memory(rate: float) -> None:
    """Each message by itself: neither the step before nor the way back tells anything."""
    found = lost(f"loss:{rate}", 30)
    assert found.double().mean().item() == pytest.approx(rate, abs=0.005)
    for other in (found.roll(1, 0), backwards(found)):
        both = (found & other).double().mean().item()
        assert both == pytest.approx(rate**2, abs=0.005)


@pytest.mark.parametrize(("share", "mean"), [(0.0, 0), (0.5, 5), (0.25, 2.5), (1.0, 10)])
def test_links_break_both_ways_and_in_their_exact_share(share: float, mean: float) -> None:
    """Of 10 links; once an episode, or anew at every step."""
    for kind, changes in (("links", False), ("links-step", True)):
        found = lost(f"{kind}:{share}", 20)
        assert torch.equal(found, backwards(found))
        broken = found.sum((-1, -2)) // 2
        assert set(broken.unique().tolist()) <= {int(mean), int(mean + 0.5)}
        assert broken.double().mean().item() == pytest.approx(mean, abs=0.07)
        stays = bool((found == found[:1]).all())
        assert stays != (changes and share in (0.25, 0.5))


@pytest.mark.parametrize("text", ["bursts:0.2,4", "bursts:0.5,2", "bursts:0.05,1", *TMC])
def test_bursts_have_their_loss_and_their_length(text: str) -> None:
    """In every step, from the first on; lengths are those of whole bursts, and geometric."""
    mean_loss, mean_length = Channel.read(text).settings
    found = lost(text, 150)
    by_step = found.double().mean((1, 2, 3))
    assert by_step.numpy() == pytest.approx(mean_loss, abs=0.03)
    assert by_step.mean().item() == pytest.approx(mean_loss, rel=0.05)
    begins = found[1:] & ~found[:-1]
    # A burst that has begun goes on with the same probability at every step.
    goes_on = (found[2:] & found[1:-1]).sum().item() / found[1:-1].sum().item()
    assert goes_on == pytest.approx(1 - 1 / mean_length, abs=0.02)
    rate = begins.sum().item() / (~found[:-1]).sum().item()
    assert rate == pytest.approx(mean_loss / (1 - mean_loss) / mean_length, rel=0.06)
    both = (found & backwards(found)).double().mean().item()
    assert both == pytest.approx(mean_loss**2, abs=0.01)


def test_bursts_that_cannot_be_are_refused() -> None:
    """Nine tenths lost in bursts of two steps would need more than one beginning a step."""
    with pytest.raises(Exception, match="take at least 9 steps"):
        kind_of(Channel.read("bursts:0.9,2"))


def test_one_way_links_break_in_one_direction() -> None:
    """Exactly half of the 20 directed links; both directions only as chance has it."""
    found = lost("one-way:0.5", 3)
    assert (found.sum((-1, -2)) == 10).all()
    both = (found & backwards(found)).double().mean().item()
    assert both == pytest.approx(0.5 * 9 / 19, abs=0.01)
    assert (found == found[:1]).all()


@pytest.mark.parametrize("count", [0, 1, 3, 9])
def test_the_silent_are_heard_by_nobody(count: int) -> None:
    """And everybody else by everybody."""
    found = lost(f"silent:{count}", 2)
    heard = torch.ones(2, GAMES, AGENTS, AGENTS)
    heard.scatter_(-1, others(AGENTS).expand(found.shape), (~found).float())
    silent = (heard.sum(-2) == 1).sum(-1)  # only its own place is left
    assert (silent == min(count, AGENTS)).all()
    assert (found.sum((-1, -2)) == min(count, AGENTS) * (AGENTS - 1)).all()


def test_a_delay_is_the_age() -> None:
    """Of every message."""
    assert (ages("delay:7", 3) == 7).all()
    assert (ages("delay:0", 3) == 0).all()


def test_jitter_has_the_ages_of_messages_that_overtake_each_other() -> None:
    """P(age > a) is the product of P(the message of j steps ago takes more than j), j <= a."""
    found = ages("jitter:1,3", 30)[5:]
    longer = [(found > age).double().mean().item() for age in range(4)]
    # Takes 1, 2 or 3 steps: more than 0 always, more than 1 in 2/3, more than 2 in 1/3.
    assert longer == pytest.approx([1.0, 2 / 3, 2 / 9, 0.0], abs=0.01)
    fresh = ages("jitter:2,4", 5)
    assert (fresh[:2] == LOST).all()
    assert (found[1:] <= found[:-1] + 1).all(), "a receiver forgets nothing newer"


def test_distance_decides_who_is_heard() -> None:
    """Within: exactly; distance: with a probability that grows in proportion."""
    where = torch.tensor([[0.0, 0], [3, 4], [6, 8], [0, 5], [30, 0]]).expand(GAMES, -1, -1)
    apart = (where[0, others(AGENTS)] - where[0, :, None]).norm(dim=-1)
    assert torch.equal(lost("within:5", 1, where)[0, 0], apart > 5)
    found = lost("distance:20", 40, where).double().mean((0, 1))
    assert found.numpy() == pytest.approx((apart / 20).clamp(max=1).numpy(), abs=0.02)


def test_noise_is_gaussian_and_finite() -> None:
    """Mean 0 and the deviation that was asked for; finite at both ends of the numbers."""
    kind = kind_of(Channel.read("noise:0.5"))
    uniforms = torch.rand(200_000, generator=torch.Generator().manual_seed(1))
    found = kind.alter(torch.full((200_000,), 3.0), uniforms)
    assert found.mean().item() == pytest.approx(3.0, abs=0.005)
    assert found.std().item() == pytest.approx(0.5, abs=0.005)
    assert (found > 3.5).double().mean().item() == pytest.approx(0.1587, abs=0.003)
    assert kind.alter(torch.zeros(2), torch.tensor([0.0, 1 - 2**-24])).isfinite().all()


def test_controls_say_whose_message_it_is() -> None:
    """Another game's, another sender's, one's own; each sender once where they are swapped."""
    scene = Scene(AGENTS, torch.zeros(GAMES, dtype=torch.long))
    empty, uniforms = torch.zeros(GAMES, 0), torch.rand(GAMES, 20)
    shuffled = kind_of(Channel("shuffled")).step(empty, uniforms, scene)
    assert shuffled.game is not None
    assert (shuffled.game != torch.arange(GAMES)).all()
    assert len(shuffled.game.unique()) == GAMES
    swapped = kind_of(Channel("swapped")).step(empty, uniforms, scene).speaker
    assert swapped is not None
    assert torch.equal(swapped.sort(-1).values, others(AGENTS).expand_as(swapped))
    same = (swapped == others(AGENTS)).double().mean().item()
    assert same == pytest.approx(1 / (AGENTS - 1), abs=0.03)
    own = kind_of(Channel("own")).step(empty, uniforms, scene).speaker
    assert own is not None
    assert (own == torch.arange(AGENTS)[:, None]).all()
