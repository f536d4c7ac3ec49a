"""Observations: spaces, and conversion of perceptions."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.planning.path import PathPart
from eidrive_scenario.driving.step import StationPerception
from eidrive_scenario.gym.libraries import spaces
from eidrive_scenario.gym.object_table import MAX_AGE, MAX_SPEED, column_bounds, object_values
from eidrive_scenario.gym.observation_settings import ObservationSettings, RouteSettings, TableSettings
from eidrive_scenario.gym.occupancy_grid import grid_bounds, occupancy_grid
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import Control

EGO_COLUMNS = (
    "speed", "acceleration", "yaw_rate", "requested_speed", "request_known", "throttle", "brake", "steering",
)  # fmt: skip
"""Entries of the part `ego`: SI units; the control is that of the last step."""
_EGO_HIGH = np.array([MAX_SPEED, 20.0, math.pi, MAX_SPEED, 1.0, 1.0, 1.0, math.pi / 2.0])
_EGO_LOW = np.array([-MAX_SPEED, -20.0, -math.pi, 0.0, 0.0, 0.0, 0.0, -math.pi / 2.0])
ROUTE_COLUMNS = ("known", "x", "y")
"""Columns of the part `route`: whether the route has this point, and its position in the frame of the vehicle [m]."""
SENDER_COLUMNS = ("known", "age")
"""Columns of the part `senders`: whether a message was received, and the age of the newest one [s]."""

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
        scales, lows, highs, start = [], [], [], 0
        for name, (encode, low, high) in sorted(self._selected().items()):
            scale = high if settings.normalized else np.ones_like(high)
            low32, high32 = (low / scale).astype(np.float32), (high / scale).astype(np.float32)
            parts[name] = spaces.Box(low32, high32, dtype=np.float32)
            self._parts[name] = encode, slice(start, start + high.size), high.shape
            start += high.size
            scales.append(scale.ravel())
            lows.append(low32.ravel())
            highs.append(high32.ravel())
        self._scale = np.concatenate([*scales, []])
        self._low, self._high = (np.concatenate([*each, []], dtype=np.float32) for each in (lows, highs))
        space = spaces.Dict(parts)
        self.space: spaces.Space[Any] = spaces.flatten_space(space) if settings.flat else space

    def _selected(self) -> Mapping[str, tuple[Part, Array, Array]]:
        """Return conversion, lower and upper bounds in SI units of the selected parts."""
        settings = self.settings
        found: dict[str, tuple[Part, Array, Array]] = {}
        if settings.ego:
            found["ego"] = self._ego, _EGO_LOW, _EGO_HIGH
        if settings.route is not None:
            reach = settings.route.length + 10.0
            high = np.tile([1.0, reach, reach], (settings.route.points, 1))
            found["route"] = self._route_ahead, high * [0.0, -1.0, -1.0], high
        for name, table in (("tracks", settings.tracks), ("own", settings.own)):
            if table is not None:
                low, high = (np.tile(bound, (table.count, 1)) for bound in column_bounds(table.range))
                found[name] = self._table_part(name, table), low, high
        if settings.senders:
            high = np.tile([1.0, MAX_AGE], (len(self._senders), 1))
            found["senders"] = self._ages, np.zeros_like(high), high
        if settings.grid is not None:
            found["grid"] = self._grid, *grid_bounds(settings.grid)
        return found

    @property
    def needs_route(self) -> bool:
        """Whether the observation contains the route."""
        return self.settings.route is not None or self.settings.grid is not None

    def reset(self) -> None:
        """Begin an episode."""
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
        for encode, place, _ in self._parts.values():
            first = encode(perceived)
            values[place.start : place.start + len(first)] = first
        values /= self._scale
        found = values.astype(np.float32)
        np.maximum(found, self._low, out=found)
        np.minimum(found, self._high, out=found)
        return self._in_parts(found)

    def zeros(self) -> Any:
        """Return the observation of a station that is not present."""
        return self._in_parts(np.zeros(len(self._scale), np.float32))

    def _in_parts(self, values: NDArray[np.float32]) -> Any:
        """Return values as the space has them; flat ones are in the order of the parts already."""
        if self.settings.flat:
            return values
        return {name: values[place].reshape(shape) for name, (_, place, shape) in self._parts.items()}

    def _ego(self, perceived: StationPerception) -> Sequence[float]:
        ego, control = perceived.ego, self._control
        requested = None if perceived.goal is None else perceived.goal.speed
        request = (0.0, 0.0) if requested is None else (requested, 1.0)
        driven = control.throttle, control.brake, control.steering
        return (ego.speed, ego.acceleration, ego.yaw_rate, *request, *driven)

    def _route_ahead(self, perceived: StationPerception) -> Sequence[float]:
        assert self.settings.route is not None
        return () if self._route is None else points_ahead(self._route, perceived.ego, self.settings.route)

    def _table_part(self, name: str, table: TableSettings) -> Part:
        def encode(perceived: StationPerception) -> Sequence[float] | Array:
            objects = perceived.fused if name == "tracks" else perceived.detections
            return object_values(objects, perceived.ego, perceived.time, count=table.count, reach=table.range)

        return encode

    def _ages(self, perceived: StationPerception) -> Sequence[float]:
        newest = [self._newest.get(sender) for sender in self._senders]
        rows = [(0.0, 0.0) if time is None else (1.0, max(perceived.time - time, 0.0)) for time in newest]
        return [value for row in rows for value in row]

    def _grid(self, perceived: StationPerception) -> NDArray[Any]:
        assert self.settings.grid is not None
        ego = perceived.ego
        points = np.empty((0, 2)) if self._route is None else _in_frame(self._route.points, ego)
        return occupancy_grid(perceived.fused, points, ego, self.settings.grid).ravel()


def _in_frame(points: Array, ego: EgoState) -> Array:
    """Return points (M, 2) of the world frame in the frame of the vehicle."""
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    local: Array = (points - ego.position[:2]) @ np.array([[cos, -sin], [sin, cos]])
    return local


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
    found: list[float] = []
    for number in range(1, settings.points + 1):
        wanted = start + number * settings.spacing
        if wanted > along[-1]:
            break
        index = bisect_left(along, wanted, 1) - 1
        x, y, dx, dy, square = segments[index]
        share = (wanted - along[index]) / math.sqrt(square)
        ahead_x, ahead_y = x + share * dx - own_x, y + share * dy - own_y
        found += 1.0, cos * ahead_x + sin * ahead_y, cos * ahead_y - sin * ahead_x
    return found
