"""Named streams of random numbers, one of each kind for every run of a cohort.

The generator is SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators,
OOPSLA 2014). It is counter-based: number n of a stream is a function of (seed, stream, n) alone.
So CPU and GPU see the same numbers, a cohort's runs stay independent, the state of a stream is
one position, and reading one stream more often cannot change another.
"""

import hashlib
from collections.abc import Sequence
from ctypes import c_int64, c_uint64, c_void_p
from typing import Literal

import torch
from torch import Tensor

from msgdrop_cli.kernels.build import library

Name = Literal[
    "init",
    "explore",
    "replay",
    "dropout",
    "env",
    "evaluate",
    "links",
    "noise",
    "worst",
    "losses",
    "epsilon",
]
BLOCK = 16_384
"""Numbers made ahead at a time: enough that a draw costs a slice (benchmarks/NOTES.md)."""
_WEYL, _MIX1, _MIX2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB


class Streams:
    """The streams of R runs, read in lockstep. Positions count numbers, from 0."""

    def __init__(
        self, seeds: Sequence[int], device: torch.device | str = "cpu", *, first: int = 0
    ) -> None:
        """first: the position at which every stream is read first."""
        self._seeds, self._first = tuple(seeds), first
        self.device = device
        self.positions: dict[str, int] = {}
        self._keys: dict[str, Tensor] = {}
        self._blocks: dict[str, tuple[int, Tensor]] = {}
        self._places: dict[tuple[str, int], Tensor] = {}

    def uniforms(self, name: Name, *shape: int) -> Tensor:
        """The next float32 numbers in [0, 1), multiples of 2^-24: [R, *shape]."""
        return ((self._draw(name, shape) >> 8) * 2.0**-24).view(len(self._seeds), *shape)

    def rows(self, name: Name, rows: Tensor, of: int, *shape: int) -> Tensor:
        """Some rows of what `uniforms(name, of, *shape)` gives, [R, len(rows), *shape].

        rows: [any] int64. The others are passed over, as far as whole words are: where most
        episodes have ended, most numbers are nobody's.
        """
        each, position = torch.Size(shape).numel(), self.positions.get(name, self._first)
        if len(rows) == of or each % 2 or position % 2:
            return self.uniforms(name, of, *shape)[:, rows]
        self.positions[name] = position + of * each
        words = position // 2 + rows * (each // 2)
        keys = (self._key(name) + words * _signed(_WEYL)).view(-1, 1)  # [R * len(rows), 1]
        bits = splitmix64(keys, 0, each // 2)
        return ((bits >> 8) * 2.0**-24).view(len(self._seeds), len(rows), *shape)

    def integers(self, name: Name, below: int | Tensor, *shape: int) -> Tensor:
        """The next integers on 0 to below - 1 (below < 2^31): [R, *shape] int64.

        Of 2^32 draws some integers get one more than others: their probabilities differ by
        below / 2^32, so 4.7e-5 of themselves where one of 200,000 is drawn.
        """
        return ((self._draw(name, shape) * below) >> 32).view(len(self._seeds), *shape)

    def load(self, name: str, count: int) -> None:
        """Have the next `count` numbers lie where those of the last such call lay (graphs.py)."""
        position = self.positions.get(name, self._first)
        bits = self._bits(name, position // 2, count // 2 + 1)
        bits = bits[:, position % 2 : position % 2 + count]
        place = self._places.setdefault((name, count), torch.empty_like(bits))
        self._blocks[name] = (position, place.copy_(bits))

    def _draw(self, name: Name, shape: tuple[int, ...]) -> Tensor:
        count = torch.Size(shape).numel()
        position = self.positions.get(name, self._first)
        start, block = self._blocks.get(name, (0, None))
        if block is None or position < start or position + count > start + block.shape[1]:
            start = position - position % 2
            block = self._bits(name, start // 2, max(count + 1, BLOCK) // 2 + 1)
            self._blocks[name] = (start, block)
        self.positions[name] = position + count
        return block[:, position - start : position - start + count]

    def _bits(self, name: str, first_word: int, words: int) -> Tensor:
        """32-bit numbers, two from each 64-bit word: [R, 2 * words] int64."""
        return splitmix64(self._key(name), first_word, words)

    def _key(self, name: str) -> Tensor:
        """Where a stream begins, [R, 1]."""
        if name not in self._keys:
            keys = [[_signed(stream_key(seed, name))] for seed in self._seeds]
            self._keys[name] = torch.tensor(keys, device=self.device)
        return self._keys[name]


def splitmix64(keys: Tensor, first_word: int, words: int) -> Tensor:
    """Words `first_word` on of the streams that begin at `keys` [R, 1], as two halves each.

    Returns [R, 2 * words] int64, the upper 32 bits of a word first.
    """
    compiled = library() if keys.device.type == "cpu" else None
    if compiled is not None:  # the same numbers
        bits = torch.empty(len(keys), 2 * words, dtype=torch.int64)
        counts = (c_int64(len(keys)), c_uint64(first_word), c_int64(words))
        compiled.splitmix64(c_void_p(keys.data_ptr()), *counts, c_void_p(bits.data_ptr()))
        return bits
    steps = torch.arange(words, device=keys.device) * _signed(_WEYL)
    z = keys + _signed((first_word + 1) * _WEYL) + steps  # [R, words]
    z = (z ^ _shift_right(z, 30)) * _signed(_MIX1)
    z = (z ^ _shift_right(z, 27)) * _signed(_MIX2)
    z = z ^ _shift_right(z, 31)
    return torch.stack((_shift_right(z, 32), z & 0xFFFFFFFF), -1).flatten(1)


def stream_key(seed: int, name: str) -> int:
    """Where stream `name` of `seed` begins: 64 bits of a SHA-256, so that streams lie far apart."""
    digest = hashlib.sha256(f"msgdrop/{seed}/{name}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


def _shift_right(z: Tensor, bits: int) -> Tensor:
    """A logical shift: torch's own shift of int64 copies the sign."""
    return (z >> bits) & ((1 << (64 - bits)) - 1)


def _signed(word: int) -> int:
    """The int64 with the same 64 bits."""
    word %= 2**64
    return word - 2**64 if word >= 2**63 else word
