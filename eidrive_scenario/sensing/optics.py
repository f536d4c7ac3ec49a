"""Lenses: pinhole cameras with the distortion of Brown and Conrady, as OpenCV has it."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world.camera import Pinhole, Radiance


class _Bend(NamedTuple):
    """The straight picture to take, and where each pixel of the bent one lies in it (pixel centers at integers)."""

    straight: Pinhole
    x: Floats
    y: Floats


def lens_of(settings: CameraSettings) -> Pinhole:
    """The camera without its distortion."""
    fov = math.radians(settings.fov)
    return Pinhole.of_fov(settings.width, settings.height, fov, settings.near, settings.far)


class Optics:
    """How the picture of a lens is made from one without distortion, taken wide enough."""

    def __init__(self, settings: CameraSettings) -> None:
        self._bend = _bend(settings) if any(settings.distortion) else None
        self._finer = settings.supersampling
        straight = lens_of(settings) if self._bend is None else self._bend.straight
        self.pinhole = straight.finer(self._finer)
        """The camera whose picture `bent` expects."""

    def bent(self, seen: Radiance) -> Radiance:
        """The picture through the lens; depth and segmentation are those of the nearest ray, not blended."""
        luminance: Any
        luminance, depth, segmentation = seen
        if self._finer > 1:
            size = (self.pinhole.width // self._finer, self.pinhole.height // self._finer)
            luminance = cv2.resize(luminance, size, interpolation=cv2.INTER_AREA)
            middle = slice(self._finer // 2, None, self._finer)
            depth, segmentation = depth[middle, middle], segmentation[middle, middle]
        if self._bend is not None:
            x, y = self._bend.x, self._bend.y
            luminance = cv2.remap(luminance, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            row, column = np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)
            depth, segmentation = depth[row, column], segmentation[row, column]
        return Radiance(luminance, depth, segmentation)


@lru_cache(maxsize=32)
def _bend(settings: CameraSettings) -> _Bend:
    """For each pixel center, the direction that the lens shows there, found by iteration to 1e-9.

    Raise SettingError if the iteration does not converge, as with strong coefficients that compensate each other.
    """
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
    return _Bend(straight, np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1]))


def _check_convergence(rays: Array, pixels: Array, lens: Pinhole, settings: CameraSettings) -> None:
    """Raise SettingError unless the lens shows each direction (N, 2) within a tenth of a pixel of its place (N, 2)."""
    along = np.column_stack([rays, np.ones(len(rays))])
    none = np.zeros(3)
    shown = cv2.projectPoints(along, none, none, lens.intrinsics, np.array(settings.distortion))[0][:, 0]
    if not np.abs(shown - pixels).max() < 0.1:
        what = f"the distortion {list(settings.distortion)} of a camera cannot be inverted"
        raise SettingError(Diagnostic(what, "give smaller coefficients or a smaller fov"))
