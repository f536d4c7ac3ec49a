"""Lifting of image boxes to boxes on the ground, from the camera and prior sizes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.perception.geometry.map_context import LANE_DEVIATION, MapContext
from eidrive_scenario.perception.geometry.projection import NEAREST, level_frame, straight_boxes
from eidrive_scenario.perception.geometry.size_priors import possible_classes, prior_of
from eidrive_scenario.sensing.readings import CameraReading

EDGE_DEVIATION = 1.5
"""Standard deviation between the edges of a box and of the object [px]; EDGE_SHARE of the box size is added."""
EDGE_SHARE = 0.02
AT_BORDER = 2.0
"""Distance from the border of the image within which an edge is that of the image, not of the object [px]; EDGE_SHARE
of the box size is added."""
HIDDEN_SHARE = 0.8
"""Share of an edge in a nearer box above which the edge is that of the nearer object. Below it, the rest of the edge
shows the end of this object."""


def edges_in_image(boxes: Array, camera: CameraReading) -> Bools:
    """Return whether (N, 4) the edges of image boxes (N, 4) are those of objects, not of the image."""
    width, height = camera.size
    inside = np.concatenate([boxes[:, :2], (width, height) - boxes[:, 2:]], axis=1)
    return np.asarray(inside > (AT_BORDER + EDGE_SHARE * largest_sides(boxes))[:, None])


def largest_sides(boxes: Array) -> Array:
    """Return the longer side (N,) of image boxes (N, 4) [px]."""
    return np.asarray(np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1]))


def edges_behind_others(boxes: Array) -> Bools:
    """Return which edges (N, 4) of boxes (N, 4) are where another box hides the object.

    The other box extends lower in the image, so it is nearer, and contains most of the length of the edge.
    """
    low, high = boxes[:, :2], boxes[:, 2:]
    size = np.maximum(high - low, 1e-6)
    nearer = high[None, :, 1] > high[:, None, 1] + EDGE_DEVIATION
    shared = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    beside = shared > HIDDEN_SHARE * size[:, None]
    margin = EDGE_DEVIATION + EDGE_SHARE * size
    hidden = np.zeros((len(boxes), 4), dtype=bool)
    for edge in range(4):
        axis = edge % 2
        position = boxes[:, edge][:, None]
        within = (position > low[None, :, axis] - margin[:, None, axis]) & (
            position < high[None, :, axis] + margin[:, None, axis]
        )
        hidden[:, edge] = (nearer & within & beside[:, :, 1 - axis]).any(axis=1)
    return hidden


HEADINGS = 12
"""Number of tested headings over half a turn."""
SHAPE_DEVIATION = 0.08
"""Standard deviation of the edges of bodies of one size: bumpers, mirrors, roofs [m]."""
CUT_DEVIATION = 0.35
"""Standard deviation of the lower edge of an object that the left or right border of the image cuts [m]. Its wheels may
be outside the image, and its lowest visible part is a bumper or a sill, up to 0.7 m above the ground."""
ROUNDS = 10
"""Number of iterations of the fit."""
FARTHEST = 300.0
"""Maximum distance of the initial position of an object [m]."""
LEVEL = 0.1
"""Change in road height at an object that requires another iteration [m]."""
LOOKS = 4
"""Maximum number of fits with updated road heights."""
INDISTINCT = 1.0
"""Excess of the squared error up to which the heading of the lane explains an image as well as the best one: one
standard deviation."""
NO_BODY = 4 * 7.0**2
"""Squared error above which no body of the class fills an image box: seven standard deviations at each edge. In 22,000
boxes of the networks on vehicles and pedestrians in view, the largest was 156; a stripe of a crosswalk had 1,700."""
OTHER_CLASS = 4.6
"""Squared error that is added for another class than that of the image detector: one object in ten belongs to it."""
DEGREES_OF_FREEDOM = 2.0
"""Number of edges minus that of the coordinates of a position. A greater squared error means that the edges are less
exact than assumed: the covariance is scaled by the ratio (Birge)."""
LARGEST_VARIANCE = 2500.0
"""Maximum variance of a position along any axis [m²]: a standard deviation of 50 m."""

_OUTWARDS = np.array([-1.0, -1.0, 1.0, 1.0])


def _hull(*quarter: tuple[float, float, float]) -> Array:
    """Return points (4 K, 3) of a symmetric body from those of a quarter of it."""
    signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    return np.array([(a * x, b * y, z) for x, y, z in quarter for a, b in signs])


_BOX = _hull((0.5, 0.5, 0.0), (0.5, 0.5, 1.0))
_CAR = _hull(
    (0.31, 0.45, 0.0), (0.5, 0.42, 0.15), (0.5, 0.42, 0.55), (0.4, 0.49, 0.2), (0.4, 0.49, 0.6), (0.22, 0.32, 1.0)
)
_TALL = _hull((0.35, 0.47, 0.0), (0.5, 0.5, 0.12), (0.5, 0.5, 0.85), (0.47, 0.47, 1.0))
_HULLS = {"car": _CAR, "van": _TALL, "truck": _TALL, "bus": _TALL}
"""Outermost points of bodies, in shares of length, width and height. An image box ends at the tires, the bumpers and
the roof, not at the corners of the box around the body: bumpers end well above the ground and roofs before the ends."""


class ByGround(NamedTuple):
    """Image boxes lifted to the world.

    boxes       (N, 7) in the world frame [m, rad]
    covariance  (N, 2, 2) of their centers [m²]
    headings    (N, HEADINGS) tested headings of the length over half a turn [rad]
    costs       (N, HEADINGS) squared errors of the best fit with each, in standard deviations
    of_named    (N,) minimum squared errors of the class that the detector gave
    """

    boxes: Array
    covariance: Array
    headings: Array
    costs: Array
    of_named: Array

    @property
    def may_be_bodies(self) -> Bools:
        """Whether (N,) a body of the detector's class on the ground fills each image box."""
        return np.asarray(self.of_named <= NO_BODY)


