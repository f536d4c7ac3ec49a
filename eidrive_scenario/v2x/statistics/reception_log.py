"""Receptions on every link: number, delay and age. Messages are processed in batches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage

MAX_BREAKPOINTS = 1 << 20
"""Maximum number of exact breakpoints over all links, 24 bytes each: six hours of one link at 20 Hz."""
GRID = 0.01
"""Relative width of the classes of compacted ages."""
RESOLUTION = 2.0**-40
"""Resolution of the time spent below an age [s]."""
LEAST = 1e-6
"""Maximum age that is compacted to 0 [s]."""


class AgeOfInformation:
    """Accumulated age of information. The age rises with slope 1 from a floor, the age at an update, to a peak.

    The time spent below an age x is piecewise linear in x with breakpoints at floors and peaks. All means are exact.
    The percentile is exact up to MAX_BREAKPOINTS breakpoints. Above, stored ages are rounded by at most 0.5 % to bound
    the memory of long runs.
    """

    def __init__(self) -> None:
        self._floor = np.zeros(0)
        """Age at the last update of each link [s]; NaN before the first, and after a station has left."""
        self._time, self._area, self._peaks = np.zeros(0), np.zeros(0), np.zeros(0)
        self._updates = np.zeros(0, dtype=np.int64)
        self._breakpoints: list[tuple[Integers, Array, Integers]] = []
        """Breakpoints: link, age, and change of the slope (1 at floors, -1 at peaks)."""
        self._number = 0
        self._limit = MAX_BREAKPOINTS

    def resize(self, links: int) -> None:
        """Extend the state to this number of links."""
        _extend_fields(self, links, _floor=np.nan, _time=0.0, _area=0.0, _peaks=0.0, _updates=0)

    def record_updates(self, links: Integers, floors: Array, peaks: Array) -> None:
        """Add updates (K,), sorted by link and then by time.

        floors, peaks  age immediately after and before each update [s]; the peak of the first update is infinity
        """
        begins = np.diff(links, prepend=-1) > 0
        low = np.where(begins, self._floor[links], np.roll(floors, 1))
        ends = np.append(begins[1:], True) if len(links) else begins
        self._floor[links[ends]] = floors[ends]
        later = np.isfinite(peaks)
        of, low, peaks = links[later], low[later], peaks[later]
        high = np.maximum(peaks, low)
        count = len(self._floor)
        self._peaks += np.bincount(of, peaks, count)
        self._updates += np.bincount(of, minlength=count)
        self._add(of, low, high)

    def end(self, links: Integers, ages: Array) -> None:
        """End the age of links at these ages (K,) [s]; the next update of a link counts as its first."""
        low = self._floor[links]
        self._add(links, low, np.maximum(ages, low))
        self._floor[links] = np.nan

    def _add(self, of: Integers, low: Array, high: Array) -> None:
        """Add rises of the age (K,) from `low` to `high` [s]."""
        count = len(self._floor)
        self._time += np.bincount(of, high - low, count)
        self._area += np.bincount(of, 0.5 * (high**2 - low**2), count)
        self._breakpoints.append(_breakpoints(of, low, high))
        self._number += 2 * len(of)
        if self._number > self._limit:
            self._compact()

    def statistics(self, now: float, newest: Array, order: Integers) -> tuple[Array, Array, Array]:
        """Return mean and 95th percentile over time, and the mean peak age (L,) at `now` of the links in `order` [s].

        NaN if undefined. The peak age is that immediately before an update; the first update of a link has none.

        newest  (L,) newest generation times [s]
        """
        running = ~np.isnan(self._floor)
        low = np.where(running, self._floor, 0.0)
        high = np.where(running, np.maximum(now - newest, low), 0.0)
        time, area = self._time + (high - low), self._area + 0.5 * (high**2 - low**2)
        defined = time > 0.0
        mean = np.divide(area, time, out=np.full(len(low), np.nan), where=defined)
        peak = np.divide(self._peaks, self._updates, out=np.full(len(low), np.nan), where=self._updates > 0)
        return mean[order], self._percentile(0.95, low, high, defined, order), peak[order]

    def _percentile(self, share: float, low: Array, high: Array, defined: NDArray[np.bool_], order: Integers) -> Array:
        """Return the age below which each link spent this share of the time (L,) [s]."""
        selected = order[defined[order]]
        index_of = np.full(len(low), -1)
        index_of[selected] = np.arange(len(selected))
        links, levels, weights = self._all_breakpoints(_breakpoints(np.arange(len(low)), low, high))
        indices = index_of[links]
        wanted = indices >= 0
        indices, levels, weights = indices[wanted], levels[wanted], weights[wanted]
        rising = np.lexsort((levels, indices))
        indices, levels, above = indices[rising], levels[rising], np.cumsum(weights[rising])
        percentile = np.full(len(order), np.nan)
        if not len(selected):
            return percentile
        # Integer arithmetic makes the result of a link independent of other links; no age exceeds the last level.
        exact = np.round(levels / RESOLUTION).astype(np.int64)
        spent = np.cumsum(np.concatenate([[0], above[:-1] * np.diff(exact)]))
        first = np.searchsorted(indices, np.arange(len(selected)))
        last = np.append(first[1:], len(indices)) - 1
        spent -= spent[first][indices]
        target = share * spent[last]
        after = np.clip(first + np.add.reduceat(spent < target[indices], first, dtype=np.int64), first + 1, last)
        before = after - 1
        within = (target - spent[before]) / np.maximum(spent[after] - spent[before], 1)
        percentile[defined[order]] = levels[before] + within * (levels[after] - levels[before])
        return percentile

    def _all_breakpoints(self, *more: tuple[Integers, Array, Integers]) -> tuple[Integers, Array, Integers]:
        links, levels, weights = zip(*self._breakpoints, *more, strict=True)
        return np.concatenate(links), np.concatenate(levels), np.concatenate(weights)

    def _compact(self) -> None:
        """Round the ages and merge equal ones."""
        links, levels, weights = self._all_breakpoints()
        rounded = np.exp(GRID * np.round(np.log(np.maximum(levels, LEAST)) / GRID))
        levels = np.where(levels < LEAST, 0.0, rounded)
        order = np.lexsort((levels, links))
        links, levels, weights = links[order], levels[order], weights[order]
        begins = np.flatnonzero((np.diff(links, prepend=-1) > 0) | (np.diff(levels, prepend=-1.0) != 0.0))
        sums = np.add.reduceat(weights, begins)
        left = begins[sums != 0]
        self._breakpoints = [(links[left], levels[left], sums[sums != 0])]
        self._number = len(left)
        self._limit = max(MAX_BREAKPOINTS, 2 * self._number)


def _breakpoints(links: Integers, low: Array, high: Array) -> tuple[Integers, Array, Integers]:
    weights = np.ones(2 * len(links), dtype=np.int64)
    weights[len(links) :] = -1
    return np.concatenate([links, links]), np.concatenate([low, high]), weights


Entry = tuple[float, str, int, float, ReceivedMessage]
"""Time of arrival [s], sender, number, time of sending [s], and received message; receivers may share an entry."""

MAX_PENDING = 1 << 14
"""Maximum number of unprocessed messages, because each holds its content in memory."""


def queue_entry(message: Message, sent: float, arrives: float) -> Entry:
    """Return the queue entry of a message that was sent and arrives at these times [s]."""
    return arrives, message.sender, message.number, sent, ReceivedMessage(message, arrives)


class ReceptionStatistics(NamedTuple):
    """Receptions on one link, with the fields of LinkStatistics; by default before the first one."""

    received: int = 0
    mean_delay: float | None = None
    max_delay: float | None = None
    age: float | None = None
    mean_age: float | None = None
    p95_age: float | None = None
    peak_age: float | None = None


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
        """Generation time of the newest message since the entry of both stations [s]."""
        self._left: dict[str, float] = {}
        """Time at which a station has left for the last time [s]; ages ignore its messages up to then."""
        self._ages = AgeOfInformation()

    def record(self, receiver: str, entries: Sequence[Entry]) -> None:
        """Add messages that were delivered to a receiver, in this order."""
        self._pending.append((receiver, entries))
        self._number += len(entries)
        if self._number > MAX_PENDING:
            self._process_pending()

    def end_links(self, station: str, now: float) -> None:
        """End the age of information of the links of a station that has left at `now` [s], until their next reception.

        Messages in flight from it do not count as one.
        """
        self._process_pending()
        self._left[station] = now
        sent = [senders[station] for senders in self._codes.values() if station in senders]
        codes = np.unique(np.array([*self._codes.get(station, {}).values(), *sent], dtype=np.int64))
        codes = codes[np.isfinite(self._newest_present[codes])]
        self._ages.end(codes, now - self._newest_present[codes])
        self._newest_present[codes] = -np.inf

    def statistics_by_link(self, now: float) -> dict[tuple[str, str], ReceptionStatistics]:
        """Return the receptions on each link up to `now` [s], by (sender, receiver) in alphabetical order."""
        self._process_pending()
        code_of = {(sender, name): code for name, senders in self._codes.items() for sender, code in senders.items()}
        links = sorted(code_of)
        codes = np.array([code_of[link] for link in links], dtype=np.int64)
        received = self._received[codes]
        columns = (received, self._delay_sum[codes] / received, self._delay_max[codes], now - self._newest[codes])
        ages = [
            [None if math.isnan(age) else age for age in column.tolist()]
            for column in self._ages.statistics(now, self._newest_present, codes)
        ]
        rows = zip(*(column.tolist() for column in columns), *ages, strict=True)
        return {link: ReceptionStatistics(*row) for link, row in zip(links, rows, strict=True)}

    def _process_pending(self) -> None:
        if not self._pending:
            return
        link_codes: list[int] = []
        for receiver, entries in self._pending:
            code_of = self._codes.setdefault(receiver, {})
            for sender in sorted({entry[1] for entry in entries} - code_of.keys()):
                code_of[sender] = self._count
                self._count += 1
            link_codes += [code_of[entry[1]] for entry in entries]
        received = [entry for _, entries in self._pending for entry in entries]
        codes = np.array(link_codes, dtype=np.int64)
        generated = np.array([entry[4].message.generated for entry in received], dtype=float)
        arrived = np.array([entry[0] for entry in received], dtype=float)
        left = np.array([self._left.get(entry[1], -math.inf) for entry in received])
        delay = arrived - np.array([entry[3] for entry in received], dtype=float)
        self._pending, self._number = [], 0
        _extend_fields(
            self, self._count, _received=0, _delay_sum=0.0, _delay_max=0.0, _newest=-np.inf, _newest_present=-np.inf
        )
        self._ages.resize(self._count)
        np.add.at(self._received, codes, 1)
        np.add.at(self._delay_sum, codes, delay)
        np.maximum.at(self._delay_max, codes, delay)
        np.maximum.at(self._newest, codes, generated)
        counted = generated > left
        self._record_ages(codes[counted], generated[counted], arrived[counted])

    def _record_ages(self, codes: Integers, generated: Array, arrived: Array) -> None:
        """Update the age of information with messages that are newer than all earlier ones of their link."""
        order = np.argsort(codes, kind="stable")
        codes, generated, arrived = codes[order], generated[order], arrived[order]
        before = np.maximum(_largest_before(codes, generated), self._newest_present[codes])
        fresh = generated > before
        self._ages.record_updates(codes[fresh], (arrived - generated)[fresh], (arrived - before)[fresh])
        np.maximum.at(self._newest_present, codes, generated)


def _extend_fields(owner: object, count: int, **fresh: float) -> None:
    """Extend arrays of an object to this length, given by attribute with the value of the new entries."""
    for field, value in fresh.items():
        values = getattr(owner, field)
        setattr(owner, field, np.concatenate([values, np.full(count - len(values), value, values.dtype)]))


def _largest_before(groups: Integers, values: Array) -> Array:
    """Return the largest earlier value of the same group (K,); minus infinity for the first. Groups are ascending."""
    levels, rank = np.unique(values, return_inverse=True)
    base = groups * len(levels)
    running = np.maximum.accumulate(base + rank)  # restarts per group: each base exceeds all earlier ranks
    before = np.empty(len(values))
    before[1:] = levels[(running - base)[:-1]]
    before[np.diff(groups, prepend=-1) > 0] = -np.inf
    return before
