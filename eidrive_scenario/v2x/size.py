"""How large a collective perception message is."""

from __future__ import annotations

MANAGEMENT_BYTES = 121
"""Header, management and station containers [bytes]."""
CONTAINER_BYTES = 35
"""One sensor information container, and one perceived object [bytes]."""


def cpm_size(objects: int, sensors: int) -> int:
    """Size of a collective perception message without security envelope [bytes].

    121 + 35 (S + O) for S sensors and O objects (Thandavarayan, Sepulcre, Gozalvez: Generation of cooperative
    perception messages for connected and automated vehicles, IEEE IV 2019).
    """
    return MANAGEMENT_BYTES + CONTAINER_BYTES * (sensors + objects)
