"""Checks of what planners return."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.planning.route_planner import Planner
from eidrive_scenario.driving.result_checks import check_plan
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.sensing.readings import EgoState

POINTS = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])


class StraightPlanner(Planner):
    """A planner with the same plan for every tick, straight ahead."""

    def __init__(self) -> None:
        pass

    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        return Plan(POINTS, np.full(3, 10.0), reason="cruise")


def plan(**fields: Any) -> Plan:
    return Plan(**{"points": POINTS, "speeds": np.full(3, 10.0), "reason": "cruise", **fields})


@pytest.mark.parametrize(
    "made",
    [
        plan(),
        plan(points=POINTS + 1e8, speeds=np.full(3, -1.0), acceleration=-8, braking=8.0),
        plan(points=POINTS.astype(np.int16), speeds=np.zeros(3, np.float32)),
        plan(objects=(0, np.int64(1))),
    ],
    ids=["usual", "far and backwards", "other types", "all objects"],
)
def test_check_plan_numbers_in_range_accepts(made: Plan) -> None:
    check_plan(StraightPlanner(), made, count=2)


@pytest.mark.parametrize(
    ("made", "diagnostic"),
    [
        (None, "returned None (expected Plan)"),
        (plan(points=POINTS * math.nan), "returned points with the value nan (expected finite numbers)"),
        (plan(points=POINTS * 1e300), "returned points with the value 1e+301 (expected -1e+09 to 1e+09)"),
        (plan(points=POINTS * 1j), "returned points as an array of type complex128 (expected numbers)"),
        (plan(speeds=np.full(3, 1e300)), "returned speeds with the value 1e+300 (expected -10000 to 10000)"),
        (plan(speeds=np.array([1.0, -math.inf, 1.0])), "returned speeds with the value -inf"),
        (plan(speeds=np.full(3, None)), "returned speeds as an array of type object"),
        (plan(acceleration=-1e300), "returned acceleration with the value -1e+300"),
        (plan(acceleration=None), "returned acceleration as None"),
        (plan(braking=1e300), "returned braking with the value 1e+300"),
        (plan(braking="hard"), "returned braking as an object of type str"),
        (plan(objects=("Incoming",)), "returned the object 'Incoming' (expected 0 to 1)"),
        (plan(objects=(2,)), "returned the object 2 (expected 0 to 1)"),
        (plan(objects=(-1,)), "returned the object -1"),
        (plan(reason="\udcff"), "returned the reason '\\udcff' (expected a text)"),
        (plan(reason=None), "returned the reason None"),
        (plan(points=POINTS[:1], speeds=np.ones(1)), "returned points of shape (1, 2) and speeds of shape (1,)"),
    ],
)
def test_check_plan_numbers_out_of_range_refuses(made: Any, diagnostic: str) -> None:
    with pytest.raises(InvalidResult) as caught:
        check_plan(StraightPlanner(), made, count=2)
    assert str(caught.value).startswith(f"plan {diagnostic}")
