"""Counters of many links in arrays, flushed into the counters of the links when statistics are requested."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.v2x.radio.reception import CAUSES, DELIVERED, QUEUE
from eidrive_scenario.v2x.statistics.link_statistics import DISTANCE_BIN
from eidrive_scenario.v2x.statistics.links import Links

_CLASSES = 41
"""Number of distance classes; the last class contains all distances beyond 1 km."""


class LinkCounterTable:
    """Counters of the links between N stations, by row of sender and receiver."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        count = len(names)
        self._sent = np.zeros((count, count), dtype=np.int64)
        self._bytes = np.zeros((count, count), dtype=np.int64)
        # links in the last axes: most entries of the others remain zero, and their memory is not touched
        self._causes = np.zeros((len(CAUSES), count, count), dtype=np.int64)
        self._outcomes = np.zeros((2, _CLASSES, count, count), dtype=np.int64)

    def send(self, row: int, receivers: Integers, size: int) -> None:
        """Count a sent message of `size` bytes."""
        self._sent[row, receivers] += 1
        self._bytes[row, receivers] += size

    def drop(self, row: int, receivers: Integers) -> None:
        """Count a message that was dropped before transmission."""
        self._causes[QUEUE, row, receivers] += 1

    def decide(self, senders: Integers, receivers: Integers, causes: Integers, distance: Array) -> None:
        """Count outcomes of transmissions, one entry per message and receiver."""
        links = len(self.names) ** 2
        link = senders * len(self.names) + receivers  # flat indices: np.add.at is ten times as fast
        np.add.at(self._causes.reshape(-1), causes.astype(np.int64) * links + link, 1)
        place = np.minimum((distance // DISTANCE_BIN).astype(np.int64), _CLASSES - 1)
        np.add.at(self._outcomes.reshape(-1), ((causes == DELIVERED) * _CLASSES + place) * links + link, 1)

    def flush_into(self, links: Links) -> None:
        """Add the counts to the counters of the links and reset them."""
        senders, receivers = np.nonzero((self._sent > 0) | self._causes.any(axis=0))
        counters = [
            links.counters(self.names[sender], self.names[receiver])
            for sender, receiver in zip(senders.tolist(), receivers.tolist(), strict=True)
        ]
        sent, size = (counts[senders, receivers].tolist() for counts in (self._sent, self._bytes))
        for counter, messages, length in zip(counters, sent, size, strict=True):
            counter.sent += messages
            counter.bytes_sent += length
        causes = self._causes[:, senders, receivers].T
        causes[:, DELIVERED] = 0
        lost = np.nonzero(causes)
        for place, code, number in zip(*(column.tolist() for column in (*lost, causes[lost])), strict=True):
            counters[place].count_loss(CAUSES[code], number)
        outcomes = self._outcomes[:, :, senders, receivers].T
        known = np.nonzero(outcomes.any(axis=2))
        for place, bin_index, (losses, deliveries) in zip(
            *(column.tolist() for column in (*known, outcomes[known])), strict=True
        ):
            counters[place].count_outcomes(bin_index, losses + deliveries, deliveries)
        for counts in (self._sent, self._bytes, self._causes, self._outcomes):
            counts[...] = 0
