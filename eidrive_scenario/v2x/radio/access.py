"""Medium access. The base class manages queues and DCC gates; a technology determines the start of transmissions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.messages.message import Message
from eidrive_scenario.v2x.propagation import FadingDraws
from eidrive_scenario.v2x.radio.congestion import DccGate


class QueueSettings(Settings):
    """Transmit queue of a sender.

    discipline  `fifo`: first come, first served; `lcfs`: a message replaces queued messages of its kind from earlier
                ticks, because their information is outdated
    length      maximum number of queued messages; further messages are dropped
    """

    discipline: Literal["fifo", "lcfs"] = "fifo"
    length: Annotated[int, Field(ge=1, le=10_000)] = 16


@dataclass(eq=False)
class Transmission:
    """Transmission of a message: sent at `sent`, ready at `ready`, transmitted from `start` to `end` [s]."""

    message: Message
    receivers: Sequence[str]
    sent: float
    ready: float
    duration: float
    start: float = math.nan
    end: float = math.nan
    first_band: int = 0
    bands: int = 1
    """Number of subchannels, from `first_band` on."""
    reserves: bool = False
    """Whether the control information reserves the resource for the next message."""
    retransmission: int = 0
    """Number of earlier transmissions of the same message."""
    later: Sequence[tuple[int, int]] = ()
    """Slots from here to each later transmission of the message, and its first subchannel."""
    decided: set[str] = field(default_factory=set)
    """Receivers whose outcome an earlier transmission of the message decided; one set for all of them."""
    gain: Array | None = None
    """Fading gain at each station (N,) [dB]; None without fading."""
    busy: Bools | None = None
    """Stations that are locked to an earlier message at the start (N,); None without preamble detection."""
    control: NDArray[np.int8] | None = None
    """Outcome of the control information at each station (N,), as cause of loss or 0; None without it."""

    @property
    def draw_number(self) -> int:
        """Number of the random draws of this transmission; that of the message for the first."""
        return self.message.number + (self.retransmission << 40)

    @property
    def undecided(self) -> Sequence[str]:
        """Receivers whose outcome no earlier transmission of the message decided."""
        return [name for name in self.receivers if name not in self.decided] if self.decided else self.receivers


class MediumAccess(ABC):
    """Abstract base class for discrete-event models of the medium, with one row per station in `names`.

    sensing_dbm  minimum power of messages that a station senses [dBm]
    """

    def __init__(self, queue: QueueSettings, gate: DccGate, sensing_dbm: float) -> None:
        """Begin without stations, which `rearrange` adds."""
        self.names: tuple[str, ...] = ()
        self.gate = gate
        self.queue = queue
        self.sensing_dbm = sensing_dbm
        self._rows: dict[str, int] = {}
        self._waiting: list[deque[Transmission]] = []
        self._arrivals: deque[Transmission] = deque()
        self._head: list[Transmission | None] = []
        self.contending = 0
        """Number of stations with a queued message."""
        self.ready = np.zeros(0)
        """Time from which the first message of each station may contend [s]; infinity for empty queues."""
        self._last_start, self._last_use = np.zeros(0), np.zeros(0)
        """Start of the last message of each station, and its channel time: duration times share of the channel [s]."""
        self._busy_time, self._period_busy = np.zeros(0), np.zeros(0)
        self._period: int | None = None
        """Index of the current period of congestion control; None before the first message."""
        self.fading: FadingDraws | None = None
        """Fading of each message at each station; None: power of the link budget."""
        self.senses_jammer: Bools | None = None
        """Stations (N,) whose channel jammers occupy all the time; None without a jammer."""
        self.power = np.zeros((0, 0))
        """Received power (N, N) of the last `advance` [dBm]."""
        self.active: list[Transmission] = []
        """Transmissions that may overlap with unfinished ones."""

    def enqueue(self, transmissions: Sequence[Transmission]) -> None:
        """Add transmissions, which enter the queue of their sender when they are ready."""
        self._arrivals = deque(
            sorted(
                [*self._arrivals, *transmissions],
                key=lambda transmission: (transmission.ready, transmission.message.sender, transmission.message.number),
            )
        )

    @property
    def is_waiting(self) -> bool:
        """Whether any transmission has not started."""
        return bool(self._arrivals) or self.contending > 0

    def advance(self, until: float, power: Array) -> tuple[list[Transmission], list[Transmission]]:
        """Simulate the medium up to `until` [s]; return started and dropped transmissions.

        power  (N, N) received power by sender (row) and receiver (column) [dBm]
        """
        started: list[Transmission] = []
        dropped: list[Transmission] = []
        self.power = power
        while self.names:
            row, event = self.next_event()
            if self._arrivals and self._arrivals[0].ready <= min(event, until - TIME_TOLERANCE):
                dropped += self._arrive(self._arrivals.popleft())
                continue
            if not event < until - TIME_TOLERANCE:
                break
            self._measure(event)
            transmission = self.process(row, event)
            if transmission is not None:
                started.append(transmission)
        self.rest(until)
        self.receive(started, until)
        return started, dropped

    @abstractmethod
    def next_event(self) -> tuple[int, float]:
        """Return the row and the time [s] of the next event of a station; infinity without one."""

    @abstractmethod
    def process(self, row: int, time: float) -> Transmission | None:
        """Process the event of a station; return the transmission that it starts."""

    @abstractmethod
    def receive(self, started: Sequence[Transmission], until: float) -> None:
        """Determine which started transmissions the stations detect up to `until` [s]."""

    @abstractmethod
    def reset_event(self, row: int) -> None:
        """Reset the event of a station, whose queue has a new first message or is empty."""

    def share(self, transmission: Transmission) -> float:
        """Return the share of the channel that a transmission occupies."""
        return 1.0

    def rest(self, until: float) -> None:
        """Advance to `until` [s] without transmissions."""
        if math.isfinite(until):
            self._measure(until)

    def interval(self, row: int) -> float:
        """Return the minimum interval between messages of a station after its last one, by congestion control [s]."""
        return self.gate.interval(row, float(self._last_use[row]))

    def channel_busy_ratio(self, row: int, span: float) -> float:
        """Return the channel busy ratio of a station over the `span` [s] since its entry."""
        return float(self._busy_time[row] + self._period_busy[row]) / span

    def continue_from(self, previous: MediumAccess) -> None:
        """Take the congestion control of the same stations from a replaced medium, unless its settings differ."""
        if self.gate.control == previous.gate.control and self.gate.background == previous.gate.background:
            self.gate = previous.gate
            self._last_start, self._last_use = previous._last_start, previous._last_use

    def rearrange(self, names: tuple[str, ...]) -> list[Transmission]:
        """Replace the stations; return the pending transmissions of removed stations."""
        rows = [self._rows.get(name) for name in names]
        gone = set(self.names).difference(names)
        lost = self.withdraw(gone)
        self._waiting = [deque() if old is None else self._waiting[old] for old in rows]
        self._head = [None if old is None else self._head[old] for old in rows]
        self.contending = sum(head is not None for head in self._head)
        reorder_fields(
            self, rows, ready=math.inf, _last_start=-math.inf, _last_use=0.0, _busy_time=0.0, _period_busy=0.0
        )
        for transmission in self.active:
            reorder_fields(transmission, rows, gain=0.0, busy=False)
        self.gate = self.gate.reorder(rows)
        self.names, self._rows = names, {name: row for row, name in enumerate(names)}
        self.reorder(rows)
        return lost

    def withdraw(self, senders: Collection[str]) -> list[Transmission]:
        """Remove the pending transmissions of present stations, and return them."""
        rows = [row for name, row in self._rows.items() if name in senders and self._waiting[row]]
        pending = [transmission for row in rows for transmission in self._waiting[row]]
        pending += [transmission for transmission in self._arrivals if transmission.message.sender in senders]
        self._arrivals = deque(
            transmission for transmission in self._arrivals if transmission.message.sender not in senders
        )
        for row in rows:
            self._waiting[row].clear()
            self._contend_next(row)
        return pending

    @abstractmethod
    def reorder(self, rows: Sequence[int | None]) -> None:
        """Reorder the state of the stations; `rows` contains the former row of each station, None for new ones."""

    def evict_before(self, time: float) -> None:
        """Remove transmissions that ended before this time [s] and overlap with no unfinished one."""
        self.active = [transmission for transmission in self.active if transmission.end > time]

    def _arrive(self, transmission: Transmission) -> list[Transmission]:
        row = self._rows[transmission.message.sender]
        queue = self._waiting[row]
        dropped: list[Transmission] = []
        index = len(queue)
        if self.queue.discipline == "lcfs" and queue:
            if any(_is_outdated(transmission, by=queued) for queued in queue):
                return [transmission]
            dropped = [queued for queued in queue if _is_outdated(queued, by=transmission)]
            index = queue.index(dropped[0]) if dropped else index
            for queued in dropped:
                queue.remove(queued)
        if len(queue) >= self.queue.length:
            return [*dropped, transmission]
        queue.insert(index, transmission)
        if queue[0] is not self._head[row]:
            self._contend_next(row)
        return dropped

    def _contend_next(self, row: int) -> None:
        """Let the first message in the queue of a station contend as soon as the DCC gate opens."""
        queue = self._waiting[row]
        self.contending += bool(queue) - (self._head[row] is not None)
        self._head[row] = first = queue[0] if queue else None
        opens = self._last_start[row] + self.interval(row)
        if first is None:
            self.ready[row] = math.inf
        else:
            self.ready[row] = first.ready if first.retransmission else max(first.ready, opens)
        self.reset_event(row)

    def _begin(self, row: int, transmission: Transmission, start: float) -> None:
        """Start the transmission of the first message in the queue of a station."""
        transmission.start, transmission.end = start, start + transmission.duration
        if self.fading is not None:
            transmission.gain = self.fading.gain_db(row, transmission.draw_number)
        self._waiting[row].popleft()
        before = self._last_use[row] if transmission.retransmission else 0.0
        self._last_start[row], self._last_use[row] = start, before + transmission.duration * self.share(transmission)
        self.active.append(transmission)

    def _measure(self, now: float) -> None:
        """Pass the channel busy ratio of each completed period to congestion control."""
        period = self.gate.control.period
        if self._period is None:
            self._period = math.floor(now / period + 1e-6)
        while now >= (self._period + 1) * period - TIME_TOLERANCE:
            self._busy_time += self._period_busy
            ratio = self._period_ratio(period)
            self.gate.update(ratio if self.senses_jammer is None else np.where(self.senses_jammer, 1.0, ratio))
            self._period_busy = np.zeros(len(self.names))
            self._period += 1

    def _period_ratio(self, period: float) -> Array:
        """Return the channel busy ratio (N,) of the completed period [s]."""
        return self._period_busy / period


def reorder_fields(owner: object, rows: Sequence[int | None], **fresh: float) -> None:
    """Reorder the stations in the last axis of arrays, attributes of an object that may be None.

    rows   former row of each station, None for new ones
    fresh  value for new stations, by attribute
    """
    kept = [new for new, old in enumerate(rows) if old is not None]
    former = [old for old in rows if old is not None]
    for name, value in fresh.items():
        values = getattr(owner, name)
        if values is not None:
            reordered = np.full((*values.shape[:-1], len(rows)), value, dtype=values.dtype)
            reordered[..., kept] = values[..., former]
            setattr(owner, name, reordered)


def _is_outdated(transmission: Transmission, *, by: Transmission) -> bool:
    """Return True if another message of the same kind was sent in a later tick, and no transmission has started."""
    if transmission.retransmission:
        return False
    return transmission.sent < by.sent and transmission.message.kind == by.message.kind
