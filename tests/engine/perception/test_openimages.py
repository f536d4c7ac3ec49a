"""Detector `ssd_openimages`: anchors, decoding, weights from the npm package, and detections where it is installed."""

from __future__ import annotations

import hashlib
import importlib.util
import io
import math
import tarfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from sample_car import make_car

from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import parse_settings
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.perception.learned import openimages
from eidrive_scenario.perception.learned.openimages import (
    ARCHIVE,
    CLASSES,
    SIDE,
    OpenImagesDetector,
    OpenImagesSettings,
    anchors,
    decode,
)
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement

BICYCLE, PERSON, VEHICLE, CAR = 1, 4, 18, 23
"""Lines of `object_detection_oidv4_labelmap.txt` in the npm package."""
WEIGHTS = Path(__file__).parents[3] / ARCHIVE
INSTALLED = importlib.util.find_spec("ai_edge_litert") is not None
needs_network = pytest.mark.skipif(
    not (INSTALLED and WEIGHTS.is_file()), reason=f"needs the extra openimages, and {ARCHIVE} in the root folder"
)
SENSORS = {"camera": CameraSettings(width=512, height=384), "lidar": LidarSettings()}


def logits(**probabilities: float) -> NDArray[np.float32]:
    """Return the class outputs, where the first anchor has these probabilities and everything else is improbable."""
    table = np.full((1, 1917, 24), -20.0, dtype=np.float32)
    labels = {"bicycle": BICYCLE, "person": PERSON, "vehicle": VEHICLE, "car": CAR}
    for name, probability in probabilities.items():
        table[0, 0, labels[name]] = math.log(probability / (1.0 - probability))
    return table


def test_anchors_are_those_of_ssd_with_six_maps() -> None:
    """Liu et al. (2016), section 2.2, with scales from 0.2 to 0.95 and the reduced lowest map of TensorFlow."""
    expected = []
    scales = [0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.0]
    for level, cells in enumerate([19, 10, 5, 3, 2, 1]):
        for line in range(cells):
            for column in range(cells):
                shapes = [(ratio, scales[level]) for ratio in (1.0, 2.0, 0.5, 3.0, 0.3333)]
                shapes += [(1.0, math.sqrt(scales[level] * scales[level + 1]))]
                if level == 0:
                    shapes = [(1.0, 0.1), (2.0, 0.2), (0.5, 0.2)]
                for ratio, scale in shapes:
                    size = scale * math.sqrt(ratio), scale / math.sqrt(ratio)
                    expected.append(((column + 0.5) / cells, (line + 0.5) / cells, *size))
    assert len(expected) == 1917
    np.testing.assert_allclose(anchors(), expected, atol=1e-12)


def test_decode_code_of_zero_returns_anchor_in_pixels() -> None:
    found = decode(np.zeros((1, 1917, 4), dtype=np.float32), logits(person=0.8), 0.5)
    center, half = SIDE * 0.5 / 19, SIDE * 0.1 / 2  # the first anchor: cell (0, 0) of 19 x 19, a square of a tenth
    np.testing.assert_allclose(found.boxes, [[center - half, center - half, center + half, center + half]])
    assert [CLASSES[number] for number in found.classes] == ["pedestrian"]
    np.testing.assert_allclose(found.scores, [0.8], rtol=1e-6)


def test_decode_code_moves_center_and_scales_size() -> None:
    encoded = np.zeros((1, 1917, 4), dtype=np.float32)
    encoded[0, 0] = 10.0, 20.0, 5.0 * math.log(2.0), 5.0 * math.log(3.0)  # y by 1 height, x by 2 widths
    found = decode(encoded, logits(bicycle=0.9), 0.5)
    x, y = SIDE * (0.5 / 19 + 0.2), SIDE * (0.5 / 19 + 0.1)
    np.testing.assert_allclose(found.boxes, [[x - 45.0, y - 30.0, x + 45.0, y + 30.0]], rtol=1e-6)


