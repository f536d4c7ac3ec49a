"""From boxes in a picture to boxes on the ground, with nothing but the camera and the usual sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import NEAREST, level_frame, straight_boxes
from eidrive_scenario.perception.geometry.size_priors import prior_of
from eidrive_scenario.sensing.readings import CameraReading

HEADINGS = 12
"""Headings that are tried, over half a turn."""
LANE_DEVIATION = math.radians(25.0)
"""How much vehicles turn away from their lane's direction [rad]."""
EDGE_DEVIATION = 1.5
"""Of the edges of a box from those of the object, standard deviation [px]; a share of the box's size on top."""
EDGE_SHARE = 0.02
SHAPE_DEVIATION = 0.08
"""How far bodies of one size differ in where their edges are: bumpers, mirrors, roofs [m]."""
CUT_DEVIATION = 0.35
"""Of the lower edge of an object that the picture's left or right border cuts: its wheels may be beyond it, and what is
seen lowest is a bumper or a sill, up to 0.7 m above the ground [m]."""
AT_BORDER = 2.0
"""An edge this near to the picture's border is where the picture ends, not the object [px]."""
HIDDEN_SHARE = 0.8
"""An edge of which more lies in a nearer box is where that object begins, not where this one ends; else what is left
of the edge shows where that is."""
ROUNDS = 10
FARTHEST = 300.0
LEVEL = 0.1
"""Roads that lie this much higher or lower at an object than was assumed call for another look [m]."""
LOOKS = 4
LARGEST_VARIANCE = 2500.0

_OUTWARDS = np.array([-1.0, -1.0, 1.0, 1.0])


def _hull(*quarter: tuple[float, float, float]) -> Array:
    """(4 K, 3) points of a body that is the same to both sides and ends, from those of a quarter of it."""
    signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    return np.array([(a * x, b * y, z) for x, y, z in quarter for a, b in signs])


def _sliced(hull: Array) -> Array:
    """The points of a hull and those between its two ends: what is cut off has its own outline."""
    rear = hull * (-1.0, 1.0, 1.0)
    return np.concatenate([hull + share * (rear - hull) for share in (0.0, 0.125, 0.25, 0.375, 0.5)])


_BOX = _hull((0.5, 0.5, 0.0), (0.5, 0.5, 1.0))
_CAR = _hull(
    (0.31, 0.45, 0.0), (0.5, 0.42, 0.15), (0.5, 0.42, 0.55), (0.4, 0.49, 0.2), (0.4, 0.49, 0.6), (0.22, 0.32, 1.0)
)
_TALL = _hull((0.35, 0.47, 0.0), (0.5, 0.5, 0.12), (0.5, 0.5, 0.85), (0.47, 0.47, 1.0))
_HULLS = {"car": _CAR, "van": _TALL, "truck": _TALL, "bus": _TALL}
"""Outermost points of bodies, in shares of length, width and height. A picture's box ends at the tires, the bumpers and
the roof, not at the corners of the box around the body: bumpers end well above the ground and roofs before the ends."""


class ByGround(NamedTuple):
    """What boxes of a picture are in the world.

    boxes       (N, 7) in the world frame [m, rad]
    covariance  (N, 2, 2) of their centers [m²]
    headings    (N, HEADINGS) of the length, that were tried over half a turn [rad]
    costs       (N, HEADINGS) squared errors of the best fit with each, in standard deviations
    """

    boxes: Array
    covariance: Array
    headings: Array
    costs: Array


