"""Right-angled crossings of two straight streets.

Connecting roads follow lane centers: straight for every lane, right from the outermost lane, left from the innermost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from xosc.roads.layout import Arm, Control, Junction, Layout, Road, Street, Way, movement

CORNER_CLEARANCE = 14.0
"""Distance of houses from the junction [m]."""
OPPOSITE_PAIRS = (("1", "2"), ("3", "4"))
"""Roads whose lights are green together."""


@dataclass(frozen=True)
class Crossing:
    """Street of the ego along x with lane 0 at y = `y`, and a street along y with lane 0 at x = `x`.

    box        ends of the arms at the junction: near x, far x, right y, left y
    reach      outer ends of the arms, in that order
    control    of each arm
    line       distance of the signals from the junction
    crosswalk  whether crosswalks are between stop lines and junction
    houses     distance of the rows of houses from the junction; None for no houses
    """

    name: str
    ego_street: Street
    cross_street: Street
    y: float
    x: float
    box: tuple[float, float, float, float]
    reach: tuple[float, float, float, float]
    control: Control
    line: float = 4.4
    crosswalk: bool = True
    houses: float | None = CORNER_CLEARANCE

    def arms(self) -> tuple[Arm, Arm, Arm, Arm]:
        """Return the arms: near, far, left and right of the ego."""
        near, far, right, left = self.box
        near_end, far_end, right_end, left_end = self.reach
        quarter = math.pi / 2
        e, c = self.ego_street, self.cross_street
        roads = (
            Road.straight("1", "near", e, near_end, self.y, 0.0, near - near_end, houses=self.houses),
            Road.straight("2", "far", e, far, self.y, 0.0, far_end - far, houses=self.houses),
            Road.straight("3", "left", c, self.x, left, quarter, left_end - left, houses=self.houses),
            Road.straight("4", "right", c, self.x, right_end, quarter, right - right_end, houses=self.houses),
        )
        contacts = ("end", "start", "start", "end")
        first, second, third, fourth = (
            Arm(road, "end" if contact == "end" else "start", self.control, self.line, self.crosswalk)
            for road, contact in zip(roads, contacts, strict=True)
        )
        return first, second, third, fourth

    def layout(self) -> Layout:
        """Return the road network."""
        arms = self.arms()
        near_end, far_end, right_end, left_end = self.reach
        phases = OPPOSITE_PAIRS if self.control == "light" else ()
        junction = Junction("100", self.name, arms, tuple(all_movements(*arms)), phases)
        roads = tuple(arm.road for arm in arms)
        return Layout(self.name, roads, (junction,), (near_end, right_end, far_end, left_end))


def all_movements(near: Arm, far: Arm, left: Arm, right: Arm) -> Iterator[Way]:
    """Yield all movements of a four-way junction."""
    neighbors = ((near, far, right, left), (far, near, left, right), (left, right, near, far), (right, left, far, near))
    for arm, ahead, to_right, to_left in neighbors:
        for turn, other in (("ahead", ahead), ("right", to_right), ("left", to_left)):
            yield movement(arm, other, turn)
