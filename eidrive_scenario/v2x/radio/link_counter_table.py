"""Counts of many links at once; they go into the books of the links when somebody reads those."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.v2x.radio.reception import CAUSES, DELIVERED, QUEUE
from eidrive_scenario.v2x.statistics.link_statistics import DISTANCE_BIN
from eidrive_scenario.v2x.statistics.links import Links

Rows = NDArray[np.int64]

_CLASSES = 41
"""Classes of distance; the last one takes all beyond 1 km."""


class LinkCounterTable:
    """For N stations, by row of sender and receiver."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        count = len(names)
        self._sent = np.zeros((count, count), dtype=np.int64)
        self._bytes = np.zeros((count, count), dtype=np.int64)
        self._causes = np.zeros((count, count, len(CAUSES)), dtype=np.int64)
        self._fates = np.zeros((count, count, _CLASSES, 2), dtype=np.int64)

    def send(self, row: int, receivers: Rows, size: int) -> None:
        """A message of `size` bytes was said."""
        self._sent[row, receivers] += 1
        self._bytes[row, receivers] += size

    def drop(self, row: int, receivers: Rows) -> None:
        """A message never went on the air."""
        self._causes[row, receivers, QUEUE] += 1

    def decide(self, senders: Rows, receivers: Rows, causes: Rows, distance: Array) -> None:
        """Count outcomes of messages, one entry per message and receiver."""
        link = senders * len(self.names) + receivers  # flat places: numpy counts at those ten times as fast
        np.add.at(self._causes.reshape(-1), link * len(CAUSES) + causes, 1)
        place = np.minimum((distance // DISTANCE_BIN).astype(np.int64), _CLASSES - 1)
        np.add.at(self._fates.reshape(-1), 2 * (link * _CLASSES + place) + (causes == DELIVERED), 1)

    def flush_into(self, links: Links) -> None:
        """Carry everything over into the books, and begin anew."""
        senders, receivers = np.nonzero((self._sent > 0) | self._causes.any(axis=2))
        books = [
            links.counters(self.names[sender], self.names[receiver])
            for sender, receiver in zip(senders.tolist(), receivers.tolist(), strict=True)
        ]
        sent, size = (counts[senders, receivers].tolist() for counts in (self._sent, self._bytes))
        for book, messages, length in zip(books, sent, size, strict=True):
            book.sent += messages
            book.bytes_sent += length
        causes = self._causes[senders, receivers]
        causes[:, DELIVERED] = 0
        found = np.nonzero(causes)
        for place, code, number in zip(*(column.tolist() for column in (*found, causes[found])), strict=True):
            books[place].count_loss(CAUSES[code], number)
        fates = self._fates[senders, receivers]
        where = np.nonzero(fates.any(axis=2))
        for place, nearest, (lost, kept) in zip(*(column.tolist() for column in (*where, fates[where])), strict=True):
            books[place].count_outcomes(nearest, lost + kept, kept)
        for counts in (self._sent, self._bytes, self._causes, self._fates):
            counts[...] = 0
