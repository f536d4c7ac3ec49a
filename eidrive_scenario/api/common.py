"""Names that every kind of extension may need: errors, settings, geometry, roads, actors and the world view.

Stable: all names.
"""

from eidrive_scenario.base.arrays import Array as Array
from eidrive_scenario.base.arrays import Bools as Bools
from eidrive_scenario.base.arrays import Floats as Floats
from eidrive_scenario.base.arrays import Integers as Integers
from eidrive_scenario.base.geometry import box_distance as box_distance
from eidrive_scenario.base.geometry import footprint as footprint
from eidrive_scenario.base.geometry import footprint_distance as footprint_distance
from eidrive_scenario.base.geometry import iou_bev as iou_bev
from eidrive_scenario.base.geometry import overlap as overlap
from eidrive_scenario.base.geometry import point_in_polygon as point_in_polygon
from eidrive_scenario.base.geometry import points_in_box as points_in_box
from eidrive_scenario.base.geometry import points_in_polygon as points_in_polygon
from eidrive_scenario.base.geometry import wrap_angle as wrap_angle
from eidrive_scenario.base.randomness import generator as generator
from eidrive_scenario.base.tolerances import EPSILON as EPSILON
from eidrive_scenario.base.tolerances import TIME_TOLERANCE as TIME_TOLERANCE
from eidrive_scenario.errors import ConstraintError as ConstraintError
from eidrive_scenario.errors import Diagnostic as Diagnostic
from eidrive_scenario.errors import EidriveError as EidriveError
from eidrive_scenario.errors import ExtensionError as ExtensionError
from eidrive_scenario.errors import InputError as InputError
from eidrive_scenario.errors import RegistryError as RegistryError
from eidrive_scenario.errors import ScenarioError as ScenarioError
from eidrive_scenario.errors import SettingError as SettingError
from eidrive_scenario.errors import SimulationError as SimulationError
from eidrive_scenario.errors import WallLimitError as WallLimitError
from eidrive_scenario.errors import counted as counted
from eidrive_scenario.errors import quoted as quoted
from eidrive_scenario.errors import suggestion as suggestion
from eidrive_scenario.extensions.registry import register as register
from eidrive_scenario.extensions.registry import registry as registry
from eidrive_scenario.extensions.settings import Settings as Settings
from eidrive_scenario.extensions.settings import parse_settings as parse_settings
from eidrive_scenario.files.atomic import exclusive as exclusive
from eidrive_scenario.files.atomic import write_atomically as write_atomically
from eidrive_scenario.files.bounded import load_json as load_json
from eidrive_scenario.files.yaml_text import load_yaml as load_yaml
from eidrive_scenario.openscenario import Scenario as Scenario
from eidrive_scenario.roads import LaneLocation as LaneLocation
from eidrive_scenario.roads import Pose as Pose
from eidrive_scenario.roads import RoadNetwork as RoadNetwork
from eidrive_scenario.roads import Route as Route
from eidrive_scenario.roads import RouteError as RouteError
from eidrive_scenario.roads.model.location import LaneKey as LaneKey
from eidrive_scenario.world.actor import ActorSpec as ActorSpec
from eidrive_scenario.world.actor import Control as Control
from eidrive_scenario.world.actor import Placement as Placement
from eidrive_scenario.world.view import Contact as Contact
from eidrive_scenario.world.view import WorldView as WorldView
