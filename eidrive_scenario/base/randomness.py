"""Random numbers that depend on their purpose, not on the draws before them.

Every consumer uses a generator keyed by (seed, consumer, …). Enabling one fault model does not shift the draws of
another one, and the order of the agents in a list does not matter.
"""

from __future__ import annotations

import hashlib

import numpy as np


def generator(seed: int, *key: str | int) -> np.random.Generator:
    """Return the counter-based generator (Philox 4x64-10) of this seed and key, the same in every process."""
    return np.random.Generator(np.random.Philox(key=integer_key(seed, *key, size=16)))


def integer_key(seed: int, *key: str | int, size: int) -> int:
    """Return an integer of `size` bytes for this seed and key.

    The key is hashed with BLAKE2b, as the `hash` of Python differs between processes.
    """
    text = "\x1f".join([str(seed), *(f"{type(part).__name__}:{part}" for part in key)])
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=size).digest(), "little")
