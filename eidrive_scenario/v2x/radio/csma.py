"""Medium access of IEEE 802.11p: carrier sensing with random backoff (IEEE 802.11-2012, 9.19), preambles."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.counter_random import Keys, key, uniforms
from eidrive_scenario.v2x.radio.access import MediumAccess, QueueSettings, Transmission, reorder_rows
from eidrive_scenario.v2x.radio.congestion import DccGate
from eidrive_scenario.v2x.standards import SLOT


class PreambleDetection:
    """Messages to which N stations are locked, each to the end of its message.

    A station does not lock to a message while it transmits, and stops to receive when it starts to transmit. Of
    messages that start at the same time none is earlier: they interfere with each other.

    sensing_dbm  minimum power of a message to which a station locks [dBm]
    """

    def __init__(self, count: int, sensing_dbm: float) -> None:
        self._sensing_dbm = sensing_dbm
        self._until = np.full(count, -math.inf)
        """Time until which each station is locked or transmits [s]."""

    def reorder(self, rows: Sequence[int | None]) -> None:
        """Reorder the state of the stations; `rows` contains the former row of each station, None for new ones."""
        self._until = reorder_rows(self._until, rows, -math.inf)

    def detect(self, started: Sequence[Transmission], rows: Mapping[str, int], power: Array) -> None:
        """Set `busy` of these transmissions. Those of a later call may not start earlier.

        rows   row of each station
        power  (N, N) received power by sender (row) and receiver (column) [dBm]
        """
        pending = sorted(started, key=_start)
        while pending:
            instant = pending[0].start + TIME_TOLERANCE
            count = bisect_right(pending, instant, key=_start)
            together, pending = pending[:count], pending[count:]
            busy = self._until > instant
            until = self._until.copy()
            for transmission in together:
                transmission.busy = busy
                received = power[rows[transmission.message.sender]]
                if transmission.gain is not None:
                    received = received + transmission.gain
                locks = ~busy & (received >= self._sensing_dbm)
                until[locks] = np.maximum(until[locks], transmission.end)
            for transmission in together:
                until[rows[transmission.message.sender]] = transmission.end
            self._until = until


def _start(transmission: Transmission) -> float:
    return transmission.start


AIFS = 32e-6 + 6 * SLOT
"""SIFS and 6 slots: access category AC_BE in the OCB mode (IEEE 802.11-2012, table 8-106) [s]."""
CONTENTION_WINDOW = 15
"""aCWmin: the backoff of broadcast messages is 0 to 15 slots, and they are never retransmitted."""


class Csma(MediumAccess):
    """CSMA/CA: a message starts if the medium was idle for AIFS, or else after AIFS and a number of idle slots.

    Stations that start within one slot of each other cannot sense each other, and their transmissions overlap.
    """

    def __init__(
        self, names: tuple[str, ...], queue: QueueSettings, gate: DccGate, sensing_dbm: float, seed: int
    ) -> None:
        super().__init__(names, queue, gate, sensing_dbm)
        self._seed = seed
        self._slots = np.full(len(names), math.nan)
        """Remaining backoff of the first message of each station [slots]; NaN if it met no busy medium."""
        self._fixed = np.full(len(names), math.nan)
        """Fixed starts, which no later transmission defers [s]; NaN if not fixed."""
        self.free_from = np.full(len(names), -math.inf)
        """Time from which each station senses an idle medium, by the transmissions so far [s]."""
        self._keys = self._backoff_keys()
        self._preambles = PreambleDetection(len(names), sensing_dbm)

    def advance(self, until: float, power: Array) -> tuple[list[Transmission], list[Transmission]]:
        started: list[Transmission] = []
        dropped: list[Transmission] = []
        if not self.names:
            return started, dropped
        sensed = power >= self.sensing_dbm
        np.fill_diagonal(sensed, True)
        no_starts = np.full(len(self.names), math.inf)
        while True:
            starts = self.starts() if self.contending else no_starts
            row = int(np.argmin(starts)) if self.contending else 0
            start = float(starts[row])
            if self._arrivals and self._arrivals[0].ready <= min(start, until - TIME_TOLERANCE):
                dropped += self._arrive(self._arrivals.popleft())
                continue
            if not start < until - TIME_TOLERANCE:
                break
            self._measure(start)
            transmission = self._head[row]
            assert transmission is not None
            self._begin(row, transmission, start)
            sensing = sensed[row]
            if transmission.gain is not None:
                sensing = power[row] + transmission.gain >= self.sensing_dbm
                sensing[row] = True
            self._occupy(row, transmission, sensing, starts)
            self._contend_next(row)
            started.append(transmission)
        if math.isfinite(until):
            self._measure(until)
        self._preambles.detect(started, self._rows, power)
        return started, dropped

    def _backoff_keys(self) -> Keys:
        return np.array([key(self._seed, "backoff", name) for name in self.names], dtype=np.uint64)

    def starts(self) -> Array:
        """Return the predicted start of the first message of each station (N,) [s]; infinity for empty queues."""
        # NaN and infinity select the cases: no backoff yet, an empty queue, no fixed start.
        met_busy = np.isnan(self._slots) & (self.ready < self.free_from + AIFS)
        if met_busy.any():
            rows = np.flatnonzero(met_busy)
            heads = [self._head[row] for row in rows.tolist()]
            numbers = np.array([head.message.number for head in heads if head is not None])
            self._slots[rows] = np.floor(uniforms(self._keys[rows], numbers) * (CONTENTION_WINDOW + 1))
        waited = np.maximum(self.ready, self.free_from) + AIFS + self._slots * SLOT
        starts = np.where(np.isnan(self._slots), self.ready, waited)
        return np.where(np.isnan(self._fixed), starts, self._fixed)

    def predicted_starts(self, row: int, transmission: Transmission | None) -> None:
        self._slots[row] = self._fixed[row] = math.nan

    def _occupy(self, row: int, transmission: Transmission, sensed: NDArray[np.bool_], starts: Array) -> None:
        """Mark the medium as busy for the stations in `sensed`; `starts` are the predictions before this start."""
        start, end = transmission.start, transmission.end
        self._period_busy += np.where(sensed, np.maximum(0.0, end - np.maximum(start, self.free_from)), 0.0)
        if self.contending > 1:
            self._count_down(row, start, sensed, starts)
        self.free_from[sensed] = np.maximum(self.free_from[sensed], end)

    def _count_down(self, row: int, start: float, sensed: NDArray[np.bool_], starts: Array) -> None:
        """Reduce the backoff of the other stations by the elapsed idle slots.

        Stations that cannot have sensed the start yet keep their predicted start.
        """
        others = sensed & np.isfinite(starts)
        others[row] = False
        unaware = others & (starts < start + SLOT - TIME_TOLERANCE)
        self._fixed[unaware] = starts[unaware]
        waiting = others & ~unaware & ~np.isnan(self._slots)
        # Slots that were idle between the end of AIFS and this start; the backoff freezes while the medium is busy.
        counted = np.floor((start - np.maximum(self.ready, self.free_from) - AIFS + TIME_TOLERANCE) / SLOT)
        self._slots[waiting] -= np.clip(counted[waiting], 0.0, self._slots[waiting])

    def reorder(self, rows: Sequence[int | None]) -> None:
        self._slots, self._fixed = reorder_rows(self._slots, rows, math.nan), reorder_rows(self._fixed, rows, math.nan)
        self.free_from = reorder_rows(self.free_from, rows, -math.inf)
        self._keys = self._backoff_keys()
        self._preambles.reorder(rows)
