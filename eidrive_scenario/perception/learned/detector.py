"""Detectors `yolov5` and `ssd`: a network on each camera image, with boxes lifted to the world."""

from __future__ import annotations

import math
import weakref
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, Self

import numpy as np
from msgspec.structs import astuple, replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.content_digest import content_digest
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.perception.detector import Detector, DetectorContext, ImageDetections, without_duplicates
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern, pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import in_camera
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.image_memory import Key, StationDetections
from eidrive_scenario.perception.learned.image_network import ImageNetwork, object_category
from eidrive_scenario.perception.learned.lights import LightsOnMap, LightStates, signal_kinds
from eidrive_scenario.perception.learned.network_loading import build_network, check_network, runtime_of, weights_path
from eidrive_scenario.perception.learned.runtimes import runtime_versions
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.camera import unexposed
from eidrive_scenario.sensing.readings import CameraReading, LidarReading, Readings, SignalReading
from eidrive_scenario.sensing.sensor import Mounting, mounting
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, SensorSettings

CAR_HEIGHT = 1.5
"""Height of a car [m]."""
LEAST_HEIGHT = 8
"""Minimum height of the objects with which the networks are trained [px]."""
INPUT_SIZE = (512, 384)
"""Width and height of the input of the networks of this project [px]."""


class ImageDetector(Detector):
    """Detections of a network in the images of all cameras, lifted by lidar points if there are any, else by the
    ground.

    Of overlapping boxes from one or several cameras, the one with the highest score is kept.

    input_size, letterbox  of the network, as in ImageNetwork
    """

    input_size: tuple[int, int] = INPUT_SIZE
    letterbox = False
    needs: ClassVar[frozenset[str]] = frozenset({"camera"})
    detectable_signals = frozenset({"light"})
    default_sensors: ClassVar[Mapping[str, SensorSettings]] = {
        "camera": CameraSettings(width=512, height=384, rate=10.0),
        "lidar": LidarSettings(rate=10.0, field_of_view=110.0),
    }

    def __init__(self) -> None:
        self.image_detections: Mapping[str, ImageDetections] = {}
        self._signals: tuple[SignalReading, ...] = ()
        self._light_states = LightStates()
        self._network: ImageNetwork | None = None
        self._prepared: Mapping[str, ImageDetections] = {}
        """Detections in the next images, by camera, after `prepare_batch`."""
        self._map_context = MapContext(None)
        self._patterns: dict[str, Pattern] = {}
        self._lights = LightsOnMap(None)
        self._cameras: list[tuple[Mounting, CameraReading]] = []
        """Mountings of the cameras, and readings without an image."""
        self._roads: weakref.ref[RoadNetwork] | None = None

    @abstractmethod
    def build_network(self, *, allow_torchscript: bool = False) -> ImageNetwork:
        """Return the network. Raise SettingError if its weights are not suitable."""

    def load_weights(self, *, allow_torchscript: bool = False) -> None:
        """Create the network. Raise SettingError if its weights are not suitable."""
        if self._network is None:
            self._network = self.build_network(allow_torchscript=allow_torchscript)
            self.detectable_signals = signal_kinds(self._network.classes)
            self.input_size = self._network.input_size

    def setup(self, context: DetectorContext) -> None:
        """Store the map and the ray patterns of the lidars."""
        self._map_context = MapContext(context.roads)
        self._lights = LightsOnMap(context.roads)
        self._roads = None if context.roads is None else weakref.ref(context.roads)
        for name, sensor in context.sensors.items():
            if isinstance(sensor, LidarSettings):
                self._patterns[name] = pattern_from_settings(sensor)
            elif isinstance(sensor, CameraSettings):
                self._cameras.append((mounting(sensor, context.spec, "front"), unexposed(sensor)))

    @classmethod
    def prepare_batch(cls, detectors: Sequence[Self], readings: Sequence[Readings]) -> None:
        """Find the objects in the images of all stations; images of equal networks form one batch."""
        batches: dict[str, list[tuple[Self, str, CameraReading]]] = {}
        networks: dict[str, ImageNetwork] = {}
        for detector, of_station in zip(detectors, readings, strict=True):
            detector.load_weights()
            network, detector._prepared = detector._network, {}
            assert network is not None
            if network.identity is not None:
                networks[network.identity] = network
                batch = batches.setdefault(network.identity, [])
                batch += [(detector, camera, image) for camera, image in of_station.cameras.items()]
        for identity, batch in batches.items():
            detected = networks[identity].find_in_all([image for _, _, image in batch])
            for (detector, camera, _), detections in zip(batch, detected, strict=True):
                detector._prepared = {**detector._prepared, camera: detections}

    def detect(self, readings: Readings) -> Detections:
        """Return the road users in the images of all cameras with a reading."""
        self.load_weights()
        assert self._network is not None
        memory = image_memory.active()
        key = None if memory is None else self._key_of(self._network, readings)
        result = None if memory is None or key is None else memory.stations.get(key)
        if result is None:
            result = self._detect_objects(self._network, readings)
            if memory is not None and key is not None:
                objects = result.objects
                image_memory.read_only(objects.boxes, objects.scores, objects.velocity, objects.covariance)
                memory.stations.add(key, result)
        self.image_detections, signals, objects = result
        self._signals = self._light_states.confirm(signals, readings.time)
        return objects

    def _detect_objects(self, network: ImageNetwork, readings: Readings) -> StationDetections:
        prepared, self._prepared = self._prepared, {}
        images = {
            camera: prepared[camera] if camera in prepared else network.find_in(reading)
            for camera, reading in readings.cameras.items()
        }
        signals = self._lights.read(images, readings.cameras)
        parts = [self._lift_image(detections, readings, camera) for camera, detections in images.items()]
        return StationDetections(images, signals, without_duplicates(Detections.concatenate(readings.time, parts)))

    def _key_of(self, network: ImageNetwork, readings: Readings) -> Key | None:
        """Return everything that determines the result of these readings; None if a part of it is unknown."""
        images = {name: reading.image_digest for name, reading in readings.cameras.items()}
        if network.identity is None or None in images.values():
            return None
        digest = content_digest(
            images,
            [(camera.size, camera.intrinsics, camera.pose, camera.distortion) for camera in readings.cameras.values()],
            [(name, astuple(cloud)) for name, cloud in readings.lidars.items()],
            readings.time,
            float(readings.ego.position[2]),
            self._patterns,
        )
        return type(self), network.identity, self._roads, digest

    def can_read_light(self, signal: str, x: float, y: float, z: float, yaw: float) -> bool:
        """Return whether a light would be inside the image of a camera."""
        cameras = (camera.at(mount.level_camera_pose(x, y, z, yaw)) for mount, camera in self._cameras)
        return any(signal == light.id for camera in cameras for light in self._lights.in_view(camera))

    def range_of(self, sensor: SensorSettings) -> float:
        """Return the distance at which a car in the network input has the minimum height of objects in training [m]."""
        if not isinstance(sensor, CameraSettings):
            return super().range_of(sensor)
        focal_length = sensor.width / (2.0 * math.tan(math.radians(sensor.fov) / 2.0))
        return focal_length * self._reduction(sensor.width, sensor.height) * CAR_HEIGHT / LEAST_HEIGHT

    def _reduction(self, width: int, height: int) -> float:
        """Return the share of its height that an image keeps in the network input; 1 if it is enlarged."""
        ratio = self.input_size[1] / height
        return min(1.0, ratio, self.input_size[0] / width) if self.letterbox else min(1.0, ratio)

    def in_view(self, boxes: Array, readings: Readings, detections: Detections) -> Array:
        """Return the maximum share (N,) of each box (N, 7) that one of the cameras can show."""
        shares = [
            in_camera(boxes, reading, detections.boxes, self._reduction(*reading.size))
            for reading in readings.cameras.values()
        ]
        return np.max(shares, axis=0) if shares else np.zeros(len(boxes))

    def signals(self) -> tuple[SignalReading, ...]:
        """Return the traffic lights and stop signs of the map that are in the last images, in confirmed states."""
        return self._signals

    def _lift_image(self, detections: ImageDetections, readings: Readings, camera: str) -> Detections:
        """Return the objects of one image; of several lidars, the one with the best position estimate is used.

        Image boxes that no body fills are omitted.
        """
        clouds: Mapping[str, LidarReading | None] = readings.lidars or {"": None}
        categories = map(object_category, detections.classes)
        used = {row: category for row, category in enumerate(categories) if category is not None}
        rows = list(used)
        lifted = most_certain(
            [
                lift(
                    detections.boxes[rows],
                    list(used.values()),
                    detections.scores[rows],
                    readings.cameras[camera],
                    cloud,
                    time=readings.time,
                    ground=float(readings.ego.position[2]),
                    surroundings=self._map_context,
                    pattern=self._patterns.get(lidar),
                )
                for lidar, cloud in clouds.items()
            ]
        )
        return lifted if lifted.scores.all() else lifted.subset(np.flatnonzero(lifted.scores).tolist())


