"""Medium access of IEEE 802.11p: carrier sensing with random backoff (IEEE 802.11-2012, 9.19), preambles."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.counter_random import Keys, key, uniforms
from eidrive_scenario.v2x.radio.access import MediumAccess, QueueSettings, Transmission, reorder_fields
from eidrive_scenario.v2x.radio.congestion import DccGate
from eidrive_scenario.v2x.standards import SLOT

AIFS = 32e-6 + 6 * SLOT
"""SIFS and 6 slots: access category AC_BE in the OCB mode (IEEE 802.11-2012, table 8-106) [s]."""
CONTENTION_WINDOW = 15
"""aCWmin: the backoff of broadcast messages is 0 to 15 slots, and they are never retransmitted."""


class Csma(MediumAccess):
    """CSMA/CA: a message starts if the medium was idle for AIFS, or else after AIFS and a number of idle slots.

    Contending stations whose starts are within one slot of each other cannot sense each other, and their transmissions
    overlap. A station that becomes ready later senses each transmission that has begun, also within its first slot.

    A station locks to a message up to its end, unless it is locked or transmits already, or the interference at the
    start is too strong to decode it. It stops to receive when it starts to transmit. Of messages that start at the same
    time none is earlier: they interfere with each other.

    noise_dbm     noise in the channel
    decodable_db  minimum ratio of the signal to noise and interference at the start
    """

    def __init__(
        self,
        queue: QueueSettings,
        gate: DccGate,
        sensing_dbm: float,
        seed: int,
        noise_dbm: float,
        decodable_db: float,
    ) -> None:
        super().__init__(queue, gate, sensing_dbm)
        self._seed = seed
        self._noise, self._decodable = 10.0 ** (noise_dbm / 10.0), 10.0 ** (decodable_db / 10.0)
        self._lockable = max(sensing_dbm, noise_dbm + decodable_db)
        """Minimum power to lock to a message without interference [dBm]."""
        self._slots = np.zeros(0)
        """Remaining backoff of the first message of each station [slots]; NaN if it met no busy medium."""
        self._fixed = np.zeros(0)
        """Fixed starts, which no later transmission defers [s]; NaN if not fixed."""
        self._free_from = np.zeros(0)
        """Time from which each station senses an idle medium, by the transmissions so far [s]."""
        self._locked_until = np.zeros(0)
        """Time until which each station is locked or transmits [s]."""
        self._starts = np.zeros(0)
        """Predicted start of the first message of each station [s]; infinity for empty queues."""
        self._keys: Keys = np.zeros(0, dtype=np.uint64)

    def next_event(self) -> tuple[int, float]:
        """Return the station that starts first, and the predicted start."""
        if not self.contending:
            return 0, math.inf
        # NaN and infinity select the cases: no backoff yet, an empty queue, no fixed start.
        met_busy = np.isnan(self._slots) & (self.ready < self._free_from + AIFS)
        if met_busy.any():
            rows = np.flatnonzero(met_busy)
            heads = [self._head[row] for row in rows.tolist()]
            numbers = np.array([head.message.number for head in heads if head is not None])
            self._slots[rows] = np.floor(uniforms(self._keys[rows], numbers) * (CONTENTION_WINDOW + 1))
        waited = np.maximum(self.ready, self._free_from) + AIFS + self._slots * SLOT
        starts = np.where(np.isnan(self._slots), self.ready, waited)
        self._starts = np.where(np.isnan(self._fixed), starts, self._fixed)
        row = int(np.argmin(self._starts))
        return row, float(self._starts[row])

    def process(self, row: int, time: float) -> Transmission:
        """Start the first message of a station, and mark the medium as busy for the stations that sense it."""
        transmission = self._head[row]
        assert transmission is not None
        self._begin(row, transmission, time)
        sensed = self._received(transmission) >= self.sensing_dbm
        sensed[row] = True
        end = transmission.end
        self._period_busy += np.where(sensed, np.maximum(0.0, end - np.maximum(time, self._free_from)), 0.0)
        if self.contending > 1:
            self._count_down(row, time, sensed)
        self._free_from[sensed] = np.maximum(self._free_from[sensed], end)
        self._contend_next(row)
        return transmission

    def reset_event(self, row: int) -> None:
        self._slots[row] = self._fixed[row] = math.nan

    def _count_down(self, row: int, start: float, sensed: Bools) -> None:
        """Reduce the backoff of the other stations by the elapsed idle slots.

        Stations that cannot have sensed the start yet keep their predicted start.
        """
        starts = self._starts
        others = sensed & np.isfinite(starts)
        others[row] = False
        contends = self.ready <= start + TIME_TOLERANCE
        unaware = others & contends & (starts < start + SLOT - TIME_TOLERANCE)
        self._fixed[unaware] = starts[unaware]
        waiting = others & ~unaware & ~np.isnan(self._slots)
        # Slots that were idle between the end of AIFS and this start; the backoff freezes while the medium is busy.
        counted = np.floor((start - np.maximum(self.ready, self._free_from) - AIFS + TIME_TOLERANCE) / SLOT)
        self._slots[waiting] -= np.clip(counted[waiting], 0.0, self._slots[waiting])

    def receive(self, started: Sequence[Transmission], until: float) -> None:
        """Set `busy` of the started transmissions, which are in order: the stations locked to earlier ones."""
        pending = list(started)
        on_air = [each for each in self.active if pending and each.start < pending[0].start]
        while pending:
            instant = pending[0].start + TIME_TOLERANCE
            count = bisect_right(pending, instant, key=lambda transmission: transmission.start)
            together, pending = pending[:count], pending[count:]
            busy = self._locked_until > instant
            locked_until = self._locked_until.copy()
            on_air = [*(each for each in on_air if each.end > instant), *together]
            received = [self._received(each) for each in on_air]
            total = sum((10.0 ** (power / 10.0) for power in received), self._noise) if len(on_air) > 1 else None
            for transmission, power in zip(together, received[-count:], strict=True):
                transmission.busy = busy
                locks = ~busy & (power >= self._lockable)
                if total is not None:
                    signal = 10.0 ** (power / 10.0)
                    locks &= signal >= self._decodable * (total - signal)
                locked_until[locks] = np.maximum(locked_until[locks], transmission.end)
            for transmission in together:
                locked_until[self._rows[transmission.message.sender]] = transmission.end
            self._locked_until = locked_until

    def _received(self, transmission: Transmission) -> Array:
        """Return the received power of a transmission at each station (N,) [dBm]."""
        power: Array = self.power[self._rows[transmission.message.sender]]
        return power if transmission.gain is None else power + transmission.gain

    def reorder(self, rows: Sequence[int | None]) -> None:
        reorder_fields(self, rows, _slots=math.nan, _fixed=math.nan, _free_from=-math.inf, _locked_until=-math.inf)
        self._keys = np.array([key(self._seed, "backoff", name) for name in self.names], dtype=np.uint64)
