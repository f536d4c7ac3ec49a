"""Random numbers that depend on their purpose, not on the draws before them.

Every consumer uses a generator keyed by (seed, consumer, …). Enabling one fault model does not shift the draws of
another one, and the order of the agents in a list does not matter.
"""

from __future__ import annotations

import hashlib
from operator import index
from typing import SupportsIndex

import numpy as np

from eidrive_scenario.errors import Diagnostic, SettingError


def checked_seed(seed: SupportsIndex) -> int:
    """Return a seed, such as an entry of an array, as an int. Raise SettingError if it is not an integer."""
    try:
        return index(seed)
    except TypeError:
        raise SettingError(Diagnostic(f"the seed is {seed!r}", "give an integer")) from None


def generator(seed: int, *key: str | int) -> np.random.Generator:
    """Return the counter-based generator (Philox 4x64-10) of this seed and key, the same in every process."""
    return np.random.Generator(np.random.Philox(key=integer_key(seed, *key, size=16)))


def integer_key(seed: int, *key: str | int, size: int) -> int:
    """Return an integer of `size` bytes for this seed and key.

    The key is hashed with BLAKE2b, as the `hash` of Python differs between processes.
    """
    text = "\x1f".join([str(seed), *(f"{type(part).__name__}:{part}" for part in key)])
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=size).digest(), "little")
