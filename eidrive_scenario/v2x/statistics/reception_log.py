"""What was heard on every link: how much, how late, and how old it was; many messages are written down at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.v2x.messages.message import ReceivedMessage
from eidrive_scenario.v2x.statistics.age_of_information import AgeOfInformation

Codes = NDArray[np.int64]

Entry = tuple[float, str, int, float, ReceivedMessage]
"""Arrival, sender, number, sending, and what the receiver gets; several receivers may share one."""

MOST_WAITING = 1 << 14
"""So many messages are held at most before they are written down, as each holds what it says."""


class ReceptionStatistics(NamedTuple):
    """Of one link: messages heard, their delays [s], and when the newest information there was said [s].

    mean_age, p95_age, peak_age  see LinkStatistics; None where nothing can be said yet
    """

    received: int
    delay_sum: float
    delay_max: float
    newest_generation_time: float
    mean_age: float | None
    p95_age: float | None
    peak_age: float | None


class ReceptionLog:
    """Takes lists of messages as they are given out, and works them off together when somebody asks."""

    def __init__(self) -> None:
        self._codes: dict[str, dict[str, int]] = {}
        """Places of the links in the arrays, by receiver and sender."""
        self._count = 0
        self._waiting: list[tuple[str, Sequence[Entry]]] = []
        self._number = 0
        self._received: Codes = np.zeros(0, dtype=np.int64)
        self._delay_sum, self._delay_max, self._newest = np.zeros(0), np.zeros(0), np.zeros(0)
        self._ages = AgeOfInformation()

    def record(self, receiver: str, entries: Sequence[Entry]) -> None:
        """A receiver has heard these, in this order."""
        self._waiting.append((receiver, entries))
        self._number += len(entries)
        if self._number > MOST_WAITING:
            self._work_off()

    def statistics_by_link(self, now: float) -> dict[tuple[str, str], ReceptionStatistics]:
        """What was heard on each link up to `now` [s], by (sender, receiver) in alphabetical order."""
        self._work_off()
        code_of = {(sender, name): code for name, senders in self._codes.items() for sender, code in senders.items()}
        links = sorted(code_of)
        codes = np.array([code_of[link] for link in links], dtype=np.int64)
        columns = (self._received, self._delay_sum, self._delay_max, self._newest)
        ages = [_known(age) for age in self._ages.at(now, self._newest, codes)]
        rows = zip(*(column[codes].tolist() for column in columns), *ages, strict=True)
        return {link: ReceptionStatistics(*row) for link, row in zip(links, rows, strict=True)}

    def _work_off(self) -> None:
        if not self._waiting:
            return
        where: list[int] = []
        for receiver, entries in self._waiting:
            known = self._codes.setdefault(receiver, {})
            for sender in sorted({entry[1] for entry in entries} - known.keys()):
                known[sender] = self._count
                self._count += 1
            where += [known[entry[1]] for entry in entries]
        heard = [entry for _, entries in self._waiting for entry in entries]
        codes = np.array(where, dtype=np.int64)
        said = np.array([entry[4].message.generated for entry in heard], dtype=float)
        arrived = np.array([entry[0] for entry in heard], dtype=float)
        delay = arrived - np.array([entry[3] for entry in heard], dtype=float)
        self._waiting, self._number = [], 0
        self._make_room()
        np.add.at(self._received, codes, 1)
        np.add.at(self._delay_sum, codes, delay)
        np.maximum.at(self._delay_max, codes, delay)
        self._note_ages(codes, said, arrived)

    def _make_room(self) -> None:
        more = self._count - len(self._received)
        self._received = np.concatenate([self._received, np.zeros(more, dtype=np.int64)])
        self._delay_sum, self._delay_max = (
            np.concatenate([a, np.zeros(more)]) for a in (self._delay_sum, self._delay_max)
        )
        self._newest = np.concatenate([self._newest, np.full(more, -np.inf)])
        self._ages.make_room(self._count)

    def _note_ages(self, codes: Codes, said: Array, arrived: Array) -> None:
        """Which messages told something newer than all before on their link, and how the age went then."""
        order = np.argsort(codes, kind="stable")
        codes, said, arrived = codes[order], said[order], arrived[order]
        before = np.maximum(_largest_before(codes, said), self._newest[codes])
        fresh = said > before
        self._ages.note(codes[fresh], (arrived - said)[fresh], (arrived - before)[fresh])
        np.maximum.at(self._newest, codes, said)


def _known(ages: Array) -> list[float | None]:
    return [None if math.isnan(age) else age for age in ages.tolist()]


def _largest_before(groups: Codes, values: Array) -> Array:
    """(K,) the largest of the earlier `values` of the same group; minus infinity for the first. Groups rise."""
    levels, rank = np.unique(values, return_inverse=True)
    base = groups * len(levels)
    running = np.maximum.accumulate(base + rank)  # begins anew with each group, as its base is above all before
    before = np.empty(len(values))
    before[1:] = levels[(running - base)[:-1]]
    before[np.diff(groups, prepend=-1) > 0] = -np.inf
    return before
