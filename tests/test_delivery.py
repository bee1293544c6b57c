"""What receivers are handed, against a slow account of it, message by message."""

from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.algorithms.dcc import DCC, Config
from msgdrop_cli.channels import LOST, others
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.delivery import Delivery
from msgdrop_cli.engine.randomness import Streams
from msgdrop_cli.errors import DefinitionError
from msgdrop_cli.messages.received import Received
from msgdrop_envs import autoreset, registry

AGENTS, EPISODES, STEPS = 6, 4, 9
ENV = registry.make(registry.settings()["pursuit-n6"], "cpu")
TEXTS = (
    *("loss:0.5", "loss:0.5+hold:2", "loss:0.5+mean", "delay:3", "jitter:0,3+hold:1"),
    *("constant", "bursts:0.4,3+hold:100", "shuffled", "swapped", "own", "loss:0.6+scale:one"),
)


def played(text: str) -> list[tuple[autoreset.Games, Tensor, Received, Any]]:
    """Some steps of pursuit, whose episodes end one after another: games, playing, received."""
    generator = torch.Generator().manual_seed(3)
    delivery = Delivery(Channel.read(text), ENV, Streams([5]), EPISODES)
    twin = Delivery(Channel.read(text), ENV, Streams([5]), EPISODES)
    uniforms = torch.rand(1, EPISODES, ENV.reset_uniforms, generator=generator)
    games = autoreset.start(ENV, uniforms, torch.zeros(1, EPISODES).long())
    playing, seen = torch.arange(EPISODES), []
    for step in range(STEPS):
        seen.append(
            (games, playing, delivery(games, playing, games.obs), twin.arriving(games, playing))
        )
        actions = torch.randint(5, (1, len(playing), AGENTS), generator=generator)
        numbers = torch.rand(1, len(playing), ENV.step_uniforms, generator=generator)
        games, _ = autoreset.play(ENV, games, actions, numbers)
        if step == 5:
            on = torch.tensor([True, False, True, True])
            games, playing = autoreset.take(games, on), playing[on]
    return seen


def expected(text: str) -> list[dict[tuple[int, int, int], Tensor | None]]:
    """By step: episode, agent, sender's place -> what is there; None: nothing."""
    channel, senders = Channel.read(text), others(AGENTS)
    said: dict[tuple[int, int, int], Tensor] = {}
    heard: dict[tuple[int, int, int], list[tuple[int, Tensor]]] = {}
    answer = []
    for step, (games, playing, _, found) in enumerate(played(text)):
        there: dict[tuple[int, int, int], Tensor | None] = {}
        for place, episode in enumerate(playing.tolist()):
            for agent in range(AGENTS):
                said[episode, agent, step] = games.obs[0, place, agent].float()
        for place, episode in enumerate(playing.tolist()):
            for agent in range(AGENTS):
                for slot in range(AGENTS - 1):
                    age = int(found.age[0, place, agent, slot])
                    speaker = senders if found.speaker is None else found.speaker[0, place]
                    who = int(speaker[agent, slot])
                    game = int(playing[found.game[0, place]]) if found.game is not None else episode
                    key = (episode, agent, slot)
                    message = None
                    if age != LOST and age <= step:
                        message = said[game, who, step - age]
                        heard.setdefault(key, []).append((step, message))
                    elif key in heard and channel.hold:
                        when, last = heard[key][-1]
                        message = last if step - when <= channel.hold else None
                    elif key in heard and channel.missing == "mean":
                        message = torch.stack([each for _, each in heard[key]]).mean(0)
                    there[key] = message
        answer.append(there)
    return answer


@pytest.mark.parametrize("text", TEXTS)
def test_what_receivers_have_is_what_a_slow_account_says(text: str) -> None:
    """Every message of every step, while episodes end."""
    nothing = 0
    for (games, playing, received, _), there in zip(played(text), expected(text), strict=True):
        messages = received.messages
        if messages is None:
            messages = games.obs[:, :, others(AGENTS)]
        for place, episode in enumerate(playing.tolist()):
            for agent in range(AGENTS):
                for slot in range(AGENTS - 1):
                    message = there[episode, agent, slot]
                    keep = received.keep[0, place, agent, slot]
                    nothing += message is None
                    assert keep == (message is not None)
                    if message is not None:
                        found = messages[0, place, agent, slot].float()
                        torch.testing.assert_close(found, message)
    assert (nothing > 0) == (text not in ("constant", "shuffled", "swapped", "own"))


@pytest.mark.parametrize(
    "text", ["delay:0", "noise:0", "jitter:0,0", "loss:0+hold:3", "loss:0+mean"]
)
def test_a_channel_that_does_nothing_hands_over_what_is_said(text: str) -> None:
    """The same Q-values, to the last bit."""
    learner = DCC([Config(rate=0.3)], ENV)
    learner.initialise(torch.rand(1, learner.init_uniforms))
    for games, _, received, _ in played(text):
        assert (received.keep == 1).all()
        q = learner.q_exec(games.obs, received)
        if text.endswith("mean"):  # numbers instead of bytes, so the page computes
            torch.testing.assert_close(q, learner.q_exec(games.obs), rtol=1e-5, atol=1e-5)
        else:
            assert torch.equal(q, learner.q_exec(games.obs))


@pytest.mark.parametrize("network", ["fgh", "concat"])
@pytest.mark.parametrize("topology", ["all", "ring"])
def test_the_kernel_hears_what_the_page_hears(
    network: Any, topology: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Old messages of whoever is heard, some of them missing."""
    config = Config(rate=0.3, network=network, topology=topology)
    ours = DCC([config] * 2, ENV)
    monkeypatch.setenv("MSGDROP_KERNEL", "torch")
    page = DCC([config] * 2, ENV)
    weights = torch.rand(2, ours.init_uniforms, generator=torch.Generator().manual_seed(1))
    for learner in (ours, page):
        learner.initialise(weights)
    for games, _, received, _ in played("loss:0.4+hold:1"):
        assert received.messages is not None
        # A second run whose games are those of the first in another order.
        obs, keep, messages = (
            torch.cat((each, each.flip(1)))
            for each in (games.obs, received.keep, received.messages)
        )
        found = ours.q_exec(obs, Received(keep, messages))
        expected = page.q_exec(obs, Received(keep, messages))
        torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)
        assert not torch.allclose(found, ours.q_exec(obs, Received(0 * keep, messages)))


def test_scales_are_what_they_are_called() -> None:
    """Trained: 1 - rate; one: 1; delivered: 1 - rate times all over those who arrived."""
    trained = torch.tensor([1.0, 0.75, 0.75, 0.75, 0.75]).view(1, 1, 5, 1).expand(5, -1, -1, -1)
    links = torch.arange(4).expand(5, 4)
    keep = torch.tensor([[1.0, 0, 0, 1]]).expand(1, 1, 5, 4).clone()
    keep[0, 0, 4] = 0
    expected = {"trained": 0.75, "one": 1.0, "delivered": 1.5}
    for scale, factor in expected.items():
        found = Received(keep, scale=scale).factors(trained, links)  # type: ignore[arg-type]
        assert found[0, 0, :, 0].tolist() == [1.0, factor, 0.0, 0.0, factor]
        assert found[4, 0, :, 0].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]


def test_a_game_without_places_is_told_apart() -> None:
    """Distance has no meaning there."""

    class Nowhere:
        agents = 3

    with pytest.raises(DefinitionError, match="does not say where its agents are"):
        Delivery(Channel.read("within:3"), Nowhere(), Streams([1]), 2)  # type: ignore[arg-type]
