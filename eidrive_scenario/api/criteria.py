"""Criteria, and the frames that they evaluate.

Stable: all names.
"""

from eidrive_scenario.evaluation.actor_tracking import SIDEWALKS as SIDEWALKS
from eidrive_scenario.evaluation.actor_tracking import Continuity as Continuity
from eidrive_scenario.evaluation.actor_tracking import LaneTracker as LaneTracker
from eidrive_scenario.evaluation.actor_tracking import Step as Step
from eidrive_scenario.evaluation.actor_tracking import corners as corners
from eidrive_scenario.evaluation.criterion import Criterion as Criterion
from eidrive_scenario.evaluation.criterion import CriterionSettings as CriterionSettings
from eidrive_scenario.evaluation.criterion import Verdict as Verdict
from eidrive_scenario.evaluation.criterion import actor_never_present as actor_never_present
from eidrive_scenario.evaluation.criterion import evaluate_criteria as evaluate_criteria
from eidrive_scenario.evaluation.fault import Impact as Impact
from eidrive_scenario.evaluation.fault import judge_impact as judge_impact
from eidrive_scenario.evaluation.known_actors import Brakings as Brakings
from eidrive_scenario.evaluation.known_actors import FalseTracks as FalseTracks
from eidrive_scenario.evaluation.known_actors import Source as Source
from eidrive_scenario.evaluation.known_actors import known_actors as known_actors
from eidrive_scenario.evaluation.lines_of_sight import LinesOfSight as LinesOfSight
from eidrive_scenario.evaluation.nearest_actor import half_projection as half_projection
from eidrive_scenario.evaluation.nearest_actor import separating_axes as separating_axes
from eidrive_scenario.evaluation.nearest_actor import time_to_contact as time_to_contact
from eidrive_scenario.evaluation.route_progress import Place as Place
from eidrive_scenario.evaluation.route_progress import RouteProgress as RouteProgress
from eidrive_scenario.evaluation.route_progress import route_through as route_through
from eidrive_scenario.evaluation.safe_distance import SafeDistanceModel as SafeDistanceModel
from eidrive_scenario.evaluation.stop_line_crossings import Crossing as Crossing
from eidrive_scenario.evaluation.stop_line_crossings import StopLineCrossings as StopLineCrossings
from eidrive_scenario.evaluation.stop_line_crossings import along as along
from eidrive_scenario.evaluation.stop_line_crossings import beside as beside
from eidrive_scenario.evaluation.surroundings import Relation as Relation
from eidrive_scenario.evaluation.surroundings import Surroundings as Surroundings
from eidrive_scenario.recording.frame import Frame as Frame
from eidrive_scenario.roads.model.signal_states import lamp_colors as lamp_colors
from eidrive_scenario.roads.model.signal_states import shows_red as shows_red
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics as LinkStatistics
from eidrive_scenario.v2x.statistics.reception_log import ReceptionLog as ReceptionLog
