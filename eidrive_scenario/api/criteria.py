"""Criteria, and the frames that they evaluate.

Stable: all names.
"""

from eidrive_scenario.evaluation.criterion import (
    Criterion,
    CriterionSettings,
    Verdict,
    actor_never_present,
    evaluate_criteria,
)
from eidrive_scenario.evaluation.fault import Impact, judge_impact
from eidrive_scenario.evaluation.lane_tracking import SIDEWALKS, LaneTracker, corners
from eidrive_scenario.evaluation.safe_distance import SafeDistanceModel
from eidrive_scenario.evaluation.surroundings import Relation, Surroundings
from eidrive_scenario.recording.frame import Frame

__all__ = [
    "SIDEWALKS",
    "Criterion",
    "CriterionSettings",
    "Frame",
    "Impact",
    "LaneTracker",
    "Relation",
    "SafeDistanceModel",
    "Surroundings",
    "Verdict",
    "actor_never_present",
    "corners",
    "evaluate_criteria",
    "judge_impact",
]
