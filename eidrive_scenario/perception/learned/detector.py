"""The detectors `yolov5` and `ssd`: a network on each camera's picture, its boxes lifted to the world."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.geometry import iou_bev
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern, pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.visibility import in_camera
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned.classes import misspelt, object_category
from eidrive_scenario.perception.learned.external_network import ExternalNetwork, Layout
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.learned.lights import LightsOnMap, signal_kinds
from eidrive_scenario.perception.learned.runtimes import runtime_versions
from eidrive_scenario.perception.learned.weight_files import (
    DEFAULT_CONFIDENCE,
    MAX_CLASSES,
    MAX_SIDE,
    TORCHSCRIPT_SUFFIX,
    check_weights_exist,
    refused_torchscript,
    torchscript_is_allowed,
)
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.sensing.readings import LidarReading, Readings, SignalReading
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, SensorSettings
from eidrive_scenario.settings import Settings

SHIPPED = Path(__file__).parents[1] / "weights"
OWN_SUFFIX, FOREIGN_SUFFIXES = ".npz", (".onnx", TORCHSCRIPT_SUFFIX)

SAME_PLACE = 0.1
"""Lifted boxes that overlap this much in plan view are one object; the surer one counts."""


Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
"""Width or height of a network's input [px]."""


class LearnedSettings(Settings):
    """What the property `detector_settings` may say.

    weights      a file, seen from the working directory: .npz as training/train.py writes it, an ONNX model (.onnx) or
                 a TorchScript model (.pt), which is loaded only where the user allows it; None is what is shipped
    classes, input_size, layout   of an .onnx or .pt: its classes in their order, width and height of its input [px],
                 and how its output is laid out, where the shape does not tell
    letterbox    of an .onnx or .pt: whether it takes pictures in their own shape, with gray margins; else stretched
    confidence   below which a box does not count; None is what suits shipped weights best, and 0.35 for others
    threads      of the network's computation, in the whole process
    """

    weights: str | None = None
    classes: Annotated[tuple[str, ...], Field(max_length=MAX_CLASSES)] | None = None
    input_size: tuple[Side, Side] | None = None
    layout: Layout | None = None
    letterbox: bool = False
    confidence: float | None = Field(default=None, gt=0.0, lt=1.0)
    threads: Annotated[int, Field(ge=1, le=256)] = 1

    @model_validator(mode="after")
    def _fit_together(self) -> LearnedSettings:
        suffix = Path(self.weights or OWN_SUFFIX).suffix or OWN_SUFFIX
        if suffix in FOREIGN_SUFFIXES:
            if not self.classes or self.input_size is None:
                raise ValueError(f"weights {suffix} need `classes: [...]` and `input_size: [width, height]`")
            for name in self.classes:
                meant = misspelt(name)
                if meant is not None:
                    raise ValueError(f"class {name!r} means nothing here; did you mean {meant!r}?")
            if not any(object_category(name) for name in self.classes):
                raise ValueError("none of `classes` is an object on the road such as car, truck, bus or pedestrian")
        elif self.weights is not None and suffix != OWN_SUFFIX:
            raise ValueError(f"weights end in .npz, .onnx or .pt, not in {suffix!r}")
        elif self.classes is not None or self.input_size is not None or self.layout is not None or self.letterbox:
            raise ValueError("`classes`, `input_size`, `layout` and `letterbox` are for weights .onnx and .pt")
        return self


