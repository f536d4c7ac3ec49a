"""Reception model: signal, interference and resulting cause of loss of each message at each station."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.analytic.table import ErrorTable
from eidrive_scenario.v2x.counter_random import Keys, uniform, uniforms
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.budget import Budget
from eidrive_scenario.v2x.radio.packet_error import ErrorCurve, interpolate

Codes = NDArray[np.int8]
CAUSES = ("delivered", "half_duplex", "sensing", "busy", "propagation", "jamming", "collision", "queue")
"""Causes of loss in order of precedence; codes in arrays are indices. `queue`: dropped before transmission."""
DELIVERED, HALF_DUPLEX, SENSING, BUSY, PROPAGATION, JAMMING, COLLISION, QUEUE = range(len(CAUSES))
MAX_SCALAR = 12
"""Maximum number of receptions for scalar evaluation, which is then faster than arrays."""
BACKGROUND = {"half_duplex": HALF_DUPLEX, "busy": BUSY, "collision": COLLISION}
"""Causes added by background traffic. Causes of signal strength are excluded, because the link budget has them."""


@dataclass(frozen=True)
class Receptions:
    """Receptions of T messages at N stations: cause (T, N), signal-to-noise ratio (T, N) [dB], sender row (T,)."""

    causes: Codes
    snr: Array
    senders: NDArray[np.int64]


@dataclass(frozen=True)
class Receiver:
    """Parameters common to all receivers.

    noises_dbm   noise in the band of a message in 1, 2, … subchannels [dBm]
    sensing_dbm  minimum sensed power [dBm]
    curves       packet error curves by code of the line-of-sight state
    background   background traffic, and the mean path loss (D,) at the distances of its table [dB]
    """

    noises_dbm: Sequence[float]
    sensing_dbm: float
    curves: Sequence[ErrorCurve]
    background: tuple[ErrorTable, Array] | None = None

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
        few = len(ended) * len(power) <= MAX_SCALAR
        return (self._receive_scalar if few else self._receive_array)(ended, active, power, budget, keys, jamming)

    def _receive_array(
        self,
        ended: Sequence[Transmission],
        active: Sequence[Transmission],
        power: Array,
        budget: Budget,
        keys: Keys,
        jamming: Array | None,
    ) -> Receptions:
        rows = np.array([budget.rows[entry.message.sender] for entry in active], dtype=np.int64)
        place = {id(entry): index for index, entry in enumerate(active)}
        own = np.array([place[id(entry)] for entry in ended], dtype=np.int64)
        start, end = (np.array([getattr(entry, name) for entry in active]) for name in ("start", "end"))
        first = np.array([entry.first_band for entry in active])
        last = first + np.array([entry.bands for entry in active])
        overlapping = (start[None, :] < end[own, None] - TIME_TOLERANCE) & (
            start[own, None] < end[None, :] - TIME_TOLERANCE
        )
        overlapping[np.arange(len(own)), own] = False
        same_band = overlapping & (first[None, :] < last[own, None]) & (first[own, None] < last[None, :])

        senders = rows[own]
        received = power[rows]
        for index, entry in enumerate(active):
            if entry.gain is not None:
                received[index] += entry.gain
        signal = received[own]
        noise_dbm = np.array([self.noises_dbm[entry.bands - 1] for entry in ended])[:, None]
        snr = signal - noise_dbm
        numbers = np.array([entry.message.number for entry in ended])[:, None]
        draws = uniforms(keys[senders], numbers)
        sizes = np.array([entry.message.size for entry in ended], dtype=float)[:, None]
        states = budget.states[senders]
        lost_alone = self._errors(snr, states, sizes)

        causes = np.zeros(snr.shape, dtype=np.int8)
        shares = None
        if int(last.max() - first.min()) > 1:
            common = np.minimum(last[None, :], last[own, None]) - np.maximum(first[None, :], first[own, None])
            shares = common / (last - first)
        interference, half_duplex = self._interference(overlapping, same_band, shares, rows, received)
        if jamming is not None:
            interference = interference + jamming
        if same_band.any():
            disturbed = signal - 10.0 * np.log10(10.0 ** (noise_dbm / 10.0) + interference)
            causes[draws < self._errors(disturbed, states, sizes)] = COLLISION
        controls = [entry.control for entry in ended if entry.control is not None]
        if controls:
            control = np.stack(controls)
            causes[control == COLLISION] = COLLISION
            causes[control == PROPAGATION] = PROPAGATION
        if jamming is not None:
            jammed = signal - 10.0 * np.log10(10.0 ** (noise_dbm / 10.0) + jamming)
            causes[draws < self._errors(jammed, states, sizes)] = JAMMING
        causes[draws < lost_alone] = PROPAGATION
        for index, entry in enumerate(ended):
            if entry.busy is not None:
                causes[index, entry.busy] = BUSY
        causes[signal < self.sensing_dbm] = SENSING
        causes[half_duplex] = HALF_DUPLEX
        if self.background is not None:
            self._add_background(causes, budget.mean_loss[senders], keys[senders], numbers)
        return Receptions(causes, snr, senders)

    def _receive_scalar(
        self,
        ended: Sequence[Transmission],
        active: Sequence[Transmission],
        power: Array,
        budget: Budget,
        keys: Keys,
        jamming: Array | None,
    ) -> Receptions:
        """Return the receptions, evaluated one by one."""
        powers, links = power.tolist(), keys.tolist()
        faded = {
            id(entry): powers[budget.rows[entry.message.sender]]
            if entry.gain is None
            else (power[budget.rows[entry.message.sender]] + entry.gain).tolist()
            for entry in active
        }
        jam = [0.0] * len(powers) if jamming is None else jamming.tolist()
        states, mean_loss = budget.states.tolist(), budget.mean_loss.tolist()
        senders = [budget.rows[entry.message.sender] for entry in ended]
        causes, ratios = [], []
        for entry, sender in zip(ended, senders, strict=True):
            overlapping = [other for other in active if other is not entry and _overlap(other, entry)]
            transmitting = {budget.rows[other.message.sender] for other in overlapping}
            disturbing = sorted(
                (other for other in overlapping if _common_share(other, entry) > 0.0),
                key=lambda other: budget.rows[other.message.sender],
            )
            shares = [(faded[id(other)], _common_share(other, entry)) for other in disturbing]
            busy = None if entry.busy is None else entry.busy.tolist()
            noise_dbm = self.noises_dbm[entry.bands - 1]
            controls = None if entry.control is None else entry.control.tolist()
            number, size = entry.message.number, entry.message.size
            entry_causes = []
            for station, signal in enumerate(faded[id(entry)]):
                curve, draw = self.curves[states[sender][station]], uniform(links[sender][station], number)
                cause = DELIVERED
                if station in transmitting:
                    cause = HALF_DUPLEX
                elif signal < self.sensing_dbm:
                    cause = SENSING
                elif busy is not None and busy[station]:
                    cause = BUSY
                elif draw < curve.of(signal - noise_dbm, size):
                    cause = PROPAGATION
                elif jam[station] and draw < curve.of(signal - _floor(noise_dbm, jam[station]), size):
                    cause = JAMMING
                elif controls is not None and controls[station] != DELIVERED:
                    cause = controls[station]
                elif disturbing:
                    others = sum(10.0 ** (received[station] / 10.0) * share for received, share in shares)
                    others += jam[station]
                    floor = _floor(noise_dbm, others)
                    cause = COLLISION if draw < curve.of(signal - floor, size) else DELIVERED
                if self.background is not None:
                    cause = self._in_background(cause, mean_loss[sender][station], links[sender][station], number)
                entry_causes.append(cause)
            causes.append(entry_causes)
            ratios.append([signal - noise_dbm for signal in faded[id(entry)]])
        return Receptions(np.array(causes, dtype=np.int8), np.array(ratios), np.array(senders, dtype=np.int64))

    def _in_background(self, cause: int, mean_loss: float, link: int, number: int) -> int:
        """Return `_add_background` for one reception."""
        losses, distances, given = self._background_lists
        distance = interpolate(mean_loss, losses, distances)
        for salt, code, probabilities in given:
            if cause == DELIVERED or cause > code:
                draw = uniform(link + salt, number)
                cause = code if draw < interpolate(distance, distances, probabilities) else cause
        return cause

    @cached_property
    def _background_lists(self) -> tuple[list[float], list[float], list[tuple[int, int, list[float]]]]:
        """Path loss and distances of the background traffic, and salt, code and probabilities of each cause."""
        assert self.background is not None
        table, loss_at = self.background
        given = [(salt, BACKGROUND[cause], table.given[cause].tolist()) for salt, cause in _salted_causes(table)]
        return loss_at.tolist(), table.distance.tolist(), given

    def _interference(
        self, overlapping: Bools, same_band: Bools, shares: Array | None, rows: Integers, received: Array
    ) -> tuple[Array, Bools]:
        """Return the interference (T, N) [mW], and whether the receiver transmits (T, N).

        Sums follow the order of the stations, which makes them independent of the BLAS library.

        shares    (T, A) share of the power of each interferer in the band of a message; None: 1
        received  (A, N) received power of each transmission at each station [dBm]
        """
        shape = (len(overlapping), received.shape[1])
        interference, half_duplex = np.zeros(shape), np.zeros(shape, dtype=bool)
        milliwatts = 10.0 ** (received / 10.0)
        for place in np.flatnonzero(overlapping.any(axis=1)).tolist():
            half_duplex[place, rows[overlapping[place]]] = True
            others = np.flatnonzero(same_band[place])
            if len(others):
                others = others[np.argsort(rows[others], kind="stable")]
                disturbing = milliwatts[others]
                if shares is not None:
                    disturbing = disturbing * shares[place, others][:, None]
                interference[place] = disturbing.sum(axis=0)
        return interference, half_duplex

    def _errors(self, ratio: Array, states: NDArray[np.int64], sizes: Array) -> Array:
        lowest, highest = int(states.min()), int(states.max())
        if all(self.curves[state] is self.curves[lowest] for state in range(lowest, highest + 1)):
            return self.curves[lowest].at(ratio, sizes)
        return np.choose(states, [curve.at(ratio, sizes) for curve in self.curves])

    def _add_background(self, causes: Codes, mean_loss: Array, keys: Keys, numbers: NDArray[np.int64]) -> None:
        """Add losses by background traffic, at the distance where its model has this path loss."""
        assert self.background is not None
        table, loss_at = self.background
        given = _salted_causes(table)
        distance = np.interp(mean_loss, loss_at, table.distance)
        salts = np.array([salt for salt, _ in given], dtype=np.uint64)
        draws = uniforms(keys + salts[:, None, None], numbers)
        for (_, cause), own in zip(given, draws, strict=True):
            code = BACKGROUND[cause]
            probability = np.interp(distance, table.distance, table.given[cause])
            causes[(own < probability) & ((causes == DELIVERED) | (causes > code))] = code


def _salted_causes(table: ErrorTable) -> list[tuple[int, str]]:
    """Return the causes of background traffic, each with the salt of its random numbers."""
    return [(salt, cause) for salt, cause in enumerate(BACKGROUND, start=1) if cause in table.given]


def _floor(noise_dbm: float, others: float) -> float:
    """Return the sum of noise and other powers [mW] in dBm."""
    return 10.0 * math.log10(10.0 ** (noise_dbm / 10.0) + others)


def _overlap(first: Transmission, second: Transmission) -> bool:
    return first.start < second.end - TIME_TOLERANCE and second.start < first.end - TIME_TOLERANCE


def _common_share(interferer: Transmission, entry: Transmission) -> float:
    """Return the share of the power of an interferer in the band of a message."""
    last = min(interferer.first_band + interferer.bands, entry.first_band + entry.bands)
    return max(0, last - max(interferer.first_band, entry.first_band)) / interferer.bands
