"""Constants and durations of IEEE 802.11p and the sidelinks that the radio channel and the analytic models share."""

from __future__ import annotations

import math
from collections.abc import Mapping

SLOT = 13e-6
"""aSlotTime in 10 MHz [s] (IEEE 802.11-2012, table 18-17)."""
PREAMBLE = 40e-6
"""Duration of preamble and signal field in 10 MHz [s] (IEEE 802.11-2012, 18.3)."""
RESOURCE_BLOCKS = 50
"""Number of resource blocks in 10 MHz (3GPP TS 36.101, table 5.6-1)."""
CANDIDATE_SHARE = 0.2
"""Minimum share of candidate resources after exclusion, and share that is reported (3GPP TS 36.213, 14.1.1.6)."""
SENSING_DBM: Mapping[str, float] = {"80211p": -85.0, "cv2x_mode4": -90.5, "nr_v2x_mode2": -130.0}
"""Minimum sensed power of each technology [dBm], as in the published analytic models of the first two.

With NR-V2X the control channel decides: the minimum is far below the noise of one resource block."""
NOISE_DBM = -95.0
"""Noise in 10 MHz at a noise figure of 9 dB [dBm]."""
ANTENNA_HEIGHT = 1.5
"""Height of the antennas of vehicles [m] (3GPP TR 36.885, A.1.4)."""


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
