"""Receptions on every link: number, delay and age. Messages are processed in batches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage
from eidrive_scenario.v2x.statistics.age_of_information import AgeOfInformation

Entry = tuple[float, str, int, float, ReceivedMessage]
"""Time of arrival [s], sender, number, time of sending [s], and received message; receivers may share an entry."""

MAX_PENDING = 1 << 14
"""Maximum number of unprocessed messages, because each holds its content in memory."""


def queue_entry(message: Message, sent: float, arrives: float) -> Entry:
    """Return the queue entry of a message that was sent and arrives at these times [s]."""
    return arrives, message.sender, message.number, sent, ReceivedMessage(message, arrives)


class ReceptionStatistics(NamedTuple):
    """Receptions on one link: number, delays [s], and generation time of the newest message [s].

    mean_age, p95_age, peak_age  see LinkStatistics; None while undefined
    """

    received: int
    delay_sum: float
    delay_max: float
    newest_generation_time: float
    mean_age: float | None
    p95_age: float | None
    peak_age: float | None


class ReceptionLog:
    """Log of delivered messages, which are processed in batches when statistics are requested."""

    def __init__(self) -> None:
        self._codes: dict[str, dict[str, int]] = {}
        """Indices of the links in the arrays, by receiver and sender."""
        self._count = 0
        self._pending: list[tuple[str, Sequence[Entry]]] = []
        self._number = 0
        self._received: Integers = np.zeros(0, dtype=np.int64)
        self._delay_sum, self._delay_max, self._newest = np.zeros(0), np.zeros(0), np.zeros(0)
        self._newest_present = np.zeros(0)
        """Generation time of the newest message since the entry of the receiver [s]."""
        self._ages = AgeOfInformation()

    def record(self, receiver: str, entries: Sequence[Entry]) -> None:
        """Add messages that were delivered to a receiver, in this order."""
        self._pending.append((receiver, entries))
        self._number += len(entries)
        if self._number > MAX_PENDING:
            self._process_pending()

    def end_links(self, receiver: str, now: float) -> None:
        """End the age of information of a receiver that has left at `now` [s], until its next reception."""
        self._process_pending()
        codes = np.array([*self._codes.get(receiver, {}).values()], dtype=np.int64)
        codes = codes[np.isfinite(self._newest_present[codes])]
        self._ages.end(codes, now - self._newest_present[codes])
        self._newest_present[codes] = -np.inf

    def statistics_by_link(self, now: float) -> dict[tuple[str, str], ReceptionStatistics]:
        """Return the receptions on each link up to `now` [s], by (sender, receiver) in alphabetical order."""
        self._process_pending()
        code_of = {(sender, name): code for name, senders in self._codes.items() for sender, code in senders.items()}
        links = sorted(code_of)
        codes = np.array([code_of[link] for link in links], dtype=np.int64)
        columns = (self._received, self._delay_sum, self._delay_max, self._newest)
        ages = [
            [None if math.isnan(age) else age for age in column.tolist()]
            for column in self._ages.statistics(now, self._newest_present, codes)
        ]
        rows = zip(*(column[codes].tolist() for column in columns), *ages, strict=True)
        return {link: ReceptionStatistics(*row) for link, row in zip(links, rows, strict=True)}

    def _process_pending(self) -> None:
        if not self._pending:
            return
        link_codes: list[int] = []
        for receiver, entries in self._pending:
            known = self._codes.setdefault(receiver, {})
            for sender in sorted({entry[1] for entry in entries} - known.keys()):
                known[sender] = self._count
                self._count += 1
            link_codes += [known[entry[1]] for entry in entries]
        received = [entry for _, entries in self._pending for entry in entries]
        codes = np.array(link_codes, dtype=np.int64)
        generated = np.array([entry[4].message.generated for entry in received], dtype=float)
        arrived = np.array([entry[0] for entry in received], dtype=float)
        delay = arrived - np.array([entry[3] for entry in received], dtype=float)
        self._pending, self._number = [], 0
        self._resize()
        np.add.at(self._received, codes, 1)
        np.add.at(self._delay_sum, codes, delay)
        np.maximum.at(self._delay_max, codes, delay)
        self._record_ages(codes, generated, arrived)

    def _resize(self) -> None:
        more = self._count - len(self._received)
        self._received = np.concatenate([self._received, np.zeros(more, dtype=np.int64)])
        self._delay_sum, self._delay_max = (
            np.concatenate([a, np.zeros(more)]) for a in (self._delay_sum, self._delay_max)
        )
        self._newest, self._newest_present = (
            np.concatenate([a, np.full(more, -np.inf)]) for a in (self._newest, self._newest_present)
        )
        self._ages.resize(self._count)

    def _record_ages(self, codes: Integers, generated: Array, arrived: Array) -> None:
        """Update the age of information with messages that are newer than all earlier ones of their link."""
        order = np.argsort(codes, kind="stable")
        codes, generated, arrived = codes[order], generated[order], arrived[order]
        before = np.maximum(_largest_before(codes, generated), self._newest_present[codes])
        fresh = generated > before
        self._ages.record_updates(codes[fresh], (arrived - generated)[fresh], (arrived - before)[fresh])
        np.maximum.at(self._newest, codes, generated)
        np.maximum.at(self._newest_present, codes, generated)


def _largest_before(groups: Integers, values: Array) -> Array:
    """Return the largest earlier value of the same group (K,); minus infinity for the first. Groups are ascending."""
    levels, rank = np.unique(values, return_inverse=True)
    base = groups * len(levels)
    running = np.maximum.accumulate(base + rank)  # restarts per group: each base exceeds all earlier ranks
    before = np.empty(len(values))
    before[1:] = levels[(running - base)[:-1]]
    before[np.diff(groups, prepend=-1) > 0] = -np.inf
    return before
