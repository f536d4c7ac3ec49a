"""Ideal camera, its images, and the interface to the maker of these pictures."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.view import ActorState
from eidrive_scenario.world.weather import Weather

FIRST_SIGNAL_LABEL = -10
"""Segmentation label of the head of the first signal; the next one has -11, and so on."""


class CameraImage(NamedTuple):
    """Image: rgb (H, W, 3), depth (H, W) along the optical axis [m] with inf for no hit, segmentation (H, W) of rows or
    -1.

    Heads of traffic signals have labels below -1 (see `World.signal_labels`).
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


@dataclass(frozen=True)
class Pinhole:
    """Camera without distortion and with square pixels. Pixel (j, i) covers [j, j + 1) x [i, i + 1) of the image plane.

    focal, center_x, center_y  [px]
    near, far                  along the optical axis [m]
    """

    width: int
    height: int
    focal: float
    center_x: float
    center_y: float
    near: float = 0.1
    far: float = 500.0

    @classmethod
    def of_fov(cls, width: int, height: int, fov: float, near: float = 0.1, far: float = 500.0) -> Pinhole:
        """Return a camera with a horizontal field of view [rad] and its axis in the image center."""
        return cls(width, height, width / 2 / math.tan(fov / 2), width / 2, height / 2, near, far)

    def finer(self, times: float) -> Pinhole:
        """Return the same camera with `times` as many pixels along each axis."""
        lens = (self.focal * times, self.center_x * times, self.center_y * times)
        return Pinhole(round(self.width * times), round(self.height * times), *lens, self.near, self.far)

    @property
    def intrinsics(self) -> Array:
        """Matrix (3, 3) from camera coordinates to pixels."""
        return np.array([[self.focal, 0.0, self.center_x], [0.0, self.focal, self.center_y], [0.0, 0.0, 1.0]])


class Radiance(NamedTuple):
    """Light that reaches a camera: luminance (H, W, 3) of linear sRGB [cd/m²]; depth and segmentation as in
    CameraImage.
    """

    luminance: NDArray[np.float32]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


class UndrawnImage(Protocol):
    """Image whose content is fixed, so that it does not follow the world, but that is not drawn yet."""

    @property
    def digest(self) -> bytes:
        """Digest of everything that determines the image: equal digests mean equal images."""

    def draw(self) -> Radiance:
        """Return the light that reaches the camera."""


class VisibleState(NamedTuple):
    """Content of a world that cameras see at one time [s], in addition to its static objects.

    actors       specification and state of each actor, in the order of the rows of the view
    signals      states of the traffic signals by id
    appearances  of actors that differ from the default
    """

    time: float
    weather: Weather
    actors: Sequence[tuple[ActorSpec, ActorState]]
    signals: Mapping[str, str]
    appearances: Mapping[str, Appearance]


class PictureMaker(Protocol):
    """Maker of the images of all cameras in one world; `eidrive_scenario.rendering` has one."""

    def image(self, state: VisibleState, pose: Array, pinhole: Pinhole, ignore: Collection[str]) -> UndrawnImage:
        """Return the image of a camera at `pose` (4, 4). Actors in `ignore` are not drawn, but cast shadows and emit
        light.
        """
