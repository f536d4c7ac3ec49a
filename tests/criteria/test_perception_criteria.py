"""Criteria on what a station knows: recall, cooperation gain, position error, first detection, false brakings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from eidrive_criteria.cooperation_gain import CooperationGain, CooperationGainSettings
from eidrive_criteria.detection_recall import DetectionRecall, DetectionRecallSettings
from eidrive_criteria.false_braking import FalseBraking, FalseBrakingSettings
from eidrive_criteria.first_detection import FirstDetection, FirstDetectionSettings
from eidrive_criteria.position_error import PositionError, PositionErrorSettings
from msgspec.structs import replace
from pydantic import ValidationError

from eidrive_scenario.api.criteria import Criterion, Verdict, evaluate_criteria
from eidrive_scenario.driving.step import Plan


def judge(criterion: Criterion, frames: list[Any]) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion])
    return verdict


def recall(frames: list[Any], **settings: Any) -> Verdict:
    return judge(DetectionRecall(DetectionRecallSettings(of="Ego", range=46, **settings)), frames)


def gain(frames: list[Any], **settings: Any) -> Verdict:
    return judge(CooperationGain(CooperationGainSettings(of="Ego", range=46, **settings)), frames)


def error(frames: list[Any], **settings: Any) -> Verdict:
    return judge(PositionError(PositionErrorSettings(of="Ego", **settings)), frames)


def first(frames: list[Any], **settings: Any) -> Verdict:
    return judge(FirstDetection(FirstDetectionSettings(of="Ego", to="A", **settings)), frames)


def braking(frames: list[Any], **settings: Any) -> Verdict:
    return judge(FalseBraking(FalseBrakingSettings(of="Ego", **settings)), frames)


@pytest.fixture
def queue(frame: Any, car: Any, perceived: Any) -> Any:
    """Return a function that makes two frames of a queue behind a truck.

    The truck, 3 m high, hides A and C from the Ego. The Helper, 53 m from the Ego and 44 m from A, sees A, but C
    is 46.5 m away from it. The Ego knows the truck, and the second fused list also contains A.
    """
    cars = {"Ego": car(0), "Truck": car(10), "A": car(30), "C": car(45), "Helper": car(30, 44)}
    sizes = {"Truck": (4.0, 2.5, 3.0)}

    def make(*, sends: bool = True) -> list[Any]:
        found = []
        for second, fused in enumerate(([(10, 0)], [(10, 0), (30, 0)])):
            plain = frame(second / 2, cars, sizes=sizes, categories={"Truck": "truck"})
            helped = perceived(plain, "Helper", sends=sends and second == 0)
            found.append(perceived(helped, "Ego", own=[(10, 0)], fused=fused))
        return found

    return make


@pytest.mark.parametrize(
    ("objects", "fused", "own"),
    [("all", 3 / 6, 2 / 6), ("visible", 1.0, 1.0), ("helper_only", 0.5, 0.0), ("hidden", 0.0, 0.0)],
)
def test_recall_by_sight(queue: Any, objects: str, fused: float, own: float) -> None:
    assert recall(queue(), objects=objects).value == pytest.approx(fused)
    assert recall(queue(), objects=objects, source="own").value == pytest.approx(own)
    assert gain(queue(), objects=objects).value == pytest.approx(fused - own)


def test_limits_of_recall_and_gain(queue: Any) -> None:
    assert recall(queue(), at_least=0.5, at_most=0.5).passed
    verdict = recall(queue(), at_least=0.51)
    assert (verdict.passed, verdict.limit) == (False, 0.51)
    assert gain(queue(), at_least=0.16).passed
    assert not gain(queue(), at_least=0.17).passed
    assert not gain(queue(), at_most=-0.1).passed
    with pytest.raises(ValidationError):
        CooperationGainSettings(of="Ego", at_least=1.1)


@pytest.mark.parametrize(
    ("settings", "margin"),
    [
        ({"objects": "visible", "at_least": 0.8}, 1.0),
        ({"at_least": 0.4}, 0.1 / 0.6),
        ({"at_least": 0.4, "at_most": 0.9}, 0.1 / 0.6),
        ({"at_least": 0.1, "at_most": 0.6}, None),
        ({"at_most": 0.6}, None),
    ],
)
def test_margin_of_recall_is_1_at_all_objects(queue: Any, settings: dict[str, Any], margin: float | None) -> None:
    """The recall of all objects is 0.5, that of visible ones 1."""
    criterion = DetectionRecall(DetectionRecallSettings(of="Ego", range=46, **settings))
    judge(criterion, queue())
    assert criterion.metrics().get("detection_recall.margin") == (None if margin is None else pytest.approx(margin))


def test_silent_station_is_no_helper(queue: Any) -> None:
    """A and C are hidden then: one of four objects is known."""
    verdict = recall(queue(sends=False), objects="helper_only")
    assert (verdict.passed, verdict.value) == (True, None)
    assert "no objects that only other stations have in sight" in verdict.reason
    assert recall(queue(sends=False), objects="hidden").value == 0.25


def test_objects_outside_the_field_of_view_are_not_visible(frame: Any, car: Any, perceived: Any) -> None:
    """B is 45° to the left, A behind the Ego, and no other station transmits."""
    frames = [perceived(frame(0.0, {"Ego": car(0), "A": car(-20), "B": car(20, 20)}), "Ego", fused=[(20, 20)])]
    assert recall(frames, objects="visible").value == 0.5
    assert recall(frames, objects="visible", field_of_view=90).value == 1.0
    assert recall(frames, objects="visible", field_of_view=89).value is None
    assert recall(frames, objects="hidden", field_of_view=90).value == 0.0


def test_classes_and_range_of_recall(queue: Any) -> None:
    assert recall(queue(), classes=["truck"]).value == 1.0
    verdict = recall(queue(), classes=["bicycle"])
    assert (verdict.passed, verdict.value) == (True, None)


def test_building_hides(frame: Any, car: Any, perceived: Any, roads: Any) -> None:
    """The building of 18 m x 12 m around (-3, -17.4) is between (-3, -5) and (-3, -30)."""
    frames = [perceived(frame(0.0, {"Ego": car(-3, -5), "A": car(-3, -30)}), "Ego")]
    for given, value in ((roads, None), (None, 0.0)):
        criterion = DetectionRecall(DetectionRecallSettings(of="Ego", objects="visible"))
        (verdict,) = evaluate_criteria(frames, [criterion], given)
        assert verdict.value == value


@pytest.fixture
def approach(frame: Any, car: Any, perceived: Any) -> list[Any]:
    """The fused object of A is 0.5 m, 1 m and 1.5 m away from it in the last three of five frames."""
    found = []
    for second, offset in enumerate([None, None, (0.3, 0.4), (0.6, 0.8), (0.9, 1.2)]):
        plain = frame(float(second), {"Ego": car(0), "A": car(30 - second), "B": car(0, 30)})
        fused = [] if offset is None else [(30 - second + offset[0], offset[1])]
        found.append(perceived(plain, "Ego", own=[(0, 30)], fused=fused))
    return found


def test_position_error(approach: list[Any]) -> None:
    """The 95th percentile of three values is at rank 1.9 of 0 to 2: 1.45 m."""
    assert error(approach).value == pytest.approx(1.0)
    assert error(approach, measure="p95").value == pytest.approx(1.45)
    assert error(approach, measure="max", at_most=1.6).passed
    verdict = error(approach, measure="max", at_most=1.2, fatal=True)
    assert (verdict.passed, verdict.first_violation, verdict.fatal) == (False, 4.0, True)
    assert verdict.value == pytest.approx(1.5)
    assert not error(approach, at_most=0.9).passed
    assert error(approach, source="own").value == 0.0
    assert error(approach, within=0.8).value == pytest.approx(0.5)


def test_position_error_of_one_actor(approach: list[Any]) -> None:
    assert error(approach, to="A").value == pytest.approx(1.0)
    verdict = error(approach, to="B")
    assert (verdict.passed, verdict.value) == (True, None)
    assert "never knew B" in verdict.reason


def test_first_detection(approach: list[Any]) -> None:
    verdict = first(approach, by=2.0)
    assert (verdict.passed, verdict.value) == (True, 2.0)
    assert "28.0 m" in verdict.reason
    verdict = first(approach, by=1.5, fatal=True)
    assert (verdict.passed, verdict.value, verdict.fatal) == (False, 2.0, True)
    assert not first(approach[:1], by=1.5, fatal=True).fatal
    verdict = first(approach, source="own")
    assert (verdict.passed, verdict.value) == (True, None)
    assert not first(approach, source="own", by=10).passed
    with pytest.raises(ValidationError, match="equal"):
        FirstDetectionSettings(of="Ego", to="Ego")


def test_missing_actors_fail(frame: Any, car: Any, perceived: Any) -> None:
    alone = [perceived(frame(0.0, {"Ego": car(0)}), "Ego")]
    verdict = first(alone)
    assert (verdict.passed, verdict.reason) == (False, "A was never present, so nothing was measured")
    verdict = error(alone, to="A")
    assert (verdict.passed, verdict.reason) == (False, "A was never present, so nothing was measured")
    for verdict in (recall([]), gain([]), error([]), first([]), braking([])):
        assert (verdict.passed, verdict.value) == (False, None)
        assert "never present" in verdict.reason
    bare = [frame(0.0, {"Ego": car(0), "A": car(9)})]
    for verdict in (recall(bare), gain(bare), error(bare), first(bare)):
        assert not verdict.passed
        assert "no driving stack" in verdict.reason
    verdict = braking(bare)
    assert (verdict.passed, verdict.reason) == (False, "Ego has no planner")


@pytest.fixture
def brake(frame: Any, car: Any, perceived: Any) -> Any:
    """Return a function for frames with a plan each: (braking, acceleration, rows). Row 0 is A, row 1 is false."""

    def make(*plans: tuple[float | None, float, tuple[int, ...]]) -> list[Any]:
        return [
            perceived(
                frame(float(second), {"Ego": car(0), "A": car(20)}),
                "Ego",
                fused=[(20, 0), (60, 0)],
                plan=Plan(np.zeros((1, 2)), np.zeros(1), "", plan[1], plan[0], plan[2]),
            )
            for second, plan in enumerate(plans)
        ]

    return make


def test_false_braking(brake: Any) -> None:
    """Two of four brakings are for the false object; a deceleration of 3 m/s² is none."""
    none = (None, 0.0, ())
    frames = brake(none, (5.0, 0.0, (0,)), none, (5.0, 0.0, (1,)), none, (None, -3.1, (1,)), none, (None, -4.0, (0,)))
    verdict = braking(frames, fatal=True)
    assert (verdict.passed, verdict.value, verdict.first_violation, verdict.fatal) == (False, 2.0, 3.0, True)
    assert "4 times" in verdict.reason
    assert braking(frames, at_most=2).passed
    assert braking(frames, harder_than=3.5).value == 1.0
    assert braking(brake((None, -3.0, (1,)))).value == 0.0


def test_own_trailers_are_no_objects_of_recall(queue: Any) -> None:
    """Without the truck, which the Ego tows, one of two other objects is known in the second frame."""
    frames = [replace(one, trailers={"Ego": "Truck"}) for one in queue()]
    assert recall(frames, objects="all").value == pytest.approx(1 / 4)
