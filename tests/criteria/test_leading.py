"""Criteria on the leader: boxes 4 m by 2 m, values from the definitions."""

import math
from typing import Any

import pytest
from eidrive_criteria.deceleration_to_avoid_crash import DecelerationToAvoidCrash, DecelerationToAvoidCrashSettings
from eidrive_criteria.time_headway import TimeHeadway, TimeHeadwaySettings

from eidrive_scenario.api.common import Contact
from eidrive_scenario.api.criteria import Criterion, Verdict, evaluate_criteria


def headway(**settings: Any) -> TimeHeadway:
    return TimeHeadway(TimeHeadwaySettings.model_validate({"of": "Ego", **settings}))


def deceleration(**settings: Any) -> DecelerationToAvoidCrash:
    return DecelerationToAvoidCrash(DecelerationToAvoidCrashSettings.model_validate({"of": "Ego", **settings}))


def judge(criterion: Criterion, frames: list[Any]) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion])
    return verdict


@pytest.mark.parametrize(
    ("gap", "speed", "lead_speed", "time", "needed"),
    [(20.0, 15.0, 10.0, 20 / 15, 0.625), (12.0, 8.0, 0.0, 1.5, 64 / 24), (20.0, 10.0, 15.0, 2.0, 0.0)],
)
def test_value_in_one_frame(
    frame: Any, car: Any, gap: float, speed: float, lead_speed: float, time: float, needed: float
) -> None:
    cars = {"Ego": car(0, speed=speed), "Lead": car(gap + 4.0, speed=lead_speed)}
    assert judge(headway(), [frame(0.0, cars)]).value == pytest.approx(time)
    assert judge(deceleration(), [frame(0.0, cars)]).value == pytest.approx(needed)


