"""How old the newest information was on many links at once, over the time since the first arrival on each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array

Codes = NDArray[np.int64]

MOST_STEPS = 1 << 20
"""So many bends are kept exactly, over all links [24 bytes each]: six hours of one link at 20 Hz."""
GRID = 0.01
"""Relative width of the classes into which older ages are sorted then."""
RESOLUTION = 2.0**-40
"""To which the time spent below an age is counted [s]."""
LEAST = 1e-6
"""Ages below this are 0 there [s]."""


class AgeStatistics(NamedTuple):
    """Of L links [s]: average and 95th percentile over time, and the mean of the maxima just before each update but the
    first; NaN where nothing can be said."""

    mean: Array
    p95: Array
    peak: Array


class AgeOfInformation:
    """Age rises at slope 1 from a floor, the age of an update, to a peak just before the next.

    The time spent below an age x is piecewise linear in x and bends at floors and peaks. All averages are exact. The
    percentile is so up to MOST_STEPS bends; then ages so far are rounded by 0.5 % at most, so that a long run does not
    fill the memory.
    """

    def __init__(self) -> None:
        self._floor = np.zeros(0)
        """Of the last update of each link; NaN before the first."""
        self._time, self._area, self._peaks = np.zeros(0), np.zeros(0), np.zeros(0)
        self._updates = np.zeros(0, dtype=np.int64)
        self._steps: list[tuple[Codes, Array, Codes]] = []
        """Link, age, and how many more times a rising age is above it: 1 at floors, -1 at peaks."""
        self._number = 0
        self._most = MOST_STEPS

    def make_room(self, links: int) -> None:
        """From now on there are so many links."""
        more = links - len(self._floor)
        self._floor = np.concatenate([self._floor, np.full(more, np.nan)])
        self._time, self._area, self._peaks = (
            np.concatenate([values, np.zeros(more)]) for values in (self._time, self._area, self._peaks)
        )
        self._updates = np.concatenate([self._updates, np.zeros(more, dtype=np.int64)])

    def note(self, links: Codes, floors: Array, peaks: Array) -> None:
        """Updates (K,) in the order of links, those of one link in the order of time: the age just after each, and just
        before; infinity before the first of a link."""
        begins = np.diff(links, prepend=-1) > 0
        low = np.where(begins, self._floor[links], np.roll(floors, 1))
        ends = np.append(begins[1:], True) if len(links) else begins
        self._floor[links[ends]] = floors[ends]
        later = np.isfinite(peaks)
        of, low, peaks = links[later], low[later], peaks[later]
        high = np.maximum(peaks, low)
        count = len(self._floor)
        self._time += np.bincount(of, high - low, count)
        self._area += np.bincount(of, 0.5 * (high**2 - low**2), count)
        self._peaks += np.bincount(of, peaks, count)
        self._updates += np.bincount(of, minlength=count)
        self._steps.append(_steps(of, low, high))
        self._number += 2 * len(of)
        if self._number > self._most:
            self._compact()

    def at(self, now: float, newest: Array, order: Codes) -> AgeStatistics:
        """What can be said of the links in this order at `now`; their newest information was said at `newest` (L,)."""
        low = self._floor
        high = np.maximum(now - newest, low)
        time, area = self._time + (high - low), self._area + 0.5 * (high**2 - low**2)
        some = time > 0.0
        mean = np.divide(area, time, out=np.full(len(low), np.nan), where=some)
        peak = np.divide(self._peaks, self._updates, out=np.full(len(low), np.nan), where=self._updates > 0)
        return AgeStatistics(mean[order], self._percentile(0.95, low, high, some, order), peak[order])

    def _percentile(self, share: float, low: Array, high: Array, some: NDArray[np.bool_], order: Codes) -> Array:
        """(L,) the age below which a link spent this share of the time."""
        asked = order[some[order]]
        place_of = np.full(len(low), -1)
        place_of[asked] = np.arange(len(asked))
        links, levels, weights = self._all(_steps(np.arange(len(low)), low, high))
        places = place_of[links]
        wanted = places >= 0
        places, levels, weights = places[wanted], levels[wanted], weights[wanted]
        rising = np.lexsort((levels, places))
        places, levels, above = places[rising], levels[rising], np.cumsum(weights[rising])
        found = np.full(len(order), np.nan)
        if not len(asked):
            return found
        # In whole numbers, so that a link's result depends on no other link; nothing is above the last level of each.
        exact = np.round(levels / RESOLUTION).astype(np.int64)
        spent = np.cumsum(np.concatenate([[0], above[:-1] * np.diff(exact)]))
        first = np.searchsorted(places, np.arange(len(asked)))
        last = np.append(first[1:], len(places)) - 1
        spent -= spent[first][places]
        target = share * spent[last]
        after = np.clip(first + np.add.reduceat(spent < target[places], first, dtype=np.int64), first + 1, last)
        before = after - 1
        within = (target - spent[before]) / np.maximum(spent[after] - spent[before], 1)
        found[some[order]] = levels[before] + within * (levels[after] - levels[before])
        return found

    def _all(self, *more: tuple[Codes, Array, Codes]) -> tuple[Codes, Array, Codes]:
        links, levels, weights = zip(*self._steps, *more, strict=True)
        return np.concatenate(links), np.concatenate(levels), np.concatenate(weights)

    def _compact(self) -> None:
        """Round the ages, and count those that are equal then once."""
        links, levels, weights = self._all()
        rounded = np.exp(GRID * np.round(np.log(np.maximum(levels, LEAST)) / GRID))
        levels = np.where(levels < LEAST, 0.0, rounded)
        order = np.lexsort((levels, links))
        links, levels, weights = links[order], levels[order], weights[order]
        begins = np.flatnonzero((np.diff(links, prepend=-1) > 0) | (np.diff(levels, prepend=-1.0) != 0.0))
        sums = np.add.reduceat(weights, begins)
        left = begins[sums != 0]
        self._steps = [(links[left], levels[left], sums[sums != 0])]
        self._number = len(left)
        self._most = max(MOST_STEPS, 2 * self._number)


def _steps(links: Codes, low: Array, high: Array) -> tuple[Codes, Array, Codes]:
    weights = np.ones(2 * len(links), dtype=np.int64)
    weights[len(links) :] = -1
    return np.concatenate([links, links]), np.concatenate([low, high]), weights
