"""Sensing-based resource selection: candidate resources of a station.

Sources: Mode 4, 3GPP TS 36.213, 14.1.1.6; NR-V2X Mode 2, TS 38.214, 8.1.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools, Integers

STEP_DB = 3.0
"""Increment of the threshold while fewer candidates remain (step 7) [dB]."""
PSTEP = 100
"""Subframes of Mode 4 between the averaged S-RSSI of longer resource reservation intervals."""
WINDOW = 10 * PSTEP
"""Number of slots with stored S-RSSI: the sensing window of Mode 4."""


@dataclass(frozen=True)
class Request:
    """Request of a station for a resource in slot `now`.

    first, last    selection window, from n + T1 to n + T2 [slots]
    width, length  subchannels and slots of a resource
    interval       resource reservation interval [slots]
    uses           C_resel, maximum number of reserved uses
    threshold      SL-ThresPSSCH-RSRP [dBm]
    share          minimum share of candidates after exclusion
    span           slots within which a shorter interval counts as several reservations: P_step in Mode 4, T_scal
    """

    now: int
    first: int
    last: int
    width: int
    length: int
    interval: int
    uses: int
    threshold: float
    share: float
    span: int

    @property
    def starts(self) -> int:
        """Number of slots in which a candidate resource can start."""
        return max(1, self.last - self.first + 2 - self.length)


@dataclass(frozen=True)
class Sensed:
    """Sensing results of one station before slot n.

    rssi       (WINDOW, S) S-RSSI of slot z in row z mod WINDOW, 0 where not monitored [mW]
    monitored  (WINDOW,) whether the station received in that slot
    own        (Z,) slots of the transmissions of the station
    decoded    (R,) slots of decoded SCI, ahead (R,) slots from there to a transmission of the message, 0 for its own;
               repeats (R,) whether it also reserves that of the next message, an interval later; bands (R,) first
               subchannels, widths (R,), and rsrp (R,) [dBm]
    """

    rssi: NDArray[np.float32]
    monitored: Bools
    own: Integers
    decoded: Integers
    ahead: Integers
    repeats: Integers
    bands: Integers
    widths: Integers
    rsrp: NDArray[np.float32]


def candidates(request: Request, sensed: Sensed, order: Array | None) -> Integers:
    """Return the resources that are reported to higher layers, as indices of (start slot, first subchannel).

    order  (starts · (S - width + 1),) random numbers that order candidates of equal average S-RSSI, of which Mode 4
           reports the lowest; None: all candidates are reported (Mode 2)
    """
    bands = sensed.rssi.shape[1]
    slots = request.starts + request.length - 1
    reserved, blind = np.full((slots, bands), -np.inf), np.full((slots, 1), -np.inf)
    _mark(reserved, request, sensed.decoded, sensed.ahead, sensed.repeats, sensed.bands, sensed.widths, sensed.rsrp)
    zeros = np.zeros_like(sensed.own)
    _mark(blind, request, sensed.own, zeros, zeros + 1, zeros, zeros + 1, np.inf)
    highest = _over(np.maximum(reserved, blind), request).max(axis=(2, 3)).ravel()
    least = math.ceil(request.share * len(highest) - 1e-9)
    if order is None and np.isposinf(highest).sum() > len(highest) - least:
        highest = _over(reserved, request).max(axis=(2, 3)).ravel()  # step 5a: too many slots were not monitored
    selectable = np.flatnonzero(highest <= _raise_threshold(highest, request.threshold, least))
    if order is None:
        return selectable
    average = _over(_average_rssi(request, sensed, slots), request).mean(axis=(2, 3)).ravel()
    best = np.lexsort((order[selectable], average[selectable]))[:least]
    return np.sort(selectable[best])


def _mark(
    level: Array,
    request: Request,
    decoded: Integers,
    ahead: Integers,
    repeats: Integers,
    bands: Integers,
    widths: Integers,
    power: NDArray[np.float32] | float,
) -> None:
    """Store the maximum `power` of reservations in each slot and subchannel of the window (steps 5 and 6).

    A reservation counts if it overlaps with a use by this station, now or within `uses` intervals.
    """
    if not len(decoded):
        return
    interval = request.interval
    periods = -(-request.span // interval) if interval < request.span else 1  # Q
    recent = request.now - decoded <= interval
    powers = np.broadcast_to(np.asarray(power, dtype=np.float64), decoded.shape)
    for period in range(periods + 1):
        use = decoded + ahead + period * interval
        counts = ahead > 0 if period == 0 else (repeats > 0) & (recent | (period == 1))
        if not counts.any():
            continue
        start = (use - request.first) % interval
        for shift in range(0, len(level), interval):
            at = start + shift
            until = use - (request.first + at)
            hit = np.flatnonzero(counts & (at < len(level)) & (until >= 0) & (until < request.uses * interval))
            for offset in range(int(widths[hit].max(initial=0))):
                wide = hit[widths[hit] > offset]
                np.maximum.at(level, (at[wide], bands[wide] + offset), powers[wide])


def _average_rssi(request: Request, sensed: Sensed, slots: int) -> Array:
    """Return the mean S-RSSI of monitored slots at multiples of the interval or 100 ms before [mW] (step 8).

    The shape is (slots, S).
    """
    apart = min(request.interval, PSTEP)
    phases = sensed.rssi.reshape(-1, apart, sensed.rssi.shape[1])
    counts = sensed.monitored.reshape(-1, apart).sum(axis=0)
    mean = phases.sum(axis=0) / np.maximum(counts, 1)[:, None]
    average: Array = mean[(request.first + np.arange(slots)) % apart]
    return average


def _over(values: Array, request: Request) -> Array:
    """Return the values of each candidate resource (starts, S - width + 1, length, width)."""
    return sliding_window_view(values, (request.length, request.width))


def _raise_threshold(level: Array, threshold: float, least: int) -> float:
    """Return the threshold, raised in steps of 3 dB until at least `least` candidates do not exceed it (step 7).

    Slots that the station did not monitor have level infinity. They stay excluded unless no others remain.
    """
    finite = np.sort(level)
    needed = float(finite[least - 1])
    if needed <= threshold or math.isinf(needed):
        return max(threshold, needed)
    return threshold + STEP_DB * math.ceil((needed - threshold) / STEP_DB)
