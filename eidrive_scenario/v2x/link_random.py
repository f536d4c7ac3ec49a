"""Uniform numbers in (0, 1) that depend on seed, purpose, link and message number alone."""

from __future__ import annotations

from array import array

import numpy as np

from eidrive_scenario.randomness import generator

BLOCK = 128
"""Numbers made at once: a keyed generator costs some 20 µs, however many are drawn from it."""


class LinkRandom:
    """The draw of message `number` on a link is the same whoever else talks, and whenever it is asked for."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._blocks: dict[tuple[str, str, str], tuple[int, array[float]]] = {}

    def uniform(self, purpose: str, sender: str, receiver: str, number: int) -> float:
        """One number in (0, 1) for this purpose, link and message."""
        block, place = divmod(number, BLOCK)
        link = (purpose, sender, receiver)
        held = self._blocks.get(link)
        if held is None or held[0] != block:
            numbers = generator(self._seed, *link, block).random(BLOCK)
            held = self._blocks[link] = (block, array("d", np.clip(numbers, 1e-16, 1.0 - 1e-16).tobytes()))
        return held[1][place]
