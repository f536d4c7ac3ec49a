"""The books of one link: what was sent, heard and lost, how late, and how old the newest information is."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

DISTANCE_BIN = 25.0
"""Width of the classes of distance between antennas in which receptions are counted [m]."""


@dataclass(frozen=True)
class LinkStatistics:
    """The books of one link; sent = received + lost + in_flight at any time.

    lost_by     how many were lost, by reason
    mean_delay, max_delay  from sending to arrival, over what was received [s]; None before that
    age         of the newest information at the receiver now, since it was said [s]
    mean_age, p95_age, peak_age   average and 95th percentile over time, and mean over the maxima just before each
                update, since the first arrival [s]
    reception   (nearest distance of the class [m], messages whose fate is known, messages that got through)
    busy_ratio  share of the time in which the receiver found the channel busy; None where the channel has no such
    """

    sent: int
    received: int
    lost: int
    in_flight: int
    bytes_sent: int
    mean_delay: float | None
    max_delay: float | None
    age: float | None
    mean_age: float | None
    peak_age: float | None
    p95_age: float | None = None
    lost_by: Mapping[str, int] = field(default_factory=dict)
    reception: tuple[tuple[float, int, int], ...] = ()
    busy_ratio: float | None = None

    def as_json(self) -> dict[str, Any]:
        """For `--json`: times in s, sizes in bytes."""
        written = asdict(self)
        written["reception"] = [
            {"from_m": nearest, "fates": fates, "ratio": through / fates} for nearest, fates, through in self.reception
        ]
        return written


@dataclass
class Book:
    """What is written down as a link is used."""

    sent: int = 0
    received: int = 0
    lost: int = 0
    bytes_sent: int = 0
    delay_sum: float = 0.0
    delay_max: float = 0.0
    lost_by: dict[str, int] = field(default_factory=dict)
    fates: dict[int, list[int]] = field(default_factory=dict)
    """By class of distance: how many fates are known, and how many of them are deliveries."""
    newest: float | None = None
    """When the newest information at the receiver was said [s]."""
    since: float = 0.0
    until: float = 0.0
    age_area: float = 0.0
    peaks: array[float] = field(default_factory=lambda: array("d"))
    floors: array[float] = field(default_factory=lambda: array("d"))
    """Ages just after each update, the first included [s]; `peaks` are those just before, from the second on."""

    def lose(self, reason: str, count: int = 1) -> None:
        """Messages were lost."""
        self.lost += count
        self.lost_by[reason] = self.lost_by.get(reason, 0) + count

    def fate(self, distance: float, delivered: bool) -> None:
        """The fate of a message over this distance [m] is known."""
        known = self.fates.setdefault(int(distance // DISTANCE_BIN), [0, 0])
        known[0] += 1
        known[1] += delivered

    def arrive(self, said: float, sent: float, arrived: float) -> None:
        """A message was heard."""
        self.received += 1
        self.delay_sum += arrived - sent
        self.delay_max = max(self.delay_max, arrived - sent)
        if self.newest is None:
            self.newest, self.since, self.until = said, arrived, arrived
            self.floors.append(arrived - said)
        elif said > self.newest:
            self._age_until(arrived)
            self.peaks.append(arrived - self.newest)
            self.floors.append(arrived - said)
            self.newest = said

    def statistics(self, now: float, busy_ratio: float | None = None) -> LinkStatistics:
        """The books as they stand."""
        self._age_until(now)
        span = self.until - self.since
        return LinkStatistics(
            sent=self.sent,
            received=self.received,
            lost=self.lost,
            in_flight=self.sent - self.received - self.lost,
            bytes_sent=self.bytes_sent,
            mean_delay=self.delay_sum / self.received if self.received else None,
            max_delay=self.delay_max if self.received else None,
            age=None if self.newest is None else now - self.newest,
            mean_age=self.age_area / span if span > 0.0 else None,
            peak_age=sum(self.peaks) / len(self.peaks) if self.peaks else None,
            p95_age=self._age_quantile(0.95) if span > 0.0 else None,
            lost_by=dict(sorted(self.lost_by.items())),
            reception=tuple((DISTANCE_BIN * place, known, kept) for place, (known, kept) in sorted(self.fates.items())),
            busy_ratio=busy_ratio,
        )

    def _age_until(self, time: float) -> None:
        if self.newest is not None and time > self.until:
            middle = (time + self.until) / 2.0
            self.age_area += (time - self.until) * (middle - self.newest)
            self.until = time

    def _age_quantile(self, share: float) -> float:
        """The age that is not exceeded in this share of the time [s], exactly.

        Age rises at slope 1 from a floor to the next peak, so the time spent below x is piecewise linear in x.
        """
        assert self.newest is not None
        floors, peaks = np.array(self.floors), np.array([*self.peaks, self.until - self.newest])
        levels = np.concatenate([floors, peaks])
        order = np.argsort(levels, kind="stable")
        rising = np.cumsum(np.repeat([1.0, -1.0], len(floors))[order])
        spent = np.concatenate([[0.0], np.cumsum(rising[:-1] * np.diff(levels[order]))])
        return float(np.interp(share * spent[-1], spent, levels[order]))
