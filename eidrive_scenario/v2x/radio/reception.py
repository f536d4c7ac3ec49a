"""Reception model: signal, interference and resulting cause of loss of each message at each station."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.analytic.table import ErrorTable
from eidrive_scenario.v2x.counter_random import Keys, uniforms
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.budget import Budget
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LOS

Codes = NDArray[np.int8]
CAUSES = ("delivered", "half_duplex", "sensing", "busy", "propagation", "jamming", "collision", "queue")
"""Causes of loss in order of precedence; codes in arrays are indices. `queue`: dropped before transmission."""
DELIVERED, HALF_DUPLEX, SENSING, BUSY, PROPAGATION, JAMMING, COLLISION, QUEUE = range(len(CAUSES))
BACKGROUND = {"busy": BUSY, "collision": COLLISION}
"""Causes added by background traffic. Those of signal strength and of the station's own transmissions are excluded: the
link budget and the access to the medium have them."""
_SALTS = np.arange(1, len(BACKGROUND) + 1, dtype=np.uint64)[:, None, None]


@dataclass(frozen=True)
class Receptions:
    """Receptions of T messages at N stations: cause (T, N), signal-to-noise ratio (T, N) [dB], sender row (T,)."""

    causes: Codes
    snr: Array
    senders: NDArray[np.int64]


class Receiver:
    """Model of the receivers of all stations.

    background   background traffic, and the mean path loss (D,) at the distances of its table [dB]
    """

    def __init__(self, profile: RadioProfile) -> None:
        self._noises_dbm = [profile.noise_in(width) for width in range(1, profile.max_subchannels + 1)]
        """Noise in the band of a message in 1, 2, … subchannels [dBm]."""
        self._sensing_dbm = profile.sensing
        self._curves = profile.curves
        """Packet error curves by code of the line-of-sight state."""
        self.background = profile.background_by_loss()

    def receive(
        self,
        ended: Sequence[Transmission],
        active: Sequence[Transmission],
        power: Array,
        budget: Budget,
        keys: Keys,
        jamming: Array | None = None,
    ) -> Receptions:
        """Return the receptions of the transmissions in `ended`.

        active   all transmissions that may overlap with them, including themselves
        power    (N, N) received power by sender (row) and receiver (column) [dBm]
        keys     (N, N) keys of the links, by sender and receiver
        jamming  (N,) power of jammers at the receivers [mW]; None without a jammer
        """
        rows = np.array([budget.rows[transmission.message.sender] for transmission in active], dtype=np.int64)
        received = power.take(rows, axis=0)
        for index, transmission in enumerate(active):
            if transmission.gain is not None:
                received[index] += transmission.gain
        index_of = {id(transmission): index for index, transmission in enumerate(active)}
        own = np.array([index_of[id(transmission)] for transmission in ended], dtype=np.int64)
        senders, signal = rows.take(own), received.take(own, axis=0)
        links, states = keys.take(senders, axis=0), budget.states.take(senders, axis=0)
        numbers = np.array([[transmission.draw_number] for transmission in ended])
        sizes = np.array([[transmission.message.size] for transmission in ended], dtype=float)
        noise_dbm = np.array([[self._noises_dbm[transmission.bands - 1]] for transmission in ended])
        draws, snr = uniforms(links, numbers), signal - noise_dbm

        def errors_with(disturbance: Array, of: Integers) -> Array:
            """Return the packet error rates of messages `of` with noise and this power of other transmitters [mW]."""
            floor = 10.0 * np.log10(10.0 ** (noise_dbm[of] / 10.0) + disturbance)
            return self._errors(signal[of] - floor, states[of], sizes[of])

        losses = [(SENSING, signal < self._sensing_dbm), (PROPAGATION, draws < self._errors(snr, states, sizes))]
        busy = [transmission.busy for transmission in ended if transmission.busy is not None]
        if busy:
            losses.append((BUSY, np.array(busy)))
        controls = [transmission.control for transmission in ended if transmission.control is not None]
        if controls:
            control = np.array(controls)
            losses += [(PROPAGATION, control == PROPAGATION), (COLLISION, control == COLLISION)]
        if jamming is not None:
            losses.append((JAMMING, draws < errors_with(jamming, np.arange(len(ended)))))
        if _is_any_overlap(active):
            interference, half_duplex = _interference(own, active, rows, received)
            losses.append((HALF_DUPLEX, half_duplex))
            if interference is not None:
                others = interference.power + (0.0 if jamming is None else jamming)
                losses.append((COLLISION, draws < interference.combine(errors_with(others, interference.of))))
        if self.background is not None:
            losses += self._background_losses(self.background, budget.mean_loss.take(senders, axis=0), links, numbers)
        causes = np.zeros(snr.shape, dtype=np.int8)
        for code, applies in sorted(losses, key=lambda loss: -loss[0]):  # the first cause in the order of CAUSES
            causes[applies] = code
        return Receptions(causes, snr, senders)

    def _errors(self, ratio: Array, states: NDArray[np.int64], sizes: Array) -> Array:
        """Return the packet error rates (T, N) at these ratios of signal to noise and interference [dB]."""
        if not states.any():
            return self._curves[LOS].at(ratio, sizes)
        return np.choose(states, [curve.at(ratio, sizes) for curve in self._curves])

    @staticmethod
    def _background_losses(
        background: tuple[ErrorTable, Array], mean_loss: Array, links: Keys, numbers: Integers
    ) -> list[tuple[int, Bools]]:
        """Return the losses by background traffic, at the distances where its model has these path losses.

        Each cause has a separate random number: the key of the link is shifted by the index of the cause.
        """
        table, loss_at = background
        distance = np.interp(mean_loss, loss_at, table.distance)
        draws = uniforms(links + _SALTS, numbers)
        return [
            (code, own < np.interp(distance, table.distance, table.given[cause]))
            for (cause, code), own in zip(BACKGROUND.items(), draws, strict=True)
            if cause in table.given
        ]


@dataclass(frozen=True)
class Interference:
    """Power of other transmitters in P parts of those of T messages that overlap with any.

    The parts are between the starts and ends of the others.

    of      (P,) messages, ascending
    shares  (P,) durations, as shares of the message
    power   (P, N) sum of the others at each station [mW]
    """

    count: int
    of: Integers
    shares: Array
    power: Array

    def combine(self, errors: Array) -> Array:
        """Return the error rates (T, N) of messages whose parts would have `errors` (P, N) over the whole message.

        Errors in the parts are independent: 1 - PER is the product of (1 - PER of the part)^share, as in ns-3.
        """
        combined = np.zeros((self.count, errors.shape[1]))
        starts = np.flatnonzero(np.diff(self.of, prepend=-1))
        with np.errstate(divide="ignore"):  # the logarithm of a part that is certainly lost is minus infinity
            survival = np.add.reduceat(self.shares[:, None] * np.log1p(-errors), starts)
        combined[self.of[starts]] = -np.expm1(survival)
        return combined


def _is_any_overlap(active: Sequence[Transmission]) -> bool:
    """Return whether any two transmissions overlap; with carrier sensing and few stations, none do."""
    end = -math.inf
    for transmission in sorted(active, key=lambda transmission: transmission.start):
        if transmission.start < end - TIME_TOLERANCE:
            return True
        end = max(end, transmission.end)
    return False


def _interference(
    own: Integers, active: Sequence[Transmission], rows: Integers, received: Array
) -> tuple[Interference | None, Bools]:
    """Return the interference, None without any, and whether the receiver transmits (T, N).

    Sums follow the order of the stations, which makes them independent of the BLAS library.

    own       (T,) indices of the ended transmissions in `active`
    rows      (A,) rows of the senders of `active`
    received  (A, N) received power of each transmission at each station [dBm]
    """
    starts, ends = [transmission.start for transmission in active], [transmission.end for transmission in active]
    start, end = np.array(starts), np.array(ends)
    overlapping = (start < end[own, None] - TIME_TOLERANCE) & (start[own, None] < end - TIME_TOLERANCE)
    overlapping[np.arange(len(own)), own] = False
    same_band, shares = overlapping, None
    if len({(transmission.first_band, transmission.bands) for transmission in active}) > 1:
        # An interferer in other subchannels contributes the share of its power that lies in those of the message.
        first = np.array([transmission.first_band for transmission in active])
        last = first + np.array([transmission.bands for transmission in active])
        common = np.minimum(last, last[own, None]) - np.maximum(first, first[own, None])
        same_band, shares = overlapping & (common > 0), common / (last - first)
    half_duplex = np.zeros((len(own), received.shape[1]), dtype=bool)
    milliwatts = 10.0 ** (received / 10.0)
    parts: list[tuple[int, float, Array]] = []
    for index in np.flatnonzero(overlapping.any(axis=1)).tolist():
        half_duplex[index, rows[overlapping[index]]] = True
        others = np.flatnonzero(same_band[index])
        if not len(others):
            continue
        others = others[np.argsort(rows[others], kind="stable")]
        disturbing = milliwatts[others]
        if shares is not None:
            disturbing = disturbing * shares[index, others][:, None]
        begin, stop = starts[own[index]], ends[own[index]]
        times = {time for other in others for time in (starts[other], ends[other]) if begin < time < stop}
        for since, until in pairwise([begin, *sorted(times), stop]):
            if until - since > TIME_TOLERANCE:
                present = disturbing
                if times:
                    begun, goes_on = start[others] < until - TIME_TOLERANCE, since < end[others] - TIME_TOLERANCE
                    present = disturbing[begun & goes_on]
                parts.append((index, (until - since) / (stop - begin), present.sum(axis=0)))
    if not parts:
        return None, half_duplex
    of, lengths, power = zip(*parts, strict=True)
    return Interference(len(own), np.array(of), np.array(lengths), np.array(power)), half_duplex
