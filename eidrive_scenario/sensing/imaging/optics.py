"""Lenses: pinhole cameras with the distortion of Brown and Conrady, as in OpenCV."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world.camera import Pinhole, Radiance


class _Distortion(NamedTuple):
    """Pinhole camera of the undistorted image, and positions of the distorted pixels in it (centers at integers)."""

    straight: Pinhole
    x: Floats
    y: Floats


def lens_of(settings: CameraSettings) -> Pinhole:
    """Return the camera without its distortion."""
    fov = math.radians(settings.fov)
    return Pinhole.of_fov(settings.width, settings.height, fov, settings.near, settings.far)


class Optics:
    """Distortion of an undistorted image with a sufficiently large field of view."""

    def __init__(self, settings: CameraSettings) -> None:
        self._distortion = _distortion(settings) if any(settings.distortion) else None
        self._supersampling = settings.supersampling
        straight = lens_of(settings) if self._distortion is None else self._distortion.straight
        self.pinhole = straight.finer(self._supersampling)
        """Camera of the image that `distort` expects."""

    def distort(self, radiance: Radiance) -> Radiance:
        """Return the image of the lens; depth and segmentation are those of the nearest ray, not interpolated."""

        import cv2

        luminance: Any
        luminance, depth, segmentation = radiance
        if self._supersampling > 1:
            size = (self.pinhole.width // self._supersampling, self.pinhole.height // self._supersampling)
            luminance = cv2.resize(luminance, size, interpolation=cv2.INTER_AREA)
            middle = slice(self._supersampling // 2, None, self._supersampling)
            depth, segmentation = depth[middle, middle], segmentation[middle, middle]
        if self._distortion is not None:
            x, y = self._distortion.x, self._distortion.y
            luminance = cv2.remap(luminance, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            row, column = np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)
            depth, segmentation = depth[row, column], segmentation[row, column]
        return Radiance(luminance, depth, segmentation)


@lru_cache(maxsize=32)
def _distortion(settings: CameraSettings) -> _Distortion:
    """Return the direction of each pixel center, found by iteration to 1e-9.

    Raise SettingError if the iteration does not converge, as with strong coefficients that compensate each other.
    """

    import cv2

    lens = lens_of(settings)
    columns, rows = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=1)[:, None]
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    same = np.eye(3)
    found = cv2.undistortPointsIter(pixels, lens.intrinsics, np.array(settings.distortion), same, same, until)
    rays = np.asarray(found, dtype=float)[:, 0]
    _check_convergence(rays, pixels[:, 0], lens, settings)
    low, high = rays.min(axis=0) * lens.focal - 1.0, rays.max(axis=0) * lens.focal + 1.0
    (left, top), (right, bottom) = np.floor(low), np.ceil(high)
    straight = Pinhole(int(right - left), int(bottom - top), lens.focal, -left, -top, lens.near, lens.far)
    places = (rays * lens.focal - (left, top) - 0.5).astype(np.float32).reshape(lens.height, lens.width, 2)
    return _Distortion(straight, np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1]))


def _check_convergence(rays: Array, pixels: Array, lens: Pinhole, settings: CameraSettings) -> None:
    """Raise SettingError unless each direction (N, 2) projects within a tenth of a pixel of its position (N, 2)."""

    import cv2

    along = np.column_stack([rays, np.ones(len(rays))])
    none = np.zeros(3)
    projected = cv2.projectPoints(along, none, none, lens.intrinsics, np.array(settings.distortion))[0][:, 0]
    if not np.abs(projected - pixels).max() < 0.1:
        what = f"distortion: the coefficients cannot be inverted (got {list(settings.distortion)})"
        raise SettingError(Diagnostic(what, "use smaller coefficients or a smaller fov"))
