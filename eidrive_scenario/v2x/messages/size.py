"""How large messages are."""

from __future__ import annotations

MANAGEMENT_BYTES = 121
"""Header, management and station containers [bytes]."""
CONTAINER_BYTES = 35
"""One sensor information container, and one perceived object [bytes]."""
CAM_BYTES, CAM_LOW_FREQUENCY_BYTES = 190, 300
"""Without and with the low-frequency container, security included: the messages of the periodic traffic model of 3GPP
TR 36.885, A.1.5 [bytes]."""


def cpm_size(objects: int, sensors: int, security: int = 0) -> int:
    """Size of a collective perception message with a security envelope of `security` bytes [bytes].

    121 + 35 (S + O) for S sensors and O objects (Thandavarayan, Sepulcre, Gozalvez: Generation of cooperative
    perception messages for connected and automated vehicles, IEEE IV 2019).
    """
    return MANAGEMENT_BYTES + CONTAINER_BYTES * (sensors + objects) + security


def cam_size(low_frequency: bool) -> int:
    """Size of a cooperative awareness message [bytes]."""
    return CAM_LOW_FREQUENCY_BYTES if low_frequency else CAM_BYTES


def objects_that_fit(mtu: int, sensors: int, security: int = 0) -> int:
    """How many objects a collective perception message of at most `mtu` bytes has room for, at least one."""
    return max(1, (mtu - cpm_size(0, sensors, security)) // CONTAINER_BYTES)
