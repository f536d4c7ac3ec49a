"""Evaluation of runs: criteria, verdicts and metrics over frames."""

from eidrive_scenario.evaluation.criterion import (
    Criterion,
    CriterionSettings,
    Verdict,
    actor_never_present,
    evaluate_criteria,
)

__all__ = ["Criterion", "CriterionSettings", "Verdict", "actor_never_present", "evaluate_criteria"]
