"""Detectors `yolov5` and `ssd` with the shipped weights."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import parse_settings
from eidrive_scenario.perception.detector import DetectorContext, ImageDetections, without_duplicates
from eidrive_scenario.perception.learned.detector import LearnedDetector, SsdDetector, YoloDetector
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, misspelt, object_category
from eidrive_scenario.perception.learned.network_loading import SHIPPED, build_network
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

ONNX = Path(__file__).parents[2] / "data" / "red_boxes.onnx"
KINDS = pytest.mark.parametrize("kind", [YoloDetector, SsdDetector])
SENSORS = {"camera": CameraSettings(), "lidar": LidarSettings()}


def car(name: str) -> ActorSpec:
    return ActorSpec(
        name,
        "car",
        "car",
        (4.6, 1.85, 1.5),
        (1.35, 0.0, 0.75),
        wheelbase=2.7,
        color=(0.6, 0.1, 0.1),
        wheel_radius=0.33,
    )


@pytest.fixture(scope="module")
def readings() -> Iterator[Readings]:
    """A car 14 m ahead and slightly to the left of a car with a camera and a lidar, on a clear day."""
    with World(picture_maker=picture_maker) as world:
        world.add(car("Ego"), Placement(0.0, 0.0))
        world.add(car("Other"), Placement(14.0, 1.5, yaw=0.4))
        yield Rig(car("Ego"), SENSORS).read(world, world.view())


def create(kind: type[LearnedDetector], **settings: object) -> LearnedDetector:
    detector = kind(LearnedSettings(**settings))  # type: ignore[arg-type]
    detector.setup(DetectorContext(car("Ego"), SENSORS))
    return detector


@pytest.mark.parametrize(("letterbox", "expected"), [(False, 18.75), (True, 14.0625)])
def test_range_follows_height_of_car_in_network_input(letterbox: bool, expected: float) -> None:
    """A focal length of 320 px is 100 px in the input if heights are reduced by 100/320, and 75 px if by 150/640.

    1.5 m are 8 px high at 18.75 m and 14.06 m.
    """
    detector = create(YoloDetector, weights=str(ONNX), classes=("car",), input_size=(150, 100), letterbox=letterbox)
    assert detector.range_of(CameraSettings(width=640, height=320, fov=90.0)) == pytest.approx(expected)


@KINDS
def test_detect_car_in_image_returns_car_in_world(kind: type[LearnedDetector], readings: Readings) -> None:
    detections = create(kind).detect(readings)
    assert detections.time == readings.time
    assert "car" in detections.classes
    center = (14.0 + 1.35 * math.cos(0.4), 1.5 + 1.35 * math.sin(0.4))
    away = np.hypot(detections.boxes[:, 0] - center[0], detections.boxes[:, 1] - center[1])
    nearest = int(np.argmin(away))
    assert away[nearest] < 0.75
    assert detections.classes[nearest] == "car"
    assert detections.scores[nearest] > 0.5
    assert len(detections) == 1


@KINDS
def test_detect_without_lidar_uses_ground_plane(kind: type[LearnedDetector], readings: Readings) -> None:
    detections = create(kind).detect(Readings(readings.time, readings.ego, cameras=readings.cameras))
    away = np.hypot(detections.boxes[:, 0] - 15.24, detections.boxes[:, 1] - 2.03)
    assert away.min() < 3.0


@KINDS
def test_detect_with_two_lidars_uses_better_position_estimate(kind: type[LearnedDetector], readings: Readings) -> None:
    """The first lidar has points behind the station only, which leaves the distance to the ground plane."""
    front = readings.lidars["lidar"]
    behind = front.points[:, 0] < 0.0
    rear = replace(front, points=front.points[behind], intensity=front.intensity[behind])
    expected = create(kind).detect(readings)
    detections = create(kind).detect(replace(readings, lidars={"rear": rear, "lidar": front}))
    np.testing.assert_array_equal(detections.boxes, expected.boxes)
    np.testing.assert_array_equal(detections.covariance, expected.covariance)
    assert detections.classes == expected.classes


@KINDS
def test_detect_omits_image_boxes_that_no_body_fills(
    kind: type[LearnedDetector], readings: Readings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A truck between the bumper and the horizon, as networks see in a stripe of a crosswalk; the car remains."""
    detector = kind(LearnedSettings())
    detector.setup(DetectorContext(car("Ego")))
    detector.load_weights()
    network = detector._network
    assert network is not None
    detections = network.find(readings.cameras["camera"].rgb)
    stripe = np.concatenate([detections.boxes, [[161.0, 313.0, 262.0, 384.0]]])
    false = ImageDetections(stripe, np.append(detections.scores, 0.5), (*detections.classes, "truck"))
    monkeypatch.setattr(network, "find_in", lambda reading: false)
    detected = detector.detect(replace(readings, lidars={}))
    assert "truck" not in detected.classes
    assert len(detected) == len(detections.boxes) > 0
    assert detector.image_detections["camera"] is false


