"""The pictures of a run's cameras as files, with what was found drawn in."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.files.atomic import create
from eidrive_scenario.geometry import box_corners
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.sensing.readings import CameraReading

Image = NDArray[np.uint8]

QUALITY = 90
"""Of the JPEG files, in percent."""
_COLORS = {
    "car": (80, 220, 255),
    "van": (80, 220, 255),
    "truck": (90, 160, 255),
    "bus": (200, 140, 255),
    "motorbike": (255, 200, 60),
    "bicycle": (160, 255, 90),
    "pedestrian": (255, 110, 110),
}
"""Red, green, blue."""
_OTHER = (255, 255, 255)
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
"""Of a box, between the corners as `box_corners` gives them."""


class CameraImageWriter:
    """Writes each picture that a station takes to FOLDER/STATION/CAMERA-TICK.jpg.

    What the station's detector found in the picture is drawn in as it found it, with class and score; of a detector
    that does not look at pictures, what the station takes to be there is drawn as boxes in space.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stations: Stations | None = None

    def watch(self, stations: Stations) -> None:
        """Whose pictures to keep."""
        self._stations = stations

    def observe(self, frame: Frame) -> None:
        """Write the pictures of this tick. Raises SettingError if that cannot be done."""
        if self._stations is None:
            return
        for station, readings in self._stations.readings.items():
            found = self._stations.detector(station).image_detections
            for camera, reading in readings.cameras.items():
                if camera in found:
                    picture = drawn(reading.rgb, found[camera])
                else:
                    picture = drawn_in_space(reading, frame.steps[station].detections)
                name = f"{quote(camera, safe=' ')}-{frame.view.tick:06d}.jpg"
                self._write(self._folder / quote(station, safe=" ") / name, picture)

    def close(self) -> None:
        """Nothing is left to write."""

    def _write(self, path: Path, picture: Image) -> None:
        _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        with create(path) as stream:
            stream.write(data.tobytes())


def drawn(picture: Image, found: ImageDetections) -> Image:
    """The picture (H, W, 3) with boxes, classes and scores."""
    canvas = picture.copy()
    for box, score, name in zip(found.boxes, found.scores.tolist(), found.classes, strict=True):
        left, top, right, bottom = np.rint(box).astype(int).tolist()
        color = _COLORS.get(name, _OTHER)
        cv2.rectangle(canvas, (left, top), (right - 1, bottom - 1), color, 1)
        _label(canvas, f"{name} {score:.2f}", left, top, color)
    return canvas


def drawn_in_space(reading: CameraReading, found: Detections) -> Image:
    """The picture with boxes of the world, but for those that reach behind the camera."""
    canvas = reading.rgb.copy()
    height, width = canvas.shape[:2]
    for corners, name, score in zip(box_corners(found.boxes), found.classes, found.scores.tolist(), strict=True):
        places, _ = pixels(corners, reading)
        if not np.isfinite(places).all() or (np.abs(places) > 10 * max(width, height)).any():
            continue
        color = _COLORS.get(name, _OTHER)
        points = np.rint(places).astype(int).tolist()
        for first, last in _EDGES:
            cv2.line(canvas, points[first], points[last], color, 1, cv2.LINE_AA)
        _label(canvas, f"{name} {score:.2f}", min(x for x, _ in points), min(y for _, y in points), color)
    return canvas


def _label(canvas: Image, text: str, left: int, top: int, color: tuple[int, int, int]) -> None:
    """Text above a place, or below where there is no room, dark behind."""
    font, size = cv2.FONT_HERSHEY_SIMPLEX, max(0.35, canvas.shape[1] / 1800.0)
    (wide, high), _ = cv2.getTextSize(text, font, size, 1)
    left = min(max(left, 0), max(canvas.shape[1] - wide, 0))
    base = top - 3 if top - 3 - high >= 0 else top + high + 4
    cv2.putText(canvas, text, (left, base), font, size, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(canvas, text, (left, base), font, size, color, 1, cv2.LINE_AA)
