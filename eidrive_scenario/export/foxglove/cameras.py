"""Camera images beside a recording, their calibration, and the frames of cameras."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.export.foxglove.schemas import Foxglove, frame_of, stamp, vector
from eidrive_scenario.files.atomic import partial_path
from eidrive_scenario.files.bounded import load_json, read_regular_file
from eidrive_scenario.recording.camera_images import Picture, camera_file, pictures_in
from eidrive_scenario.recording.run_files import IMAGES

_LARGEST_IMAGE = 64 * 2**20
"""Maximum size of an image file [bytes]."""
_LARGEST_DESCRIPTION = 2**16
"""Maximum size of the description of a camera [bytes]."""


@dataclass(frozen=True)
class Camera:
    """Camera of a station: image size and intrinsics [px], distortion, and pose (4, 4) camera to station."""

    station: str
    name: str
    width: int
    height: int
    intrinsics: Array
    distortion: Array
    pose: Array


class CameraImages:
    """Images of a run by tick. Damaged descriptions of cameras are omitted with a warning."""

    def __init__(self, recording: Path, warnings: list[str]) -> None:
        self.cameras: list[Camera] = []
        self._pictures: dict[int, list[Picture]] = {}
        folder = recording.parent / IMAGES
        if not folder.is_dir():
            folder = partial_path(folder)
        cameras: dict[tuple[str, str], Path] = {}
        for picture in pictures_in(folder):
            self._pictures.setdefault(picture.tick, []).append(picture)
            cameras[picture.station, picture.camera] = picture.path.with_name(camera_file(picture.camera))
        for (station, name), path in cameras.items():
            try:
                self.cameras.append(_camera(station, name, path))
            except (OSError, AttributeError, LookupError, TypeError, ValueError) as error:
                warnings.append(f"{path}: no calibration: {str(error)[:200]}")

    def at(self, tick: int) -> list[Picture]:
        """Return the images of a tick."""
        return self._pictures.get(tick, [])


def _camera(station: str, name: str, path: Path) -> Camera:
    """Read the description of a camera. Raise OSError, LookupError, TypeError or ValueError if it is invalid."""
    data = load_json(read_regular_file(path, _LARGEST_DESCRIPTION), max_depth=5)
    arrays = [np.array(data[key], dtype=float) for key in ("intrinsics", "distortion", "pose")]
    if [array.shape for array in arrays] != [(3, 3), (5,), (4, 4)] or not all(
        np.isfinite(array).all() for array in arrays
    ):
        raise ValueError("matrices have other shapes or non-finite values")
    return Camera(station, name, int(data["width"]), int(data["height"]), *arrays)


def image_message(foxglove: Foxglove, picture: Picture, time: float) -> Any:
    """Return an image. Raise OSError if it cannot be read."""
    data = read_regular_file(picture.path, _LARGEST_IMAGE)
    frame = frame_of(picture.station, picture.camera)
    return foxglove.image(timestamp=stamp(time), frame_id=frame, format="jpeg", data=data)


def calibration_message(foxglove: Foxglove, camera: Camera, time: float) -> Any:
    """Return the calibration of a camera, with Brown's distortion."""
    lens = camera.intrinsics
    return foxglove.calibration(
        timestamp=stamp(time),
        frame_id=frame_of(camera.station, camera.name),
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        D=camera.distortion.tolist(),
        K=lens.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=np.column_stack([lens, np.zeros(3)]).ravel().tolist(),
    )


def add_camera_transforms(transforms: Any, cameras: list[Camera], present: Iterator[str], time: float) -> None:
    """Add the poses of cameras on the stations that are present."""
    here = set(present)
    for camera in cameras:
        if camera.station in here:
            transforms.transforms.add(
                timestamp=stamp(time),
                parent_frame_id=frame_of(camera.station),
                child_frame_id=frame_of(camera.station, camera.name),
                translation=vector(camera.pose[:3, 3].tolist()),
                rotation=_rotation(camera.pose[:3, :3]),
            )


def _rotation(turn: Array) -> dict[str, float]:
    """Return the quaternion of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_matrix(turn).as_quat().tolist()
    norm = math.hypot(*quaternion)
    return {axis: value / norm for axis, value in zip("xyzw", quaternion, strict=True)}
