"""Sensing-based resource selection of C-V2X Mode 4: candidate resources of a station (3GPP TS 36.213, 14.1.1.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.v2x.standards import CANDIDATE_SHARE

STEP_DB = 3.0
"""Increment of the threshold while fewer candidates remain (step 7) [dB]."""
PSTEP = 100
"""Subframes between the averaged S-RSSI of longer resource reservation intervals."""
WINDOW = 10 * PSTEP
"""Length of the sensing window [subframes]."""


@dataclass(frozen=True)
class Request:
    """Request of a station for a resource in subframe `now`.

    first, last    selection window, from n + T1 to n + T2 [subframes]
    width, length  subchannels and subframes of a resource
    interval       resource reservation interval [subframes]
    uses           C_resel, maximum number of reserved uses
    threshold      SL-ThresPSSCH-RSRP [dBm]
    """

    now: int
    first: int
    last: int
    width: int
    length: int
    interval: int
    uses: int
    threshold: float

    @property
    def starts(self) -> int:
        """Number of subframes in which a candidate resource can start."""
        return max(1, self.last - self.first + 2 - self.length)


@dataclass(frozen=True)
class Sensed:
    """Sensing results of one station before subframe n.

    rssi       (WINDOW, S) S-RSSI of subframe z in row z mod WINDOW, 0 where not monitored [mW]
    monitored  (WINDOW,) whether the station received in that subframe
    own        (Z,) subframes of the transmissions of the station
    reserved   (R,) subframes of decoded SCI, bands (R,) their first subchannels, widths (R,), and rsrp (R,) [dBm]
    """

    rssi: NDArray[np.float32]
    monitored: Bools
    own: Integers
    reserved: Integers
    bands: Integers
    widths: Integers
    rsrp: NDArray[np.float32]


def candidates(request: Request, sensed: Sensed, order: Array) -> Integers:
    """Return the resources that are reported to higher layers, as indices of (start subframe, first subchannel).

    order  (starts · (S - width + 1),) random numbers that order candidates with the same average S-RSSI
    """
    bands = sensed.rssi.shape[1]
    subframes = request.starts + request.length - 1
    level = np.full((subframes, bands), -np.inf)
    _mark(level, request, sensed.reserved, sensed.bands, sensed.widths, sensed.rsrp)
    blind = np.full((subframes, 1), -np.inf)
    _mark(blind, request, sensed.own, np.zeros_like(sensed.own), np.ones_like(sensed.own), np.inf)
    highest = _over(np.maximum(level, blind), request).max(axis=(2, 3)).ravel()
    average = _over(_average_rssi(request, sensed, subframes), request).mean(axis=(2, 3)).ravel()

    least = math.ceil(CANDIDATE_SHARE * len(highest) - 1e-9)
    selectable = np.flatnonzero(highest <= _raise_threshold(highest, request.threshold, least))
    best = np.lexsort((order[selectable], average[selectable]))[:least]
    return np.sort(selectable[best])


def _mark(
    level: Array,
    request: Request,
    reserved_in: Integers,
    bands: Integers,
    widths: Integers,
    power: NDArray[np.float32] | float,
) -> None:
    """Store the maximum `power` of reservations in each subframe and subchannel of the window (steps 5 and 6).

    A reservation from the subframes `reserved_in` counts if it overlaps with a use by this station, now or within
    `uses` intervals.
    """
    if not len(reserved_in):
        return
    interval = request.interval
    repeats = -(-PSTEP // interval) if interval < PSTEP else 1  # Q
    recent = request.now - reserved_in <= interval
    powers = np.broadcast_to(np.asarray(power, dtype=np.float64), reserved_in.shape)
    for repeat in range(1, repeats + 1):
        use = reserved_in + repeat * interval
        counts = recent if repeat > 1 else np.ones_like(recent)
        start = (use - request.first) % interval
        for shift in range(0, len(level), interval):
            at = start + shift
            ahead = use - (request.first + at)
            hit = np.flatnonzero(counts & (at < len(level)) & (ahead >= 0) & (ahead < request.uses * interval))
            for offset in range(int(widths[hit].max(initial=0))):
                wide = hit[widths[hit] > offset]
                np.maximum.at(level, (at[wide], bands[wide] + offset), powers[wide])


def _average_rssi(request: Request, sensed: Sensed, subframes: int) -> Array:
    """Return the mean S-RSSI of monitored subframes at multiples of the interval or 100 ms before [mW] (step 8).

    The shape is (subframes, S).
    """
    apart = min(request.interval, PSTEP)
    phases = sensed.rssi.reshape(-1, apart, sensed.rssi.shape[1])
    counts = sensed.monitored.reshape(-1, apart).sum(axis=0)
    mean = phases.sum(axis=0) / np.maximum(counts, 1)[:, None]
    average: Array = mean[(request.first + np.arange(subframes)) % apart]
    return average


def _over(values: Array, request: Request) -> Array:
    """Return the values of each candidate resource (starts, S - width + 1, length, width)."""
    return sliding_window_view(values, (request.length, request.width))


def _raise_threshold(level: Array, threshold: float, least: int) -> float:
    """Return the threshold, raised in steps of 3 dB until at least `least` candidates do not exceed it (step 7).

    Subframes that the station did not monitor have level infinity. They stay excluded unless no others remain.
    """
    finite = np.sort(level)
    needed = float(finite[least - 1])
    if needed <= threshold or math.isinf(needed):
        return max(threshold, needed)
    return threshold + STEP_DB * math.ceil((needed - threshold) / STEP_DB)
