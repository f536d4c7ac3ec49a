"""Detector `pillars`: a network on lidar points in plan view."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.feature_map import FeatureMap
from eidrive_scenario.base.geometry import rotation
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.perception.detector import Detector, DetectorContext, without_duplicates
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame, pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.learned.network_loading import SHIPPED
from eidrive_scenario.perception.learned.pillars.codec import FeatureCodec
from eidrive_scenario.perception.learned.pillars.decode import class_probability, decode
from eidrive_scenario.perception.learned.pillars.grid import CELL, CELLS, ScanHistory
from eidrive_scenario.perception.learned.pillars.network import NETWORK, STRIDE, PillarNetwork, load_network
from eidrive_scenario.perception.learned.runtimes import (
    GraphRuntime,
    is_installed,
    missing_runtime,
    runtime_versions,
    select_runtime,
)
from eidrive_scenario.perception.learned.weights import OWN_SUFFIX, Precision, check_weights_exist
from eidrive_scenario.perception.lidar.station import StationLidars
from eidrive_scenario.sensing.readings import LidarReading, Readings
from eidrive_scenario.sensing.settings import LidarSettings, SensorSettings


def grid_frame(reading: LidarReading) -> LevelFrame:
    """Return the frame of the grid of a station with this reading: axes of the world, its origin on a multiple of the
    output cells.

    Features depend on the axes: those of stations with other headings would show turned boxes. With common axes and
    exact poses, the cells of all stations coincide.
    """
    x, y, height = reading.pose[:3, 3].tolist()
    side = STRIDE * CELL
    return LevelFrame(round(x / side) * side, round(y / side) * side, height, 0.0)


class PillarSettings(Settings):
    """Settings of the property `detector_settings`.

    weights     path relative to the working directory; None: the shipped weights
    confidence  minimum score of a box; None: that of the weights
    runtime     library that executes the network; `auto`: the fastest one that is installed
    precision   `int8` executes the network by OpenVINO with 8-bit integers
    """

    weights: str | None = None
    confidence: float | None = Field(default=None, gt=0.0, lt=1.0)
    runtime: Literal["auto", GraphRuntime] = "auto"
    precision: Precision = "float32"


class PillarDetector(Detector):
    """Detections of a network in the points of all lidars of the station together, within 51.2 m.

    The station can exchange its features (`feature_map`), and detects objects in fused ones (`Readings.features`).
    Velocities come from two scans 0.2 s apart. They initiate tracks, and remain without a tracker.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"lidar"})
    provides_features: ClassVar[bool] = True
    velocity_deviation = 1.5
    """Root mean square of 10,519 errors for moving objects in 60 scenarios of the library (seed 1, 8 s, overlap of at
    least 0.3): 1.6. The 5,623 errors of standing objects have 0.8.
    """
    default_sensors: ClassVar[Mapping[str, SensorSettings]] = {"lidar": LidarSettings(rate=10.0, rotation=10.0)}
    settings_type: ClassVar[type[Settings] | None] = PillarSettings

    def __init__(self, settings: PillarSettings | None = None) -> None:
        self.settings = settings or PillarSettings()
        weights = self.settings.weights
        self._path = SHIPPED / f"{NETWORK}{OWN_SUFFIX}" if weights is None else Path(weights)
        check_weights_exist(self._path)
        self._runtime = select_runtime(
            self._path,
            self.settings.runtime,
            precision=self.settings.precision,
            supported=get_args(GraphRuntime),
        )
        self.library_versions = runtime_versions(self._runtime)
        self._network: PillarNetwork | None = None
        self._map_context = MapContext(None)
        self._lidars = StationLidars({})
        self._history = ScanHistory()

    @property
    def codec(self) -> FeatureCodec:
        """Codec of the compressed features. Raise SettingError as `load_weights`."""
        return self._loaded().codec

    def check_weights(self, *, allow_torchscript: bool = False) -> None:
        """Raise SettingError if the weights are missing, or the runtime is not installed. Nothing is read."""
        check_weights_exist(self._path)
        if not is_installed(self._runtime):
            raise missing_runtime(self._runtime)

    def load_weights(self, *, allow_torchscript: bool = False) -> None:
        """Create the network. Raise SettingError if its weights are not suitable."""
        if self._network is None:
            self.check_weights()
            self._network = load_network(self._path, self._runtime, self.settings.precision)

    def setup(self, context: DetectorContext) -> None:
        """Store the map and the lidars."""
        self._map_context = MapContext(context.roads)
        self._lidars = StationLidars(context.sensors)

    def detect(self, readings: Readings) -> Detections:
        """Return the road users in the fused features if there are any, else in the points of all lidars."""
        network = self._loaded()
        if readings.features is not None:
            maps = network.objects(readings.features.features)
            return self._objects(network, maps, readings.features, readings.time)
        if not readings.lidars:
            return Detections(readings.time)
        clouds = list(self._lidars.revolutions(readings).values())
        frame, foot = grid_frame(clouds[0]), float(readings.ego.position[2])
        grid = self._history.add(readings.time, clouds, frame, foot)
        features = network.features(grid.channels)
        maps = network.objects(features)
        self.feature_map = FeatureMap(
            readings.time,
            frame.x,
            frame.y,
            frame.yaw,
            frame.height,
            foot,
            STRIDE * CELL,
            features,
            network.compress(features),
            class_probability(maps),
            grid.age,
        )
        return self._objects(network, maps, self.feature_map, readings.time)

    def range_of(self, sensor: SensorSettings) -> float:
        """Return the distance at which the front of a car has one point on average, within the grid [m]."""
        nominal = super().range_of(sensor)
        if not isinstance(sensor, LidarSettings):
            return nominal
        return min(nominal, pattern_from_settings(sensor).range_of_car(1), CELLS * CELL / 2.0)

    def in_view(self, boxes: Array, readings: Readings, detections: Detections) -> Array:
        """Return the maximum share (N,) of each box (N, 7) that one of the lidars can show; 0 outside of the grid."""
        shares = self._lidars.in_view(boxes, readings, detections)
        for reading in list(readings.lidars.values())[:1]:
            offset = np.abs(grid_frame(reading).to_local(boxes[:, :2]))
            shares[offset.max(axis=1, initial=0.0) > CELLS * CELL / 2.0] = 0.0
        return shares

    def _loaded(self) -> PillarNetwork:
        self.load_weights()
        assert self._network is not None
        return self._network

    def _objects(self, network: PillarNetwork, maps: Floats, features: FeatureMap, time: float) -> Detections:
        """Return the objects in the maps of these features."""
        objects = decode(maps, features.cell, self.settings.confidence or network.confidence)
        boxes = LevelFrame(features.x, features.y, features.height, features.yaw).boxes_to_world(objects.boxes)
        boxes[:, 2] += self._map_context.ground(boxes[:, :2], features.foot)
        velocity = objects.displacement @ rotation(-features.yaw) / (features.interval or math.nan)
        return without_duplicates(
            Detections(
                time,
                boxes,
                objects.scores,
                tuple([network.classes[number] for number in objects.classes.tolist()]),
                velocity,
                np.square(objects.deviation)[:, None, None] * np.eye(2),
            )
        )
