"""How long a message is on the air."""

from __future__ import annotations

import math

PREAMBLE = 40e-6
"""Preamble and signal field in 10 MHz [s] (IEEE 802.11-2012, 18.3)."""
SYMBOL = 8e-6
"""One OFDM symbol in 10 MHz [s]."""
EXTRA_BITS = 22
"""Service field and tail."""
BITS_PER_SYMBOL = {3.0: 24, 4.5: 36, 6.0: 48, 9.0: 72, 12.0: 96, 18.0: 144, 24.0: 192, 27.0: 216}
"""By data rate in 10 MHz [Mbit/s]."""

SUBFRAME = 1e-3
"""Of LTE [s]."""


def ieee80211p_airtime(size: int, data_rate_mbps: float, mtu: int) -> float:
    """Duration of a message of `size` bytes [s], sent in frames of at most `mtu` bytes one after the other."""
    bits = BITS_PER_SYMBOL[data_rate_mbps]
    duration = 0.0
    for frame in fragments(size, mtu):
        duration += PREAMBLE + math.ceil((8 * frame + EXTRA_BITS) / bits) * SYMBOL
    return duration


def fragments(size: int, mtu: int) -> tuple[int, ...]:
    """The sizes of the frames of a message [bytes]."""
    whole, rest = divmod(size, mtu)
    return (mtu,) * whole + ((rest,) if rest or not whole else ())
