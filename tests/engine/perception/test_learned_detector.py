"""The detectors `yolov5` and `ssd` with the weights that travel with the package."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.errors import SettingError
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.perception.learned import detector as module
from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES, misspelt, object_category
from eidrive_scenario.perception.learned.detector import (
    SHIPPED,
    LearnedDetector,
    LearnedSettings,
    SsdDetector,
    YoloDetector,
    build_network,
    merge_duplicates,
)
from eidrive_scenario.registry import registry
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings
from eidrive_scenario.settings import parse_settings
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
    """A car 14 m ahead and a little to the left of a car with a camera and a LiDAR, on a clear day."""
    with World() as world:
        world.add(car("Ego"), Placement(0.0, 0.0))
        world.add(car("Other"), Placement(14.0, 1.5, yaw=0.4))
        yield Rig(car("Ego"), SENSORS).read(world, world.view())


def built(kind: type[LearnedDetector], **settings: object) -> LearnedDetector:
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    detector = kind(LearnedSettings(**settings))  # type: ignore[arg-type]
    detector.setup(DetectorContext(car("Ego"), SENSORS))
    return detector


@KINDS
def test_a_car_in_a_picture_becomes_a_car_in_the_world(kind: type[LearnedDetector], readings: Readings) -> None:
    found = built(kind).detect(readings)
    assert found.time == readings.time
    assert "car" in found.classes
    middle = (14.0 + 1.35 * math.cos(0.4), 1.5 + 1.35 * math.sin(0.4))
    away = np.hypot(found.boxes[:, 0] - middle[0], found.boxes[:, 1] - middle[1])
    nearest = int(np.argmin(away))
    assert away[nearest] < 0.75
    assert found.classes[nearest] == "car"
    assert found.scores[nearest] > 0.5
    assert len(found) == 1


@KINDS
def test_without_a_lidar_the_ground_tells_the_distance(kind: type[LearnedDetector], readings: Readings) -> None:
    found = built(kind).detect(Readings(readings.time, readings.ego, cameras=readings.cameras))
    away = np.hypot(found.boxes[:, 0] - 15.24, found.boxes[:, 1] - 2.03)
    assert away.min() < 3.0


@KINDS
def test_detect_second_lidar_that_sees_the_car_locates_it(kind: type[LearnedDetector], readings: Readings) -> None:
    """The first LiDAR has points behind the station only. With its points alone, the ground tells the distance."""
    front = readings.lidars["lidar"]
    behind = front.points[:, 0] < 0.0
    rear = replace(front, points=front.points[behind], intensity=front.intensity[behind])
    expected = built(kind).detect(readings)
    found = built(kind).detect(replace(readings, lidars={"rear": rear, "lidar": front}))
    np.testing.assert_array_equal(found.boxes, expected.boxes)
    np.testing.assert_array_equal(found.covariance, expected.covariance)
    assert found.classes == expected.classes


@KINDS
def test_the_same_picture_gives_the_same_bits(kind: type[LearnedDetector], readings: Readings) -> None:
    first, second = built(kind), built(kind)
    a, b, c = first.detect(readings), first.detect(readings), second.detect(readings)
    for other in (b, c):
        np.testing.assert_array_equal(a.boxes, other.boxes)
        np.testing.assert_array_equal(a.scores, other.scores)
    picture = first.image_detections["camera"]
    assert picture.classes == second.image_detections["camera"].classes
    assert (picture.boxes >= 0.0).all()
    assert (picture.boxes <= np.array([800, 600, 800, 600])).all()


@KINDS
def test_what_no_picture_shows_is_not_found(kind: type[LearnedDetector]) -> None:
    with World() as world:
        world.add(car("Ego"), Placement(0.0, 0.0))
        empty = Rig(car("Ego"), SENSORS).read(world, world.view())
    assert len(built(kind).detect(empty)) == 0


@pytest.mark.parametrize("name", ["yolov5", "ssd"])
def test_weights_are_small_and_have_a_card(name: str) -> None:
    path = SHIPPED / f"{name}.npz"
    assert path.stat().st_size < 10e6
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["network"] == name
    assert tuple(card["classes"]) == IMAGE_CLASSES
    assert {"date", "torch", "data", "training", "validation_ap50", "held_out"} <= set(card)
    assert card["data"]["seed"] == 1
    assert card["held_out"]["images"] >= 1000


def test_all_classes_are_objects_or_signals() -> None:
    assert [object_category(name) for name in IMAGE_CLASSES[:6]] == list(IMAGE_CLASSES[:6])
    assert set(IMAGE_CLASSES[:6]) <= set(CLASSES)
    assert {object_category(name) for name in IMAGE_CLASSES[6:]} == {None}


def test_they_come_through_their_entry_points() -> None:
    assert registry("detectors").load("yolov5") is YoloDetector
    assert registry("detectors").load("ssd") is SsdDetector
    assert YoloDetector.needs == {"camera"}
    assert [type(sensor) for sensor in YoloDetector.default_sensors.values()] == [CameraSettings, LidarSettings]


def test_the_surest_of_several_boxes_on_one_place_counts() -> None:
    def part(boxes: list[list[float]], scores: list[float], name: str) -> Detections:
        count = len(boxes)
        nowhere = np.full((count, 2), np.nan)
        return Detections(1.0, np.array(boxes), np.array(scores), (name,) * count, nowhere, np.zeros((count, 2, 2)))

    here, there = [10.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0], [20.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0]
    beside = [11.0, 0.2, 0.75, 4.5, 1.8, 1.5, 0.1]
    found = merge_duplicates([part([here, there], [0.6, 0.9], "car"), part([beside], [0.8], "truck")], 1.0)
    assert found.scores.tolist() == [0.9, 0.8]
    assert found.classes == ("car", "truck")
    assert len(merge_duplicates([], 2.0)) == 0


def test_own_weights_come_through_the_same_door(readings: Readings) -> None:
    settings = {"weights": str(ONNX), "classes": ["truck", "car"], "input_size": [96, 64], "confidence": 0.3}
    parsed = parse_settings(LearnedSettings, settings)
    found = YoloDetector(parsed)
    found.setup(DetectorContext(car("Ego"), SENSORS))
    assert set(found.detect(readings).classes) <= {"car"}


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"weights": "missing.npz"}, "no file 'missing.npz' with weights"),
        ({"weights": "own.tflite"}, "weights end in .npz, .onnx or .pt, not in '.tflite'"),
        ({"weights": str(ONNX)}, "need `classes: [...]` and `input_size: [width, height]`"),
        ({"weights": str(ONNX), "classes": ["cat"], "input_size": [96, 64]}, "none of `classes` is an object"),
        (
            {"weights": str(ONNX), "classes": ["car", "pedestrain"], "input_size": [96, 64]},
            "did you mean 'pedestrian'?",
        ),
        ({"weights": str(ONNX), "classes": ["car", "trafic light"], "input_size": [96, 64]}, "mean 'traffic light'?"),
        ({"weights": str(SHIPPED / "ssd.npz")}, "they are of 'ssd', not of 'yolov5'; take the detector 'ssd'"),
        ({"weights": str(SHIPPED / "lamps.npz")}, "do not fit"),
        ({"classes": ["car"]}, "settings do not fit together"),
        ({"classes": ["car"]}, "are for weights .onnx and .pt"),
        ({"letterbox": True}, "are for weights .onnx and .pt"),
        ({"weights": str(ONNX), "classes": ["car"], "input_size": [96, 64]}, "fits no layout for 1 classes"),
        ({"confidence": 1.5}, "setting 'confidence' is 1.5"),
        ({"wieghts": "own.onnx"}, "did you mean 'weights'"),
    ],
)
def test_settings_that_cannot_work_are_told_before_the_run(settings: dict[str, object], expected: str) -> None:
    with pytest.raises(SettingError) as error:
        build_network("yolov5", parse_settings(LearnedSettings, settings, source="a.xosc", line=7))
    assert expected in str(error.value)


def test_only_slips_in_names_of_classes_are_told() -> None:
    """Classes of COCO are all right, whatever is not used of them."""
    coco = {"person", "bicycle", "motorcycle", "airplane", "bus", "train", "truck", "boat", "bench", "bird", "cat"}
    coco |= {"dog", "cow", "bear", "zebra", "tv", "kite", "cup", "fork", "bowl", "cake", "chair", "bed", "mouse"}
    coco |= {"traffic light", "stop sign", "fire hydrant", "parking meter", "car"}
    assert {misspelt(name) for name in coco} == {None}
    assert [misspelt(name) for name in IMAGE_CLASSES] == [None] * len(IMAGE_CLASSES)
    assert misspelt("traffic light amber") is None
    assert (misspelt("motorcicle"), misspelt("traffic light gren")) == ("motorcycle", "traffic light green")


def test_a_file_that_holds_no_weights(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    garbled, other = tmp_path / "garbled.npz", tmp_path / "other.npz"
    garbled.write_bytes(b"not an archive")
    np.savez(other, numbers=np.arange(3))
    for path in (garbled, other):
        with pytest.raises(SettingError, match=r"do not fit: .*; give a file that training/train.py has written"):
            build_network("yolov5", LearnedSettings(weights=str(path)))


def test_without_torch_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(SettingError, match=r"needs torch.*run: pip install eidrive-scenario\[learned\]"):
        build_network("ssd", LearnedSettings())


@pytest.mark.parametrize(
    ("changes", "diagnostic"),
    [
        ({"confidence": 0.0}, "its confidence is 0 (expected a number between 0 and 1)"),
        ({"confidence": 1.0}, "its confidence is 1 (expected a number between 0 and 1)"),
        ({"confidence": math.nan}, "its confidence is nan (expected a number between 0 and 1)"),
        ({"input_size": [500, 300]}, "its input size is 500 x 300, which are not multiples of 32"),
    ],
)
def test_weights_with_unusable_description_are_refused(
    changes: dict[str, object], diagnostic: str, tmp_path: Path
) -> None:
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    with np.load(SHIPPED / "yolov5.npz") as stored:
        arrays = dict(stored)
    arrays["description"] = np.array(json.dumps({**json.loads(str(arrays["description"])), **changes}))
    path = tmp_path / "own.npz"
    np.savez(path, **arrays)
    with pytest.raises(SettingError) as error:
        build_network("yolov5", LearnedSettings(weights=str(path)))
    assert f"do not fit: {diagnostic}" in str(error.value)
