"""Faults of the perception of a station: objects that do not exist, and a wrong pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from msgspec.structs import replace
from pydantic import Field, model_validator

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import NOT_ESTIMATED, Detections
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.extensions.settings import Settings

MAX_FALSE_OBJECTS = 100
"""Maximum number of false objects of a station."""
FIRST_TRACK = 1_000_000_000
"""Track number of the first false object, above those of detectors."""
SIZES: dict[str, tuple[float, float, float]] = {
    "car": (4.5, 1.8, 1.5),
    "truck": (8.5, 2.5, 3.4),
    "bus": (12.0, 2.55, 3.1),
    "van": (5.9, 2.0, 2.6),
    "motorbike": (2.2, 0.8, 1.6),
    "bicycle": (1.8, 0.65, 1.75),
    "pedestrian": (0.4, 0.4, 1.8),
    "misc": (1.0, 1.0, 1.0),
}
"""Default length, width and height of a false object by class [m], as in the catalogs of the library."""

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Size = Annotated[float, Field(gt=0.0, le=100.0)]
Time = Annotated[float, Field(ge=0.0, le=1e9)]


class FalseObject(Settings):
    """Object that a faulty detector reports, and that does not exist. World frame; it moves at constant velocity.

    kind       class of the detection
    x, y, z    center in plan view, and height of its ground, at the time `since` [m]
    speed, heading  of its motion [m/s], [degrees]
    size       length, width and height [m]; None: as usual for the class
    score      score of the detections
    deviation  standard deviation of its position that the detector states [m]
    since, until  time in which it is reported [s]; None: to the end
    """

    kind: Literal["car", "truck", "bus", "van", "motorbike", "bicycle", "pedestrian", "misc"] = "car"
    x: Coordinate
    y: Coordinate
    z: Coordinate = 0.0
    speed: Annotated[float, Field(ge=-100.0, le=100.0)] = 0.0
    heading: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    size: tuple[Size, Size, Size] | None = None
    score: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    deviation: Annotated[float, Field(ge=0.0, le=100.0)] = 0.3
    since: Time = 0.0
    until: Time | None = None

    @model_validator(mode="after")
    def _in_order(self) -> FalseObject:
        if self.until is not None and self.until <= self.since:
            raise ValueError(f"until is not after since (got {self.until:g} s and {self.since:g} s)")
        return self

    def is_reported(self, now: float) -> bool:
        """Return whether the detector reports it at this time [s]."""
        return self.since <= now and (self.until is None or now < self.until)

    def box(self, now: float) -> list[float]:
        """Return its box (7,) at this time [s]."""
        length, width, height = self.size or SIZES[self.kind]
        distance, heading = self.speed * (now - self.since), math.radians(self.heading)
        x, y = self.x + distance * math.cos(heading), self.y + distance * math.sin(heading)
        return [x, y, self.z + height / 2.0, length, width, height, wrap_angle(heading)]

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity (2,) [m/s]."""
        heading = math.radians(self.heading)
        return self.speed * math.cos(heading), self.speed * math.sin(heading)


class PoseError(Settings):
    """Constant error of the pose that a station assumes, as by wrong calibration: x, y [m] and yaw [degrees]."""

    x: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    y: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    yaw: Annotated[float, Field(ge=-180.0, le=180.0)] = 0.0


def with_false_objects(detections: Detections, objects: Sequence[FalseObject], *, with_velocity: bool) -> Detections:
    """Return the detections with the false objects that are reported at their time.

    with_velocity  whether the detector provides velocities
    """
    numbers = [number for number, false_object in enumerate(objects) if false_object.is_reported(detections.time)]
    if not numbers:
        return detections
    added = [objects[number] for number in numbers]
    scores = np.array([false_object.score for false_object in added])
    velocity: Array = np.array(
        [false_object.velocity if with_velocity else (math.nan, math.nan) for false_object in added]
    )
    covariance = np.array([np.eye(2) * false_object.deviation**2 for false_object in added])
    boxes = np.array([false_object.box(detections.time) for false_object in added])
    # Their velocities are exact; fusion raises the variance to the usual one.
    variance = detections.velocity_variance
    return replace(
        detections,
        boxes=np.concatenate([detections.boxes, boxes]),
        scores=np.concatenate([detections.scores, scores]),
        classes=(*detections.classes, *(false_object.kind for false_object in added)),
        velocity=np.concatenate([detections.velocity, velocity]),
        covariance=np.concatenate([detections.covariance, covariance]),
        tracks=(*detections.tracks, *(FIRST_TRACK + number for number in numbers)) if detections.tracks else (),
        existence=np.concatenate([detections.existence, scores]) if len(detections.existence) else NOT_ESTIMATED,
        velocity_variance=np.concatenate([variance, np.zeros(len(added))]) if len(variance) else NOT_ESTIMATED,
    )
