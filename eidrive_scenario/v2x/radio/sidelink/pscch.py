"""Reception of sidelink control information (SCI) on the PSCCH, which is required for the reception of data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.v2x.counter_random import Keys, uniforms
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.packet_error import ErrorCurve
from eidrive_scenario.v2x.radio.reception import COLLISION, DELIVERED, PROPAGATION, Codes

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
        for index, place in enumerate(met.tolist()):
            others = np.flatnonzero(meets[place])
            boosted = np.where(first[others] == first[place], BOOST, 1.0)
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
