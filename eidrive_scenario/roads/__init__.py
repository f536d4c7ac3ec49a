"""OpenDRIVE roads: lane and road coordinates to x, y, z and back, and routes over lanes."""

from eidrive_scenario.roads.model.location import LaneKey, LaneLocation, LaneLocations, Pose, Poses, PositionError
from eidrive_scenario.roads.model.road_map import (
    Junction,
    Lane,
    LaneSection,
    Road,
    RoadObject,
    Signal,
    SignalController,
    SignalPlace,
)
from eidrive_scenario.roads.network import RoadNetwork, fastest, fewest_junctions, random_costs
from eidrive_scenario.roads.objects import PlacedObject, outlines, placed_objects
from eidrive_scenario.roads.routing.distance import Chain
from eidrive_scenario.roads.routing.graph import Cost, RouteError
from eidrive_scenario.roads.routing.movement import Branch, BranchSelector
from eidrive_scenario.roads.routing.route import Route
from eidrive_scenario.roads.surfaces import KINDS, SurfaceMesh, surface_meshes

__all__ = [
    "KINDS",
    "Branch",
    "BranchSelector",
    "Chain",
    "Cost",
    "Junction",
    "Lane",
    "LaneKey",
    "LaneLocation",
    "LaneLocations",
    "LaneSection",
    "PlacedObject",
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
    "SurfaceMesh",
    "fastest",
    "fewest_junctions",
    "outlines",
    "placed_objects",
    "random_costs",
    "surface_meshes",
]
