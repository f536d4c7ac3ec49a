"""Random numbers of links that depend only on seed, purpose, link and message number."""

from __future__ import annotations

from array import array

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.randomness import generator, integer_key

Keys = NDArray[np.uint64]

GOLDEN, FIRST, SECOND = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
_GOLDEN, _FIRST, _SECOND = np.uint64(GOLDEN), np.uint64(FIRST), np.uint64(SECOND)
_ONE, _11, _27, _30, _31 = (np.uint64(number) for number in (1, 11, 27, 30, 31))
_64_BITS = (1 << 64) - 1


def key(seed: int, *parts: str | int) -> int:
    """Return a 64-bit key of this seed, purpose and link, equal in every process."""
    return integer_key(seed, *parts, size=8)


def uniforms(keys: Keys, counts: Integers | int) -> Array:
    """Return uniform numbers in (0, 1): output `counts` of a SplitMix64 generator seeded with each key.

    G. L. Steele, D. Lea, C. H. Flood: Fast Splittable Pseudorandom Number Generators, OOPSLA 2014.
    """
    mixed = _mix(keys + (np.atleast_1d(counts).astype(np.uint64) + _ONE) * _GOLDEN)
    numbers: Array = ((mixed >> _11).astype(np.float64) + 0.5) * 2.0**-53
    return numbers


def uniform(key: int, count: int) -> float:
    """Return one number of `uniforms`, identical to the bit; faster for few links."""
    mixed = (key + (count + 1) * GOLDEN) & _64_BITS
    mixed = ((mixed ^ mixed >> 30) * FIRST) & _64_BITS
    mixed = ((mixed ^ mixed >> 27) * SECOND) & _64_BITS
    return (((mixed ^ mixed >> 31) >> 11) + 0.5) * 2.0**-53


def combine_keys(first: Keys, second: Keys) -> Keys:
    """Return the keys of pairs, broadcast; (a, b) and (b, a) differ."""
    return _mix(_mix(first + _GOLDEN) ^ second)


def _mix(numbers: Keys) -> Keys:
    mixed = numbers ^ (numbers >> _30)
    mixed *= _FIRST
    mixed ^= mixed >> _27
    mixed *= _SECOND
    mixed ^= mixed >> _31
    return mixed


BLOCK = 128
"""Numbers per block: creating a keyed generator costs about 20 µs, independent of the block size."""


class LinkRandom:
    """Random numbers of links, independent of other links and of the order of calls."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._blocks: dict[tuple[str, str, str], tuple[int, array[float]]] = {}

    def uniform(self, purpose: str, sender: str, receiver: str, number: int) -> float:
        """Return the number in (0, 1) of this purpose, link and message."""
        block, index = divmod(number, BLOCK)
        link = (purpose, sender, receiver)
        held = self._blocks.get(link)
        if held is None or held[0] != block:
            numbers = generator(self._seed, *link, block).random(BLOCK)
            held = self._blocks[link] = (block, array("d", np.clip(numbers, 1e-16, 1.0 - 1e-16).tobytes()))
        return held[1][index]
