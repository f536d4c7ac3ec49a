"""Parts of scenarios: a straight street, positions on it, actions of its cars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from opendrive_xml import lane_links_xml, lane_xml, lanes_xml, map_xml, road_xml, section_xml
from openscenario_xml import controller_xml
from storyboard_xml import (
    condition_xml,
    event_xml,
    group_xml,
    lane_position_xml,
    maneuver_xml,
    private_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

AGENT = controller_xml({"module": "eidrive", "planner": "route"}, attributes='controllerType="movement"')
LANES = lanes_xml(1, 2, 4)
NOTHING = private_xml('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
"""Action without effect."""


def street(lanes: str = LANES, *, profiles: str = "", extra: str = "") -> str:
    """Return a street of 1000 m along x, by default with lanes of 4 m: 1, -1 and -2; see `road_xml`."""
    return map_xml(road_xml(length=1000.0, lanes=lanes, profiles=profiles, extra=extra))


STREET = street()
OPENING = street(
    section_xml(
        lane_xml(1, 4, link=lane_links_xml(after=1)),
        lane_xml(-1, 4, link=lane_links_xml(after=-2)) + lane_xml(-2, 4, link=lane_links_xml(after=-3)),
    )
    + section_xml(
        lane_xml(1, 4, link=lane_links_xml(before=1)),
        lane_xml(-1, 4) + lane_xml(-2, 4, link=lane_links_xml(-1)) + lane_xml(-3, 4, link=lane_links_xml(-2)),
        s=200.0,
    )
)
"""Street on which a new lane -1 begins at s = 200, and lanes -1 and -2 continue as -2 and -3, 4 m to the right."""
THROUGH = lane_links_xml(-1, -1)
"""Links of lane -1 to the lanes -1 before and after it."""


def at(lane: int, s: float, speed: float) -> str:
    """Return Init actions: position in a lane (-1: y = -2, -2: y = -6, 1: y = 2 towards -x) and speed."""
    return teleport_xml(lane_position_xml(lane, s)) + speed_xml(speed)


def after(time: float) -> str:
    """Return a condition on the simulation time: later than `time` [s]."""
    return time_xml(time)


def groups_of(
    steps: Sequence[tuple[str, ...]], *, edge: str = "none", delay: float = 0.0, count: int = 1, selecting: bool = False
) -> str:
    """Return a maneuver group for each step (actor, action[, condition]): "group 0" with "event 0" and "action 0".

    `count` is the maximum execution count of the events. With `selecting` the triggering entities act too.
    """
    groups = ""
    for number, (actor, action, *condition) in enumerate(steps):
        trigger = trigger_xml(condition_xml(condition[0], edge, delay)) if condition else ""
        event = event_xml(f"event {number}", action, trigger, action_name=f"action {number}", count=count)
        maneuver = maneuver_xml(event, f"maneuver {number}")
        groups += group_xml(maneuver, actor, name=f"group {number}", triggering=selecting)
    return groups


def lane_road(
    number: int, x: float, y: float, hdg: float, length: float, link: str, lane_links: str = "", **more: Any
) -> str:
    """Return a road with lane -1 of 4 m."""
    lanes = section_xml(right=lane_xml(-1, 4, link=lane_links))
    return road_xml(str(number), x=x, y=y, hdg=hdg, length=length, link=link, lanes=lanes, **more)
