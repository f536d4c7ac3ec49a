"""Detectors `yolov5` and `ssd`: a network on each camera image, with boxes lifted to the world."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec.structs import astuple, replace
from pydantic import Field, model_validator

from eidrive_scenario.arrays import Array
from eidrive_scenario.content_digest import content_digest
from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.geometry.duplicates import without_duplicates
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern, pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.visibility import in_camera
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.classes import misspelt, object_category
from eidrive_scenario.perception.learned.external_network import ExternalNetwork, Layout
from eidrive_scenario.perception.learned.image_memory import Key, StationDetections
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.learned.lights import LightsOnMap, signal_kinds
from eidrive_scenario.perception.learned.own_network import OwnNetwork
from eidrive_scenario.perception.learned.runtime_selection import (
    Device,
    Runtime,
    is_installed,
    missing_runtime,
    runtime_versions,
    select_runtime,
)
from eidrive_scenario.perception.learned.weight_files import (
    DEFAULT_CONFIDENCE,
    MAX_CLASSES,
    MAX_SIDE,
    ONNX_SUFFIX,
    OWN_SUFFIX,
    TORCHSCRIPT_SUFFIX,
    check_weights_exist,
    refused_torchscript,
    torchscript_is_allowed,
)
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import CameraReading, LidarReading, Readings, SignalReading
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, SensorSettings
from eidrive_scenario.settings import Settings

SHIPPED = Path(__file__).parents[1] / "weights"
EXTERNAL_SUFFIXES = (ONNX_SUFFIX, TORCHSCRIPT_SUFFIX)

Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
"""Width or height of a network input [px]."""


class LearnedSettings(Settings):
    """Settings of the property `detector_settings`.

    weights      path relative to the working directory: .npz as training/train.py writes it, an ONNX model (.onnx) or a
                 TorchScript model (.pt), which is loaded only with permission of the user; None: the shipped weights
    classes, input_size, layout   of an .onnx or .pt: its classes in order, width and height of its input [px], and the
                 layout of its outputs, if the shape does not determine it
    letterbox    of an .onnx or .pt: whether images keep their aspect ratio, with gray margins; otherwise stretched
    confidence   minimum score of a box; None: the optimum of the shipped weights, and 0.35 for others
    runtime      library that executes the network; `auto`: the fastest one that is installed
    device       `cuda` executes .npz and .pt by torch on a GPU
    threads      of the computation of the network on the CPU, in the whole process
    """

    weights: str | None = None
    classes: Annotated[tuple[str, ...], Field(max_length=MAX_CLASSES)] | None = None
    input_size: tuple[Side, Side] | None = None
    layout: Layout | None = None
    letterbox: bool = False
    confidence: float | None = Field(default=None, gt=0.0, lt=1.0)
    runtime: Literal["auto", Runtime] = "auto"
    device: Device = "cpu"
    threads: Annotated[int, Field(ge=1, le=256)] = 1

    @model_validator(mode="after")
    def _check_consistency(self) -> LearnedSettings:
        suffix = Path(self.weights or OWN_SUFFIX).suffix or OWN_SUFFIX
        if suffix in EXTERNAL_SUFFIXES:
            if not self.classes or self.input_size is None:
                raise ValueError(f"weights: {suffix} files require `classes: [...]` and `input_size: [width, height]`")
            for name in self.classes:
                suggestion = misspelt(name)
                if suggestion is not None:
                    raise ValueError(f"classes: class {name!r} is unknown (did you mean {suggestion!r}?)")
            if not any(object_category(name) for name in self.classes):
                raise ValueError("classes: none is a road user (expected for example car, truck, bus or pedestrian)")
        elif self.weights is not None and suffix != OWN_SUFFIX:
            raise ValueError(f"weights: unknown file type (got {suffix!r}; expected .npz, .onnx or .pt)")
        elif self.classes is not None or self.input_size is not None or self.layout is not None or self.letterbox:
            raise ValueError("`classes`, `input_size`, `layout` and `letterbox` apply to weights .onnx and .pt only")
        return self


class LearnedDetector(Detector):
    """Detections of a network in the images of all cameras, lifted by lidar points if there are any, else by the
    ground.

    Of overlapping boxes from one or several cameras, the one with the highest score is kept.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"camera"})
    default_sensors: ClassVar[Mapping[str, SensorSettings]] = {
        "camera": CameraSettings(width=512, height=384, rate=10.0),
        "lidar": LidarSettings(rate=10.0, field_of_view=110.0),
    }
    settings_type: ClassVar[type[Settings] | None] = LearnedSettings
    network: ClassVar[Literal["yolov5", "ssd"]]

    def __init__(self, settings: LearnedSettings | None = None) -> None:
        self.settings = settings or LearnedSettings()
        self.image_detections: Mapping[str, ImageDetections] = {}
        self._signals: tuple[SignalReading, ...] = ()
        path = weights_path(self.network, self.settings)
        check_weights_exist(path)
        self.library_versions = runtime_versions(select_runtime(path, self.settings.runtime, self.settings.device))
        self._network: ImageNetwork | None = None
        self.processes_batches = self.settings.device == "cuda"
        self._prepared: Mapping[str, ImageDetections] = {}
        """Detections in the next images, by camera, after `prepare_batch`."""
        self._map_context = MapContext(None)
        self._patterns: dict[str, Pattern] = {}
        self._lights = LightsOnMap(None)
        self._roads: weakref.ref[RoadNetwork] | None = None

    def load_weights(self, *, allow_torchscript: bool = False) -> None:
        """Create the network. Raise SettingError if its weights are not suitable."""
        if self._network is None:
            self._network = build_network(self.network, self.settings, allow_torchscript=allow_torchscript)
            self.detectable_signals = signal_kinds(self._network.classes)

    def setup(self, context: DetectorContext) -> None:
        """Store the map and the ray patterns of the lidars."""
        self._map_context = MapContext(context.roads)
        self._lights = LightsOnMap(context.roads)
        self._roads = None if context.roads is None else weakref.ref(context.roads)
        for name, sensor in context.sensors.items():
            if isinstance(sensor, LidarSettings):
                self._patterns[name] = pattern_from_settings(sensor)

    @classmethod
    def prepare_batch(cls, detectors: Sequence[Detector], readings: Sequence[Readings]) -> None:
        """Find the objects in the images of all stations; images of equal networks form one batch."""
        batches: dict[str, list[tuple[LearnedDetector, str, CameraReading]]] = {}
        networks: dict[str, ImageNetwork] = {}
        for detector, of_station in zip(detectors, readings, strict=True):
            assert isinstance(detector, LearnedDetector)
            detector.load_weights()
            network, detector._prepared = detector._network, {}
            assert network is not None
            if network.identity is not None:
                networks[network.identity] = network
                batch = batches.setdefault(network.identity, [])
                batch += [(detector, camera, image) for camera, image in of_station.cameras.items()]
        for identity, batch in batches.items():
            found = networks[identity].find_in_all([image for _, _, image in batch])
            for (detector, camera, _), one in zip(batch, found, strict=True):
                detector._prepared = {**detector._prepared, camera: one}

    def detect(self, readings: Readings) -> Detections:
        """Return the road users in the images of all cameras with a reading."""
        self.load_weights()
        assert self._network is not None
        memory = image_memory.active()
        key = None if memory is None else self._key_of(self._network, readings)
        found = None if memory is None or key is None else memory.stations.get(key)
        if found is None:
            found = self._process(self._network, readings)
            if memory is not None and key is not None:
                objects = found.objects
                image_memory.read_only(objects.boxes, objects.scores, objects.velocity, objects.covariance)
                memory.stations.add(key, found)
        self.image_detections, self._signals, objects = found
        return objects

    def _process(self, network: ImageNetwork, readings: Readings) -> StationDetections:
        prepared, self._prepared = self._prepared, {}
        images = {
            camera: prepared[camera] if camera in prepared else network.find_in(reading)
            for camera, reading in readings.cameras.items()
        }
        signals = self._lights.read(images, readings.cameras)
        parts = [self._lift_image(found, readings, camera) for camera, found in images.items()]
        return StationDetections(images, signals, merge_duplicates(parts, readings.time))

    def _key_of(self, network: ImageNetwork, readings: Readings) -> Key | None:
        """Return everything that determines the result of these readings; None if a part of it is unknown."""
        images = {name: reading.image_digest for name, reading in readings.cameras.items()}
        if network.identity is None or None in images.values():
            return None
        digest = content_digest(
            images,
            [(one.size, one.intrinsics, one.pose, one.distortion) for one in readings.cameras.values()],
            [(name, astuple(cloud)) for name, cloud in readings.lidars.items()],
            readings.time,
            float(readings.ego.position[2]),
            self._patterns,
        )
        return type(self), network.identity, self._roads, digest

    def in_view(self, boxes: Array, readings: Readings, found: Detections) -> Array:
        """Return the maximum share (N,) of each box (N, 7) that one of the cameras can show."""
        shares = [in_camera(boxes, reading, found.boxes) for reading in readings.cameras.values()]
        return np.max(shares, axis=0) if shares else np.zeros(len(boxes))

    def signals(self) -> tuple[SignalReading, ...]:
        """Return the traffic lights and stop signs of the map that are in the last images."""
        return self._signals

    def _lift_image(self, found: ImageDetections, readings: Readings, camera: str) -> Detections:
        """Return the objects of one image; of several lidars, the one with the best position estimate is used.

        Image boxes that no body fills are omitted.
        """
        clouds: Mapping[str, LidarReading | None] = readings.lidars or {"": None}
        lifted = most_certain([self._lift_with(found, readings, camera, *cloud) for cloud in clouds.items()])
        return lifted if lifted.scores.all() else lifted.subset(np.flatnonzero(lifted.scores).tolist())

    def _lift_with(
        self, found: ImageDetections, readings: Readings, camera: str, lidar: str, cloud: LidarReading | None
    ) -> Detections:
        categories = [object_category(name) for name in found.classes]
        rows = [row for row, category in enumerate(categories) if category is not None]
        return lift(
            found.boxes[rows],
            [category for category in categories if category is not None],
            found.scores[rows],
            readings.cameras[camera],
            cloud,
            time=readings.time,
            ground=float(readings.ego.position[2]),
            surroundings=self._map_context,
            pattern=self._patterns.get(lidar),
        )


