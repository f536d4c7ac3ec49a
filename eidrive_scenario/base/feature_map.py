"""Features of one station on a grid in plan view: produced by detectors, transmitted and fused."""

from __future__ import annotations

from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats


class LatentCodec(Protocol):
    """Compression of features to the bytes of messages, and back. Arrays have one column per cell."""

    @property
    def scale(self) -> Any:
        """Latent units of one step of an integer."""

    def to_int8(self, latent: Floats) -> NDArray[np.int8]:
        """Return compressed features (8, N) as integers (8, N)."""

    def from_int8(self, steps: NDArray[np.int8]) -> Floats:
        """Return the compressed features (8, N) that integers stand for."""

    def to_codes(self, latent: Floats) -> NDArray[np.uint8]:
        """Return the entries (N,) of the code book that are nearest to compressed features (8, N)."""

    def from_codes(self, codes: NDArray[np.uint8]) -> Floats:
        """Return entries of the code book as compressed features (8, N)."""

    def expand(self, latent: Floats) -> Floats:
        """Return the features (96, N) of compressed features (8, N)."""


class FeatureMap(msgspec.Struct, frozen=True, gc=False):
    """Features of one station at one instant on a grid in plan view.

    The grid is centered on the first lidar of the station, to the nearest multiple of a cell. Its axes are those of the
    world, as the station assumes them.
    Arrays have the index [channel, i, j], where i is along x and j along y. The center of cell (i, j) of n x n cells
    is at ((i + 0.5 - n / 2) cell, (j + 0.5 - n / 2) cell).

    time        of the scan [s]
    x, y, yaw   pose of the grid in the world, as the station assumes it [m, rad]
    height      of the lidar in the world [m]
    foot        height of the ground below it in the world [m]
    cell        edge of a cell [m]
    features    (96, 128, 128), at least 0
    latent      (8, 128, 128): the compressed features before rounding, in latent units
    confidence  (128, 128): maximum probability of a class
    interval    time between the two scans in the features [s]; None: they are of one scan and show no motion
    """

    time: float
    x: float
    y: float
    yaw: float
    height: float
    foot: float
    cell: float
    features: Floats
    latent: Floats
    confidence: Floats
    interval: float | None = None