class LearnedDetector(ImageDetector):
    """Detector of a network of this project, or of one from an ONNX or TorchScript file."""

    settings_type: ClassVar[type[Settings] | None] = LearnedSettings
    network: ClassVar[Literal["yolov5", "ssd"]]

    def __init__(self, settings: LearnedSettings | None = None) -> None:
        super().__init__()
        self.settings = settings or LearnedSettings()
        self.input_size, self.letterbox = self.settings.input_size or INPUT_SIZE, self.settings.letterbox
        runtime = runtime_of(weights_path(self.network, self.settings), self.settings)
        self.library_versions = runtime_versions(runtime)
        self.processes_batches = self.settings.device == "cuda"

    def check_weights(self, *, allow_torchscript: bool = False) -> None:
        """Raise SettingError if a run refuses the weights, without reading them."""
        check_network(self.network, self.settings, allow_torchscript=allow_torchscript)

    def build_network(self, *, allow_torchscript: bool = False) -> ImageNetwork:
        return build_network(self.network, self.settings, allow_torchscript=allow_torchscript)


class YoloDetector(LearnedDetector):
    """Detector `yolov5`."""

    network: ClassVar[Literal["yolov5", "ssd"]] = "yolov5"


class SsdDetector(LearnedDetector):
    """Detector `ssd`."""

    network: ClassVar[Literal["yolov5", "ssd"]] = "ssd"


def most_certain(estimates: Sequence[Detections]) -> Detections:
    """Return, row by row, the estimate of the same object with the minimum position variance; a score of 0 is the last
    choice."""
    if len(estimates) == 1:
        return estimates[0]
    variances = [
        np.where(estimate.scores > 0.0, np.trace(estimate.covariance, axis1=1, axis2=2), np.inf)
        for estimate in estimates
    ]
    best, rows = np.argmin(variances, axis=0), np.arange(len(estimates[0]))
    return replace(
        estimates[0],
        boxes=np.stack([estimate.boxes for estimate in estimates])[best, rows],
        scores=np.stack([estimate.scores for estimate in estimates])[best, rows],
        covariance=np.stack([estimate.covariance for estimate in estimates])[best, rows],
    )
