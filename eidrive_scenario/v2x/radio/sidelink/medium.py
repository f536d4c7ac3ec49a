"""Medium access of C-V2X Mode 4 and NR-V2X Mode 2: sensing-based semi-persistent scheduling.

Sources: 3GPP TS 36.213, 14.1.1.6, and TS 36.321, 5.14.1.1; TS 38.214, 8.1.4, and TS 38.321, 5.22.1.1.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniform, uniforms
from eidrive_scenario.v2x.radio.access import MediumAccess, QueueSettings, Transmission, reorder_fields
from eidrive_scenario.v2x.radio.congestion import DccGate
from eidrive_scenario.v2x.radio.nr_physical_layer import SUBCARRIERS
from eidrive_scenario.v2x.radio.reception import DELIVERED, PROPAGATION
from eidrive_scenario.v2x.radio.resource_pool import Pool
from eidrive_scenario.v2x.radio.sidelink.resource_selection import PSTEP, WINDOW, Request, candidates
from eidrive_scenario.v2x.radio.sidelink.sensing import Pdus, SensingHistory, decode_control

ATTEMPTS_PER_COUNT = 10
"""C_resel is ten times the reselection counter (3GPP TS 36.213, 14.1.1.4B)."""
UNUSED = 1.0
"""Maximum time for which an unused resource stays reserved [s] (3GPP TS 36.321, 5.14.1.1)."""
RETRANSMISSIONS_WITHIN = 32
"""Slots in which control information can reserve all transmissions of a message (3GPP TS 38.214, 8.1.5)."""


@dataclass
class Grant:
    """Resources reserved by a station: first used in `slot`, then once per interval.

    resources  slots from the first, and first subchannel, of each transmission of a message
    counter    remaining messages (SL_RESOURCE_RESELECTION_COUNTER)
    used       slot of the first transmission of the last message on it; None before
    """

    slot: int
    resources: Sequence[tuple[int, int]]
    width: int
    length: int
    counter: int
    used: int | None = None


@dataclass
class Sending:
    """A transmission from `slot`, the first that has not been sensed yet, to `end`, exclusive."""

    row: int
    transmission: Transmission
    slot: int
    end: int


class Sidelink(MediumAccess):
    """Sidelink of C-V2X Mode 4 or NR-V2X Mode 2. Stations do not receive in slots in which they transmit.

    A resource is a slot of the interval, with Mode 4 a subframe, and a range of subchannels. Slot k begins at k times
    its duration. A station without a resource for its first message selects one when the message may be sent, based on
    its sensing results.

    noise_dbm  noise in 10 MHz
    """

    def __init__(
        self,
        queue: QueueSettings,
        gate: DccGate,
        sensing_dbm: float,
        seed: int,
        settings: Pool,
        noise_dbm: float,
    ) -> None:
        super().__init__(queue, gate, sensing_dbm)
        self._settings = settings
        self._seed = seed
        noise = 10.0 ** (noise_dbm / 10.0)
        self._block_noise = noise / settings.noise_blocks
        self._busy_above = 10.0 ** (settings.cbr_threshold_dbm / 10.0) - noise / settings.noise_subchannels
        """Received power above which a subchannel is busy [mW]; if negative, the noise alone exceeds the threshold."""
        self._slot = settings.slot
        self._interval = round(settings.interval / settings.slot)
        self._window = round(settings.window / settings.slot)
        """T2 in slots."""
        self._span = min(self._interval, round(settings.sensing_window / settings.slot))
        """Slots for which a reservation or an own transmission excludes resources."""
        self._history = SensingHistory(settings.subchannels, self._span)
        self._grants: list[Grant | None] = []
        self._sent: list[deque[range]] = []
        """Slots of the recent transmissions of each station."""
        self._choices: dict[str, int] = {}
        """Number of drawn reselection counters by station, including the time before a re-entry."""
        self._next_event = np.zeros(0)
        """Time at which each station selects a resource, or starts its first message on a reserved one [s]."""
        self._scheduled = np.zeros(0, dtype=np.bool_)
        """Whether the event is the start of a message."""
        self._sending: list[Sending] = []
        """Transmissions that are not sensed up to their end."""
        self._unmeasured_time, self._period_unmeasured = np.zeros(0), np.zeros(0)
        """Time in which each station could not measure because it transmitted [s]."""
        self._keys: Keys = np.zeros((0, 0), dtype=np.uint64)

    def next_event(self) -> tuple[int, float]:
        row = int(np.argmin(self._next_event))
        return row, float(self._next_event[row])

    def process(self, row: int, time: float) -> Transmission | None:
        """Select the resource of the first message of a station, or transmit the message on it."""
        if self._scheduled[row]:
            return self._start(row)
        self._next_event[row] = self._occasion(row) * self._slot
        self._scheduled[row] = True
        return None

    def receive(self, started: Sequence[Transmission], until: float) -> None:
        """Evaluate sensing up to `until` [s]."""
        self._sense(until)

    def reset_event(self, row: int) -> None:
        self._next_event[row] = self.ready[row]
        self._scheduled[row] = False

    def share(self, transmission: Transmission) -> float:
        return transmission.bands / self._settings.subchannels

    def channel_busy_ratio(self, row: int, span: float) -> float:
        """Return the channel busy ratio of a station: mean over all subchannels of the measured slots."""
        if self._busy_above < 0.0:
            return 1.0
        measured = span - float(self._unmeasured_time[row] + self._period_unmeasured[row])
        return super().channel_busy_ratio(row, measured) if measured > 0.0 else 0.0

    def reorder(self, rows: Sequence[int | None]) -> None:
        former = {old: row for row, old in enumerate(rows) if old is not None}
        self._grants = [None if old is None else self._grants[old] for old in rows]
        self._sent = [deque() if old is None else self._sent[old] for old in rows]
        reorder_fields(self, rows, _next_event=math.inf, _scheduled=False, _unmeasured_time=0.0, _period_unmeasured=0.0)
        self._sending = [sending for sending in self._sending if sending.row in former]
        for sending in self._sending:
            sending.row = former[sending.row]
        for transmission in self.active:
            reorder_fields(transmission, rows, control=PROPAGATION)
        self._history.rearrange(rows)
        own = np.array([key(self._seed, "sci", name) for name in self.names], dtype=np.uint64)
        self._keys = combine_keys(own[:, None], own[None, :])

    def _start(self, row: int) -> Transmission:
        """Transmit the first message of a station on its resource."""
        transmission, grant = self._head[row], self._grants[row]
        assert transmission is not None
        assert grant is not None
        slot = round(float(self._next_event[row]) / self._slot)
        offset, transmission.first_band = grant.resources[transmission.retransmission]
        transmission.bands = grant.width
        transmission.later = [
            (after - offset, band) for after, band in grant.resources[transmission.retransmission + 1 :]
        ]
        if not transmission.retransmission:
            grant.used = slot
            grant.counter -= 1
            periodic, keep = self._settings.periodic, self._settings.resource_keep_probability
            if grant.counter == 0 and periodic and self._draw("keep", row) < keep:
                grant.counter = self._new_counter(row)
        transmission.reserves = grant.counter > 0
        length = round(transmission.duration / self._slot)
        self._sending.append(Sending(row, transmission, slot, slot + length))
        self._sent[row].append(range(slot, slot + length))
        self._begin(row, transmission, slot * self._slot)
        if transmission.later:
            ready = (slot + transmission.later[0][0]) * self._slot
            self._waiting[row].appendleft(
                replace(transmission, retransmission=transmission.retransmission + 1, ready=ready)
            )
        self._contend_next(row)
        return transmission

    def _occasion(self, row: int) -> int:
        """Return the slot of the first message of a station, on its reserved resource or a new one."""
        head, grant = self._head[row], self._grants[row]
        assert head is not None
        if head.retransmission:
            assert grant is not None
            assert grant.used is not None
            return grant.used + grant.resources[head.retransmission][0]
        settings, ready = self._settings, float(self.ready[row])
        now = math.floor(ready / self._slot + 1e-6)
        free = now
        if self._sent[row]:  # a message that waited for the one before is processed from the start of its transmission
            now, free = max(now, self._sent[row][-1].start), self._sent[row][-1].stop
        width, length = settings.extent(head.message.size)
        if grant is not None and grant.counter > 0 and grant.width >= width and grant.length >= length:
            # A message that is delayed by congestion control is processed in the meantime.
            processed = max(ready, head.ready + settings.processing)
            earliest = max(free, math.ceil(processed / self._slot - 1e-6))
            occasion = earliest + (grant.slot - earliest) % self._interval
            in_time = occasion * self._slot <= ready + settings.latency + TIME_TOLERANCE
            # A resource that was not used for some time, or for some occasions, is released.
            interval, limit = self._interval, settings.reselect_after
            used = grant.slot - interval if grant.used is None else grant.used
            is_released = (now - used) * self._slot > UNUSED or (
                limit is not None and (occasion - used) // interval - 1 >= limit
            )
            if in_time and not is_released:
                return occasion
        earliest = max(free, math.ceil((ready + settings.processing) / self._slot - 1e-6))
        self._grants[row] = grant = self._select(row, now, earliest, width, length)
        return grant.slot

    def _select(self, row: int, now: int, earliest: int, width: int, length: int) -> Grant:
        """Select a new resource among the candidates after sensing, and draw its reselection counter."""
        settings = self._settings
        self._sense(now * self._slot)
        counter = self._new_counter(row)
        sent, oldest = self._sent[row], now - self._span
        while sent and sent[0].stop <= oldest:
            sent.popleft()
        request = Request(
            now=now,
            first=earliest,
            last=max(earliest, now + self._window),
            width=width,
            length=length,
            interval=self._interval,
            uses=ATTEMPTS_PER_COUNT * counter if settings.periodic else 1,
            threshold=settings.pssch_rsrp_threshold_dbm,
            share=settings.candidate_share,
            span=PSTEP if settings.ranks_candidates else self._window,
        )
        spells = sent if settings.periodic else ()
        own = [slot for spell in spells for slot in range(max(spell.start, oldest), min(spell.stop, now))]
        first_bands = settings.subchannels - width + 1
        order = None
        if settings.ranks_candidates:
            count = np.arange(request.starts * first_bands)
            order = uniforms(np.array([self._key("order", row)], dtype=np.uint64), count)
        reported = candidates(request, self._history.of(row, now, np.array(own, dtype=np.int64)), order)
        chosen = [int(reported[math.floor(self._draw("choice", row) * len(reported))])]
        starts = reported // first_bands
        for retransmission in range(1, settings.transmissions):
            taken = [resource // first_bands for resource in chosen]
            apart = np.abs(starts[:, None] - taken).min(axis=1)
            within = np.maximum(starts, max(taken)) - np.minimum(starts, min(taken)) < RETRANSMISSIONS_WITHIN
            remaining = reported[(apart >= length) & within]
            if not len(remaining):
                break
            chosen.append(
                int(remaining[math.floor(self._draw(f"retransmission {retransmission}", row) * len(remaining))])
            )
        (first, _), *_ = resources = sorted(divmod(resource, first_bands) for resource in chosen)
        return Grant(earliest + first, [(start - first, band) for start, band in resources], width, length, counter)

    def _new_counter(self, row: int) -> int:
        name = self.names[row]
        self._choices[name] = self._choices.get(name, 0) + 1
        low, high = self._settings.counter_range if self._settings.periodic else (1, 1)
        return low + math.floor(self._draw("counter", row) * (high - low + 1))

    def _sense(self, until: float) -> None:
        """Evaluate sensing of the slots that end by `until` [s]."""
        ended = math.inf if math.isinf(until) else math.floor((until + TIME_TOLERANCE) / self._slot + 1e-9)
        while self._sending:
            first = min(sending.slot for sending in self._sending)
            if first >= ended:
                return
            self._sense_window(int(min(ended, first + WINDOW)))

    def _sense_window(self, ended: int) -> None:
        """Evaluate sensing of transmissions before slot `ended`, at most one sensing window."""
        due = [
            (slot, sending.row, sending.transmission)
            for sending in self._sending
            for slot in range(sending.slot, min(sending.end, ended))
        ]
        for sending in self._sending:
            sending.slot = max(sending.slot, ended)
        self._sending = [sending for sending in self._sending if sending.slot < sending.end]
        pdus = Pdus.of(sorted(due, key=lambda part: part[:2]))
        blocks = np.array([self._settings.pssch_blocks(width) for width in pdus.widths.tolist()])[:, None]
        power = self.power[pdus.rows]
        for index, transmission in enumerate(pdus.transmissions):
            if transmission.gain is not None:
                power[index] += transmission.gain
        milliwatts = 10.0 ** (power / 10.0)
        self._history.proceed(int(pdus.slots[-1]) + 1)
        received = self._history.receive(pdus, milliwatts / pdus.widths[:, None])
        busy, unmeasured = self._history.busy(received, self._busy_above)
        self._period_busy += self._slot * busy
        self._period_unmeasured += self._slot * unmeasured
        curve, boost = self._settings.control_curve, self._settings.control_boost
        codes = decode_control(pdus, milliwatts / blocks, self._block_noise, boost, curve, self._keys)
        for transmission, code in zip(pdus.transmissions, codes, strict=True):
            before = transmission.control
            transmission.control = code if before is None else np.where(before == DELIVERED, code, before)
        codes[power < self.sensing_dbm] = PROPAGATION
        self._history.reserve(pdus, codes, power - 10.0 * np.log10(SUBCARRIERS * blocks))

    def _measure(self, now: float) -> None:
        period = self.gate.control.period
        while self._period is not None and now >= (self._period + 1) * period - TIME_TOLERANCE:
            end = (self._period + 1) * period
            self._sense(end)
            super()._measure(end)
        super()._measure(now)

    def _period_ratio(self, period: float) -> Array:
        measured = period - self._period_unmeasured
        ratio: Array = np.where(
            (measured > TIME_TOLERANCE) & (self._busy_above >= 0.0),
            self._period_busy / np.maximum(measured, TIME_TOLERANCE),
            1.0,
        )
        self._unmeasured_time += self._period_unmeasured
        self._period_unmeasured = np.zeros(len(self.names))
        return ratio

    def _draw(self, purpose: str, row: int) -> float:
        return uniform(self._key(purpose, row), self._choices[self.names[row]])

    def _key(self, purpose: str, row: int) -> int:
        return key(self._seed, "sidelink", purpose, self.names[row], self._choices[self.names[row]])