class LearnedDetector(Detector):
    """What a network finds in the pictures of all cameras, lifted by LiDAR points where there are, else by the ground.

    Of boxes on one place, from one camera or several, the surest counts.
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
        self.library_versions = runtime_versions(path)
        self._network: ImageNetwork | None = None
        self._surroundings = MapContext(None)
        self._patterns: dict[str, Pattern] = {}
        self._lights = LightsOnMap(None)

    def load_weights(self, *, allow_torchscript: bool = False) -> None:
        """Build the network. Raises SettingError if its weights do not fit."""
        if self._network is None:
            self._network = build_network(self.network, self.settings, allow_torchscript=allow_torchscript)
            self.detectable_signals = signal_kinds(self._network.classes)

    def setup(self, installation: DetectorContext) -> None:
        """Learn the map and the patterns of the LiDARs."""
        self._surroundings = MapContext(installation.roads)
        self._lights = LightsOnMap(installation.roads)
        for name, sensor in installation.sensors.items():
            if isinstance(sensor, LidarSettings):
                self._patterns[name] = pattern_from_settings(sensor)

    def detect(self, readings: Readings) -> Detections:
        """The road users in the pictures of all cameras that were read."""
        self.load_weights()
        assert self._network is not None
        self.image_detections = {
            camera: self._network.find(reading.rgb) for camera, reading in readings.cameras.items()
        }
        self._signals = self._lights.read(self.image_detections, readings.cameras)
        parts = [self._lifted(found, readings, camera) for camera, found in self.image_detections.items()]
        return merge_duplicates(parts, readings.time)

    def in_view(self, boxes: Array, readings: Readings, found: Detections) -> Array:
        """(N,) the largest share of each box (N, 7) that one of the cameras can show."""
        shares = [in_camera(boxes, reading, found.boxes) for reading in readings.cameras.values()]
        return np.max(shares, axis=0) if shares else np.zeros(len(boxes))

    def signals(self) -> tuple[SignalReading, ...]:
        """The traffic lights and stop signs of the map that were seen in the last pictures."""
        return self._signals

    def _lifted(self, found: ImageDetections, readings: Readings, camera: str) -> Detections:
        """The objects of one picture; of several LiDARs the one that locates an object best."""
        sweeps: Mapping[str, LidarReading | None] = readings.lidars or {"": None}
        return most_certain([self._lifted_by(found, readings, camera, *sweep) for sweep in sweeps.items()])

    def _lifted_by(
        self, found: ImageDetections, readings: Readings, camera: str, lidar: str, sweep: LidarReading | None
    ) -> Detections:
        categories = [object_category(name) for name in found.classes]
        rows = [row for row, category in enumerate(categories) if category is not None]
        return lift(
            found.boxes[rows],
            [category for category in categories if category is not None],
            found.scores[rows],
            readings.cameras[camera],
            sweep,
            time=readings.time,
            ground=float(readings.ego.position[2]),
            surroundings=self._surroundings,
            pattern=self._patterns.get(lidar),
        )


class YoloDetector(LearnedDetector):
    """The detector `yolov5`."""

    network: ClassVar[Literal["yolov5", "ssd"]] = "yolov5"


class SsdDetector(LearnedDetector):
    """The detector `ssd`."""

    network: ClassVar[Literal["yolov5", "ssd"]] = "ssd"


def weights_path(name: str, settings: LearnedSettings) -> Path:
    """The file of weights that the settings of the detector of this name ask for."""
    return SHIPPED / f"{name}{OWN_SUFFIX}" if settings.weights is None else Path(settings.weights)


def build_network(name: str, settings: LearnedSettings, *, allow_torchscript: bool = False) -> ImageNetwork:
    """The network that the settings ask for.

    Raises SettingError if its weights are missing or do not fit, or are TorchScript, which the user has to allow.
    """
    path = weights_path(name, settings)
    check_weights_exist(path)
    allow_torchscript = torchscript_is_allowed(allow_torchscript)
    if path.suffix == TORCHSCRIPT_SUFFIX and not allow_torchscript:
        raise refused_torchscript(path)
    if path.suffix != ".onnx" and importlib.util.find_spec("torch") is None:
        message = f"detector {name!r} needs torch, which is not installed"
        raise SettingError(Diagnostic(message, "run: pip install eidrive-scenario[learned]"))
    if path.suffix in FOREIGN_SUFFIXES and settings.classes is not None and settings.input_size is not None:
        confidence = settings.confidence or DEFAULT_CONFIDENCE
        return ExternalNetwork(
            path,
            settings.classes,
            settings.input_size,
            confidence,
            settings.layout,
            settings.threads,
            settings.letterbox,
            allow_torchscript=allow_torchscript,
        )
    from eidrive_scenario.perception.learned.torch_network import TorchNetwork

    network = TorchNetwork(path, settings.confidence, settings.threads)
    if network.name != name:
        message = f"weights {quoted(str(path))} do not fit: they are of {network.name!r}, not of {name!r}"
        raise SettingError(Diagnostic(message, f"take the detector {network.name!r}"))
    return network


def most_certain(estimates: Sequence[Detections]) -> Detections:
    """Of several estimates of the same objects, row by row, those with the least variance of the position."""
    if len(estimates) == 1:
        return estimates[0]
    variances = [np.trace(estimate.covariance, axis1=1, axis2=2) for estimate in estimates]
    best, rows = np.argmin(variances, axis=0), np.arange(len(estimates[0]))
    return replace(
        estimates[0],
        boxes=np.stack([estimate.boxes for estimate in estimates])[best, rows],
        covariance=np.stack([estimate.covariance for estimate in estimates])[best, rows],
    )


def merge_duplicates(parts: list[Detections], time: float) -> Detections:
    """All detections, those left out that lie on the place of a surer one."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return Detections(time)
    together = Detections(
        time,
        np.concatenate([part.boxes for part in parts]),
        np.concatenate([part.scores for part in parts]),
        tuple(name for part in parts for name in part.classes),
        np.concatenate([part.velocity for part in parts]),
        np.concatenate([part.covariance for part in parts]),
    )
    shared = iou_bev(together.boxes, together.boxes)
    kept: list[int] = []
    for row in np.argsort(-together.scores, kind="stable").tolist():
        if not kept or shared[row, kept].max() <= SAME_PLACE:
            kept.append(row)
    return together.subset(sorted(kept))
