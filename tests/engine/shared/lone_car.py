"""Scenario of a car with round numbers alone on a straight road, whose speed no action requests."""

from __future__ import annotations

from collections.abc import Mapping

from openscenario_xml import agent_xml, road_file_xml, round_car_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, teleport_xml


def lone_car(seconds: float = 6.0, **properties: object) -> bytes:
    """Return the file: the car Ego stands at the start of a straight road; the run ends after some seconds."""
    return _scenario(seconds, _ego(properties), _start("Ego", 20.0))


def car_behind_parked_car() -> bytes:
    """Return the file with a car without a controller 30 m ahead of the other one."""
    entities = _ego({}) + round_car_xml("Parked")
    return _scenario(20.0, entities, _start("Ego", 20.0) + _start("Parked", 50.0))


def _ego(properties: Mapping[str, object]) -> str:
    return round_car_xml("Ego", agent_xml(**{"planner": "route", "target_speed": 10, **properties}))


def _start(entity: str, s: float) -> str:
    return init_xml(entity, teleport_xml(lane_position_xml(-1, s)))


def _scenario(seconds: float, entities: str, init: str) -> bytes:
    road = road_file_xml("eidrive_library/roads/two_lane_road.xodr")
    return scenario_xml(road=road, entities=entities, init=init, stop=end_xml(seconds))
