"""Many steps of training at one launch: what a GPU repeats instead of being told each time.

A step with its updates is some hundreds of small operations, and telling a GPU about them takes the
host longer than doing them takes the GPU. So a chunk of steps is recorded once, as a CUDA graph,
and repeated. What is recorded is `Training.advance` itself: no rule stands here.

What the host decides within a chunk (how many updates are due, which of them copies the target) is
its *pattern*; each has a recording of its own. What changes from one chunk to the next lies in
tensors that stay where they are: the games, the random numbers, and the memory's clock, from which
rows and epsilon follow. The first chunk of each pattern is played without a recording: it loads
whatever loads itself at first use, and shows how many random numbers a chunk takes.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol

import torch
from torch import Tensor

from msgdrop_cli.engine.training import Training
from msgdrop_envs.autoreset import Games

STEPS = 25
"""Steps in a chunk: 625 make a row of the log with the usual 8 games, so that nothing is left."""

Pattern = tuple[tuple[bool, ...], ...]
"""For each step, for each update that is due after it: whether it does more than the others."""


class Recorder(Protocol):
    """Something that can repeat operations on tensors."""

    def record(self, body: Callable[[], None]) -> Callable[[], None]:
        """Take down what `body` does to tensors, without doing it; the result does it."""

    def send(self, tensor: Tensor) -> Callable[[], Tensor]:
        """Begin to bring the numbers of a tensor to the host; the result waits for them."""


class CudaGraphs:
    """Recordings as CUDA graphs. They share their memory: none keeps anything in it."""

    def __init__(self) -> None:
        self._pool = torch.cuda.graph_pool_handle()

    def record(self, body: Callable[[], None]) -> Callable[[], None]:
        """Capture `body`, in which the host must not wait for the GPU."""
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph, pool=self._pool, capture_error_mode="thread_local"):
            body()
        return graph.replay

    def send(self, tensor: Tensor) -> Callable[[], Tensor]:
        """Copy it behind all that was launched so far."""
        copied = tensor.to("cpu", non_blocking=True)  # into pinned memory: nothing waits here
        sent = torch.cuda.Event(blocking=True)
        sent.record()

        def arrived() -> Tensor:
            sent.synchronize()
            return copied

        return arrived


def recorder(device: str) -> Recorder | None:
    """What repeats steps on this device; None on the CPU, where a call costs little."""
    return CudaGraphs() if torch.device(device).type == "cuda" else None


class Chunks:
    """Advances a Training by chunks where something can repeat them, else step by step."""

    def __init__(self, training: Training, recorder: Recorder | None, steps: int = STEPS) -> None:
        self._training, self._recorder, self._steps = training, recorder, steps
        self._drawn: dict[Pattern, Mapping[str, int]] = {}
        self._recorded: dict[Pattern, Callable[[], None]] = {}
        self._games: Games | None = None
        self._sent: tuple[Callable[[], Tensor], int] | None = None
        self._unseen = 0
        """Steps since the last look at the numbers."""
        self._clock = torch.zeros((), dtype=torch.long, device=training.streams.device)

    def advance(self, most: int) -> None:
        """Advance by a chunk, if `most` steps allow it and learning has begun, or by one step."""
        training, recorder = self._training, self._recorder
        if recorder is None:
            training.advance()  # sees for itself whether the numbers are finite
            return
        starts = training.learner.config.replay_start_env_steps
        # What a channel remembers changes its place at every step, which no recording knows.
        if training.lost or most < self._steps or training.env_steps < starts:
            training.advance()
            self._unseen += 1
        else:
            self._advance_by_a_chunk(recorder)
            self._unseen += self._steps
        if self._unseen >= self._steps:
            self._unseen = 0
            self._look(recorder)

    def _advance_by_a_chunk(self, recorder: Recorder) -> None:
        pattern = self._pattern()
        if pattern not in self._drawn:
            self._drawn[pattern] = self._numbers_of_a_chunk()
            return
        with self._in_place(pattern):
            if pattern not in self._recorded:
                self._recorded[pattern] = recorder.record(self._play)
            self._recorded[pattern]()

    def _look(self, recorder: Recorder) -> None:
        """See whether the numbers were finite at the look before, not now: a chunk's steps ago.

        So the host is ahead of the GPU by one launch, never by none or a hundred.
        """
        training, before = self._training, self._sent
        numbers = recorder.send(torch.cat(training.watched))
        self._sent = numbers, training.learner.progress[0]
        if before is not None:
            numbers, updates = before
            training.look(numbers().tolist(), updates)

    def _pattern(self) -> Pattern:
        """What the host will decide in the chunk that begins now."""
        training, learner = self._training, self._training.learner
        update, env_steps = learner.progress[0], training.env_steps
        pattern = []
        for _ in range(self._steps):
            env_steps += training.games_each
            due = training.updates_due_at(env_steps)
            pattern.append(tuple(map(learner.does_more, range(update, update + due))))
            update += due
        return tuple(pattern)

    def _numbers_of_a_chunk(self) -> Mapping[str, int]:
        """Play a chunk, and count the random numbers that it takes of each stream."""
        before = dict(self._training.streams.positions)
        for _ in range(self._steps):
            self._training.advance()
        after = self._training.streams.positions
        drawn = {name: last - before.get(name, 0) for name, last in after.items()}
        return {name: count for name, count in drawn.items() if count}

    @contextmanager
    def _in_place(self, pattern: Pattern) -> Iterator[None]:
        """All that a recorded chunk reads is put where it expects it; the host counts afterwards.

        A chunk that is repeated passes by the host's counters, one that is being recorded does not.
        """
        training, streams = self._training, self._training.streams
        if self._games is None:
            self._games = _copy(training.games)
        elif self._games is not training.games:
            _overwrite(self._games, training.games)
        training.games = self._games
        positions = dict(streams.positions)
        progress = training.learner.progress
        added, env_steps = training.replay.added, training.env_steps
        for name, count in self._drawn[pattern].items():
            streams.load(name, count)
            positions[name] = positions.get(name, 0) + count
        training.replay.clock = self._clock.fill_(added)
        yield
        training.replay.clock = None
        training.games = self._games
        training.replay.added = added + self._steps
        training.env_steps = env_steps + self._steps * training.games_each
        updates = sum(map(len, pattern))
        training.learner.resume_at(*(count + updates for count in progress))
        streams.positions = positions

    def _play(self) -> None:
        """What is recorded."""
        assert self._games is not None
        for _ in range(self._steps):
            self._training.advance()
        _overwrite(self._games, self._training.games)


def _copy(games: Games) -> Games:
    state = {field.name: getattr(games.state, field.name) for field in _fields(games)}
    fresh = {name: tensor.clone() for name, tensor in state.items()}
    state = dataclasses.replace(games.state, **fresh)
    return Games(state, games.elapsed.clone(), games.obs.clone())


def _overwrite(old: Games, new: Games) -> None:
    for field in _fields(old):
        getattr(old.state, field.name).copy_(getattr(new.state, field.name))
    old.elapsed.copy_(new.elapsed)
    old.obs.copy_(new.obs)


def _fields(games: Games) -> tuple["dataclasses.Field[object]", ...]:
    return dataclasses.fields(games.state)
