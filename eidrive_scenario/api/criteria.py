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
from eidrive_scenario.evaluation.safe_distance import SafeDistanceModel
from eidrive_scenario.evaluation.surroundings import Relation, Surroundings
from eidrive_scenario.recording.frame import Frame

__all__ = [
    "Criterion",
    "CriterionSettings",
    "Frame",
    "Relation",
    "SafeDistanceModel",
    "Surroundings",
    "Verdict",
    "actor_never_present",
    "evaluate_criteria",
]