@pytest.mark.parametrize(
    ("probabilities", "name", "score"),
    [
        ({"car": 0.7, "vehicle": 0.4}, "car", 0.7),
        ({"car": 0.4, "vehicle": 0.6}, "car", 0.6),
        ({"car": 0.2, "vehicle": 0.6}, "truck", 0.6),
        ({"vehicle": 0.3}, "truck", 0.3),
        ({"person": 0.5, "bicycle": 0.6}, "bicycle", 0.6),
    ],
)
def test_decode_vehicle_is_car_if_more_probable_than_not(
    probabilities: dict[str, float], name: str, score: float
) -> None:
    found = decode(np.zeros((1, 1917, 4), dtype=np.float32), logits(**probabilities), 0.25)
    assert [CLASSES[number] for number in found.classes] == [name]
    np.testing.assert_allclose(found.scores, [score], rtol=1e-5)


def test_decode_below_confidence_returns_nothing() -> None:
    assert not len(decode(np.zeros((1, 1917, 4), dtype=np.float32), logits(car=0.2), 0.25).boxes)


def test_detector_is_registered_with_its_settings() -> None:
    assert registry("detectors").load("ssd_openimages", OpenImagesDetector) is OpenImagesDetector
    with pytest.raises(SettingError, match="runtime"):
        parse_settings(OpenImagesSettings, {"runtime": "torch"})


def test_missing_runtime_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openimages, "_is_installed", lambda: False)
    with pytest.raises(SettingError, match=r"LiteRT.*\[openimages\]"):
        OpenImagesDetector().check_weights()


def test_missing_package_names_the_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    detectors = OpenImagesDetector(), OpenImagesDetector(OpenImagesSettings(weights="none.tgz"))
    monkeypatch.setattr(openimages, "_is_installed", lambda: True)
    monkeypatch.chdir(tmp_path)
    for detector in detectors:
        with pytest.raises(SettingError, match=r"npm pack @mediapipe/objectron@0\.4\.1675468480"):
            detector.check_weights()


def test_other_file_is_refused_by_its_digest(tmp_path: Path) -> None:
    path = tmp_path / ARCHIVE
    path.write_bytes(b"TFL3")
    with pytest.raises(SettingError, match="SHA-256"):
        openimages._read_network(path)


def test_network_is_read_behind_the_label_map(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assets = b"\n".join([b"label"] * 40)[:184] + b"network"
    loose, packed = tmp_path / "assets.data", tmp_path / ARCHIVE
    loose.write_bytes(assets)
    with tarfile.open(packed, "w:gz") as archive:
        entry = tarfile.TarInfo("package/objectron_solution_packed_assets.data")
        entry.size = len(assets)
        archive.addfile(entry, io.BytesIO(assets))
    monkeypatch.setattr(openimages, "_ASSETS_SHA256", hashlib.sha256(assets).hexdigest())
    monkeypatch.setattr(openimages, "_ARCHIVE_SHA256", hashlib.sha256(packed.read_bytes()).hexdigest())
    assert openimages._read_network(loose) == openimages._read_network(packed) == b"network"


@pytest.fixture(scope="module")
def readings() -> Readings:
    """A car 14 m ahead of a car with a camera and a lidar, on a clear day."""
    with World(picture_maker=picture_maker) as world:
        world.add(make_car(), Placement(0.0, 0.0))
        world.add(make_car("Other"), Placement(14.0, 1.5, yaw=0.4))
        return Rig(make_car(), SENSORS).read(world, world.view())


@needs_network
def test_detect_car_in_image_returns_car_in_world(readings: Readings) -> None:
    detector = OpenImagesDetector(OpenImagesSettings(weights=str(WEIGHTS)))
    detector.load_weights()
    detector.setup(DetectorContext(make_car(), SENSORS))
    found = detector.detect(readings)
    assert "car" in found.classes
    best = found.boxes[int(np.argmax(found.scores))]
    assert math.hypot(best[0] - 15.2, best[1] - 2.0) < 1.5
    assert detector.library_versions.keys() == {"ai_edge_litert"}


@needs_network
def test_find_in_equal_images_returns_equal_bits(readings: Readings) -> None:
    image = readings.cameras["camera"].rgb
    first, second = (openimages.OpenImagesNetwork(WEIGHTS, threads=threads).find(image) for threads in (1, 2))
    np.testing.assert_array_equal(first.boxes, second.boxes)
    np.testing.assert_array_equal(first.scores, second.scores)
    assert not len(openimages.OpenImagesNetwork(WEIGHTS).find(np.full_like(image, 120)))
