"""Access to the medium: who is on the air when. The base keeps queues and gates; a technology says when to start."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from eidrive_scenario.arrays import Array
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.messages.message import Message
from eidrive_scenario.v2x.propagation.fading import FadingDraws
from eidrive_scenario.v2x.radio.congestion import DccGate

EARLY = 1e-9
"""Instants nearer than this are one [s]."""


class QueueSettings(Settings):
    """What waits for the medium at a sender.

    discipline  `fifo`: first come, first served; `lcfs`: a message takes the place of those of its kind that wait
                since an earlier tick, as old news are worth nothing
    length      how many messages can wait; what does not fit is lost
    """

    discipline: Literal["fifo", "lcfs"] = "fifo"
    length: Annotated[int, Field(ge=1, le=10_000)] = 16


@dataclass(eq=False)
class Transmission:
    """A message on its way through a sender: said at `sent`, ready at `ready`, on the air from `start` to `end` [s]."""

    message: Message
    receivers: Sequence[str]
    sent: float
    ready: float
    duration: float
    start: float = math.nan
    end: float = math.nan
    first_band: int = 0
    bands: int = 1
    """Which subchannels it takes."""
    reserves: bool = False
    """Whether its control information announces another use of the resource."""
    gain: Array | None = None
    """(N,) its power at each station over that of the link budget [dB]: fading; None: it has none."""
    control: NDArray[np.int8] | None = None
    """(N,) what became of its control information at each station, as a cause of loss or 0; None where it has none."""


class MediumAccess(ABC):
    """A discrete-event model of the medium for the stations in `names`, one row each.

    sensing_dbm  a station senses a message of at least this power
    """

    def __init__(self, names: tuple[str, ...], queue: QueueSettings, gate: DccGate, sensing_dbm: float) -> None:
        self.names = names
        self.gate = gate
        self.queue = queue
        self.sensing_dbm = sensing_dbm
        count = len(names)
        self._rows = {name: row for row, name in enumerate(names)}
        self._waiting: list[deque[Transmission]] = [deque() for _ in names]
        self._arrivals: deque[Transmission] = deque()
        self._head: list[Transmission | None] = [None] * count
        self.contending = 0
        """How many stations have a message for the medium."""
        self.ready = np.full(count, math.inf)
        """When the first message of each station may contend [s]; infinity where there is none."""
        self._last_start = np.full(count, -math.inf)
        self._last_use = np.zeros(count)
        """Channel time that the last message of each station took: its duration, times its share of the channel [s]."""
        self._busy_time = np.zeros(count)
        self._period_busy = np.zeros(count)
        self._period: int | None = None
        """Which period of congestion control goes on; None before the first message."""
        self.fading: FadingDraws | None = None
        """Draws the power of each message at each station; None: it is that of the link budget."""
        self.on_air: list[Transmission] = []
        """What may overlap with something whose end is not reached."""

    def enqueue(self, transmissions: Sequence[Transmission]) -> None:
        """Messages that stations have said; they enter their queues when they are ready."""
        self._arrivals = deque(sorted([*self._arrivals, *transmissions], key=_entry))

    @property
    def waiting(self) -> list[Transmission]:
        """What has not started."""
        return [*self._arrivals, *(entry for queue in self._waiting for entry in queue)]

    @abstractmethod
    def advance(self, until: float, power: Array) -> tuple[list[Transmission], list[Transmission]]:
        """Play the medium up to `until` [s]: what has started, and what was thrown out of queues.

        power  (N, N) at which each station (column) receives each other (row) [dBm]
        """

    @abstractmethod
    def predicted_starts(self, row: int, transmission: Transmission | None) -> None:
        """A message has become the first in the queue of its station; None: the queue is empty now."""

    def share(self, transmission: Transmission) -> float:
        """Which share of the channel a message takes while it is on the air."""
        return 1.0

    def rest(self, until: float) -> None:
        """Nobody has anything to say up to `until` [s]."""
        if math.isfinite(until):
            self._measure(until)

    def interval(self, row: int) -> float:
        """How long congestion control lets a station wait from one message to the next, after its last one [s]."""
        return self.gate.interval(row, float(self._last_use[row]))

    def channel_busy_ratio(self, row: int, span: float) -> float:
        """The channel busy ratio of a station over the `span` [s] since it joined."""
        return float(self._busy_time[row] + self._period_busy[row]) / span

    def rearrange(self, names: tuple[str, ...]) -> list[Transmission]:
        """Other stations from now on; the answer is what those had still to say who have left."""
        rows = [self._rows.get(name) for name in names]
        gone = [name for name in self.names if name not in names]
        lost = [entry for name in gone for entry in self._waiting[self._rows[name]]]
        lost += [entry for entry in self._arrivals if entry.message.sender in gone]
        self._arrivals = deque(entry for entry in self._arrivals if entry.message.sender not in gone)
        self._waiting = [deque() if old is None else self._waiting[old] for old in rows]
        self._head = [None if old is None else self._head[old] for old in rows]
        self.contending = sum(head is not None for head in self._head)
        for field, fresh in (
            ("ready", math.inf),
            ("_last_start", -math.inf),
            ("_last_use", 0.0),
            ("_busy_time", 0.0),
            ("_period_busy", 0.0),
        ):
            setattr(self, field, moved(getattr(self, field), rows, fresh))
        for entry in self.on_air:
            if entry.gain is not None:
                entry.gain = moved(entry.gain, rows, 0.0)
        self.gate = self.gate.rearranged(rows)
        self.names, self._rows = names, {name: row for row, name in enumerate(names)}
        self.reorder(rows)
        return lost

    @abstractmethod
    def reorder(self, rows: Sequence[int | None]) -> None:
        """Stations have other rows now: the former row of each is in `rows`, None for those who are new."""

    def forget(self, before: float) -> None:
        """Drop what ended before this instant [s], as nothing that goes on overlaps with it."""
        self.on_air = [entry for entry in self.on_air if entry.end > before]

    def _arrive(self, transmission: Transmission) -> list[Transmission]:
        row = self._rows[transmission.message.sender]
        queue = self._waiting[row]
        dropped: list[Transmission] = []
        place = len(queue)
        if self.queue.discipline == "lcfs" and queue:
            if any(_old_news(transmission, beside=entry) for entry in queue):
                return [transmission]
            dropped = [entry for entry in queue if _old_news(entry, beside=transmission)]
            place = queue.index(dropped[0]) if dropped else place
            for entry in dropped:
                queue.remove(entry)
        if len(queue) >= self.queue.length:
            return [*dropped, transmission]
        queue.insert(place, transmission)
        if queue[0] is not self._head[row]:
            self._next(row)
        return dropped

    def _next(self, row: int) -> None:
        """The first message in the queue of a station becomes the one that contends, as soon as the gate is open."""
        queue = self._waiting[row]
        self.contending += bool(queue) - (self._head[row] is not None)
        if not queue:
            self._head[row], self.ready[row] = None, math.inf
            self.predicted_starts(row, None)
            return
        first = queue[0]
        opens = self._last_start[row] + self.interval(row)
        self._head[row], self.ready[row] = first, max(first.ready, opens)
        self.predicted_starts(row, first)

    def _begin(self, row: int, transmission: Transmission, start: float) -> None:
        """The first message in the queue of a station goes on the air."""
        transmission.start, transmission.end = start, start + transmission.duration
        if self.fading is not None:
            transmission.gain = self.fading.gain_db(row, transmission.message.number)
        self._waiting[row].popleft()
        self._last_start[row], self._last_use[row] = start, transmission.duration * self.share(transmission)
        self.on_air.append(transmission)

    def _measure(self, now: float) -> None:
        """Tell congestion control how busy each of its periods was."""
        period = self.gate.control.period
        if self._period is None:
            self._period = math.floor(now / period + 1e-6)
        while now >= (self._period + 1) * period - EARLY:
            self._busy_time += self._period_busy
            self.gate.measured(self._period_ratio(period))
            self._period_busy = np.zeros(len(self.names))
            self._period += 1

    def _period_ratio(self, period: float) -> Array:
        """(N,) busy ratio of the period that ends [s]."""
        return self._period_busy / period


def moved(values: NDArray[Any], rows: Sequence[int | None], fresh: float) -> Array:
    """An array by station for other stations: the value of the former row, or `fresh`."""
    return np.array([fresh if old is None else values[old] for old in rows], dtype=float)


def _old_news(entry: Transmission, *, beside: Transmission) -> bool:
    """Whether another message of this kind was said later. Those of one tick belong together."""
    return entry.message.kind == beside.message.kind and entry.sent < beside.sent


def _entry(transmission: Transmission) -> tuple[float, str, int]:
    return transmission.ready, transmission.message.sender, transmission.message.number
