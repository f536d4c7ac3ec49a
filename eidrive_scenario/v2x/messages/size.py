"""Sizes of messages."""

from __future__ import annotations

MANAGEMENT_BYTES = 121
"""Size of header, management and station containers [bytes]."""
CONTAINER_BYTES = 35
"""Size of one sensor information container and of one perceived object [bytes]."""
CAM_BYTES, CAM_LOW_FREQUENCY_BYTES = 190, 300
"""Size of a CAM without and with the low-frequency container, including security [bytes].

These are the message sizes of the periodic traffic model of 3GPP TR 36.885, A.1.5.
"""


def cpm_size(objects: int, sensors: int, security: int = 0) -> int:
    """Return the size of a CPM with a security envelope of `security` bytes [bytes].

    121 + 35 (S + O) for S sensors and O objects (Thandavarayan, Sepulcre, Gozalvez: Generation of cooperative
    perception messages for connected and automated vehicles, IEEE IV 2019).
    """
    return MANAGEMENT_BYTES + CONTAINER_BYTES * (sensors + objects) + security


def cam_size(low_frequency: bool) -> int:
    """Return the size of a CAM [bytes]."""
    return CAM_LOW_FREQUENCY_BYTES if low_frequency else CAM_BYTES


def objects_that_fit(mtu: int, sensors: int, security: int = 0) -> int:
    """Return the maximum number of objects in a CPM of at most `mtu` bytes, at least one."""
    return max(1, (mtu - cpm_size(0, sensors, security)) // CONTAINER_BYTES)
