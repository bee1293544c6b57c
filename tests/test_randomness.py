"""SplitMix64 in tensors is SplitMix64; streams are uniform, apart, and free of hidden state."""

import math

import pytest
import torch
from torch import Tensor

from msgdrop_cli.engine import randomness
from msgdrop_cli.engine.randomness import (
    BLOCK,
    Name,
    Streams,
    splitmix64,
    stream_key,
)
from msgdrop_cli.kernels.build import library
from tests.dcc_samples import use_kernel

PUBLISHED = (
    6457827717110365317,
    3203168211198807973,
    9817491932198370423,
    4593380528125082431,
    16408922859458223821,
)
"""The first words of SplitMix64 for seed 1234567 (Rosetta Code, from Vigna's splitmix64.c)."""
NAMES: tuple[Name, ...] = ("init", "explore", "replay", "dropout", "env", "evaluate", "links")


def _splitmix64(key: int, count: int) -> list[int]:
    """The generator as published, one word at a time, in Python's own integers."""
    words = []
    for _ in range(count):
        key = (key + 0x9E3779B97F4A7C15) % 2**64
        z = key
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
        words.append(z ^ (z >> 31))
    return words


def _halves(words: list[int]) -> list[int]:
    return [half for word in words for half in (word >> 32, word & 0xFFFFFFFF)]


def _words(halves: Tensor) -> list[int]:
    """The 64-bit words of pairs of 32-bit numbers, which torch keeps in int64."""
    return [(high << 32) + low for high, low in halves.view(-1, 2).tolist()]


def _chi_squared(values: Tensor, cells: int) -> float:
    expected = values.numel() / cells
    return float(((values.bincount(minlength=cells) - expected) ** 2 / expected).sum())


def _limit(cells: int) -> float:
    """Five standard deviations above the mean of a chi-squared variable."""
    return cells - 1 + 5 * math.sqrt(2 * (cells - 1))


def test_scalar_generator_gives_the_published_words() -> None:
    """The yardstick of this file is right itself."""
    assert tuple(_splitmix64(1234567, 5)) == PUBLISHED