def lift_by_ground(
    boxes: Array, classes: Sequence[str], camera: CameraReading, *, ground: float, surroundings: MapContext
) -> ByGround:
    """Return boxes in the world whose projections fill image boxes (N, 4) [px].

    Each box stands on the ground and has the usual size of its class, or of one that detectors confuse with it. Its
    position is fitted so that the outline of its projection has the edges of the image box: least squares (Levenberg
    and Marquardt) for several headings. The class and heading with the minimum error are selected; a body has the
    heading of the lane if that is as good within one standard deviation. The spread over the other headings adds to the
    covariance. An edge at the border of the image is only a bound: the object continues there. The front points along
    the lane if there is a map, else away from the camera. The height of roads is that of the map, else `ground` [m].
    """
    if not len(boxes):
        empty = np.empty((0, HEADINGS))
        return ByGround(np.empty((0, 7)), np.empty((0, 2, 2)), empty, empty, np.empty(0))
    possible = [possible_classes(name) for name in classes]
    owner = np.repeat(np.arange(len(boxes)), [len(names) for names in possible])
    is_other = np.array([rank > 0 for names in possible for rank in range(len(names))])
    view = _View(np.asarray(boxes, dtype=float)[owner], [name for names in possible for name in names], camera)
    heights = surroundings.ground(view.positions_by_height(), ground)
    for _ in range(LOOKS):
        lifted = view.lift(heights, surroundings)
        new_heights = surroundings.ground(lifted.boxes[:, :2], ground, heights)
        if np.all(np.abs(new_heights - heights) <= LEVEL):
            break
        heights = new_heights
    return _likeliest(lifted, owner, is_other)


def _likeliest(lifted: ByGround, owner: Integers, is_other: Bools) -> ByGround:
    """Return the class with the minimum error for each image box.

    owner     (N,) index of the image box of each row, in ascending order
    is_other  (N,) whether the class is another one than that of the detector
    """
    cost = lifted.of_named + np.where(is_other, OTHER_CLASS, 0.0)
    order = np.lexsort((cost, owner))
    best = order[np.flatnonzero(np.diff(owner[order], prepend=-1))]
    weight = np.exp(-0.5 * (cost - cost[best][owner]))
    weight /= np.bincount(owner, weight)[owner]
    offset = lifted.boxes[:, :2] - lifted.boxes[best][owner, :2]
    covariance = lifted.covariance[best].copy()
    np.add.at(covariance, owner, weight[:, None, None] * offset[:, :, None] * offset[:, None, :])
    of_named = lifted.of_named[~is_other]
    return ByGround(lifted.boxes[best], covariance, lifted.headings[best], lifted.costs[best], of_named)