@KINDS
def test_detect_same_image_returns_same_bits(kind: type[LearnedDetector], readings: Readings) -> None:
    first, second = create(kind), create(kind)
    a, b, c = first.detect(readings), first.detect(readings), second.detect(readings)
    for other in (b, c):
        np.testing.assert_array_equal(a.boxes, other.boxes)
        np.testing.assert_array_equal(a.scores, other.scores)
    detections = first.image_detections["camera"]
    assert detections.classes == second.image_detections["camera"].classes
    assert (detections.boxes >= 0.0).all()
    assert (detections.boxes <= np.array([800, 600, 800, 600])).all()


@KINDS
def test_detect_in_empty_scene_returns_no_objects(kind: type[LearnedDetector]) -> None:
    with World(picture_maker=picture_maker) as world:
        world.add(car("Ego"), Placement(0.0, 0.0))
        empty = Rig(car("Ego"), SENSORS).read(world, world.view())
    assert len(create(kind).detect(empty)) == 0


@pytest.mark.parametrize("name", ["yolov5", "ssd"])
def test_shipped_weights_are_small_and_have_metadata(name: str) -> None:
    path = SHIPPED / f"{name}.npz"
    assert path.stat().st_size < 10e6
    metadata = json.loads(path.with_suffix(".json").read_text())
    assert metadata["network"] == name
    assert tuple(metadata["classes"]) == IMAGE_CLASSES
    assert {"date", "torch", "data", "training", "validation_ap50", "held_out"} <= set(metadata)
    assert metadata["data"]["seed"] == 1
    assert metadata["held_out"]["images"] >= 1000


def test_image_classes_are_objects_or_signals() -> None:
    assert [object_category(name) for name in IMAGE_CLASSES[:6]] == list(IMAGE_CLASSES[:6])
    assert set(IMAGE_CLASSES[:6]) <= set(CLASSES)
    assert {object_category(name) for name in IMAGE_CLASSES[6:]} == {None}


def test_registry_loads_learned_detectors_by_entry_point() -> None:
    assert registry("detectors").load("yolov5") is YoloDetector
    assert registry("detectors").load("ssd") is SsdDetector
    assert YoloDetector.needs == {"camera"}
    assert [type(sensor) for sensor in YoloDetector.default_sensors.values()] == [CameraSettings, LidarSettings]


def test_without_duplicates_keeps_box_with_highest_score() -> None:
    def part(boxes: list[list[float]], scores: list[float], name: str) -> Detections:
        count = len(boxes)
        nowhere = np.full((count, 2), np.nan)
        return Detections(1.0, np.array(boxes), np.array(scores), (name,) * count, nowhere, np.zeros((count, 2, 2)))

    first_box, second_box = [10.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0], [20.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0]
    beside = [11.0, 0.2, 0.75, 4.5, 1.8, 1.5, 0.1]
    parts = [part([first_box, second_box], [0.6, 0.9], "car"), part([beside], [0.8], "truck")]
    distinct = without_duplicates(Detections.concatenate(1.0, parts))
    assert distinct.scores.tolist() == [0.9, 0.8]
    assert distinct.classes == ("car", "truck")
    assert len(without_duplicates(Detections.concatenate(2.0, []))) == 0


