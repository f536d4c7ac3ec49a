"""Random numbers for many links at once, each a function of its key and a count alone."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Integers

Keys = NDArray[np.uint64]

GOLDEN, FIRST, SECOND = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
_GOLDEN, _FIRST, _SECOND = np.uint64(GOLDEN), np.uint64(FIRST), np.uint64(SECOND)
_64_BITS = (1 << 64) - 1


def key(seed: int, *parts: str | int) -> int:
    """64 bits for this seed, purpose and link, the same in every process."""
    text = "\x1f".join([str(seed), *(f"{type(part).__name__}:{part}" for part in parts)])
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def uniforms(keys: Keys, counts: Integers | int) -> Array:
    """Numbers in (0, 1): output number `counts` of the generator SplitMix64 that starts at each key.

    G. L. Steele, D. Lea, C. H. Flood: Fast Splittable Pseudorandom Number Generators, OOPSLA 2014.
    """
    mixed = _mixed(keys + (np.atleast_1d(counts).astype(np.uint64) + np.uint64(1)) * _GOLDEN)
    numbers: Array = ((mixed >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
    return numbers


def uniform(key: int, count: int) -> float:
    """One of `uniforms`, to the bit, for a handful of links."""
    mixed = (key + (count + 1) * GOLDEN) & _64_BITS
    mixed = ((mixed ^ mixed >> 30) * FIRST) & _64_BITS
    mixed = ((mixed ^ mixed >> 27) * SECOND) & _64_BITS
    return (((mixed ^ mixed >> 31) >> 11) + 0.5) * 2.0**-53


def combine_keys(first: Keys, second: Keys) -> Keys:
    """The keys of pairs, broadcast; (a, b) and (b, a) differ."""
    return _mixed(_mixed(first + _GOLDEN) ^ second)


def _mixed(numbers: Keys) -> Keys:
    numbers = (numbers ^ (numbers >> np.uint64(30))) * _FIRST
    numbers = (numbers ^ (numbers >> np.uint64(27))) * _SECOND
    return numbers ^ (numbers >> np.uint64(31))
