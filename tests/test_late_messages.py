"""Training through channels that delay or hold messages, against a slow account of every one."""

from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from msgdrop_cli.channels import LOST, others
from msgdrop_cli.definition.channel import Channel
from msgdrop_cli.engine.run import train_cohort
from msgdrop_cli.engine.scene import kind_in, scene_of
from msgdrop_cli.engine.tensors import read_tensors
from msgdrop_cli.engine.training import Training
from msgdrop_cli.records.store import POLICY
from msgdrop_envs.autoreset import Games
from msgdrop_envs.protocol import Transition
from tests.dcc_samples import use_kernel
from tests.runs import StopAt
from tests.test_lost_messages import through, trained

LATE = ("delay:2", "jitter:0,3", "loss:0.5+hold:2", "delay:1+hold:1", "jitter:1,3+hold:4")
AGENTS, GAMES, LIMIT = 6, 8, 11
Message = tuple[int, int, int]
"""Game, sender, and the step of the training in which it was said."""


class Account:
    """Who has heard what, message by message; it knows nothing of rows, bytes and ages of bytes."""

    def __init__(self, text: str, training: Training) -> None:
        self.channel = Channel.read(text)
        self.env, self.streams = training.env, training.streams
        self.kind = kind_in(self.channel, self.env, "here")
        self.said: dict[Message, Tensor] = {}
        self.heard: dict[tuple[int, int, int], list[tuple[int, Message]]] = {}
        """By game, receiver and sender: when something arrived in this episode, and what."""
        self.begun = [0] * GAMES
        """The step of the training in which each game's episode began (at the earliest, 0)."""

    def uniforms(self, count: int) -> Tensor:
        """The channel's own numbers."""
        return self.streams.uniforms("losses", GAMES, count)

    def arrivals(self, state: Tensor, games: Games) -> tuple[Tensor, Tensor]:
        """Ages [1, E, N, K] and the next state."""
        uniforms = self.uniforms(self.kind.step_uniforms(AGENTS))
        found = self.kind.step(state, uniforms, scene_of(self.kind, self.env, games))
        return found.age, found.state

    def there(self, game: int, step: int, age: Tensor, tell: bool = True) -> list[Message | None]:
        """What each agent has of each other one in this step: N*K of them."""
        messages: list[Message | None] = []
        for i in range(AGENTS):
            for slot, j in enumerate(others(AGENTS)[i].tolist()):
                link, since = (game, i, j), int(age[0, game, i, slot])
                list_so_far = self.heard.get(link, [])
                if since != LOST and step - since >= self.begun[game]:
                    list_so_far = [*list_so_far, (step, (game, j, step - since))]
                if tell:
                    self.heard[link] = list_so_far
                when, message = list_so_far[-1] if list_so_far else (-1, None)
                messages.append(message if step - when <= self.channel.hold else None)
        return messages

    def end(self, game: int, step: int) -> None:
        """Another episode begins in this step."""
        self.begun[game] = step
        self.heard = {link: known for link, known in self.heard.items() if link[0] != game}


def kept(account: Account, messages: list[Message | None]) -> tuple[Tensor, Tensor]:
    """The messages themselves, zeros where there is none, [N, K, O]; and where, [N, K]."""
    size = account.env.observation_size
    rows = [torch.zeros(size) if m is None else account.said[m].float() for m in messages]
    where = torch.tensor([float(m is not None) for m in messages])
    return torch.stack(rows).view(AGENTS, AGENTS - 1, -1), where.view(AGENTS, -1)


def advanced(training: Training) -> Transition:
    """What a step of the training stored."""
    seen: list[Transition] = []
    add = training.replay.add
    training.replay.add = lambda *a: (seen.append(a[1]), add(*a))  # type: ignore
    training.advance()
    training.replay.add = add  # type: ignore[method-assign]
    [transition] = seen
    return transition


