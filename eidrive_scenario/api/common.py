"""Names that every kind of extension may need: errors, settings, geometry, roads, actors and the world view.

Stable: all names.
"""

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.geometry import (
    box_distance,
    footprint,
    footprint_distance,
    iou_bev,
    overlap,
    point_in_polygon,
    points_in_box,
    points_in_polygon,
    wrap_angle,
)
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.base.tolerances import EPSILON, TIME_TOLERANCE
from eidrive_scenario.errors import (
    ConstraintError,
    Diagnostic,
    EidriveError,
    ExtensionError,
    InputError,
    ScenarioError,
    SettingError,
    SimulationError,
    WallLimitError,
    quoted,
    suggestion,
)
from eidrive_scenario.extensions.registry import register, registry
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.files.atomic import exclusive, write_atomically
from eidrive_scenario.files.bounded import load_json
from eidrive_scenario.files.yaml_text import load_yaml
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork, Route, RouteError
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.view import Contact, WorldView

__all__ = [
    "EPSILON",
    "TIME_TOLERANCE",
    "ActorSpec",
    "Array",
    "Bools",
    "ConstraintError",
    "Contact",
    "Control",
    "Diagnostic",
    "EidriveError",
    "ExtensionError",
    "InputError",
    "Integers",
    "LaneKey",
    "LaneLocation",
    "Placement",
    "Pose",
    "RoadNetwork",
    "Route",
    "RouteError",
    "Scenario",
    "ScenarioError",
    "SettingError",
    "Settings",
    "SimulationError",
    "WallLimitError",
    "WorldView",
    "box_distance",
    "exclusive",
    "footprint",
    "footprint_distance",
    "generator",
    "iou_bev",
    "load_json",
    "load_yaml",
    "overlap",
    "parse_settings",
    "point_in_polygon",
    "points_in_box",
    "points_in_polygon",
    "quoted",
    "register",
    "registry",
    "suggestion",
    "wrap_angle",
    "write_atomically",
]
