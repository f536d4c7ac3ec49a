"""Duration of transmissions."""

from __future__ import annotations

import math

from eidrive_scenario.v2x.standards import PREAMBLE

SYMBOL = 8e-6
"""Duration of one OFDM symbol in 10 MHz [s]."""
EXTRA_BITS = 22
"""Bits of service field and tail."""
BITS_PER_SYMBOL = {3.0: 24, 4.5: 36, 6.0: 48, 9.0: 72, 12.0: 96, 18.0: 144, 24.0: 192, 27.0: 216}
"""Data bits per OFDM symbol, by data rate in 10 MHz [Mbit/s]."""
SENSITIVITIES = {3.0: -85.0, 4.5: -84.0, 6.0: -82.0, 9.0: -80.0, 12.0: -77.0, 18.0: -73.0, 24.0: -69.0, 27.0: -68.0}
"""Minimum sensitivity of receivers in 10 MHz, by data rate [dBm] (IEEE 802.11-2012, table 18-14)."""

SUBFRAME = 1e-3
"""Duration of an LTE subframe [s]."""


def ieee80211p_airtime(size: int, data_rate_mbps: float, mtu: int) -> float:
    """Return the duration of a message of `size` bytes [s], sent in consecutive frames of at most `mtu` bytes."""
    bits = BITS_PER_SYMBOL[data_rate_mbps]
    duration = 0.0
    for frame in fragments(size, mtu):
        duration += PREAMBLE + math.ceil((8 * frame + EXTRA_BITS) / bits) * SYMBOL
    return duration


def fragments(size: int, mtu: int) -> tuple[int, ...]:
    """Return the sizes of the frames of a message [bytes]."""
    full, rest = divmod(size, mtu)
    return (mtu,) * full + ((rest,) if rest or not full else ())
