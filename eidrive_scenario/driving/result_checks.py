"""Checks of what planners and controllers return."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.driving.planner import Planner
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.result_checks import describe, raise_not_finite


def check_plan(planner: Planner, plan: object) -> None:
    """Raise InvalidResult unless `plan` is a Plan of at least two different points and as many speeds, all finite."""
    if not isinstance(plan, Plan):
        raise InvalidResult(planner, "plan", f"returned {describe(plan)} (expected Plan)")
    if not isinstance(plan.objects, tuple):
        raise InvalidResult(planner, "plan", f"returned objects as {describe(plan.objects)} (expected a tuple of rows)")
    points, speeds = plan.points, plan.speeds
    for name, array in (("points", points), ("speeds", speeds)):
        if not isinstance(array, np.ndarray):
            raise InvalidResult(planner, "plan", f"returned {name} as {describe(array)} (expected an array)")
    count = len(speeds) if speeds.ndim == 1 else 0
    if points.shape != (count, 2) or count < 2:
        shapes = f"points of shape {points.shape} and speeds of shape {speeds.shape}"
        raise InvalidResult(planner, "plan", f"returned {shapes} (expected (M, 2) and (M,), M at least 2)")
    try:
        if is_finite_plan(plan):
            return
    except (TypeError, ValueError, AttributeError):
        pass
    raise_not_finite(
        planner,
        "plan",
        {
            "points": points,
            "speeds": speeds,
            "acceleration": plan.acceleration,
            "braking": 0.0 if plan.braking is None else plan.braking,
        },
    )


def check_followed(planner: Planner, plan: Plan) -> None:
    """Raise InvalidResult if the controller can find no control for a plan because of the plan itself."""
    check_plan(planner, plan)
    steps = np.hypot(*np.diff(plan.points, axis=0).T)
    if (equal := np.flatnonzero(steps == 0.0)).size:
        row = int(equal[0])
        text = f"returned points {row} and {row + 1} at the same place {plan.points[row].tolist()} (expected a line)"
        raise InvalidResult(planner, "plan", text)


def is_finite_plan(plan: Plan) -> bool:
    """Return whether all numbers of a plan are finite: a quick check that may fail for huge ones."""
    return (
        math.isfinite(np.vdot(plan.points, plan.points))
        and math.isfinite(np.vdot(plan.speeds, plan.speeds))
        and math.isfinite(plan.acceleration)
        and (plan.braking is None or math.isfinite(plan.braking))
    )