class _View:
    """Boxes of one image, in the plane at distance 1 from the camera."""

    def __init__(self, boxes: Array, classes: Sequence[str], camera: CameraReading) -> None:
        self._frame, self._turn = level_frame(camera)
        self._edges = straight_boxes(boxes, camera)
        priors = [prior_of(name) for name in classes]
        self._sizes = np.array([prior.mean for prior in priors])
        self._deviations = np.array([prior.deviation for prior in priors])
        hulls = [_HULLS.get(name, _BOX) for name in classes]
        self._visible_edges = edges_in_image(boxes, camera)
        if not self._visible_edges[:, [0, 2]].all():
            # A truncated body has its own outline: points between the two ends of each hull are added.
            shares, mirrored = (0.0, 0.125, 0.25, 0.375, 0.5), np.array([-1.0, 1.0, 1.0])
            hulls = [np.concatenate([hull + share * (hull * mirrored - hull) for share in shares]) for hull in hulls]
        most = max(map(len, hulls))
        self._hulls = np.array([np.resize(hull, (most, 3)) for hull in hulls])
        focal = float(camera.intrinsics[0, 0])
        self._blur = (EDGE_DEVIATION + EDGE_SHARE * largest_sides(boxes)) / focal
        self._cut = ~(self._visible_edges[:, 0] & self._visible_edges[:, 2])
        """Whether the left or right border of the image cuts the object."""
        self._borders = np.where(self._cut[:, None], self._edges[:, [0, 2]], (-np.inf, np.inf))
        self._borders[self._visible_edges[:, 0], 0] = -np.inf
        self._borders[self._visible_edges[:, 2], 1] = np.inf
        self._visible_edges &= ~edges_behind_others(boxes)
        self._lowest = np.where(self._cut, CUT_DEVIATION, 0.0)

    def lift(self, ground: Array, surroundings: MapContext) -> ByGround:
        """Return the boxes in the world for ground heights (N,)."""
        count = len(self._sizes)
        start = self._first_guess(ground)
        lane = surroundings.lane_heading(self._frame.to_world(start), ground) - self._frame.yaw
        on_lane = np.isfinite(lane)
        base = np.where(on_lane, np.nan_to_num(lane), np.arctan2(start[:, 1], start[:, 0]))
        step = np.pi / HEADINGS * np.arange(HEADINGS)
        headings = base[:, None] + step
        deviation = np.minimum(step, np.pi - step) / LANE_DEVIATION
        positions, errors, informations = self._fit(start, headings, ground)
        costs = errors + np.where(on_lane[:, None], deviation**2, 0.0)
        best = np.argmin(costs, axis=1)
        rows = np.arange(count)
        weights = np.exp(-0.5 * (costs - costs[rows, best][:, None]))
        weights /= weights.sum(axis=1, keepdims=True)
        position, information = positions[rows, best], informations[rows, best]
        # The image of a distant body hardly depends on its heading, so that the best one would be random.
        indistinct = on_lane & (costs[:, 0] <= costs[rows, best] + INDISTINCT)
        heading = headings[rows, np.where(indistinct, 0, best)]
        offsets = positions - position[:, None]
        heading_spread = np.einsum("nk,nki,nkj->nij", weights, offsets, offsets)
        along = np.where(on_lane, base, np.arctan2(position[:, 1], position[:, 0]))
        heading = np.where(np.cos(heading - along) < -1e-9, heading + np.pi, heading)
        boxes = np.column_stack([position, ground + self._sizes[:, 2] / 2.0, self._sizes, wrap_angle(heading)])
        scale = np.maximum(errors[rows, best] / DEGREES_OF_FREEDOM, 1.0)
        covariance = self._covariance(information, heading, scale) + heading_spread
        return ByGround(
            self._frame.boxes_to_world(boxes),
            self._frame.covariance_to_world(covariance),
            headings + self._frame.yaw,
            costs,
            costs[rows, best],
        )

    def positions_by_height(self) -> Array:
        """Return positions (N, 2) in the world for objects of usual height, independent of the ground."""
        left, top, right, bottom = self._edges.T
        rays = np.stack([(left + right) / 2.0, (top + bottom) / 2.0, np.ones(len(left))], axis=1) @ self._turn
        return self._frame.to_world(rays[:, :2] * (self._sizes[:, 2] / np.maximum(bottom - top, 1e-6))[:, None])

    def _first_guess(self, ground: Array) -> Array:
        """Return the intersections (N, 2) of the lower edges with the ground, or positions by height."""
        left, top, right, bottom = self._edges.T
        rays = np.stack([(left + right) / 2.0, bottom, np.ones(len(left))], axis=1) @ self._turn
        fall = np.maximum(-rays[:, 2], 1e-9)
        by_ground = (self._frame.height - ground) / fall * np.hypot(rays[:, 0], rays[:, 1])
        by_height = self._sizes[:, 2] / np.maximum(bottom - top, 1e-6)
        usable = self._visible_edges[:, 3] & (-rays[:, 2] > 0.02) & (by_ground > 0.0)
        distance = np.clip(np.where(usable, by_ground, by_height), 1.0, FARTHEST)
        depth = self._sizes[:, :2].min(axis=1) / 2.0
        bearing = np.arctan2(rays[:, 1], rays[:, 0])
        guess: Array = np.stack([np.cos(bearing), np.sin(bearing)], axis=1) * (distance + depth)[:, None]
        return guess

    def _fit(self, start: Array, headings: Array, ground: Array) -> tuple[Array, Array, Array]:
        """Return the best position (N, K, 2) for each heading (N, K), its squared error and information matrix."""
        count, tried = headings.shape
        position = np.repeat(start[:, None], tried, axis=1)
        damping = np.full((count, tried), 1e-3)
        error, gradient, information = self._linearize(position, headings, ground)
        for _ in range(ROUNDS):
            # Levenberg-Marquardt: the damping scales with the diagonal, which has a positive lower bound.
            scaled = information + damping[..., None, None] * np.maximum(information, 1e-9) * np.eye(2)
            step = np.linalg.solve(scaled, gradient[..., None])[..., 0]
            longest = 0.3 * np.linalg.norm(position, axis=-1) + 0.5
            length = np.maximum(np.linalg.norm(step, axis=-1), 1e-12)
            moved = position + step * np.minimum(1.0, longest / length)[..., None]
            new_error, new_gradient, new_information = self._linearize(moved, headings, ground)
            better = new_error < error
            position = np.where(better[..., None], moved, position)
            error = np.where(better, new_error, error)
            gradient = np.where(better[..., None], new_gradient, gradient)
            information = np.where(better[..., None, None], new_information, information)
            damping = np.clip(np.where(better, damping * 0.2, damping * 8.0), 1e-9, 1e6)
        return position, error, information

    def _linearize(self, position: Array, headings: Array, ground: Array) -> tuple[Array, Array, Array]:
        """Return squared error, its negative half gradient and its Gauss-Newton matrix at positions (N, K, 2)."""
        nudge = 0.01
        tried = position + nudge * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])[:, None, None]
        edges, depth = self._project(tried, headings, ground)
        off = self._edges[:, None] - edges[0]
        beyond = ~self._visible_edges[:, None] & (off * _OUTWARDS < 0.0)
        weight = np.where(beyond, 0.0, self._weights(depth[0]))
        residual = off * weight
        slope = (edges[1:] - edges[0]) / nudge * weight
        gradient = np.einsum("anke,nke->nka", slope, residual)
        information = np.einsum("anke,bnke->nkab", slope, slope)
        return np.einsum("nke,nke->nk", residual, residual), gradient, information

    def _project(self, positions: Array, headings: Array, ground: Array) -> tuple[Array, Array]:
        """Return edges (3, N, K, 4) of the projections, and depths (3, N, K) of the centers."""
        corners = self._hulls * self._sizes[:, None]
        corners[..., 2] = corners[..., 2] + ground[:, None] - self._frame.height
        edges, depth = np.empty((*positions.shape[:3], 4)), np.empty(positions.shape[:3])
        turn, borders = np.ascontiguousarray(self._turn), np.ascontiguousarray(self._borders)
        _find_edges(
            corners, np.cos(headings), np.sin(headings), positions, turn, NEAREST, self._cut, borders, edges, depth
        )
        return edges, depth

    def _weights(self, depth: Array) -> Array:
        """Return the inverse standard deviation (N, K, 4) of each edge, from the box and the prior size."""
        across = self._deviations[:, 1, None] / 2.0 / depth
        upwards = self._deviations[:, 2, None] / depth
        blur = np.hypot(self._blur[:, None], SHAPE_DEVIATION / depth)
        sides = 1.0 / np.hypot(blur, across)
        lowest = np.hypot(blur, self._lowest[:, None] / depth)
        return np.stack([sides, 1.0 / np.hypot(blur, upwards), sides, 1.0 / lowest], axis=-1)

    def _covariance(self, information: Array, heading: Array, scale: Array) -> Array:
        """Return covariances (N, 2, 2) of the centers: of the fit, scaled by `scale` (N,), and of the half length and
        width that are not visible."""
        values, vectors = np.linalg.eigh(information)
        variances = np.minimum(1.0 / np.maximum(values, 1.0 / LARGEST_VARIANCE), LARGEST_VARIANCE)
        fit = np.einsum("nij,nj,nkj->nik", vectors, variances, vectors)
        cos, sin = np.cos(heading), np.sin(heading)
        axes = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
        sizes = (self._deviations[:, :2] / 2.0) ** 2
        return np.asarray(scale[:, None, None] * fit + np.einsum("nij,nj,nkj->nik", axes, sizes, axes))