@pytest.mark.parametrize(
    ("other", "what"),
    [
        ((24.0, 0.0, 0.0, 10.0), "ahead"),
        ((24.0, 2.5, 0.0, 10.0), "in the next lane"),
        ((-24.0, 0.0, 0.0, 10.0), "behind"),
        ((24.0, 0.0, 3.141592653589793, 10.0), "oncoming"),
        ((24.0, 9.0, 1.5707963267948966, 10.0), "crossing"),
        ((24.0, 0.0, 1.5707963267948966, 10.0), "crossing the path"),
        ((300.0, 0.0, 0.0, 10.0), "far away"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_only_an_actor_ahead_in_the_path_leads(
    frame: Any, car: Any, other: tuple[float, float, float, float], what: str
) -> None:
    cars = {"Ego": car(0, speed=15.0), "Lead": car(*other)}
    verdict = judge(headway(at_least=99.0), [frame(0.0, cars)])
    if what == "ahead":
        assert not verdict.passed
        assert verdict.value == pytest.approx(20 / 15)
    else:
        assert (verdict.passed, verdict.value) == (True, None)
        assert "never had" in verdict.reason


@pytest.mark.parametrize("yaw", [0.0, math.pi / 4.0])
@pytest.mark.parametrize(("gap", "leads"), [(199.9, True), (200.1, False)])
def test_leader_has_a_gap_of_up_to_200_m(frame: Any, car: Any, gap: float, leads: bool, yaw: float) -> None:
    """Bodies of 4 m and 18 m: the centers are 11 m farther apart than the bodies."""
    away = gap + 11.0
    cars = {"Ego": car(0, yaw=yaw, speed=10.0), "Lead": car(away * math.cos(yaw), away * math.sin(yaw), yaw, 5.0)}
    verdict = judge(headway(), [frame(0.0, cars, sizes={"Lead": (18.0, 2.5, 4.0)})])
    assert verdict.value == (pytest.approx(gap / 10.0) if leads else None)


def test_nearest_actor_leads_unless_to_selects_another(frame: Any, car: Any) -> None:
    cars = {"Ego": car(0, speed=10.0), "Far": car(44, speed=5.0), "Near": car(14, speed=5.0)}
    assert judge(headway(), [frame(0.0, cars)]).value == pytest.approx(1.0)
    assert judge(headway(to="Far"), [frame(0.0, cars)]).value == pytest.approx(4.0)


def test_limit_is_compared_over_time(frame: Any, car: Any) -> None:
    frames = [
        frame(float(second), {"Ego": car(0, speed=10.0), "Lead": car(4.0 + gap, speed=10.0 - closing)})
        for second, (gap, closing) in enumerate([(40, 0), (20, 4), (10, 2)])
    ]
    verdict = judge(headway(at_least=1.5), frames)
    assert (verdict.passed, verdict.first_violation) == (False, 2.0)
    assert verdict.value == pytest.approx(1.0)
    assert judge(headway(at_least=1.0), frames).passed
    verdict = judge(deceleration(at_most=0.39, fatal=True), frames)
    assert (verdict.passed, verdict.first_violation, verdict.fatal) == (False, 1.0, True)
    assert verdict.value == pytest.approx(16 / 40)
    assert judge(deceleration(at_most=0.41), frames).passed


def test_contact_needs_an_infinite_deceleration(frame: Any, car: Any) -> None:
    cars = {"Ego": car(0, speed=10.0), "Lead": car(3.9, speed=5.0)}
    verdict = judge(deceleration(at_most=8.0), [frame(0.0, cars)])
    assert (verdict.passed, verdict.value) == (False, float("inf"))


@pytest.mark.parametrize("lead", [(4.2, 0.0, 0.0, 6.0), (3.0, 2.1, 0.0, 6.0), (4.2, 0.0, 0.0, -6.0)])
def test_contact_within_a_step_needs_an_infinite_deceleration(frame: Any, car: Any, lead: Any) -> None:
    """At the end of the step the bodies are apart: ahead, beside, or approaching again."""
    contact = Contact("Lead", "Ego", (2.0, 0.0, 0.5), 5.0)
    frames = [
        frame(0.0, {"Ego": car(-0.4, speed=10.0), "Lead": car(4.0, speed=5.0)}),
        frame(0.05, {"Ego": car(0, speed=5.0), "Lead": car(*lead)}, contacts=[contact]),
    ]
    for settings in ({}, {"to": "Lead"}):
        verdict = judge(deceleration(at_most=1000.0, **settings), frames)
        assert (verdict.passed, verdict.value, verdict.first_violation) == (False, float("inf"), 0.05)


def test_contact_with_the_follower_needs_no_deceleration(frame: Any, car: Any) -> None:
    cars = {"Ego": car(0, speed=5.0), "Back": car(-4.2, speed=5.0), "Lead": car(24.0, speed=5.0)}
    contact = Contact("Back", "Ego", (-2.0, 0.0, 0.5), 5.0)
    assert judge(deceleration(), [frame(0.0, cars, contacts=[contact])]).value == 0.0


@pytest.mark.parametrize("speed", [0.0, -5.0])
def test_standing_and_reversing_actors_have_no_headway(frame: Any, car: Any, speed: float) -> None:
    verdict = judge(headway(at_least=2.0), [frame(0.0, {"Ego": car(0, speed=speed), "Lead": car(5)})])
    assert (verdict.passed, verdict.value) == (True, None)
    assert verdict.reason == "the time headway of Ego to an actor ahead in its path was never defined"


@pytest.mark.parametrize("criterion", [headway, deceleration])
def test_absent_actors(frame: Any, car: Any, criterion: Any) -> None:
    absent = judge(criterion(), [frame(0.0, {"Lead": car(5)})])
    assert (absent.passed, absent.value) == (False, None)
    assert absent.reason.startswith("Ego was never present")
    assert not judge(criterion(to="Lead"), [frame(0.0, {"Ego": car(5)})]).passed
    frames = [frame(0.0, {"Ego": car(0, speed=10)}), frame(1.0, {"Lead": car(14)})]
    assert judge(criterion(to="Lead"), frames).passed, "never together: no leader"
    assert judge(criterion(), []).reason.startswith("Ego was never present")


def test_trailer_of_the_actor_is_no_leader(frame: Any, car: Any) -> None:
    cars = {"Ego": car(0, speed=10.0), "Trailer": car(-4.5, speed=10.0)}
    assert judge(headway(at_least=5.0), [frame(0.0, cars)]).passed