class YoloDetector(LearnedDetector):
    """Detector `yolov5`."""

    network: ClassVar[Literal["yolov5", "ssd"]] = "yolov5"


class SsdDetector(LearnedDetector):
    """Detector `ssd`."""

    network: ClassVar[Literal["yolov5", "ssd"]] = "ssd"


def weights_path(name: str, settings: LearnedSettings) -> Path:
    """Return the path of the weights that the settings of this detector select."""
    return SHIPPED / f"{name}{OWN_SUFFIX}" if settings.weights is None else Path(settings.weights)


def build_network(name: str, settings: LearnedSettings, *, allow_torchscript: bool = False) -> ImageNetwork:
    """Return the network that the settings select.

    Raise SettingError if its weights are missing or not suitable, or are TorchScript without permission of the user,
    and if the runtime or the device is not available.
    """
    path = weights_path(name, settings)
    check_weights_exist(path)
    allow_torchscript = torchscript_is_allowed(allow_torchscript)
    if path.suffix == TORCHSCRIPT_SUFFIX and not allow_torchscript:
        raise refused_torchscript(path)
    runtime = select_runtime(path, settings.runtime, settings.device)
    if not is_installed(runtime):
        raise missing_runtime(runtime)
    if path.suffix in EXTERNAL_SUFFIXES and settings.classes is not None and settings.input_size is not None:
        return ExternalNetwork(
            path,
            settings.classes,
            settings.input_size,
            settings.confidence or DEFAULT_CONFIDENCE,
            settings.layout,
            settings.threads,
            settings.letterbox,
            runtime=runtime,
            device=settings.device,
            allow_torchscript=allow_torchscript,
        )
    network = OwnNetwork(path, runtime, settings.confidence, settings.threads, settings.device)
    if network.name != name:
        message = f"weights {quoted(str(path))} are of another network (got {network.name!r}; expected {name!r})"
        raise SettingError(Diagnostic(message, f"use the detector {network.name!r}"))
    return network


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


def merge_duplicates(parts: list[Detections], time: float) -> Detections:
    """Return all detections except those that overlap one with a higher score."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return Detections(time)
    merged = Detections(
        time,
        np.concatenate([part.boxes for part in parts]),
        np.concatenate([part.scores for part in parts]),
        tuple(name for part in parts for name in part.classes),
        np.concatenate([part.velocity for part in parts]),
        np.concatenate([part.covariance for part in parts]),
    )
    return without_duplicates(merged)
