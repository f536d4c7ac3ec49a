"""Message classes of Foxglove, and their common parts as arguments of these classes."""

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


def stamp(time: float) -> dict[str, int]:
    """Return a timestamp [s]."""
    return dict(zip(("seconds", "nanos"), divmod(nanoseconds(time), 1_000_000_000), strict=True))


def vector(values: Sequence[float]) -> dict[str, float]:
    """Return a vector of x, y and z."""
    return dict(zip("xyz", values, strict=True))


def rotation(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> dict[str, float]:
    """Return the quaternion of a z-y'-x'' rotation [rad]."""
    return dict(zip("xyzw", quaternion(yaw, pitch, roll), strict=True))


def rgba(color: Color) -> dict[str, float]:
    """Return a color."""
    return dict(zip("rgba", color, strict=True))


UPRIGHT = rotation(0.0)
"""Rotation of texts, lines and clouds, which have no orientation."""
