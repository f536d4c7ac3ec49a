"""The cameras' pictures that a run leaves behind, with boxes drawn in."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.experiments.single_run import IMAGES, run_and_save
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.recording.camera_images import drawn, drawn_in_space
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.simulation import RunSettings

GRAY = np.full((100, 160, 3), 90, dtype=np.uint8)


def colored(picture: np.ndarray) -> np.ndarray:
    """(H, W) the pixels that are gray no more."""
    found: np.ndarray = (picture != GRAY).any(axis=2)
    return found


def test_a_box_is_drawn_along_its_border_with_its_class_above() -> None:
    picture = drawn(GRAY, ImageDetections(np.array([[40.0, 50.0, 100.0, 80.0]]), np.array([0.5]), ("car",)))
    changed = colored(picture)
    assert changed[50, 40:100].all()
    assert changed[79, 40:100].all()
    assert changed[50:80, 40].all()
    assert changed[50:80, 99].all()
    assert not changed[52:78, 42:98].any()
    assert changed[35:48, 40:100].any()
    assert not colored(GRAY).any()


def test_a_box_in_space_is_drawn_where_its_corners_are_seen() -> None:
    """A camera that looks along x with 80 px of focal length: the near face of a box 2 m wide and high, 8 m ahead, is a
    square of 20 px around the middle."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    lens = np.array([[80.0, 0.0, 80.0], [0.0, 80.0, 50.0], [0.0, 0.0, 1.0]])
    depth, label = np.full((100, 160), np.inf, dtype=np.float32), np.full((100, 160), -1, dtype=np.int32)
    reading = CameraReading(GRAY, depth, label, lens, pose)
    ahead, behind = [10.0, 0.0, 0.0, 4.0, 2.0, 2.0, 0.0], [-10.0, 0.0, 0.0, 4.0, 2.0, 2.0, 0.0]

    def seen(*boxes: list[float]) -> np.ndarray:
        count = len(boxes)
        unknown = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
        found = Detections(0.0, np.array(boxes), np.ones(count), ("truck",) * count, *unknown)
        return colored(drawn_in_space(reading, found))

    changed = seen(ahead)
    assert changed[60, 70:91].all()
    assert changed[40:61, 70].all()
    assert changed[40:61, 90].all()
    assert not seen(behind).any()
    np.testing.assert_array_equal(seen(ahead, behind), changed)


def test_a_run_leaves_the_pictures_of_all_stations(tmp_path: Path) -> None:
    """At 10 Hz every second tick; the same run without pictures is the same run."""
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    settings = RunSettings(detector="yolov5", time_limit=0.3)
    kept = run_and_save("coop/scenario_1", settings=settings, out=tmp_path / "kept")
    bare = run_and_save("coop/scenario_1", settings=settings, out=tmp_path / "bare", record=False)
    assert kept.trace_hash == bare.trace_hash
    assert not (tmp_path / "bare" / IMAGES).exists()
    for station in ("Ego", "RSU"):
        files = sorted((tmp_path / "kept" / IMAGES / station).iterdir())
        assert [file.name for file in files] == [f"camera-{tick:06d}.jpg" for tick in (0, 2, 4, 6)]
        picture = cv2.imread(str(files[0]))
        assert picture is not None
        assert picture.shape == (384, 512, 3)
