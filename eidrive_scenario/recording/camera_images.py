"""Image files of the cameras of a run, with the detections drawn in."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import box_corners, rigid_transform, rotation_matrix
from eidrive_scenario.driving.stack import DrivingStack
from eidrive_scenario.files.atomic import create
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.sensing.readings import CameraReading

Image = NDArray[np.uint8]
_IMAGE_NAME = re.compile(r"(.+)-(\d{6,})\.jpg")

QUALITY = 90
"""Quality of the JPEG files [percent]."""
_COLORS = {
    "car": (80, 220, 255),
    "van": (80, 220, 255),
    "truck": (90, 160, 255),
    "bus": (200, 140, 255),
    "motorbike": (255, 200, 60),
    "bicycle": (160, 255, 90),
    "pedestrian": (255, 110, 110),
}
"""Color of each class: red, green, blue."""
_OTHER = (255, 255, 255)
"""Color of all other classes."""
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
"""Edges of a box: pairs of corner indices in the order of `box_corners`."""


class CameraImageWriter:
    """Writer of each camera image of a station to FOLDER/STATION/CAMERA-TICK.jpg, and its camera to CAMERA.json.

    Detections of an image detector are drawn with class and score. For a detector without image detections, the 3D
    detections of the station are projected into the image.
    """

    def __init__(self, folder: Path, stack: DrivingStack) -> None:
        self._folder = folder
        self._stack = stack
        self._described: set[tuple[str, str]] = set()

    def observe(self, frame: Frame) -> None:
        """Write the images of this tick. Raise SettingError if a file cannot be written."""
        for station, readings in self._stack.readings.items():
            detections = self._stack.image_detections(station)
            for camera, reading in readings.cameras.items():
                if camera in detections:
                    image = draw_image_detections(reading.rgb, detections[camera])
                else:
                    image = draw_projected_boxes(reading, frame.steps[station].detections)
                folder = self._folder / _folder_name(station)
                if (station, camera) not in self._described and station in frame.view:
                    self._described.add((station, camera))
                    _describe(reading, frame, station, folder / camera_file(camera))
                self._write(folder / image_file(camera, frame.view.tick), image)

    def close(self) -> None:
        """Do nothing: each image is written at once."""

    def _write(self, path: Path, image: Image) -> None:
        import cv2

        _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        with create(path) as stream:
            stream.write(data.tobytes())


def _folder_name(station: str) -> str:
    """Return the name of the folder of a station, from which `unquote` returns the station."""
    name = quote(station, safe=" ")
    return f"%2E{name[1:]}" if name.startswith(".") else name  # `.` and `..` are other folders


def image_file(camera: str, tick: int) -> str:
    """Return the name of an image."""
    return f"{quote(camera, safe=' ')}-{tick:06d}.jpg"


class Picture(NamedTuple):
    """Image file of a camera of a station at a tick."""

    station: str
    camera: str
    tick: int
    path: Path


def pictures_in(folder: Path) -> list[Picture]:
    """Return the images below a folder that CameraImageWriter wrote, in the order of stations, cameras and ticks."""
    names = ((path, _IMAGE_NAME.fullmatch(path.name)) for path in folder.glob("*/*.jpg"))
    images = [(path.parent, name[1], int(name[2]), path) for path, name in names if name and is_regular_file(path)]
    return [Picture(unquote(folder.name), unquote(camera), tick, path) for folder, camera, tick, path in sorted(images)]


def camera_file(camera: str) -> str:
    """Return the name of the description of a camera.

    It is a JSON object with width and height [px], intrinsics (3, 3) [px], distortion k1, k2, p1, p2, k3, and the pose
    (4, 4) camera to station [m], camera frame x right, y down, z forward.
    """
    return f"{quote(camera, safe=' ')}.json"


def _describe(reading: CameraReading, frame: Frame, station: str, path: Path) -> None:
    """Write the description of a camera."""
    view = frame.view
    row = view.row(station)
    turn = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    body = rigid_transform(turn, view.position[row])
    height, width = reading.rgb.shape[:2]
    text = json.dumps(
        {
            "width": width,
            "height": height,
            "intrinsics": reading.intrinsics.tolist(),
            "distortion": reading.distortion.tolist(),
            "pose": (np.linalg.inv(body) @ reading.pose).tolist(),
        }
    )
    with create(path) as stream:
        stream.write(text.encode())


def draw_image_detections(image: Image, detections: ImageDetections) -> Image:
    """Return a copy of the image (H, W, 3) with boxes, classes and scores."""

    import cv2

    canvas = image.copy()
    for box, score, name in zip(detections.boxes, detections.scores.tolist(), detections.classes, strict=True):
        left, top, right, bottom = np.rint(box).astype(int).tolist()
        color = _COLORS.get(name, _OTHER)
        cv2.rectangle(canvas, (left, top), (right - 1, bottom - 1), color, 1)
        _label(canvas, f"{name} {score:.2f}", left, top, color)
    return canvas


def draw_projected_boxes(reading: CameraReading, detections: Detections) -> Image:
    """Return a copy of the image with projected 3D boxes, without boxes that reach behind the camera."""

    import cv2

    canvas = reading.rgb.copy()
    height, width = canvas.shape[:2]
    boxes, scores = box_corners(detections.boxes), detections.scores.tolist()
    for corners, name, score in zip(boxes, detections.classes, scores, strict=True):
        projected, _ = pixels(corners, reading)
        if not np.isfinite(projected).all() or (np.abs(projected) > 10 * max(width, height)).any():
            continue
        color = _COLORS.get(name, _OTHER)
        points = np.rint(projected).astype(int).tolist()
        for first, last in _EDGES:
            cv2.line(canvas, points[first], points[last], color, 1, cv2.LINE_AA)
        _label(canvas, f"{name} {score:.2f}", min(x for x, _ in points), min(y for _, y in points), color)
    return canvas


def _label(canvas: Image, text: str, left: int, top: int, color: tuple[int, int, int]) -> None:
    """Draw a text with a dark outline above a point, or below it at the upper image border."""

    import cv2

    font, size = cv2.FONT_HERSHEY_SIMPLEX, max(0.35, canvas.shape[1] / 1800.0)
    (wide, high), _ = cv2.getTextSize(text, font, size, 1)
    left = min(max(left, 0), max(canvas.shape[1] - wide, 0))
    base = top - 3 if top - 3 - high >= 0 else top + high + 4
    cv2.putText(canvas, text, (left, base), font, size, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(canvas, text, (left, base), font, size, color, 1, cv2.LINE_AA)
