"""Uniform numbers in (0, 1) that depend only on seed, purpose, link and message number."""

from __future__ import annotations

from array import array

import numpy as np

from eidrive_scenario.randomness import generator

BLOCK = 128
"""Numbers per block: creating a keyed generator costs about 20 µs, independent of the block size."""


class LinkRandom:
    """Random numbers of links, independent of other links and of the order of calls."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._blocks: dict[tuple[str, str, str], tuple[int, array[float]]] = {}

    def uniform(self, purpose: str, sender: str, receiver: str, number: int) -> float:
        """Return the number in (0, 1) of this purpose, link and message."""
        block, place = divmod(number, BLOCK)
        link = (purpose, sender, receiver)
        held = self._blocks.get(link)
        if held is None or held[0] != block:
            numbers = generator(self._seed, *link, block).random(BLOCK)
            held = self._blocks[link] = (block, array("d", np.clip(numbers, 1e-16, 1.0 - 1e-16).tobytes()))
        return held[1][place]
