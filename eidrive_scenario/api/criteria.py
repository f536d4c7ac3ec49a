"""Criteria, and the frames that they evaluate.

Stable: all names.
"""

from eidrive_scenario.evaluation.actor_tracking import SIDEWALKS, Continuity, LaneTracker, Step, corners
from eidrive_scenario.evaluation.criterion import (
    Criterion,
    CriterionSettings,
    Verdict,
    actor_never_present,
    evaluate_criteria,
)
from eidrive_scenario.evaluation.fault import Impact, judge_impact
from eidrive_scenario.evaluation.known_actors import Brakings, FalseTracks, Source, known_actors
from eidrive_scenario.evaluation.lines_of_sight import LinesOfSight
from eidrive_scenario.evaluation.nearest_actor import half_projection, separating_axes, time_to_contact
from eidrive_scenario.evaluation.route_progress import Place, RouteProgress, route_through
from eidrive_scenario.evaluation.safe_distance import SafeDistanceModel
from eidrive_scenario.evaluation.stop_line_crossings import Crossing, StopLineCrossings, along, beside
from eidrive_scenario.evaluation.surroundings import Relation, Surroundings
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads.model.signal_states import lamp_colors, shows_red
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics
from eidrive_scenario.v2x.statistics.reception_log import ReceptionLog

__all__ = [
    "SIDEWALKS",
    "Brakings",
    "Continuity",
    "Criterion",
    "CriterionSettings",
    "Crossing",
    "FalseTracks",
    "Frame",
    "Impact",
    "LaneTracker",
    "LinesOfSight",
    "LinkStatistics",
    "Place",
    "ReceptionLog",
    "Relation",
    "RouteProgress",
    "SafeDistanceModel",
    "Source",
    "Step",
    "StopLineCrossings",
    "Surroundings",
    "Verdict",
    "actor_never_present",
    "along",
    "beside",
    "corners",
    "evaluate_criteria",
    "half_projection",
    "judge_impact",
    "known_actors",
    "lamp_colors",
    "route_through",
    "separating_axes",
    "shows_red",
    "time_to_contact",
]
