"""Checks of the results of planners and vehicle controllers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planning.route_planner import Planner
from eidrive_scenario.driving.step import MAX_TARGET_SPEED, Plan
from eidrive_scenario.errors import InvalidResult, quoted
from eidrive_scenario.perception.result_checks import LARGEST, are_within, describe, raise_not_finite, raise_outside
from eidrive_scenario.world.actor import Control


def check_plan(planner: Planner, plan: object, count: int) -> None:
    """Raise InvalidResult unless `plan` is a Plan of at least two points and as many speeds.

    count  number of objects that were passed to the planner

    All numbers are finite. No coordinate exceeds LARGEST [m], no speed or acceleration MAX_TARGET_SPEED.
    """
    if not isinstance(plan, Plan):
        raise InvalidResult(planner, "plan", f"returned {describe(plan)} (expected Plan)")
    if not isinstance(plan.objects, tuple):
        raise InvalidResult(planner, "plan", f"returned objects as {describe(plan.objects)} (expected a tuple of rows)")
    for row in plan.objects:
        if not (isinstance(row, int | np.integer) and 0 <= row < count):
            raise InvalidResult(planner, "plan", f"returned the object {quoted(row)} (expected 0 to {count - 1})")
    try:
        plan.reason.encode()
    except (AttributeError, UnicodeEncodeError):
        raise InvalidResult(planner, "plan", f"returned the reason {quoted(plan.reason)} (expected a text)") from None
    points, speeds = plan.points, plan.speeds
    for name, array in (("points", points), ("speeds", speeds)):
        if not isinstance(array, np.ndarray):
            raise InvalidResult(planner, "plan", f"returned {name} as {describe(array)} (expected an array)")
    count = len(speeds) if speeds.ndim == 1 else 0
    if points.shape != (count, 2) or count < 2:
        shapes = f"points of shape {points.shape} and speeds of shape {speeds.shape}"
        raise InvalidResult(planner, "plan", f"returned {shapes} (expected (M, 2) and (M,), M at least 2)")
    try:
        if (  # each comparison is False for NaN
            are_within(points, LARGEST)
            and are_within(speeds, MAX_TARGET_SPEED)
            and abs(plan.acceleration) <= MAX_TARGET_SPEED
            and (plan.braking is None or abs(plan.braking) <= MAX_TARGET_SPEED)
        ):
            return
    except (TypeError, ValueError, AttributeError):
        pass
    numbers: dict[str, Any] = {
        "points": points,
        "speeds": speeds,
        "acceleration": plan.acceleration,
        "braking": 0.0 if plan.braking is None else plan.braking,
    }
    raise_not_finite(planner, "plan", numbers)
    for name, value in numbers.items():
        limit = LARGEST if name == "points" else MAX_TARGET_SPEED
        raise_outside(planner, "plan", name, np.atleast_1d(value).astype(float), -limit, limit)


def check_followed(planner: Planner, plan: Plan) -> None:
    """Raise InvalidResult if a checked plan is the reason for which the controller fails."""
    steps = np.hypot(*np.diff(plan.points, axis=0).T)
    if (equal := np.flatnonzero(steps == 0.0)).size:
        row = int(equal[0])
        text = f"returned points {row} and {row + 1} at the same place {plan.points[row].tolist()} (expected a line)"
        raise InvalidResult(planner, "plan", text)


def is_valid_control(control: object) -> bool:
    """Return whether `control` is a Control of finite numbers."""
    try:
        return isinstance(control, Control) and math.isfinite(control.throttle + control.brake + control.steering)
    except TypeError:
        return False


def check_control(controller: VehicleController, method: str, control: object) -> None:
    """Raise InvalidResult unless `control`, which this method of the controller returned, is valid."""
    if is_valid_control(control):
        return
    if not isinstance(control, Control):
        raise InvalidResult(controller, method, f"returned {describe(control)} (expected Control)")
    pedals: dict[str, object] = {"throttle": control.throttle, "brake": control.brake, "steering": control.steering}
    raise_not_finite(controller, method, pedals)
