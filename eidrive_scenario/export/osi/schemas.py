"""Modules of osi-python, imported once, and identifiers: one number per entity, unique and stable over the run."""

from __future__ import annotations

import math
from typing import Any

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.export.mcap_topics import nanoseconds


class Identifiers:
    """Numbers by kind and name, in the order of first use, from `first` on."""

    def __init__(self, first: int = 1) -> None:
        self._first = first
        self._numbers: dict[tuple[object, ...], int] = {}

    def of(self, *key: object) -> int:
        """Return the number of an entity, for example `of("actor", "Ego")`."""
        return self._numbers.setdefault(key, self._first + len(self._numbers))


class Osi:
    """Message classes and the version of ASAM OSI. Raise SettingError if osi-python is missing."""

    def __init__(self) -> None:
        ground_truth = optional_import("osi3.osi_groundtruth_pb2", "export")
        self.ground_truth: Any = ground_truth.GroundTruth
        self.sensor_data: Any = optional_import("osi3.osi_sensordata_pb2", "export").SensorData
        objects = optional_import("osi3.osi_object_pb2", "export")
        self.stationary_object: Any = objects.StationaryObject
        self.moving_object: Any = objects.MovingObject
        self.traffic_light: Any = optional_import("osi3.osi_trafficlight_pb2", "export").TrafficLight
        sign = optional_import("osi3.osi_trafficsign_pb2", "export")
        self.traffic_sign: Any = sign.TrafficSign
        self.sign_value: Any = sign.TrafficSignValue
        self.lane: Any = optional_import("osi3.osi_lane_pb2", "export").Lane
        self.lane_boundary: Any = optional_import("osi3.osi_lane_pb2", "export").LaneBoundary
        self.environment: Any = optional_import("osi3.osi_environment_pb2", "export").EnvironmentalConditions
        self.detected: Any = optional_import("osi3.osi_detectedobject_pb2", "export")
        version = optional_import("osi3.osi_version_pb2", "export")
        options = version.DESCRIPTOR.GetOptions()
        self._version = options.Extensions[version.current_interface_version]

    @property
    def version(self) -> str:
        """Version of the standard."""
        return f"{self._version.version_major}.{self._version.version_minor}.{self._version.version_patch}"

    def begin(self, message: Any, time: float) -> Any:
        """Set version and timestamp [s] of a new message, and return it."""
        message.version.CopyFrom(self._version)
        set_time(message.timestamp, time)
        return message


def set_time(stamp: Any, time: float) -> None:
    """Set a timestamp [s]."""
    stamp.seconds, stamp.nanos = divmod(nanoseconds(time), 1_000_000_000)


def set_vector(vector: Any, values: Any) -> None:
    """Set a Vector3d."""
    vector.x, vector.y, vector.z = (float(value) for value in values)


def set_orientation(orientation: Any, yaw: float, pitch: float = 0.0, roll: float = 0.0) -> None:
    """Set an Orientation3d [rad] to the equivalent angles in the range that OSI prefers, from -pi to pi."""
    orientation.yaw, orientation.pitch, orientation.roll = (
        math.remainder(float(angle), math.tau) for angle in (yaw, pitch, roll)
    )
