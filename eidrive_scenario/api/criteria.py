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
from eidrive_scenario.recording.frame import Frame

__all__ = [
    "Criterion",
    "CriterionSettings",
    "Frame",
    "Verdict",
    "actor_never_present",
    "evaluate_criteria",
]
