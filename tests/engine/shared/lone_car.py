"""Scenario of a car with round numbers alone on a straight road, whose speed no action requests."""

from __future__ import annotations

from openscenario_xml import agent_xml, road_file_xml, round_car_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, teleport_xml


def lone_car(seconds: float = 6.0, **properties: object) -> bytes:
    """Return the file: the car Ego stands at the start of a straight road; the run ends after some seconds."""
    return scenario_xml(
        road=road_file_xml("eidrive_library/roads/two_lane_road.xodr"),
        entities=round_car_xml("Ego", agent_xml(**{"planner": "route", "target_speed": 10, **properties})),
        init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 20.0))),
        stop=end_xml(seconds),
    )
