"""Settings of observations."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from eidrive_scenario.driving.planning.path import SPACING
from eidrive_scenario.driving.planning.route_planner import HORIZON
from eidrive_scenario.settings import Settings

LONGEST_ROUTE = (HORIZON - 1) * SPACING
"""Maximum distance of a point of the route [m]: the length of a plan of the route planner."""


class TableSettings(Settings):
    """Table of the nearest objects: `count` rows; objects farther than `range` [m] are omitted."""

    count: Annotated[int, Field(ge=1, le=256)] = 16
    range: Annotated[float, Field(gt=0.0, le=1e4)] = 100.0


class RouteSettings(Settings):
    """Points on the route ahead of the vehicle, `spacing` apart [m]."""

    points: Annotated[int, Field(ge=1, le=59)] = 10
    spacing: Annotated[float, Field(gt=0.0, le=LONGEST_ROUTE)] = 5.0

    @model_validator(mode="after")
    def _within_the_plan(self) -> Self:
        if self.length > LONGEST_ROUTE:
            raise ValueError(f"points x spacing is above {LONGEST_ROUTE:g} m (got {self.length:g} m)")
        return self

    @property
    def length(self) -> float:
        """Distance of the last point along the route [m]."""
        return self.points * self.spacing


class GridSettings(Settings):
    """Occupancy grid in the frame of the vehicle.

    length, width  numbers of cells along and across the vehicle
    resolution     edge length of a cell [m]
    behind         distance of the rear edge of the grid behind the reference point [m]
    """

    length: Annotated[int, Field(ge=4, le=1024)] = 64
    width: Annotated[int, Field(ge=4, le=1024)] = 64
    resolution: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    behind: Annotated[float, Field(ge=0.0, le=1e4)] = 16.0


def _part(value: Any) -> Any:
    """Return the settings of a part; True selects the defaults, False omits the part."""
    if value is True:
        return {}
    return None if value is False else value


class ObservationSettings(Settings):
    """Parts of an observation, each a key of a `Dict` space.

    ego         motion of the vehicle, request of the scenario, last control
    route       points on the route ahead
    tracks      fused objects
    own         objects that the own sensors detect
    senders     age of the newest message of each other station
    grid        occupancy grid of fused objects and route
    normalized  whether values are divided by their bounds; else they are in SI units
    flat        whether the observation is one vector: all parts in alphabetical order
    """

    ego: bool = True
    route: Annotated[RouteSettings | None, BeforeValidator(_part)] = RouteSettings()
    tracks: Annotated[TableSettings | None, BeforeValidator(_part)] = TableSettings()
    own: Annotated[TableSettings | None, BeforeValidator(_part)] = None
    senders: bool = False
    grid: Annotated[GridSettings | None, BeforeValidator(_part)] = None
    normalized: bool = True
    flat: bool = False

    @model_validator(mode="after")
    def _has_a_part(self) -> Self:
        if not (self.ego or self.senders or self.route or self.tracks or self.own or self.grid):
            raise ValueError("the observation has no part; select one of ego, route, tracks, own, senders, grid")
        return self