@pytest.mark.parametrize("first", [0, 3, 2**40])
def test_c_and_torch_give_the_same_numbers(first: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit, so that a run's kernel says nothing of its random numbers."""
    if library() is None:
        pytest.skip("no C compiler, or MSGDROP_KERNEL=torch")
    keys = torch.tensor([[stream_key(seed, "dropout") - 2**63] for seed in (1, 2, 3)])
    found = splitmix64(keys, first, 1001)
    monkeypatch.setattr(randomness, "library", lambda: None)
    assert torch.equal(found, splitmix64(keys, first, 1001))


def test_raw_words_are_the_published_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the key 1234567 a stream begins with the published test vector."""
    monkeypatch.setattr(randomness, "stream_key", lambda seed, name: 1234567)
    assert _words(Streams([0])._bits("env", 0, 5)) == list(PUBLISHED)


@pytest.mark.parametrize("first", [0, 1, 999, 2**33])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_words_are_splitmix64_anywhere(seed: int, first: int) -> None:
    """Word n is a function of key and n, for keys with and without the sign bit."""
    key = (stream_key(seed, "replay") + first * 0x9E3779B97F4A7C15) % 2**64
    assert _words(Streams([seed])._bits("replay", first, 100)) == _splitmix64(key, 100)


def test_uniforms_and_integers_are_made_of_the_words() -> None:
    """A uniform is the upper 24 bits of a half word, an integer the half times `below` / 2^32."""
    halves = _halves(_splitmix64(stream_key(7, "env"), 10))
    assert Streams([7]).uniforms("env", 20).tolist() == [[(h >> 8) / 2**24 for h in halves]]
    for below in (1, 5, 199_992, 2**31 - 1):
        found = Streams([7]).integers("env", below, 20)
        assert found.tolist() == [[h * below >> 32 for h in halves]]
    assert Streams([7]).uniforms("env", 1).dtype == torch.float32


def test_numbers_do_not_depend_on_how_they_are_drawn() -> None:
    """Many small draws of odd sizes give the numbers of one large draw, over several blocks."""
    whole = Streams([3, 4]).uniforms("dropout", 3 * BLOCK)
    streams, parts, sizes = Streams([3, 4]), [], [1, 192, 7, BLOCK - 3, 3, BLOCK + 11, 0, 2]
    while streams.positions.get("dropout", 0) < 2 * BLOCK:
        parts += [streams.uniforms("dropout", size) for size in sizes]
    joined = torch.cat(parts, 1)[:, : 3 * BLOCK]
    assert torch.equal(joined, whole[:, : joined.shape[1]])


@pytest.mark.parametrize("position", [0, 1, 2, 191, BLOCK - 1, BLOCK, BLOCK + 1, 5 * BLOCK + 7])
def test_position_is_the_whole_state(position: int) -> None:
    """A new object set to a position goes on as the old one does, odd positions included."""
    old = Streams([5])
    old.uniforms("env", position)
    new = Streams([5])
    new.positions.update(old.positions)
    assert torch.equal(new.uniforms("env", 9), old.uniforms("env", 9))
    assert new.positions == old.positions


@pytest.mark.parametrize("ahead", [2, 3 * BLOCK])
def test_position_can_be_set_back(ahead: int) -> None:
    """A stream set back to an earlier position repeats its numbers, also from an earlier block."""
    streams = Streams([5])
    first = streams.uniforms("env", 9)
    streams.uniforms("env", ahead)
    streams.uniforms("env", BLOCK)
    streams.positions["env"] = 0
    assert torch.equal(streams.uniforms("env", 9), first)


def test_reading_one_stream_does_not_change_another() -> None:
    """Exploration's numbers are the same whether or not dropout has been drawn between them."""
    alone, mixed = Streams([1]), Streams([1])
    for size in (3, 50, 1):
        mixed.uniforms("dropout", 1_001)
        assert torch.equal(alone.uniforms("explore", size), mixed.uniforms("explore", size))


def test_a_runs_numbers_do_not_depend_on_its_cohort() -> None:
    """Row r of a cohort is what seed r draws alone."""
    cohort = Streams([9, 1, 4]).uniforms("replay", 5, 7)
    for row, seed in zip(cohort, (9, 1, 4), strict=True):
        assert torch.equal(Streams([seed]).uniforms("replay", 5, 7)[0], row)


def test_all_streams_of_all_seeds_differ() -> None:
    """No two of 7 streams of 20 seeds share any of their first 100 numbers' 32-bit halves."""
    rows = [Streams(list(range(1, 21))).integers(name, 2**31 - 1, 100) for name in NAMES]
    words = torch.cat(rows).view(-1, 2)  # two halves: equal by chance about once in 2^62
    assert len(set(map(tuple, words.tolist()))) == len(words)
    assert len({stream_key(seed, name) for seed in range(100) for name in NAMES}) == 700


def test_streams_are_uncorrelated() -> None:
    """Neighbouring numbers, streams and seeds have no linear correlation (5 sigma)."""
    count = 50_000
    rows = torch.cat([Streams([1, 2]).uniforms(name, count) for name in NAMES[:3]])
    rows = torch.cat((rows, rows[:1].roll(1, 1))) - 0.5
    correlation = rows @ rows.T * 12 / count
    off_diagonal = correlation - correlation.diagonal().diag()
    assert off_diagonal.abs().max() < 5 / math.sqrt(count)


def test_uniforms_are_uniform() -> None:
    """In [0, 1), flat over 64 cells, also in the lowest of the 24 bits."""
    numbers = Streams([11]).uniforms("env", 200_000)[0]
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    assert _chi_squared((numbers * 64).long(), 64) < _limit(64)
    assert _chi_squared((numbers * 2**24).long() % 64, 64) < _limit(64)


@pytest.mark.parametrize("below", [5, 192])
def test_integers_are_uniform(below: int) -> None:
    """Every integer below the bound is drawn equally often, and no other."""
    numbers = Streams([12]).integers("replay", below, 200_000)[0]
    assert (int(numbers.min()), int(numbers.max())) == (0, below - 1)
    assert _chi_squared(numbers, below) < _limit(below)


@pytest.mark.parametrize("before", [0, 1, 192, BLOCK + 7])
def test_loaded_numbers_are_the_same_at_the_same_place(before: int) -> None:
    """What is loaded ahead in one place is what would have come, and drawing goes on behind it."""
    streams, plain = Streams([3, 4]), Streams([3, 4])
    for each in (streams, plain):
        each.uniforms("env", before)
    places = set()
    for _ in range(3):
        streams.load("env", 35)
        for size in (17, 18):
            numbers = streams.integers("env", 1 << 20, size)
            assert torch.equal(numbers, plain.integers("env", 1 << 20, size))
        places.add(streams._blocks["env"][1].data_ptr())
    assert len(places) == 1
    assert torch.equal(streams.uniforms("env", 50), plain.uniforms("env", 50))
    assert streams.positions == plain.positions


@pytest.mark.parametrize("each", [6, 5])
@pytest.mark.parametrize("first", [0, 3])
@pytest.mark.parametrize("begin", [0, 40])
@pytest.mark.parametrize("kernel", ["", "torch"])
def test_some_rows_are_those_of_all(
    each: int, first: int, begin: int, kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same numbers, and the same that come next, wherever the stream begins and stands."""
    use_kernel(kernel, monkeypatch)
    some, whole = Streams([1, 2], first=begin), Streams([1, 2], first=begin)
    rows = torch.tensor([7, 0, 4])
    for streams in (some, whole) if first else ():
        streams.uniforms("noise", first)
    for _ in range(3):
        expected = whole.uniforms("noise", 9, each)[:, rows]
        assert torch.equal(some.rows("noise", rows, 9, each), expected)
    assert torch.equal(some.uniforms("noise", 5), whole.uniforms("noise", 5))
