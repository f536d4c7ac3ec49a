"""Received features on the grid of the receiver, and attention to them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Floats, Integers
from eidrive_scenario.base.feature_map import FeatureMap
from eidrive_scenario.base.geometry import rotation
from eidrive_scenario.base.kernels import kernel

ENOUGH = 0.5
"""Weight of the present cells in a bilinear interpolation from which its result is present."""


@dataclass(frozen=True)
class Grid:
    """Grid of a feature map: pose of its center in the world [m, rad], edge of a cell [m], cells along x and y."""

    x: float
    y: float
    yaw: float
    cell: float
    shape: tuple[int, int]

    @classmethod
    def of(cls, features: FeatureMap) -> Grid:
        """Return the grid of a feature map."""
        rows, columns = features.confidence.shape
        return cls(features.x, features.y, features.yaw, features.cell, (rows, columns))

    def to_world(self, coordinates: Array | Integers) -> Array:
        """Return the points (..., 2) in the world of coordinates in cells, where integers are centers of cells."""
        local = (coordinates + 0.5 - np.array(self.shape) / 2.0) * self.cell
        world: Array = local @ rotation(-self.yaw) + (self.x, self.y)
        return world

    def to_coordinates(self, points: Array) -> Array:
        """Return the coordinates (..., 2) in cells of points in the world."""
        local = (points - (self.x, self.y)) @ rotation(self.yaw)
        return np.asarray(local / self.cell + np.array(self.shape) / 2.0 - 0.5)

    def cells(self, points: Array) -> tuple[Integers, Bools]:
        """Return the cells (N, 2) that contain points (N, 2) of the world, and whether they are in the grid (N,)."""
        cells = np.floor(self.to_coordinates(points) + 0.5)
        inside: Bools = np.all((cells >= 0) & (cells < self.shape), axis=1)
        return np.where(inside[:, None], cells, 0).astype(np.int64), inside


def warp(
    latent: Floats, present: Bools, sender: Grid, receiver: Grid, moving: Array, age: float
) -> tuple[Floats, Bools]:
    """Return the features (n, m, C) of a sender on the grid of the receiver, and in which cells they are present.

    latent, present  (h, w, C) features, (h, w) whether a cell has features; on the grid of the sender
    moving           (B, 7) objects at the measurement: x, y, yaw, length and width with a margin, velocity vx, vy
                     in the world [m, rad, m/s]
    age              time from the measurement of the sender to that of the receiver [s]

    A cell with center q shows q - v age if an object with velocity v was there, and is absent if an object was at q
    itself. All other cells show q. The four nearest cells of the sender are interpolated bilinearly, with the weights
    of the present ones divided by their sum. The result is present if the nearest cell is, or if this sum is at least
    `ENOUGH`.
    """
    corners = sender.to_coordinates(receiver.to_world(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])))
    transform = np.array([corners[0], corners[1] - corners[0], corners[2] - corners[0]])
    boxes = np.empty((len(moving), 8))
    if len(moving):
        turned = moving[:, 2] - sender.yaw
        shift = sender.to_coordinates(moving[:, :2] + moving[:, 5:7] * age)
        boxes[:, :2] = sender.to_coordinates(moving[:, :2])
        boxes[:, 2], boxes[:, 3] = np.cos(turned), np.sin(turned)
        boxes[:, 4:6] = moving[:, 3:5] / (2.0 * sender.cell)
        boxes[:, 6:] = shift - boxes[:, :2]
    warped = np.zeros((*receiver.shape, latent.shape[2]), np.float32)
    is_present = np.zeros(receiver.shape, np.bool_)
    _warp(latent, present, transform, boxes, warped, is_present)
    return warped, is_present


@kernel("void(f4[:,:,::1], b1[:,::1], f8[:,::1], f8[:,::1], f4[:,:,::1], b1[:,::1])")
def _warp(latent: Floats, present: Bools, transform: Array, boxes: Array, warped: Floats, is_present: Bools) -> None:
    """Fill the arrays of `warp`.

    transform  (3, 2) coordinates of cell (0, 0) of the receiver on the grid of the sender, and its change along x and y
    boxes      (B, 8) center, cos and sin of the heading, half length, half width, displacement; in cells of the sender
    """
    rows, columns, channels = latent.shape
    for i in range(warped.shape[0]):
        for j in range(warped.shape[1]):
            u = transform[0, 0] + i * transform[1, 0] + j * transform[2, 0]
            v = transform[0, 1] + i * transform[1, 1] + j * transform[2, 1]
            from_u, from_v = u, v
            left = False
            for box in boxes:
                x, y = u - box[0], v - box[1]
                left |= abs(x * box[2] + y * box[3]) <= box[4] and abs(y * box[2] - x * box[3]) <= box[5]
                x, y = x - box[6], y - box[7]
                if abs(x * box[2] + y * box[3]) <= box[4] and abs(y * box[2] - x * box[3]) <= box[5]:
                    from_u, from_v = u - box[6], v - box[7]
                    left = False
                    break
            if left or not (-1.0 < from_u < rows and -1.0 < from_v < columns):
                continue
            first, second = math.floor(from_u), math.floor(from_v)
            total = 0.0
            nearest = False
            for a in range(2):
                for b in range(2):
                    k, m = first + a, second + b
                    if 0 <= k < rows and 0 <= m < columns and present[k, m]:
                        weight = (1.0 - abs(from_u - k)) * (1.0 - abs(from_v - m))
                        total += weight
                        nearest |= k == math.floor(from_u + 0.5) and m == math.floor(from_v + 0.5)
                        for channel in range(channels):
                            warped[i, j, channel] += np.float32(weight) * latent[k, m, channel]
            if nearest or total >= ENOUGH:
                is_present[i, j] = True
                for channel in range(channels):
                    warped[i, j, channel] /= np.float32(total)
            else:
                for channel in range(channels):
                    warped[i, j, channel] = 0.0


@kernel("void(f4[:,::1], b1[:,::1], f4[:,:,::1])")
def scatter(features: Floats, present: Bools, grid: Floats) -> None:
    """Write features (C, N) of the N present cells (n, m), in their order, into a grid (C, n, m)."""
    cells = np.flatnonzero(present)
    flat = grid.reshape(len(grid), -1)
    for channel in range(len(features)):
        for number, cell in enumerate(cells):
            flat[channel, cell] = features[channel, number]


def attend(own: Floats, received: Floats, present: Bools) -> Floats:
    """Return in each cell the mean of the features of all present stations, weighted by their likeness to the own ones.

    own (C, n, m), received (S, C, n, m), present (S, n, m). The weights are the softmax over the stations, the own one
    included, of the scalar product with the own features divided by the square root of C.
    """
    channels, stations = len(own), len(received)
    fused = np.empty((channels, own[0].size), np.float32)
    flat = np.ascontiguousarray(received).reshape(stations, channels, -1)
    _attend(np.ascontiguousarray(own).reshape(channels, -1), flat, present.reshape(stations, -1), fused)
    return fused.reshape(own.shape)


@kernel("void(f4[:,::1], f4[:,:,::1], b1[:,::1], f4[:,::1])")
def _attend(own: Floats, received: Floats, present: Bools, fused: Floats) -> None:
    stations, channels, cells = received.shape
    weights = np.zeros((stations + 1, cells), np.float32)
    for channel in range(channels):
        mine = own[channel]
        for cell in range(cells):
            weights[0, cell] += mine[cell] * mine[cell]
        for station in range(stations):
            theirs = received[station, channel]
            for cell in range(cells):
                weights[station + 1, cell] += mine[cell] * theirs[cell]
    scale = np.float32(1.0 / math.sqrt(channels))
    for cell in range(cells):
        largest = weights[0, cell]
        for station in range(stations):
            if present[station, cell]:
                largest = max(largest, weights[station + 1, cell])
        total = np.float32(0.0)
        for station in range(stations + 1):
            weight = np.float32(0.0)
            if station == 0 or present[station - 1, cell]:
                weight = np.float32(math.exp((weights[station, cell] - largest) * scale))
            weights[station, cell] = weight
            total += weight
        for station in range(stations + 1):
            weights[station, cell] /= total
    for channel in range(channels):
        result = fused[channel]
        for cell in range(cells):
            result[cell] = own[channel, cell] * weights[0, cell]
        for station in range(stations):
            theirs = received[station, channel]
            for cell in range(cells):
                result[cell] += weights[station + 1, cell] * theirs[cell]
