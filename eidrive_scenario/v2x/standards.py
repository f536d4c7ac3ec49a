"""Constants of IEEE 802.11p and C-V2X Mode 4 that the radio channel and the analytic models share."""

from __future__ import annotations

from collections.abc import Mapping

SLOT = 13e-6
"""aSlotTime in 10 MHz [s] (IEEE 802.11-2012, table 18-17)."""
PREAMBLE = 40e-6
"""Duration of preamble and signal field in 10 MHz [s] (IEEE 802.11-2012, 18.3)."""
RESOURCE_BLOCKS = 50
"""Number of resource blocks in 10 MHz (3GPP TS 36.101, table 5.6-1)."""
CANDIDATE_SHARE = 0.2
"""Minimum share of candidate resources after exclusion, and share that is reported (3GPP TS 36.213, 14.1.1.6)."""
SENSING_DBM: Mapping[str, float] = {"80211p": -85.0, "cv2x_mode4": -90.5}
"""Minimum sensed power of each technology [dBm], as in the published analytic models of both."""
NOISE_DBM = -95.0
"""Noise in 10 MHz at a noise figure of 9 dB [dBm]."""
ANTENNA_HEIGHT = 1.5
"""Height of the antennas of vehicles [m] (3GPP TR 36.885, A.1.4)."""
