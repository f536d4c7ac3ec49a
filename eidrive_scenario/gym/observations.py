"""Observations of a station: the space of its parts, tables of objects, and the occupancy grid."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.base.geometry import footprint, rotation
from eidrive_scenario.driving.planning.path import PathPart
from eidrive_scenario.driving.step import StationPerception
from eidrive_scenario.gym.libraries import spaces
from eidrive_scenario.gym.settings import GridSettings, ObservationSettings, RouteSettings, TableSettings
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import Control

MAX_SPEED = 70.0
"""Bound of speeds in observations [m/s]."""
MAX_SIZE = 30.0
"""Bound of lengths and widths of objects [m]."""
MAX_DEVIATION = 10.0
"""Bound of standard deviations of positions [m]."""
MAX_AGE = 10.0
"""Bound of ages [s]."""

COLUMNS = (
    "present", "x", "y", "velocity_x", "velocity_y", "velocity_known", "length", "width", "cos", "sin", "existence",
    "deviation_x", "deviation_y", "covariance_known", "age", *CLASSES,
)  # fmt: skip
"""Columns of the table. Positions [m], velocities over ground [m/s] and headings are in the axes of the vehicle."""
_SIGNED = ("x", "y", "velocity_x", "velocity_y", "cos", "sin")
_CLASS_COLUMNS = {name: [float(name == other) for other in CLASSES] for name in CLASSES}


def column_bounds(reach: float) -> tuple[Array, Array]:
    """Return lower and upper bounds of the columns in SI units for objects within `reach` [m]."""
    bounds = {
        "x": reach, "y": reach, "velocity_x": MAX_SPEED, "velocity_y": MAX_SPEED, "length": MAX_SIZE, "width": MAX_SIZE,
        "deviation_x": MAX_DEVIATION, "deviation_y": MAX_DEVIATION, "age": MAX_AGE,
    }  # fmt: skip
    high = np.array([bounds.get(name, 1.0) for name in COLUMNS])
    low = np.where([name in _SIGNED for name in COLUMNS], -high, 0.0)
    return low, high


def nearest_rows(objects: Detections, ego: EgoState, reach: float = math.inf) -> list[int]:
    """Return the rows of the objects within `reach` [m], nearest first; equal distances in the order of the rows."""
    x, y, _ = ego.position.tolist()
    distances = [math.hypot(box[0] - x, box[1] - y) for box in objects.boxes.tolist()]
    return sorted([row for row, distance in enumerate(distances) if distance <= reach], key=distances.__getitem__)


def object_values(objects: Detections, ego: EgoState, now: float, *, count: int, reach: float) -> list[float]:
    """Return the values of the table of the nearest objects in SI units, row by row; at most `count` rows."""
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    own_x, own_y, _ = ego.position.tolist()
    boxes, velocities = objects.boxes.tolist(), objects.velocity.tolist()
    covariances, confidence = objects.covariance.tolist(), objects.confidence.tolist()
    age = max(now - objects.time, 0.0)
    values: list[float] = []
    for row in nearest_rows(objects, ego, reach)[:count]:
        x, y, _, length, width, _, yaw = boxes[row]
        dx, dy = x - own_x, y - own_y
        vx, vy = velocities[row]
        moves = math.isfinite(vx) and math.isfinite(vy)
        if not moves:
            vx = vy = 0.0
        (xx, xy), (yx, yy) = covariances[row]
        certain = math.isfinite(xx + xy + yx + yy)
        ahead = aside = 0.0
        if certain:
            ahead = cos * cos * xx + cos * sin * (xy + yx) + sin * sin * yy
            aside = sin * sin * xx - sin * cos * (xy + yx) + cos * cos * yy
        heading = yaw - ego.yaw
        values += [
            1.0,
            dx * cos + dy * sin,
            dy * cos - dx * sin,
            vx * cos + vy * sin + 0.0,  # adding 0 replaces -0 at rest
            vy * cos - vx * sin + 0.0,
            float(moves),
            length,
            width,
            math.cos(heading),
            math.sin(heading),
            confidence[row],
            math.sqrt(max(ahead, 0.0)),
            math.sqrt(max(aside, 0.0)),
            float(certain),
            age,
            *_CLASS_COLUMNS[objects.classes[row]],
        ]
    return values


CHANNELS = ("existence", "velocity_x", "velocity_y", "route")
"""Channels of the grid: probability of existence, velocity over ground in the axes of the vehicle [m/s], route."""
ROUTE_WIDTH = 3.5
"""Width of the route in the grid [m]: a lane."""
_FRACTION_BITS = 4
"""Binary places of the coordinates of polygons."""


def grid_bounds(settings: GridSettings) -> tuple[Array, Array]:
    """Return lower and upper bounds of the grid in SI units, each (4, length, width)."""
    high = np.ones((len(CHANNELS), settings.length, settings.width))
    high[1:3] = MAX_SPEED
    low = np.zeros_like(high)
    low[1:3] = -MAX_SPEED
    return low, high


def occupancy_grid(objects: Detections, route: Array, ego: EgoState, settings: GridSettings) -> NDArray[Any]:
    """Return the grid (4, length, width) in SI units.

    Cell (i, j) has its center at x = (i + 0.5) resolution - behind ahead of the reference point, and at
    y = (j + 0.5 - width / 2) resolution to its left. Of overlapping objects the nearest one is drawn.

    route  points (P, 2) in the frame of the vehicle [m]
    """
    grid = np.zeros((len(CHANNELS), settings.length, settings.width), np.float32)
    axes = rotation(ego.yaw)
    corners_of_all = footprint(objects.boxes)
    for row in reversed(nearest_rows(objects, ego)):
        corners = (corners_of_all[row] - ego.position[:2]) @ axes
        polygon = _pixels(corners, settings)
        velocity = np.nan_to_num(objects.velocity[row] @ axes)
        values = (float(objects.confidence[row]), *velocity.tolist())
        for channel, value in enumerate(values):
            cv2.fillConvexPoly(grid[channel], polygon, value, shift=_FRACTION_BITS)
    if len(route) > 1:
        thickness = max(1, round(ROUTE_WIDTH / settings.resolution))
        cv2.polylines(grid[3], [_pixels(route, settings)], False, 1.0, thickness, shift=_FRACTION_BITS)
    return grid


def _pixels(points: Array, settings: GridSettings) -> NDArray[Any]:
    """Return points (N, 2) in the frame of the vehicle as fixed-point pixels, column before row."""
    row = (points[:, 0] + settings.behind) / settings.resolution - 0.5
    column = points[:, 1] / settings.resolution + settings.width / 2.0 - 0.5
    scaled = np.stack([column, row], axis=1) * 2.0**_FRACTION_BITS
    return np.rint(np.clip(scaled, -1e6, 1e6)).astype(np.int32)


_EGO_HIGH = np.array([MAX_SPEED, 20.0, math.pi, MAX_SPEED, 1.0, 1.0, 1.0, math.pi / 2.0])
_EGO_LOW = np.array([-MAX_SPEED, -20.0, -math.pi, 0.0, 0.0, 0.0, 0.0, -math.pi / 2.0])
"""Bounds of the part `ego` in SI units: speed, acceleration, yaw rate, requested speed, whether there is one, and
throttle, brake and steering of the last step."""

Part = Callable[[StationPerception], Sequence[float] | NDArray[Any]]
"""Conversion that returns the first values of a part, in one dimension; the others are 0."""


class ObservationEncoder:
    """Observations of one station: their space, and their conversion.

    senders  names of the other stations, in the order of the part `senders`

    All values are float32 and within the bounds of the space: larger ones are clipped.
    """

    def __init__(self, settings: ObservationSettings, senders: Sequence[str]) -> None:
        self.settings = settings
        self._senders = senders
        self._newest: dict[str, float] = {}
        self._route: PathPart | None = None
        self._control = Control()
        self._parts: dict[str, tuple[Part, slice, tuple[int, ...]]] = {}
        """Conversion, place among all values, and shape of each part."""
        parts: dict[str, spaces.Space[Any]] = {}
        scales, start = [], 0
        for name, (encode, low, high) in sorted(self._selected().items()):
            scale = high if settings.normalized else np.ones_like(high)
            parts[name] = spaces.Box((low / scale).astype(np.float32), (high / scale).astype(np.float32))
            self._parts[name] = encode, slice(start, start + high.size), high.shape
            start += high.size
            scales.append(scale.ravel())
        self._scale = np.concatenate([*scales, []])
        space = spaces.Dict(parts)
        bounds = spaces.flatten_space(space)
        assert isinstance(bounds, spaces.Box)
        self._low, self._high = bounds.low, bounds.high
        self.space: spaces.Space[Any] = bounds if settings.flat else space

    def _selected(self) -> Mapping[str, tuple[Part, Array, Array]]:
        """Return conversion, lower and upper bounds in SI units of the selected parts."""
        settings = self.settings
        parts: dict[str, tuple[Part, Array, Array]] = {}
        if settings.ego:
            parts["ego"] = self._ego, _EGO_LOW, _EGO_HIGH
        if settings.route is not None:
            reach = settings.route.length + 10.0
            high = np.tile([1.0, reach, reach], (settings.route.points, 1))
            parts["route"] = partial(self._route_ahead, settings.route), high * [0.0, -1.0, -1.0], high
        for name, table in (("tracks", settings.tracks), ("own", settings.own)):
            if table is not None:
                low, high = (np.tile(bound, (table.count, 1)) for bound in column_bounds(table.range))
                parts[name] = partial(self._table, table, name == "tracks"), low, high
        if settings.senders:
            high = np.tile([1.0, MAX_AGE], (len(self._senders), 1))
            parts["senders"] = self._ages, np.zeros_like(high), high
        if settings.grid is not None:
            parts["grid"] = partial(self._grid, settings.grid), *grid_bounds(settings.grid)
        return parts

    @property
    def needs_route(self) -> bool:
        """Whether the observation contains the route."""
        return self.settings.route is not None or self.settings.grid is not None

    def reset(self) -> None:
        """Forget all received messages."""
        self._newest = {}

    def receive(self, perceived: StationPerception) -> None:
        """Register the received messages of a tick."""
        for received in perceived.inbox:
            sender, time = received.message.sender, received.message.state.time
            self._newest[sender] = max(time, self._newest.get(sender, -math.inf))

    def encode(self, perceived: StationPerception, route: PathPart | None, control: Control | None) -> Any:
        """Return the observation.

        route    route ahead in the world frame; None if there is none
        control  control of the last step; None if there is none
        """
        self._route, self._control = route, control or Control()
        values = np.zeros(len(self._scale))
        for encode, span, _ in self._parts.values():
            first = encode(perceived)
            values[span.start : span.start + len(first)] = first
        values /= self._scale
        observation = values.astype(np.float32)
        np.maximum(observation, self._low, out=observation)
        np.minimum(observation, self._high, out=observation)
        return self._in_parts(observation)

    def zeros(self) -> Any:
        """Return the observation of a station that is not present."""
        return self._in_parts(np.zeros(len(self._scale), np.float32))

    def _in_parts(self, values: NDArray[np.float32]) -> Any:
        """Return values as the space has them; flat ones are in the order of the parts already."""
        if self.settings.flat:
            return values
        return {name: values[span].reshape(shape) for name, (_, span, shape) in self._parts.items()}

    def _ego(self, perceived: StationPerception) -> Sequence[float]:
        ego, control = perceived.ego, self._control
        requested = None if perceived.goal is None else perceived.goal.speed
        request = (0.0, 0.0) if requested is None else (requested, 1.0)
        driven = control.throttle, control.brake, control.steering
        return (ego.speed, ego.acceleration, ego.yaw_rate, *request, *driven)

    def _route_ahead(self, settings: RouteSettings, perceived: StationPerception) -> Sequence[float]:
        return () if self._route is None else points_ahead(self._route, perceived.ego, settings)

    @staticmethod
    def _table(table: TableSettings, fused: bool, perceived: StationPerception) -> Sequence[float]:
        objects = perceived.fused if fused else perceived.detections
        return object_values(objects, perceived.ego, perceived.time, count=table.count, reach=table.range)

    def _ages(self, perceived: StationPerception) -> Sequence[float]:
        newest = [self._newest.get(sender) for sender in self._senders]
        rows = [(0.0, 0.0) if time is None else (1.0, max(perceived.time - time, 0.0)) for time in newest]
        return [value for row in rows for value in row]

    def _grid(self, settings: GridSettings, perceived: StationPerception) -> NDArray[Any]:
        ego = perceived.ego
        route = self._route
        points = np.empty((0, 2)) if route is None else (route.points - ego.position[:2]) @ rotation(ego.yaw)
        return occupancy_grid(perceived.fused, points, ego, settings).ravel()


def points_ahead(route: PathPart, ego: EgoState, settings: RouteSettings) -> list[float]:
    """Return known, x and y of points at multiples of the spacing along the route from its point at the vehicle.

    Points beyond the end of the route are omitted.
    """
    own_x, own_y, _ = ego.position.tolist()
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    segments, along = route.segments, route.along
    x, y, dx, dy, square = segments[0]
    share = ((own_x - x) * dx + (own_y - y) * dy) / square
    start = along[0] + min(max(share, 0.0), 1.0) * (along[1] - along[0])
    points: list[float] = []
    for number in range(1, settings.points + 1):
        wanted = start + number * settings.spacing
        if wanted > along[-1]:
            break
        index = bisect_left(along, wanted, 1) - 1
        x, y, dx, dy, square = segments[index]
        share = (wanted - along[index]) / math.sqrt(square)
        ahead_x, ahead_y = x + share * dx - own_x, y + share * dy - own_y
        points += 1.0, cos * ahead_x + sin * ahead_y, cos * ahead_y - sin * ahead_x
    return points
