"""Random numbers that depend on what they are for, not on who drew before.

Every consumer asks for a generator keyed by (seed, consumer, …). Turning one fault on never shifts another's draws,
and the order of the agents in a list does not matter.
"""

from __future__ import annotations

import hashlib

import numpy as np


def generator(seed: int, *key: str | int) -> np.random.Generator:
    """A counter-based generator (Philox 4x64-10) for this seed and key, the same in every process.

    The key is hashed with BLAKE2b, as Python's own `hash` differs between processes.
    """
    text = "\x1f".join([str(seed), *(f"{type(part).__name__}:{part}" for part in key)])
    digest = hashlib.blake2b(text.encode(), digest_size=16).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest, "little")))