def lift_by_ground(
    boxes: Array, classes: Sequence[str], camera: CameraReading, *, ground: float, surroundings: MapContext
) -> ByGround:
    """The boxes in the world that fill boxes (N, 4) of a picture [px].

    Each stands on the ground, has the usual size of its class, and is moved until the outline of its projection has
    the edges of the given box: least squares over the place (Levenberg and Marquardt) for some headings, of which the
    one with the least error is taken; where the others lead counts as uncertainty. Of edges at the picture's border
    only counts that the object goes on there. The front follows the lane where a map is at hand, else it leads away
    from the camera. Roads' heights come from the map, else they are `ground` [m].
    """
    if not len(boxes):
        return ByGround(np.empty((0, 7)), np.empty((0, 2, 2)), np.empty((0, HEADINGS)), np.empty((0, HEADINGS)))
    view = _View(np.asarray(boxes, dtype=float), classes, camera)
    heights = surroundings.ground(view.far_as_tall(), ground)
    for _ in range(LOOKS):
        found = view.place(heights, surroundings)
        there = surroundings.ground(found.boxes[:, :2], ground)
        if np.all(np.abs(there - heights) <= LEVEL):
            break
        heights = there
    return found


class _View:
    """The boxes of one picture, in the plane at distance 1 from the camera."""

    def __init__(self, boxes: Array, classes: Sequence[str], camera: CameraReading) -> None:
        self._frame, self._turn = level_frame(camera)
        self._edges = straight_boxes(boxes, camera)
        priors = [prior_of(name) for name in classes]
        self._sizes = np.array([prior.mean for prior in priors])
        self._deviations = np.array([prior.deviation for prior in priors])
        hulls = [_HULLS.get(name, _BOX) for name in classes]
        if not np.all((boxes[:, 0] > AT_BORDER) & (boxes[:, 2] < camera.rgb.shape[1] - AT_BORDER)):
            hulls = [_sliced(hull) for hull in hulls]
        most = max(map(len, hulls))
        self._hulls = np.array([np.resize(hull, (most, 3)) for hull in hulls])
        focal = float(camera.intrinsics[0, 0])
        height, width = camera.rgb.shape[:2]
        size = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
        self._blur = (EDGE_DEVIATION + EDGE_SHARE * size) / focal
        self._known = np.stack(
            [
                boxes[:, 0] > AT_BORDER,
                boxes[:, 1] > AT_BORDER,
                boxes[:, 2] < width - AT_BORDER,
                boxes[:, 3] < height - AT_BORDER,
            ],
            axis=1,
        )

        self._cut = ~(self._known[:, 0] & self._known[:, 2])
        """Whether the picture's left or right border cuts the object off."""
        self._borders = np.where(self._cut[:, None], self._edges[:, [0, 2]], (-np.inf, np.inf))
        self._borders[self._known[:, 0], 0] = -np.inf
        self._borders[self._known[:, 2], 1] = np.inf
        self._known &= ~_behind_others(boxes)
        self._lowest = np.where(self._cut, CUT_DEVIATION, 0.0)

    def place(self, ground: Array, surroundings: MapContext) -> ByGround:
        """What the boxes are, for heights (N,) of the ground."""
        count = len(self._sizes)
        start = self._first_guess(ground)
        lane = surroundings.lane_heading(self._frame.to_world(start)) - self._frame.yaw
        on_lane = np.isfinite(lane)
        base = np.where(on_lane, np.nan_to_num(lane), np.arctan2(start[:, 1], start[:, 0]))
        step = np.pi / HEADINGS * np.arange(HEADINGS)
        headings = base[:, None] + step
        aside = np.minimum(step, np.pi - step) / LANE_DEVIATION
        places, errors, informations = self._fitted(start, headings, ground)
        costs = errors + np.where(on_lane[:, None], aside**2, 0.0)
        best = np.argmin(costs, axis=1)
        rows = np.arange(count)
        weights = np.exp(-0.5 * (costs - costs[rows, best][:, None]))
        weights /= weights.sum(axis=1, keepdims=True)
        place, heading, information = places[rows, best], headings[rows, best], informations[rows, best]
        apart = places - place[:, None]
        doubt = np.einsum("nk,nki,nkj->nij", weights, apart, apart)
        along = np.where(on_lane, base, np.arctan2(place[:, 1], place[:, 0]))
        heading = np.where(np.cos(heading - along) < -1e-9, heading + np.pi, heading)
        boxes = np.column_stack([place, ground + self._sizes[:, 2] / 2.0, self._sizes, wrap_angle(heading)])
        covariance = self._covariance(information, heading) + doubt
        return ByGround(
            self._frame.boxes_to_world(boxes),
            self._frame.covariance_to_world(covariance),
            headings + self._frame.yaw,
            costs,
        )

    def far_as_tall(self) -> Array:
        """(N, 2) where the objects are in the world if they are as tall as usual, whatever the ground."""
        left, top, right, bottom = self._edges.T
        rays = np.stack([(left + right) / 2.0, (top + bottom) / 2.0, np.ones(len(left))], axis=1) @ self._turn
        return self._frame.to_world(rays[:, :2] * (self._sizes[:, 2] / np.maximum(bottom - top, 1e-6))[:, None])

    def _first_guess(self, ground: Array) -> Array:
        """(N, 2) where the ray through the lower edge meets the ground, else by the height of the box."""
        left, top, right, bottom = self._edges.T
        rays = np.stack([(left + right) / 2.0, bottom, np.ones(len(left))], axis=1) @ self._turn
        fall = np.maximum(-rays[:, 2], 1e-9)
        by_ground = (self._frame.height - ground) / fall * np.hypot(rays[:, 0], rays[:, 1])
        by_height = self._sizes[:, 2] / np.maximum(bottom - top, 1e-6)
        usable = self._known[:, 3] & (-rays[:, 2] > 0.02) & (by_ground > 0.0)
        distance = np.clip(np.where(usable, by_ground, by_height), 1.0, FARTHEST)
        depth = self._sizes[:, :2].min(axis=1) / 2.0
        bearing = np.arctan2(rays[:, 1], rays[:, 0])
        guess: Array = np.stack([np.cos(bearing), np.sin(bearing)], axis=1) * (distance + depth)[:, None]
        return guess

    def _fitted(self, start: Array, headings: Array, ground: Array) -> tuple[Array, Array, Array]:
        """(N, K, 2) the best place for each heading (N, K), its squared error and (N, K, 2, 2) its information."""
        count, tried = headings.shape
        place = np.repeat(start[:, None], tried, axis=1)
        damping = np.full((count, tried), 1e-3)
        error, gradient, information = self._linearized(place, headings, ground)
        for _ in range(ROUNDS):
            scaled = information + damping[..., None, None] * _diagonal(information)
            step = np.linalg.solve(scaled, gradient[..., None])[..., 0]
            longest = 0.3 * np.linalg.norm(place, axis=-1) + 0.5
            length = np.maximum(np.linalg.norm(step, axis=-1), 1e-12)
            moved = place + step * np.minimum(1.0, longest / length)[..., None]
            new_error, new_gradient, new_information = self._linearized(moved, headings, ground)
            better = new_error < error
            place = np.where(better[..., None], moved, place)
            error = np.where(better, new_error, error)
            gradient = np.where(better[..., None], new_gradient, gradient)
            information = np.where(better[..., None, None], new_information, information)
            damping = np.clip(np.where(better, damping * 0.2, damping * 8.0), 1e-9, 1e6)
        return place, error, information

    def _linearized(self, place: Array, headings: Array, ground: Array) -> tuple[Array, Array, Array]:
        """Squared error, its negative half gradient and its Gauss-Newton matrix at places (N, K, 2)."""
        nudge = 0.01
        tried = place + nudge * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])[:, None, None]
        edges, depth = self._projected(tried, headings, ground)
        off = self._edges[:, None] - edges[0]
        beyond = ~self._known[:, None] & (off * _OUTWARDS < 0.0)
        weight = np.where(beyond, 0.0, self._weights(depth[0]))
        residual = off * weight
        slope = (edges[1:] - edges[0]) / nudge * weight
        gradient = np.einsum("anke,nke->nka", slope, residual)
        information = np.einsum("anke,bnke->nkab", slope, slope)
        return np.einsum("nke,nke->nk", residual, residual), gradient, information

    def _projected(self, place: Array, headings: Array, ground: Array) -> tuple[Array, Array]:
        """(3, N, K, 4) edges of the projections, and (3, N, K) depths of the centers."""
        corners = self._hulls * self._sizes[:, None]
        cos, sin = np.cos(headings)[..., None], np.sin(headings)[..., None]
        x = cos * corners[:, None, :, 0] - sin * corners[:, None, :, 1] + place[..., 0:1]
        y = sin * corners[:, None, :, 0] + cos * corners[:, None, :, 1] + place[..., 1:2]
        z = np.broadcast_to((corners[:, None, :, 2] + ground[:, None, None] - self._frame.height), x.shape)
        turn = self._turn
        across = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z
        down = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z
        ahead = np.maximum(turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z, NEAREST)
        u, v = across / ahead, down / ahead
        top, bottom = v.min(axis=-1), v.max(axis=-1)
        if self._cut.any():
            # What the border cuts off shows neither top nor bottom: only points within the picture count.
            shown = (u >= self._borders[:, None, None, 0]) & (u <= self._borders[:, None, None, 1])
            some = shown.any(axis=-1)
            top = np.where(some, np.where(shown, v, np.inf).min(axis=-1), top)
            bottom = np.where(some, np.where(shown, v, -np.inf).max(axis=-1), bottom)
        edges = np.stack([u.min(axis=-1), top, u.max(axis=-1), bottom], axis=-1)
        return edges, ahead.mean(axis=-1)

    def _weights(self, depth: Array) -> Array:
        """(N, K, 4) one over the standard deviation of each edge: of the box, and of the usual size."""
        across = self._deviations[:, 1, None] / 2.0 / depth
        upwards = self._deviations[:, 2, None] / depth
        blur = np.hypot(self._blur[:, None], SHAPE_DEVIATION / depth)
        sides = 1.0 / np.hypot(blur, across)
        lowest = np.hypot(blur, self._lowest[:, None] / depth)
        return np.stack([sides, 1.0 / np.hypot(blur, upwards), sides, 1.0 / lowest], axis=-1)

    def _covariance(self, information: Array, heading: Array) -> Array:
        """(N, 2, 2) of the centers: of the fit, and of half the length and width that are not seen."""
        values, vectors = np.linalg.eigh(information)
        variances = np.minimum(1.0 / np.maximum(values, 1.0 / LARGEST_VARIANCE), LARGEST_VARIANCE)
        fit = np.einsum("nij,nj,nkj->nik", vectors, variances, vectors)
        cos, sin = np.cos(heading), np.sin(heading)
        axes = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
        sizes = (self._deviations[:, :2] / 2.0) ** 2
        return np.asarray(fit + np.einsum("nij,nj,nkj->nik", axes, sizes, axes))


def _behind_others(boxes: Array) -> NDArray[np.bool_]:
    """(N, 4) which edges of boxes (N, 4) lie where another box hides the object: one that reaches lower in the picture,
    so is nearer, and that the edge lies in along most of its length."""
    low, high = boxes[:, :2], boxes[:, 2:]
    size = np.maximum(high - low, 1e-6)
    nearer = high[None, :, 1] > high[:, None, 1] + EDGE_DEVIATION
    shared = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    beside = shared > HIDDEN_SHARE * size[:, None]
    margin = EDGE_DEVIATION + EDGE_SHARE * size
    hidden = np.zeros((len(boxes), 4), dtype=bool)
    for edge in range(4):
        axis = edge % 2
        place = boxes[:, edge][:, None]
        within = (place > low[None, :, axis] - margin[:, None, axis]) & (
            place < high[None, :, axis] + margin[:, None, axis]
        )
        hidden[:, edge] = (nearer & within & beside[:, :, 1 - axis]).any(axis=1)
    return hidden


def _diagonal(matrices: Array) -> Array:
    """The same matrices (..., 2, 2) without what is off the diagonal, and with at least a trace of it."""
    return np.maximum(matrices, 1e-9) * np.eye(2)
