"""Camera images of a run, with detections drawn in."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from written_recording import view

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.recording.camera_images import (
    CameraImageWriter,
    camera_file,
    draw_image_detections,
    draw_projected_boxes,
    image_file,
    pictures_in,
)
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.run_files import IMAGES
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.simulation import RunSettings

GRAY = np.full((100, 160, 3), 90, dtype=np.uint8)


def changed_pixels(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return the mask (H, W) of the pixels that are no longer gray."""
    changed: NDArray[np.bool_] = (image != GRAY).any(axis=2)
    return changed


def test_image_detection_is_drawn_as_border_with_label_above() -> None:
    box = ImageDetections(np.array([[40.0, 50.0, 100.0, 80.0]]), np.array([0.5]), ("car",))
    changed = changed_pixels(draw_image_detections(GRAY, box))
    assert changed[50, 40:100].all()
    assert changed[79, 40:100].all()
    assert changed[50:80, 40].all()
    assert changed[50:80, 99].all()
    assert not changed[52:78, 42:98].any()
    assert changed[35:48, 40:100].any()
    assert not changed_pixels(GRAY).any()


def test_projected_box_is_drawn_at_its_projected_corners() -> None:
    """A camera looks along x with a focal length of 80 px. The near face of a box of 2 m width and height at 8 m is a
    square of 20 px at the image center."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    lens = np.array([[80.0, 0.0, 80.0], [0.0, 80.0, 50.0], [0.0, 0.0, 1.0]])
    depth, label = np.full((100, 160), np.inf, dtype=np.float32), np.full((100, 160), -1, dtype=np.int32)
    reading = CameraReading(GRAY, depth, label, lens, pose)
    ahead, behind = [10.0, 0.0, 0.0, 4.0, 2.0, 2.0, 0.0], [-10.0, 0.0, 0.0, 4.0, 2.0, 2.0, 0.0]

    def draw(*boxes: list[float]) -> NDArray[np.bool_]:
        count = len(boxes)
        unknown = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
        detections = Detections(0.0, np.array(boxes), np.ones(count), ("truck",) * count, *unknown)
        return changed_pixels(draw_projected_boxes(reading, detections))

    changed = draw(ahead)
    assert changed[60, 70:91].all()
    assert changed[40:61, 70].all()
    assert changed[40:61, 90].all()
    assert not draw(behind).any()
    np.testing.assert_array_equal(draw(ahead, behind), changed)


@pytest.mark.parametrize("station", [".", "..", ".a/b %2E"])
def test_images_of_station_named_like_a_folder_stay_below_theirs(tmp_path: Path, station: str) -> None:
    nothing = ImageDetections(np.empty((0, 4)), np.empty(0), ())
    readings = {station: SimpleNamespace(cameras={"front": SimpleNamespace(rgb=GRAY)})}
    stack: Any = SimpleNamespace(readings=readings, image_detections=lambda name: {"front": nothing})
    CameraImageWriter(tmp_path / IMAGES, stack).observe(Frame(view({}, tick=3)))
    assert [picture[:3] for picture in pictures_in(tmp_path / IMAGES)] == [(station, "front", 3)]
    assert [path.name for path in tmp_path.iterdir()] == [IMAGES]


@pytest.mark.exhaustive
def test_run_writes_camera_images_of_all_stations(tmp_path: Path) -> None:
    """Cameras of 10 Hz expose in every second tick. The trace hash does not depend on image files."""
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    settings = RunSettings(detector="yolov5", time_limit=0.3)
    kept = run_and_save("coop/scenario_1", settings=settings, out=tmp_path / "kept")
    bare = run_and_save("coop/scenario_1", settings=settings, out=tmp_path / "bare", record=False)
    assert kept.trace_hash == bare.trace_hash
    assert not (tmp_path / "bare" / IMAGES).exists()
    for station in ("Ego", "RSU"):
        *files, camera = sorted((tmp_path / "kept" / IMAGES / station).iterdir())
        assert camera.name == "camera.json"
        assert [file.name for file in files] == [f"camera-{tick:06d}.jpg" for tick in (0, 2, 4, 6)]
        image = cv2.imread(str(files[0]))
        assert image is not None
        assert image.shape == (384, 512, 3)


def test_description_of_camera_projects_points_into_its_image(tmp_path: Path) -> None:
    """The front camera of the ego, 1 m above the ground, sees a point 10 m ahead of it at its height in the center."""
    settings = RunSettings(detector="ssd", time_limit=0.1)
    result = run_and_save("coop/scenario_1", settings=settings, out=tmp_path)
    data = json.loads((tmp_path / IMAGES / "Ego" / camera_file("camera")).read_text())
    image = cv2.imread(str(tmp_path / IMAGES / "Ego" / image_file("camera", 0)))
    assert image is not None
    assert image.shape[:2] == (data["height"], data["width"])
    pose = np.array(data["pose"])
    assert result.recording is not None
    view = next(iter(read_recording(result.recording).frames())).view
    row = view.row("Ego")
    nose = view.offset[row, 0] + view.size[row, 0] / 2
    assert nose <= pose[0, 3] < nose + 0.2
    assert pose[1:3, 3] == pytest.approx([0.0, 1.0])
    for aside, up in ((0.0, 0.0), (2.0, -0.5)):
        ahead = np.array([pose[0, 3] + 10.0, aside, 1.0 + up, 1.0])
        x, y, depth = np.array(data["intrinsics"]) @ (np.linalg.inv(pose) @ ahead)[:3]
        focal = data["intrinsics"][0][0]
        assert depth == pytest.approx(10.0)
        assert x / depth == pytest.approx(data["width"] / 2 - focal * aside / 10.0)
        assert y / depth == pytest.approx(data["height"] / 2 - focal * up / 10.0)
