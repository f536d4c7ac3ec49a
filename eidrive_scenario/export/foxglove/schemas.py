"""Message classes of Foxglove, and setting of their common parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from eidrive_scenario.base.geometry import quaternion
from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.export.mcap_topics import nanoseconds

WORLD = "map"
"""Name of the world frame, the root of all frames."""
Color = tuple[float, float, float, float]
"""Red, green, blue and opacity in [0, 1]."""


class Foxglove:
    """Message classes. Raise SettingError if foxglove-schemas-protobuf is missing."""

    def __init__(self) -> None:
        self.calibration: Any = _message("CameraCalibration")
        self.image: Any = _message("CompressedImage")
        self.line: Any = _message("LinePrimitive")
        self.location_fix: Any = _message("LocationFix")
        self.log: Any = _message("Log")
        self.field: Any = _message("PackedElementField")
        self.point_cloud: Any = _message("PointCloud")
        self.deletion: Any = _message("SceneEntityDeletion")
        self.scene: Any = _message("SceneUpdate")
        self.transforms: Any = _message("FrameTransforms")


def _message(name: str) -> Any:
    return getattr(optional_import(f"foxglove_schemas_protobuf.{name}_pb2", "export"), name)


def frame_of(actor: str, sensor: str | None = None) -> str:
    """Return the name of the frame of an actor, or of a sensor on it."""
    parts = ["actor", actor] if sensor is None else ["actor", actor, sensor]
    return "/".join(escaped(part) for part in parts)


def escaped(name: str) -> str:
    """Return a name as a part of a topic or frame, in which a slash separates parts."""
    return quote(name, safe=" ")


def set_stamp(stamp: Any, time: float) -> None:
    """Set a timestamp [s]."""
    stamp.FromNanoseconds(nanoseconds(time))


def set_vector(vector: Any, values: Sequence[float]) -> None:
    """Set x, y and z."""
    vector.x, vector.y, vector.z = values


def set_rotation(rotation: Any, yaw: float, pitch: float = 0.0, roll: float = 0.0) -> None:
    """Set a quaternion to a z-y'-x'' rotation [rad]."""
    rotation.x, rotation.y, rotation.z, rotation.w = quaternion(yaw, pitch, roll)


def set_color(target: Any, color: Color) -> None:
    """Set a color."""
    target.r, target.g, target.b, target.a = color
