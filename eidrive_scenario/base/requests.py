"""Requests of a scenario to a driven vehicle: goals, and overrides of its controls.

The storyboard creates them, the driving stack executes them; neither imports the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import msgspec

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import aligned_distances

LONGEST_WAY = 200_000.0
"""Maximum length of a way to a destination [m]: a planner may have a point for each meter."""
ASTRAY = 10.0
"""Distance from a route above which a vehicle was teleported off it, or left it by another action [m]: more than
maneuvers beside the route require, as overtaking in the next lanes."""


class Goal(msgspec.Struct, frozen=True):
    """Goal of a driven vehicle that the storyboard sets; for None the settings of the agent apply.

    speed         current target speed [m/s]
    acceleration  rate of change of the target speed [m/s²]
    path          (M, 3) points of the line to follow to its end [m], world frame
    lap           (M, 3) points that follow the end of the path, repeatedly [m]; its end is its start
    waypoints     (M, 3) points to pass if there is no path; the last is the destination [m]; the agent plans the route
    is_route      whether the path is a route, whose lane changes the agent may make elsewhere in the same lanes
    """

    speed: float | None = None
    acceleration: float = 0.0
    path: Array | None = None
    waypoints: Array | None = None
    lap: Array | None = None
    is_route: bool = False

    @property
    def follows_route(self) -> bool:
        """Whether the way is a route: that of the path, or the one that the agent plans."""
        return self.is_route or (self.path is None and self.waypoints is not None)

    def leads_along(self, x: float, y: float, heading: float) -> bool:
        """Return whether the path or the lap leads along a heading [rad] within ASTRAY of a position [m]."""
        lines = [line for line in (self.path, self.lap) if line is not None]
        return any((aligned_distances(line, x, y, heading) <= ASTRAY).any() for line in lines)


@dataclass(frozen=True)
class Override:
    """Override of a pedal, the steering wheel or the gear by a constant value.

    control   throttle, brake, clutch, parkingBrake, steeringWheel or gear
    value     pedal position in [0, 1], steering wheel angle, left positive [rad], or number of the gear
    active    False ends the override
    max_rate  maximum rate of change towards the value [1/s, rad/s]; None for an immediate change
    newton    True for a brake whose value is a force [N], and its rate [N/s]
    parked    True for the position P of an automatic transmission
    """

    control: str
    value: float
    active: bool = True
    max_rate: float | None = None
    newton: bool = False
    parked: bool = False


Overrides: TypeAlias = Mapping[str, Override]
"""Overrides of one vehicle, by control."""
