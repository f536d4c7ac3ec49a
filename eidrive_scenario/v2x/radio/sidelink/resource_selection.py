"""Sensing-based resource selection of C-V2X Mode 4: which resources a station may choose (3GPP TS 36.213, 14.1.1.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Bools

Rows = NDArray[np.int64]

SHARE = 0.2
"""Least share of the candidate resources that remain after exclusion, and share that is reported (steps 7 and 9)."""
STEP_DB = 3.0
"""By which the threshold rises while less remain (step 7) [dB]."""
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
    uses           C_resel, how often the resource is reserved at most
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
    own: Rows
    reserved: Rows
    bands: Rows
    widths: Rows
    rsrp: NDArray[np.float32]


def candidates(request: Request, sensed: Sensed, order: Array) -> Rows:
    """The resources that are reported to higher layers, by (start subframe, first subchannel) in one index.

    order  (starts · (S - width + 1),) random numbers: which comes first of those with the same average S-RSSI
    """
    bands = sensed.rssi.shape[1]
    subframes = request.starts + request.length - 1
    level = np.full((subframes, bands), -np.inf)
    _mark(level, request, sensed.reserved, sensed.bands, sensed.widths, sensed.rsrp)
    blind = np.full((subframes, 1), -np.inf)
    _mark(blind, request, sensed.own, np.zeros_like(sensed.own), np.ones_like(sensed.own), np.inf)
    highest = _over(np.maximum(level, blind), request).max(axis=(2, 3)).ravel()
    average = _over(_average_rssi(request, sensed, subframes), request).mean(axis=(2, 3)).ravel()

    least = math.ceil(SHARE * len(highest) - 1e-9)
    places = np.flatnonzero(highest <= _raised(highest, request.threshold, least))
    best = np.lexsort((order[places], average[places]))[:least]
    return np.sort(places[best])


def _mark(
    level: Array, request: Request, announced_in: Rows, bands: Rows, widths: Rows, power: NDArray[np.float32] | float
) -> None:
    """Steps 5 and 6: note the largest `power` in each subframe and subchannel of the window whose use by this station,
    now or within `uses` intervals, meets what was announced in the subframes `announced_in`."""
    if not len(announced_in):
        return
    interval = request.interval
    repeats = -(-PSTEP // interval) if interval < PSTEP else 1  # Q
    recent = request.now - announced_in <= interval
    powers = np.broadcast_to(np.asarray(power, dtype=np.float64), announced_in.shape)
    for repeat in range(1, repeats + 1):
        use = announced_in + repeat * interval
        counts = recent if repeat > 1 else np.ones_like(recent)
        start = (use - request.first) % interval
        for place in range(0, len(level), interval):
            at = start + place
            ahead = use - (request.first + at)
            hit = np.flatnonzero(counts & (at < len(level)) & (ahead >= 0) & (ahead < request.uses * interval))
            for offset in range(int(widths[hit].max(initial=0))):
                wide = hit[widths[hit] > offset]
                np.maximum.at(level, (at[wide], bands[wide] + offset), powers[wide])


def _average_rssi(request: Request, sensed: Sensed, subframes: int) -> Array:
    """(subframes, S) step 8: mean S-RSSI of the monitored subframes that lie whole intervals or 100 ms before [mW]."""
    apart = min(request.interval, PSTEP)
    phases = sensed.rssi.reshape(-1, apart, sensed.rssi.shape[1])
    counts = sensed.monitored.reshape(-1, apart).sum(axis=0)
    mean = phases.sum(axis=0) / np.maximum(counts, 1)[:, None]
    average: Array = mean[(request.first + np.arange(subframes)) % apart]
    return average


def _over(values: Array, request: Request) -> Array:
    """(starts, S - width + 1, length, width) the values of the subframes and subchannels of each candidate resource."""
    return sliding_window_view(values, (request.length, request.width))


def _raised(level: Array, threshold: float, least: int) -> float:
    """Step 7: the threshold, raised in steps of 3 dB until at least so many candidates do not exceed it.

    Subframes that the station has not monitored have the level infinity: no threshold brings them back, unless nothing
    else is left.
    """
    finite = np.sort(level)
    needed = float(finite[least - 1])
    if needed <= threshold or math.isinf(needed):
        return max(threshold, needed)
    return threshold + STEP_DB * math.ceil((needed - threshold) / STEP_DB)
