"""Coverage of the sensors of a station."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eidrive_scenario.coverage import ViewSector
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.settings import CameraSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec


def view_sectors(sensors: Iterable[SensorSettings], spec: ActorSpec) -> tuple[ViewSector, ...]:
    """Return the sectors of sensors on a body. A sensor without a setting for its opening angle covers all directions,
    one without `range` is not limited."""
    found = []
    for settings in sensors:
        mount = mounting(settings, spec, "front" if isinstance(settings, CameraSettings) else "roof")
        angle = math.radians(getattr(settings, "fov", getattr(settings, "field_of_view", 360.0)))
        found.append(
            ViewSector(mount.x, mount.y, mount.z, mount.yaw, angle / 2.0, getattr(settings, "range", math.inf))
        )
    return tuple(found)
