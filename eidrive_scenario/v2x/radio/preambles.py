"""Preamble detection of IEEE 802.11p: a receiver locks to the first message that it senses while it is idle."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.radio.access import Transmission, reorder_rows


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
            for entry in together:
                entry.busy = busy
                row = rows[entry.message.sender]
                received = power[row] if entry.gain is None else power[row] + entry.gain
                locks = ~busy & (received >= self._sensing_dbm)
                until[locks] = np.maximum(until[locks], entry.end)
            for entry in together:
                until[rows[entry.message.sender]] = entry.end
            self._until = until


def _start(entry: Transmission) -> float:
    return entry.start
