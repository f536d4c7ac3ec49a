"""Outcomes of radio transmissions in columns, and the counters of links that count them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.budget import Budget
from eidrive_scenario.v2x.radio.reception import CAUSES, DELIVERED, QUEUE, Receptions
from eidrive_scenario.v2x.radio_environment import STATES
from eidrive_scenario.v2x.statistics.link_events import OutcomeBlock, OutcomeColumns
from eidrive_scenario.v2x.statistics.link_statistics import DISTANCE_BIN, Links

OUTCOMES = tuple(("delivered", "") if code == DELIVERED else ("lost", cause) for code, cause in enumerate(CAUSES))
"""Outcome and reason, by code of the cause."""


class ReceptionBlock(OutcomeBlock):
    """Outcomes of T ended transmissions at their receivers, E in total, sorted by transmission.

    receivers  rows of the receivers, by message
    indices    (E,) indices into `ended`;  senders, reached_receivers  (E,) rows;  causes  (E,) codes
    arrives    (E,) times of arrival [s]; infinity for lost messages
    """

    def __init__(
        self, ended: Sequence[Transmission], receptions: Receptions, budget: Budget, receivers: Sequence[Integers]
    ) -> None:
        self.ended = ended
        self.receptions = receptions
        self.budget = budget
        self.indices = np.repeat(np.arange(len(ended)), [len(rows) for rows in receivers])
        self.reached_receivers = np.concatenate(receivers)
        self.senders = receptions.senders[self.indices]
        self.causes = receptions.causes[self.indices, self.reached_receivers].astype(np.int64)
        self.arrives = np.full(len(self.indices), np.inf)

    def __len__(self) -> int:
        return len(self.indices)

    def __iter__(self) -> Iterator[LinkEvent]:
        budget, senders, reached = self.budget, self.senders, self.reached_receivers
        for index, sender, row, cause, arrives, loss, snr, state in zip(
            self.indices.tolist(),
            senders.tolist(),
            reached.tolist(),
            self.causes.tolist(),
            self.arrives.tolist(),
            budget.loss[senders, reached].tolist(),
            self.receptions.snr[self.indices, reached].tolist(),
            budget.states[senders, reached].tolist(),
            strict=True,
        ):
            transmission = self.ended[index]
            message, (outcome, reason) = transmission.message, OUTCOMES[cause]
            yield LinkEvent(
                sender=message.sender,
                receiver=budget.names[row],
                number=message.number,
                sent=transmission.sent,
                outcome=outcome,
                arrives=arrives if cause == DELIVERED else None,
                reason=reason,
                size=message.size,
                path_loss_db=loss,
                snr_db=snr,
                los=STATES[state],
                blockers=budget.bodies_between(sender, row) if state else (),
            )

    def columns(self) -> OutcomeColumns:
        number, size = np.array([(entry.message.number, entry.message.size) for entry in self.ended], dtype=np.int64).T
        sent = np.array([transmission.sent for transmission in self.ended], dtype=float)
        return OutcomeColumns(
            self.budget.names,
            self.senders,
            self.reached_receivers,
            OUTCOMES,
            self.causes,
            number[self.indices],
            sent[self.indices],
            self.arrives,
            size[self.indices],
        )


class DroppedBlock(OutcomeBlock):
    """Outcomes of a message that was dropped from its queue; `sender` and `receivers` are rows of `names`."""

    def __init__(self, transmission: Transmission, names: tuple[str, ...], sender: int, receivers: Integers) -> None:
        self._transmission = transmission
        self._names = names
        self._sender = sender
        self._receivers = receivers

    def __len__(self) -> int:
        return len(self._receivers)

    def __iter__(self) -> Iterator[LinkEvent]:
        message, sent = self._transmission.message, self._transmission.sent
        for row in self._receivers.tolist():
            yield LinkEvent(
                message.sender, self._names[row], message.number, sent, "lost", None, CAUSES[QUEUE], message.size
            )

    def columns(self) -> OutcomeColumns:
        message, count = self._transmission.message, len(self._receivers)
        sender, cause, number, size = (
            np.full(count, value) for value in (self._sender, QUEUE, message.number, message.size)
        )
        sent, arrives = (np.full(count, time) for time in (self._transmission.sent, np.inf))
        return OutcomeColumns(self._names, sender, self._receivers, OUTCOMES, cause, number, sent, arrives, size)


_CLASSES = 40
"""Number of distance classes that are counted in an array, up to 1 km; few links are longer."""


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
        self._far_outcomes: Counter[tuple[int, int, int, bool]] = Counter()
        """Outcomes in other distance classes, by sender, receiver, class and whether the message is delivered."""

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
        distance_class, is_delivered = (distance // DISTANCE_BIN).astype(np.int64), causes == DELIVERED
        near, outcome = distance_class < _CLASSES, (is_delivered * _CLASSES + distance_class) * links + link
        np.add.at(self._outcomes.reshape(-1), outcome[near], 1)
        far = (column[~near].tolist() for column in (senders, receivers, distance_class, is_delivered))
        self._far_outcomes.update(zip(*far, strict=True))

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
        for link, code, number in zip(*(column.tolist() for column in (*lost, causes[lost])), strict=True):
            counters[link].count_loss(CAUSES[code], number)
        outcomes = self._outcomes[:, :, senders, receivers].T
        counted = np.nonzero(outcomes.any(axis=2))
        for link, distance_class, (losses, deliveries) in zip(
            *(column.tolist() for column in (*counted, outcomes[counted])), strict=True
        ):
            counters[link].count_outcomes(distance_class, losses + deliveries, deliveries)
        for (sender, receiver, distance_class, is_delivered), number in self._far_outcomes.items():
            counter = links.counters(self.names[sender], self.names[receiver])
            counter.count_outcomes(distance_class, number, is_delivered * number)
        self._far_outcomes.clear()
        for counts in (self._sent, self._bytes, self._causes, self._outcomes):
            counts[..., senders, receivers] = 0  # not all links: these are many, and few of them changed
