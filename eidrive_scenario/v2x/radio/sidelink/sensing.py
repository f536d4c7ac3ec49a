"""Sensing of C-V2X Mode 4: control information, and the measured power of resources."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.counter_random import Keys, uniforms
from eidrive_scenario.v2x.radio.access import Transmission, reorder_rows
from eidrive_scenario.v2x.radio.packet_error import ErrorCurve
from eidrive_scenario.v2x.radio.reception import COLLISION, DELIVERED, PROPAGATION, Codes
from eidrive_scenario.v2x.radio.sidelink.resource_selection import WINDOW, Sensed

BOOST = 2.0
"""Power ratio of resource elements of the control channel and of the data: 3 dB (3GPP TS 36.213, 14.2)."""


@dataclass(frozen=True)
class Pdu:
    """Part of a transmission in one subframe."""

    subframe: int
    row: int
    transmission: Transmission


@dataclass(frozen=True)
class ControlChannel:
    """Decoder of the control channel.

    block_noise  noise in one resource block [mW]
    curve        packet error rate by signal-to-interference-and-noise ratio
    """

    block_noise: float
    curve: ErrorCurve

    def decode(self, pdus: Sequence[Pdu], per_block: Array, keys: Keys) -> Codes:
        """Return the outcome of the SCI of each PDU at each station (T, N): DELIVERED, PROPAGATION or COLLISION.

        The control channel is in the first subchannel of its transmission; other users of this subchannel interfere.

        per_block  (T, N) received power of each PDU in one resource block of its data [mW]
        keys       (N, N) keys of the links, by sender and receiver
        """
        subframes, rows = (np.array([getattr(pdu, name) for pdu in pdus]) for name in ("subframe", "row"))
        first = np.array([pdu.transmission.first_band for pdu in pdus])
        last = first + np.array([pdu.transmission.bands for pdu in pdus])
        numbers = np.array([pdu.transmission.message.number for pdu in pdus])[:, None]
        draws = uniforms(keys[rows], numbers)
        signal = BOOST * per_block
        codes = np.full(per_block.shape, DELIVERED, dtype=np.int8)
        meets = (subframes[:, None] == subframes) & (first <= first[:, None]) & (first[:, None] < last)
        np.fill_diagonal(meets, False)
        met = np.flatnonzero(meets.any(axis=1))
        interference = np.zeros((len(met), per_block.shape[1]))
        for index, own in enumerate(met.tolist()):
            others = np.flatnonzero(meets[own])
            boosted = np.where(first[others] == first[own], BOOST, 1.0)
            interference[index] = (per_block[others] * boosted[:, None]).sum(axis=0)
        if len(met):
            disturbed = _decibels(signal[met] / (self.block_noise + interference))
            codes[met] = np.where(draws[met] < self.curve.at(disturbed, 1), COLLISION, DELIVERED)
        ratio = _decibels(signal / self.block_noise)
        codes[draws < self.curve.at(ratio, 1)] = PROPAGATION
        return codes


def _decibels(ratio: Array) -> Array:
    level: Array = 10.0 * np.log10(np.maximum(ratio, 1e-30))
    return level


NOT_DECODED = -np.inf
CAPACITY = 256
"""Initial capacity for reservations."""


@dataclass
class Reservations:
    """Decoded control information of the last `span` subframes that reserves resources, in columns of R entries.

    subframes, bands, widths  (R,) subframe, first subchannel and number of subchannels
    rsrp                      (R, N) PSSCH-RSRP [dBm]; -inf if not decoded
    """

    stations: int
    span: int
    subframes: Integers = field(default_factory=lambda: np.zeros(CAPACITY, dtype=np.int64))
    bands: Integers = field(default_factory=lambda: np.zeros(CAPACITY, dtype=np.int64))
    widths: Integers = field(default_factory=lambda: np.zeros(CAPACITY, dtype=np.int64))
    begin: int = 0
    end: int = 0

    def __post_init__(self) -> None:
        self.rsrp = np.full((CAPACITY, self.stations), NOT_DECODED, dtype=np.float32)

    def add(self, subframes: Integers, bands: Integers, widths: Integers, rsrp: Array) -> None:
        """Append entries, in the order of their subframes."""
        count = len(subframes)
        if self.end + count > len(self.subframes):
            self._grow(count, int(subframes[0]))
        rows = slice(self.end, self.end + count)
        self.subframes[rows], self.bands[rows], self.widths[rows] = subframes, bands, widths
        self.rsrp[rows] = rsrp
        self.end += count

    def of(self, row: int, now: int) -> tuple[Integers, Integers, Integers, NDArray[np.float32]]:
        """Return subframes, bands, widths and PSSCH-RSRP decoded by a station in the span before subframe `now`."""
        self.begin += int(np.searchsorted(self.subframes[self.begin : self.end], now - self.span))
        rsrp = self.rsrp[self.begin : self.end, row]
        decoded = np.flatnonzero(rsrp > NOT_DECODED)
        rows = decoded + self.begin
        return self.subframes[rows], self.bands[rows], self.widths[rows], rsrp[decoded]

    def rearrange(self, rows: Sequence[int | None]) -> None:
        """Keep the columns of these former rows; None: a new station."""
        self.rsrp = reorder_rows(self.rsrp, rows, NOT_DECODED)
        self.stations = len(rows)

    def _grow(self, count: int, now: int) -> None:
        self.begin += int(np.searchsorted(self.subframes[self.begin : self.end], now - self.span))
        live = slice(self.begin, self.end)
        kept = self.end - self.begin
        size = len(self.subframes)
        while kept + count > size // 2:
            size *= 2
        for name in ("subframes", "bands", "widths"):
            column = np.zeros(size, dtype=np.int64)
            column[:kept] = getattr(self, name)[live]
            setattr(self, name, column)
        rsrp = np.full((size, self.stations), NOT_DECODED, dtype=np.float32)
        rsrp[:kept] = self.rsrp[live]
        self.rsrp, self.begin, self.end = rsrp, 0, kept


class SensingHistory:
    """Sensing windows of N stations (3GPP TS 36.213, 14.1.1.6, step 2).

    rssi       (WINDOW, S, N) S-RSSI by subframe mod WINDOW [mW]; 0 while a station transmits
    monitored  (WINDOW, N) whether a station received in the subframe
    """

    def __init__(self, stations: int, subchannels: int, span: int) -> None:
        self.rssi = np.zeros((WINDOW, subchannels, stations), dtype=np.float32)
        self.monitored = np.zeros((WINDOW, stations), dtype=np.bool_)
        self.reservations = Reservations(stations, span)
        self._until: int | None = None

    def proceed(self, until: int) -> None:
        """Append empty subframes up to `until`, exclusive."""
        if self._until is None:
            self._until = until
        gap = min(until - self._until, WINDOW)
        if gap > 0:
            start = (until - gap) % WINDOW
            for rows in (slice(start, start + gap), slice(0, max(0, start + gap - WINDOW))):
                self.rssi[rows] = 0.0
                self.monitored[rows] = True
            self._until = until

    def receive(self, pdus: Sequence[Pdu], per_subchannel: Array) -> Integers:
        """Add transmissions in appended subframes; return these subframes.

        per_subchannel  (T, N) received power of each PDU in each of its subchannels [mW]
        """
        subframes = np.array([pdu.subframe for pdu in pdus], dtype=np.int64)
        own = np.array([pdu.row for pdu in pdus], dtype=np.int64)
        for pdu, power in zip(pdus, per_subchannel, strict=True):
            first = pdu.transmission.first_band
            self.rssi[pdu.subframe % WINDOW, first : first + pdu.transmission.bands] += power.astype(np.float32)
        self.rssi[subframes % WINDOW, :, own] = 0.0
        self.monitored[subframes % WINDOW, own] = False
        return np.array(sorted({pdu.subframe for pdu in pdus}), dtype=np.int64)

    def busy(self, subframes: Integers, threshold: float) -> tuple[Array, Integers]:
        """Return the busy time and the unmeasured time of each station over these subframes (N,) [subframes].

        The busy time sums the shares of subchannels whose S-RSSI exceeds the threshold [mW]. A station does not
        measure while it transmits.
        """
        rows = subframes % WINDOW
        monitored = self.monitored[rows]
        counts = ((self.rssi[rows] > threshold) & monitored[:, None]).sum(axis=(0, 1))
        return counts / self.rssi.shape[1], len(rows) - monitored.sum(axis=0)

    def reserve(self, pdus: Sequence[Pdu], codes: Codes, rsrp: Array) -> None:
        """Add the decoded control information of PDUs that reserve resources."""
        subframes = np.array([pdu.subframe for pdu in pdus], dtype=np.int64)
        bands, widths = (
            np.array([getattr(pdu.transmission, name) for pdu in pdus], dtype=np.int64)
            for name in ("first_band", "bands")
        )
        decoded = (codes == DELIVERED) & self.monitored[subframes % WINDOW]
        self.reservations.add(subframes, bands, widths, np.where(decoded, rsrp, NOT_DECODED))

    def of(self, row: int, now: int, own: Integers) -> Sensed:
        """Return the sensing results of a station before subframe `now`; it transmitted in the subframes `own`."""
        self.proceed(now)
        return Sensed(self.rssi[:, :, row], self.monitored[:, row], own, *self.reservations.of(row, now))

    def rearrange(self, rows: Sequence[int | None]) -> None:
        """Keep the columns of these former rows; None: a new station."""
        self.rssi = reorder_rows(self.rssi, rows, 0.0)
        self.monitored = reorder_rows(self.monitored, rows, False)
        self.reservations.rearrange(rows)