def test_detect_with_onnx_weights_returns_configured_classes(readings: Readings) -> None:
    settings = {"weights": str(ONNX), "classes": ["truck", "car"], "input_size": [96, 64], "confidence": 0.3}
    parsed = parse_settings(LearnedSettings, settings)
    detector = YoloDetector(parsed)
    detector.setup(DetectorContext(car("Ego"), SENSORS))
    assert set(detector.detect(readings).classes) <= {"car"}


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"weights": "missing.npz"}, "no file 'missing.npz' with weights"),
        ({"weights": "own.tflite"}, "unknown file type (got '.tflite'; expected .npz, .onnx or .pt)"),
        ({"weights": str(ONNX)}, "require `classes: [...]` and `input_size: [width, height]`"),
        ({"weights": str(ONNX), "classes": ["cat"], "input_size": [96, 64]}, "classes: none is a road user"),
        (
            {"weights": str(ONNX), "classes": ["car", "pedestrain"], "input_size": [96, 64]},
            "did you mean 'pedestrian'?",
        ),
        ({"weights": str(ONNX), "classes": ["car", "trafic light"], "input_size": [96, 64]}, "mean 'traffic light'?"),
        (
            {"weights": str(SHIPPED / "ssd.npz")},
            "another network (got 'ssd'; expected 'yolov5'); use the detector 'ssd'",
        ),
        ({"weights": str(SHIPPED / "lamps.npz")}, "do not fit"),
        ({"classes": ["car"]}, "settings contradict each other"),
        ({"classes": ["car"]}, "apply to weights .onnx and .pt only"),
        ({"letterbox": True}, "apply to weights .onnx and .pt only"),
        ({"weights": str(ONNX), "classes": ["car"], "input_size": [96, 64]}, "fits no layout for 1 classes"),
        ({"confidence": 1.5}, "setting 'confidence' is 1.5"),
        ({"wieghts": "own.onnx"}, "did you mean 'weights'"),
    ],
)
def test_build_network_with_unsuitable_settings_raises(settings: dict[str, object], expected: str) -> None:
    with pytest.raises(SettingError) as error:
        build_network("yolov5", parse_settings(LearnedSettings, settings, source="a.xosc", line=7))
    assert expected in str(error.value)


def test_misspelt_reports_only_similar_class_names() -> None:
    """All classes of COCO are accepted, whether or not they are used."""
    coco = {"person", "bicycle", "motorcycle", "airplane", "bus", "train", "truck", "boat", "bench", "bird", "cat"}
    coco |= {"dog", "cow", "bear", "zebra", "tv", "kite", "cup", "fork", "bowl", "cake", "chair", "bed", "mouse"}
    coco |= {"traffic light", "stop sign", "fire hydrant", "parking meter", "car"}
    assert {misspelt(name) for name in coco} == {None}
    assert [misspelt(name) for name in IMAGE_CLASSES] == [None] * len(IMAGE_CLASSES)
    assert misspelt("traffic light amber") is None
    assert (misspelt("motorcicle"), misspelt("traffic light gren")) == ("motorcycle", "traffic light green")


def test_build_network_with_file_without_weights_raises(tmp_path: Path) -> None:
    garbled, other = tmp_path / "garbled.npz", tmp_path / "other.npz"
    garbled.write_bytes(b"not an archive")
    np.savez(other, numbers=np.arange(3))
    for path in (garbled, other):
        with pytest.raises(SettingError, match=r"do not fit: .*; use a file that training/train.py has written"):
            build_network("yolov5", LearnedSettings(weights=str(path)))


@pytest.mark.parametrize(
    ("changes", "diagnostic"),
    [
        ({"confidence": 0.0}, "its confidence is invalid (got 0; expected a number between 0 and 1)"),
        ({"confidence": 1.0}, "its confidence is invalid (got 1; expected a number between 0 and 1)"),
        ({"confidence": math.nan}, "its confidence is invalid (got nan; expected a number between 0 and 1)"),
        ({"input_size": [500, 300]}, "its input size is invalid (got 500 x 300; expected multiples of 32)"),
    ],
)
def test_build_network_with_invalid_description_raises(
    changes: dict[str, object], diagnostic: str, tmp_path: Path
) -> None:
    with np.load(SHIPPED / "yolov5.npz") as stored:
        arrays = dict(stored)
    arrays["description"] = np.array(json.dumps({**json.loads(str(arrays["description"])), **changes}))
    path = tmp_path / "own.npz"
    np.savez(path, **arrays)
    with pytest.raises(SettingError) as error:
        build_network("yolov5", LearnedSettings(weights=str(path)))
    assert f"do not fit: {diagnostic}" in str(error.value)