@kernel(
    "void(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,:,::1], f8[:,::1], f8, b1[::1], f8[:,::1], f8[:,:,:,::1],"
    "f8[:,:,::1])"
)
def _find_edges(
    corners: Array, cos: Array, sin: Array, positions: Array, turn: Array, nearest: float, cut: Bools, borders: Array,
    edges: Array, depth: Array,
) -> None:  # fmt: skip
    """Find left, top, right, bottom of the projections of hulls (N, P, 3).

    positions     (T, N, K, 2) of the hulls at headings (N, K)
    cut, borders  (N,) and (N, 2) whether and where the left and right border of the image cut an object: parts outside
                  show neither top nor bottom, if others are within the image
    depth         (T, N, K) mean of the points, of which P is a multiple of eight
    """
    trials, count, headings, _ = positions.shape
    partial = np.empty(8)
    for trial in range(trials):
        for hull in range(count):
            for heading in range(headings):
                px, py = positions[trial, hull, heading, 0], positions[trial, hull, heading, 1]
                c, s = cos[hull, heading], sin[hull, heading]
                left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
                visible_top, visible_bottom = np.inf, -np.inf
                partial[:] = 0.0
                for point in range(corners.shape[1]):
                    x = c * corners[hull, point, 0] - s * corners[hull, point, 1] + px
                    y = s * corners[hull, point, 0] + c * corners[hull, point, 1] + py
                    z = corners[hull, point, 2]
                    ahead = max(turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z, nearest)
                    u = (turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z) / ahead
                    v = (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z) / ahead
                    left, top, right, bottom = min(left, u), min(top, v), max(right, u), max(bottom, v)
                    if cut[hull] and borders[hull, 0] <= u <= borders[hull, 1]:
                        visible_top, visible_bottom = min(visible_top, v), max(visible_bottom, v)
                    partial[point % 8] += ahead
                if visible_top <= visible_bottom:
                    top, bottom = visible_top, visible_bottom
                edges[trial, hull, heading, 0], edges[trial, hull, heading, 1] = left, top
                edges[trial, hull, heading, 2], edges[trial, hull, heading, 3] = right, bottom
                # The order in which numpy adds, for which equal terms have equal sums
                total = ((partial[0] + partial[1]) + (partial[2] + partial[3])) + (
                    (partial[4] + partial[5]) + (partial[6] + partial[7])
                )
                depth[trial, hull, heading] = total / corners.shape[1]
