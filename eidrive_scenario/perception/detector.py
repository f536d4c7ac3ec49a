"""Abstract base class of detectors, which turn sensor readings into boxes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.feature_map import FeatureMap, LatentCodec
from eidrive_scenario.base.geometry import iou_bev, on_two_levels
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import Readings, SignalReading
from eidrive_scenario.sensing.sensor import nominal_range
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.world.actor import ActorSpec


@dataclass(frozen=True)
class ImageDetections:
    """Detections of a network in an image: boxes (N, 4) x1 y1 x2 y2 [px], best first, and scores (N,)."""

    boxes: Array
    scores: Array
    classes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.boxes)


SAME_OBJECT = 0.1
"""Overlap in plan view above which two boxes show one object (intersection over union): bodies do not overlap."""


def without_duplicates(detections: Detections) -> Detections:
    """Return the detections except those that overlap one on their level with a higher score, in their order."""
    boxes = detections.boxes
    overlap = iou_bev(boxes, boxes)
    z, height = boxes[:, 2], boxes[:, 5]
    overlap[on_two_levels(z[:, None], height[:, None], z, height)] = 0.0
    kept: list[int] = []
    for row in np.argsort(-detections.scores, kind="stable").tolist():
        if not kept or overlap[row, kept].max() <= SAME_OBJECT:
            kept.append(row)
    return detections.subset(sorted(kept))


@dataclass(frozen=True)
class DetectorContext:
    """Context of a detector: the body that carries it, its sensors by name, the map, and the seed of the run."""

    spec: ActorSpec
    sensors: Mapping[str, SensorSettings] = field(default_factory=dict)
    roads: RoadNetwork | None = None
    seed: int = 0


class Detector(ABC):
    """Detector of the objects in the readings of one station, as boxes in the world frame.

    A new instance is created for each station and run. A class is registered in the entry points
    `eidrive_scenario.detectors`. It is constructed as `cls()`, or as `cls(settings)` if it has a `settings_type`;
    `settings` is an instance of that type, read from the property `detector_settings` of the controller. The
    constructor may raise SettingError.

    Order of calls: `load_weights` before a run, but not by `eidrive check`; then `setup` once; then `detect` in each
    tick with readings of all kinds of sensors in `needs`.
    """

    needs: ClassVar[frozenset[str]] = frozenset()
    """Kinds of required sensors, by their names in the entry points `eidrive_scenario.sensors`."""
    default_sensors: ClassVar[Mapping[str, SensorSettings]] = {}
    """Sensors by name of a station that configures none; if empty, one of each kind in `needs`."""
    provides_velocity: ClassVar[bool] = False
    """Whether the boxes have velocities that need no tracker; otherwise a tracker estimates them, unless the station
    disables it."""
    velocity_deviation: float | None = None
    """Standard deviation of the velocities of moving objects in each axis [m/s], with which trackers begin tracks, and
    fusion filters the velocities of a station without a tracker; None for exact velocities."""
    detectable_signals: frozenset[str] = frozenset()
    """Kinds of signals that the detector reads, out of `light` and `stop sign`. The station takes the others from the
    map and the line of sight."""
    provides_features: ClassVar[bool] = False
    """Whether the detector computes `feature_map`, and detects in `Readings.features`."""
    settings_type: ClassVar[type[Settings] | None] = None
    """Type of the property `detector_settings`; None if the detector has no settings."""
    is_finite_by_construction: ClassVar[bool] = False
    """Whether this class, without those derived from it, only copies finite numbers: its results are not checked."""
    processes_batches: bool = False
    """Whether `prepare_batch` has an effect."""
    library_versions: Mapping[str, str] = MappingProxyType({})
    """Versions of the libraries that compute the detections, by name; part of the resolved settings."""
    image_detections: Mapping[str, ImageDetections] = MappingProxyType({})
    """Detections in the last image of each camera, for detectors that process images; recorded with the boxes."""
    feature_map: FeatureMap | None = None
    """Features of the points in the last readings, for detectors that compute a grid of features."""

    @property
    def codec(self) -> LatentCodec | None:
        """Compression of the features; None for a detector without features."""
        return None

    def check_weights(self, *, allow_torchscript: bool = False) -> None:  # noqa: B027 - an optional hook
        """Raise SettingError if `load_weights` would refuse its data without reading it, as `eidrive check` reports."""

    def load_weights(self, *, allow_torchscript: bool = False) -> None:  # noqa: B027 - an optional hook
        """Load the data that the detector computes with, such as the weights of a network.

        Raise SettingError if that is not possible. `allow_torchscript`: whether the user permits weights to execute
        code.
        """

    def setup(self, context: DetectorContext) -> None:  # noqa: B027 - an optional hook
        """Store the context before the first reading."""

    @classmethod  # noqa: B027 - an optional hook
    def prepare_batch(cls, detectors: Sequence[Self], readings: Sequence[Readings]) -> None:
        """Compute at once what `detect` of several stations needs for these readings of one tick.

        The next `detect` returns the same as without.
        """

    @abstractmethod
    def detect(self, readings: Readings) -> Detections:
        """Return the objects in these readings."""

    def in_view(self, boxes: Array, readings: Readings, detections: Detections) -> Array:
        """Return the share (N,) in [0, 1] of each box (N, 7) that these readings can show.

        The `detections` of these readings may occlude it.

        A tracker does not count objects out of view as missed. By default, all objects are in view.
        """
        return np.ones(len(boxes))

    def range_of(self, sensor: SensorSettings) -> float:
        """Return the distance up to which a car that comes towards this sensor is detected in clear air [m].

        By default the setting `range` of the sensor; inf if it has none.
        """
        return nominal_range(sensor)

    def signals(self) -> Sequence[SignalReading]:
        """Return the signals of the map found in the last readings, of the kinds in `detectable_signals`."""
        return ()

    def can_read_light(self, signal: str, x: float, y: float, z: float, yaw: float) -> bool:
        """Return whether the station would have the face of a light of the map in view at a place [m, rad].

        A vehicle that has to stop for the light stops where this is True. Occluding objects do not count.
        """
        return True
