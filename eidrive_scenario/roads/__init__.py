"""OpenDRIVE roads: lane and road coordinates to x, y, z and back, and routes over lanes."""

from eidrive_scenario.roads.graph import RouteError
from eidrive_scenario.roads.location import LaneKey, LaneLocation, LaneLocations, Pose, Poses, PositionError
from eidrive_scenario.roads.model import (
    Junction,
    Lane,
    LaneSection,
    Road,
    RoadObject,
    Signal,
    SignalController,
    SignalPlace,
)
from eidrive_scenario.roads.movement import Branch, Choose
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.route import Route

__all__ = [
    "Branch",
    "Choose",
    "Junction",
    "Lane",
    "LaneKey",
    "LaneLocation",
    "LaneLocations",
    "LaneSection",
    "Pose",
    "Poses",
    "PositionError",
    "Road",
    "RoadNetwork",
    "RoadObject",
    "Route",
    "RouteError",
    "Signal",
    "SignalController",
    "SignalPlace",
]
