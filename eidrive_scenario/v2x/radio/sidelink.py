"""Access of C-V2X Mode 4: each station keeps a resource for some messages, and then looks for a free one.

Sensing-based semi-persistent scheduling after 3GPP TS 36.213, 14.1.1.6 and TS 36.321, 5.14.1.1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.counter_draws import key, uniforms
from eidrive_scenario.v2x.radio.access import Access, QueueSettings, Transmission, moved
from eidrive_scenario.v2x.radio.airtime import SUBFRAME
from eidrive_scenario.v2x.radio.congestion import Gate

Array = NDArray[np.float64]

CANDIDATES = 0.2
"""Share of the resources among which a station chooses, those with the least power on them."""
COUNTER_BASE = (5, 15)
"""Messages for which a resource is kept at an interval of 100 ms; more often at shorter ones."""
INTERVALS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Between the uses of a resource [s]."""


class SidelinkSettings(Settings):
    """Resources of C-V2X Mode 4.

    interval      between two messages of a station on its resource [s]
    subchannels   into which 10 MHz are divided, and
    subchannel_bytes   what one of them carries in a subframe of 1 ms
    keep          probability of keeping the resource when its time is up
    processing    from the message to the earliest subframe that can carry it [s]
    """

    interval: float = 0.1
    subchannels: Annotated[int, Field(ge=1, le=20)] = 4
    subchannel_bytes: Annotated[int, Field(ge=1)] = 190
    keep: Annotated[float, Field(ge=0.0, le=0.8)] = 0.0
    processing: Annotated[float, Field(ge=0.0)] = 0.001

    @model_validator(mode="after")
    def _standard(self) -> SidelinkSettings:
        if self.interval not in INTERVALS:
            raise ValueError(
                f"interval is {self.interval:g} s; known: {', '.join(f'{known:g}' for known in INTERVALS)}"
            )
        return self

    def extent(self, size: int) -> tuple[int, int]:
        """How many subchannels and how many subframes a message of `size` bytes takes."""
        needed = max(1, math.ceil(size / self.subchannel_bytes))
        return min(needed, self.subchannels), math.ceil(needed / self.subchannels)


class Sidelink(Access):
    """Resources are (subframe of the interval, subchannels). Nobody hears in a subframe in which it talks."""

    def __init__(
        self,
        names: tuple[str, ...],
        queue: QueueSettings,
        gate: Gate,
        sensing_dbm: float,
        seed: int,
        settings: SidelinkSettings,
    ) -> None:
        super().__init__(names, queue, gate, sensing_dbm)
        self._settings = settings
        self._seed = seed
        self._subframes = round(settings.interval / SUBFRAME)
        count = len(names)
        self._slot, self._band, self._left = np.full(count, -1.0), np.zeros(count), np.zeros(count)
        self._width, self._choices = np.zeros(count), np.zeros(count)
        self._start = np.full(count, math.inf)
        self._milliwatts = np.zeros((count, count))

    def advance(self, until: float, power: Array) -> tuple[list[Transmission], list[Transmission]]:
        self._milliwatts = 10.0 ** (power / 10.0)
        np.fill_diagonal(self._milliwatts, 0.0)
        return super().advance(until, power)

    def starts(self) -> Array:
        for row in np.flatnonzero(np.isnan(self._start)).tolist():
            self._start[row] = self._occasion(row)
        return self._start

    def headed(self, row: int, transmission: Transmission | None) -> None:
        self._start[row] = math.inf if transmission is None else math.nan

    def began(self, row: int, transmission: Transmission, sensed: NDArray[np.bool_], starts: Array) -> None:
        transmission.first_band, transmission.bands = int(self._band[row]), int(self._width[row])
        self._left[row] -= 1

    def share(self, transmission: Transmission) -> float:
        return self._settings.extent(transmission.message.size)[0] / self._settings.subchannels

    def reorder(self, rows: Sequence[int | None]) -> None:
        self._slot, self._start = moved(self._slot, rows, -1.0), moved(self._start, rows, math.inf)
        for field in ("_band", "_left", "_width", "_choices"):
            setattr(self, field, moved(getattr(self, field), rows, 0.0))
        self._milliwatts = np.zeros((len(rows), len(rows)))

    def _occasion(self, row: int) -> float:
        """When the resource of a station comes next after its message is ready; a new one if the old is used up."""
        head = self._head[row]
        assert head is not None
        width, _ = self._settings.extent(head.message.size)
        earliest = math.ceil((self.ready[row] + self._settings.processing) / SUBFRAME - 1e-6)
        if self._slot[row] < 0.0 or width > self._width[row] or self._used_up(row):
            self._choose(row, width)
        behind = (int(self._slot[row]) - earliest) % self._subframes
        return float((earliest + behind) * SUBFRAME)

    def _used_up(self, row: int) -> bool:
        if self._left[row] > 0.0:
            return False
        if self._draw("keep", row) >= self._settings.keep:
            return True
        self._renew(row)
        return False

    def _choose(self, row: int, width: int) -> None:
        """Take one of the resources with the least power of others on them."""
        bands = self._settings.subchannels
        load = np.zeros((self._subframes, bands))
        for other in np.flatnonzero(self._slot >= 0.0).tolist():
            if other != row:
                first = int(self._band[other])
                load[int(self._slot[other]), first : first + int(self._width[other])] += self._milliwatts[other, row]
        windows = np.lib.stride_tricks.sliding_window_view(load, width, axis=1).sum(axis=2).ravel()
        number = max(1, math.floor(CANDIDATES * len(windows)))
        shuffled = uniforms(np.array([self._key("order", row)], dtype=np.uint64), np.arange(len(windows)))
        best = np.lexsort((shuffled, windows))[:number]
        chosen = int(best[math.floor(self._draw("choice", row) * number)])
        self._slot[row], self._band[row] = divmod(chosen, bands - width + 1)
        self._width[row] = width
        self._renew(row)

    def _renew(self, row: int) -> None:
        low, high = COUNTER_BASE
        often = max(1, round(0.1 / self._settings.interval))
        self._left[row] = often * (low + math.floor(self._draw("counter", row) * (high - low + 1)))
        self._choices[row] += 1

    def _draw(self, purpose: str, row: int) -> float:
        return float(uniforms(np.array([self._key(purpose, row)], dtype=np.uint64), int(self._choices[row]))[0])

    def _key(self, purpose: str, row: int) -> int:
        return key(self._seed, "sidelink", purpose, self.names[row], int(self._choices[row]))
