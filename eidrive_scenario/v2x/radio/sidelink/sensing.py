"""Sensing of a sidelink: control information, and the measured power of resources."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.counter_random import Keys, uniforms
from eidrive_scenario.v2x.radio.access import Transmission, reorder_fields
from eidrive_scenario.v2x.radio.packet_error import ErrorCurve
from eidrive_scenario.v2x.radio.reception import COLLISION, DELIVERED, PROPAGATION, Codes
from eidrive_scenario.v2x.radio.sidelink.resource_selection import WINDOW, Sensed


class Pdus(NamedTuple):
    """Parts (T,) of transmissions in one slot each, in the order of the slots.

    rows           of the senders
    bands, widths  first subchannel and number of subchannels
    numbers        of the random draws
    """

    transmissions: Sequence[Transmission]
    slots: Integers
    rows: Integers
    bands: Integers
    widths: Integers
    numbers: Integers

    @classmethod
    def of(cls, parts: Sequence[tuple[int, int, Transmission]]) -> Pdus:
        """Return at least one part, given by slot, row of the sender and transmission."""
        slots, rows, transmissions = zip(*parts, strict=True)
        columns = [(each.first_band, each.bands, each.draw_number) for each in transmissions]
        return cls(transmissions, np.array(slots), np.array(rows), *np.array(columns, dtype=np.int64).T)


def decode_control(
    pdus: Pdus, per_block: Array, block_noise: float, boost: float, curve: ErrorCurve, keys: Keys
) -> Codes:
    """Return the outcome of the SCI of each PDU at each station (T, N): DELIVERED, PROPAGATION or COLLISION.

    The control channel is in the first subchannel of its transmission; other users of this subchannel interfere.

    per_block    (T, N) received power of each PDU in one resource block of its data [mW]
    block_noise  noise in one resource block [mW]
    boost        power ratio of resource elements of the control channel and of the data
    curve        packet error rate by signal-to-interference-and-noise ratio
    keys         (N, N) keys of the links, by sender and receiver
    """
    slots, first, last = pdus.slots, pdus.bands, pdus.bands + pdus.widths
    draws = uniforms(keys[pdus.rows], pdus.numbers[:, None])
    signal = boost * per_block
    codes = np.full(per_block.shape, DELIVERED, dtype=np.int8)
    meets = (slots[:, None] == slots) & (first <= first[:, None]) & (first[:, None] < last)
    np.fill_diagonal(meets, False)
    met = np.flatnonzero(meets.any(axis=1))
    interference = np.zeros((len(met), per_block.shape[1]))
    for index, own in enumerate(met.tolist()):
        others = np.flatnonzero(meets[own])
        boosted = np.where(first[others] == first[own], boost, 1.0)
        interference[index] = (per_block[others] * boosted[:, None]).sum(axis=0)
    if len(met):
        disturbed = _decibels(signal[met] / (block_noise + interference))
        codes[met] = np.where(draws[met] < curve.at(disturbed, 1), COLLISION, DELIVERED)
    ratio = _decibels(signal / block_noise)
    codes[draws < curve.at(ratio, 1)] = PROPAGATION
    return codes


def _decibels(ratio: Array) -> Array:
    level: Array = 10.0 * np.log10(np.maximum(ratio, 1e-30))
    return level


NOT_DECODED = -np.inf
CAPACITY = 256
"""Initial capacity for reservations."""


@dataclass
class Reservations:
    """Decoded control information of the last `span` slots that reserves resources.

    resources  (R, 5) slot, slots to a transmission of the message, 0 for its own, whether it reserves for the next one,
               first subchannel and number of subchannels
    rsrp       (R, N) PSSCH-RSRP [dBm]; -inf if not decoded
    """

    span: int
    resources: Integers = field(default_factory=lambda: np.zeros((CAPACITY, 5), dtype=np.int64))
    rsrp: NDArray[np.float32] = field(default_factory=lambda: np.zeros((CAPACITY, 0), dtype=np.float32))
    begin: int = 0
    end: int = 0

    def add(self, resources: Integers, rsrp: Array) -> None:
        """Append entries, in the order of their slots."""
        count = len(resources)
        if self.end + count > len(self.resources):
            self._grow(count, int(resources[0, 0]))
        rows = slice(self.end, self.end + count)
        self.resources[rows], self.rsrp[rows] = resources, rsrp
        self.end += count

    def of(self, row: int, now: int) -> tuple[Integers, Integers, Integers, Integers, Integers, NDArray[np.float32]]:
        """Return the reservations and their PSSCH-RSRP that a station decoded in the span before slot `now`."""
        self._forget(now)
        rsrp = self.rsrp[self.begin : self.end, row]
        decoded = np.flatnonzero(rsrp > NOT_DECODED)
        slots, ahead, repeats, bands, widths = self.resources[decoded + self.begin].T
        return slots, ahead, repeats, bands, widths, rsrp[decoded]

    def rearrange(self, rows: Sequence[int | None]) -> None:
        """Keep the columns of these former rows; None: a new station."""
        reorder_fields(self, rows, rsrp=NOT_DECODED)

    def _forget(self, now: int) -> None:
        self.begin += int(np.searchsorted(self.resources[self.begin : self.end, 0], now - self.span))

    def _grow(self, count: int, now: int) -> None:
        self._forget(now)
        live, kept = slice(self.begin, self.end), self.end - self.begin
        size = len(self.resources)
        while kept + count > size // 2:
            size *= 2
        resources = np.zeros((size, 5), dtype=np.int64)
        rsrp = np.full((size, self.rsrp.shape[1]), NOT_DECODED, dtype=np.float32)
        resources[:kept], rsrp[:kept] = self.resources[live], self.rsrp[live]
        self.resources, self.rsrp, self.begin, self.end = resources, rsrp, 0, kept


class SensingHistory:
    """Sensing windows of N stations, which `rearrange` adds (3GPP TS 36.213, 14.1.1.6, and TS 38.214, 8.1.4, step 2).

    span       time for which reservations count [slots]
    rssi       (WINDOW, S, N) S-RSSI by slot mod WINDOW [mW]; 0 while a station transmits
    monitored  (WINDOW, N) whether a station received in the slot
    """

    def __init__(self, subchannels: int, span: int) -> None:
        self.rssi = np.zeros((WINDOW, subchannels, 0), dtype=np.float32)
        self.monitored = np.zeros((WINDOW, 0), dtype=np.bool_)
        self.reservations = Reservations(span)
        self._until: int | None = None

    def proceed(self, until: int) -> None:
        """Append empty slots up to `until`, exclusive."""
        if self._until is None:
            self._until = until
        gap = min(until - self._until, WINDOW)
        if gap > 0:
            start = (until - gap) % WINDOW
            for rows in (slice(start, start + gap), slice(0, max(0, start + gap - WINDOW))):
                self.rssi[rows] = 0.0
                self.monitored[rows] = True
            self._until = until

    def receive(self, pdus: Pdus, per_subchannel: Array) -> Integers:
        """Add transmissions in appended slots; return these slots.

        per_subchannel  (T, N) received power of each PDU in each of its subchannels [mW]
        """
        at = pdus.slots % WINDOW
        columns = (column.tolist() for column in (at, pdus.bands, pdus.widths))
        for row, first, width, power in zip(*columns, per_subchannel, strict=True):
            self.rssi[row, first : first + width] += power.astype(np.float32)
        self.rssi[at, :, pdus.rows] = 0.0
        self.monitored[at, pdus.rows] = False
        return np.unique(pdus.slots)

    def busy(self, slots: Integers, threshold: float) -> tuple[Array, Integers]:
        """Return the busy time and the unmeasured time of each station over these slots (N,) [slots].

        The busy time sums the shares of subchannels whose S-RSSI exceeds the threshold [mW]. A station does not
        measure while it transmits.
        """
        rows = slots % WINDOW
        monitored = self.monitored[rows]
        counts = ((self.rssi[rows] > threshold) & monitored[:, None]).sum(axis=(0, 1))
        return counts / self.rssi.shape[1], len(rows) - monitored.sum(axis=0)

    def reserve(self, pdus: Pdus, codes: Codes, rsrp: Array) -> None:
        """Add the reservations in decoded control information: of retransmissions, and of all in the next interval."""
        reserved = [
            (index, slot, ahead, transmission.reserves, band, transmission.bands)
            for index, (slot, transmission) in enumerate(zip(pdus.slots.tolist(), pdus.transmissions, strict=True))
            for ahead, band in (*transmission.later, *[(0, transmission.first_band)] * transmission.reserves)
        ]
        if reserved:
            decoded = (codes == DELIVERED) & self.monitored[pdus.slots % WINDOW]
            indices, *resources = np.array(reserved).T
            self.reservations.add(np.stack(resources, axis=1), np.where(decoded, rsrp, NOT_DECODED)[indices])

    def of(self, row: int, now: int, own: Integers) -> Sensed:
        """Return the sensing results of a station before slot `now`; it transmitted in the slots `own`."""
        self.proceed(now)
        return Sensed(self.rssi[:, :, row], self.monitored[:, row], own, *self.reservations.of(row, now))

    def rearrange(self, rows: Sequence[int | None]) -> None:
        """Keep the columns of these former rows; None: a new station."""
        reorder_fields(self, rows, rssi=0.0, monitored=False)
        self.reservations.rearrange(rows)