@pytest.mark.parametrize("capacity", [400, 96])
@pytest.mark.parametrize("text", LATE)
def test_what_is_heard_and_learnt_from_is_what_a_slow_account_says(
    text: str, capacity: int
) -> None:
    """By who acts, and in every transition of a memory that is overwritten (96) or is not.

    The ends of cut episodes are among the next observations, and what arrives there, too.
    """
    run = through(text, replay_start_env_steps=10_000, replay_capacity=capacity)
    training, twin = Training([run.spec]), Training([run.spec])
    training.begin()
    account = Account(text, twin)
    fresh = account.kind.start(account.uniforms(account.kind.episode_uniforms(AGENTS)), AGENTS)
    age, state = account.arrivals(fresh, training.games)
    transitions: list[list[tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]]] = []
    steps = 34
    for step in range(steps):
        obs = training.games.obs[0]
        account.said |= {
            (g, j, step): obs[g, j].clone() for g in range(GAMES) for j in range(AGENTS)
        }
        now = [account.there(game, step, age) for game in range(GAMES)]
        received = training.replay.received()
        assert received is not None
        for game in range(GAMES):
            messages, where = kept(account, now[game])
            assert torch.equal(received.keep[0, game], where)
            if received.messages is not None:
                masked = received.messages[0, game].float() * where[..., None]
                assert torch.equal(masked, messages)
        transition = advanced(training)
        before = Games(training.games.state, training.games.elapsed, transition.obs)
        age, going = account.arrivals(state, before)
        begun = account.kind.start(account.uniforms(account.kind.episode_uniforms(AGENTS)), AGENTS)
        new, restarted = account.arrivals(begun, training.games)
        row = []
        for game in range(GAMES):
            ends = bool(transition.ended[0, game])
            told = {(game, j, step + 1): transition.obs[0, game, j].clone() for j in range(AGENTS)}
            account.said |= told
            after = kept(account, account.there(game, step + 1, age, tell=False))
            row.append((kept(account, now[game]), after))
            if ends:
                account.end(game, step + 1)
        transitions.append(row)
        ended = transition.ended
        age = torch.where(ended[..., None, None], new, age)
        state = torch.where(ended.view(1, GAMES, *[1] * (state.dim() - 2)), restarted, going)
    compare(training, transitions, steps)


def compare(training: Training, transitions: list[Any], steps: int) -> None:
    """Every transition that can be sampled, of every agent."""
    replay, learner = training.replay, training.learner
    held = len(replay)
    drawn = torch.arange(held).expand(1, AGENTS, held)
    minibatch = replay.minibatch(replay.rows(drawn), learner.shown_agents)
    batch = minibatch.copied()
    links = torch.arange(AGENTS - 1).expand(AGENTS, -1)
    arrived = minibatch.arrived(links)
    first, cuts = steps - held // GAMES, 0
    for place in range(held):
        step, game = first + place // GAMES, place % GAMES
        for half, (messages, where) in enumerate(transitions[step][game]):
            cuts += half and (step + 1 + game * LIMIT // GAMES) % LIMIT == 0
            for agent in range(AGENTS):
                assert torch.equal(arrived[half][agent, place], where[agent])
                blocks = batch.obs[agent, half * held + place, 1:].float()
                assert torch.equal(blocks * where[agent][:, None], messages[agent])
    assert cuts > 3


def test_messages_that_are_never_late_are_learnt_from_as_without_a_channel() -> None:
    """The same bits, though every minibatch is laid out anew."""
    held, none = (
        trained(through(channel, replay_start_env_steps=80), 40).learner.policy(0)
        for channel in ("loss:0+hold:3", "none")
    )
    assert all(torch.equal(held[name], none[name]) for name in none)
    late = trained(through("delay:1", replay_start_env_steps=80), 40).learner.policy(0)
    assert not all(torch.equal(late[name], none[name]) for name in none)


@pytest.mark.parametrize("settings", [{}, {"topology": "ring"}, {"encoder": "autoencoder"}])
def test_the_kernel_learns_late_messages_as_the_page_does(
    settings: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever is heard, and whatever is said."""
    found = []
    for kernel in ("", "torch"):
        use_kernel(kernel, monkeypatch)
        run = through("jitter:0,2+hold:1", replay_start_env_steps=80, **settings)
        training = Training([run.spec])
        generator = torch.Generator().manual_seed(4)
        weights = training.learner.encoding.tensors(0).items()
        training.begin({k: torch.rand(v.shape, generator=generator) - 0.5 for k, v in weights})
        with torch.no_grad():
            for _ in range(30):
                training.advance()
        found.append(training.learner.policy(0))
    for name, tensor in found[0].items():
        torch.testing.assert_close(tensor, found[1][name], rtol=1e-4, atol=2e-5)


@pytest.mark.parametrize("channel", ["jitter:0,3", "loss:0.5+hold:3"])
def test_a_run_through_a_late_channel_goes_on_bit_for_bit(
    channel: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped in the middle and continued, its memory overwritten, it is the run nobody stopped."""
    settings: dict[str, Any] = {
        "epsilon_start": 0.3,
        "replay_start_env_steps": 80,
        "replay_capacity": 160,
        "train_env_steps": 800,
    }
    run = through(channel, **settings)
    monkeypatch.setattr("msgdrop_cli.engine.run._LOOK_UP_EVERY_S", 0.0)
    [outcome] = train_cohort([run], tmp_path / "stopped", stop=StopAt(51))
    assert outcome.status == "interrupted"
    paths = [train_cohort([run], tmp_path / root)[0].path for root in ("stopped", "whole")]
    stopped, whole = (read_tensors(path / POLICY) for path in paths)
    assert all(torch.equal(stopped[name], whole[name]) for name in whole)
