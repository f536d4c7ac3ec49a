"""Criterion `rss_violation`: boxes 4 m by 2 m around the minimum distances of RSS."""

import math
from typing import Any

import pytest
from eidrive_criteria.rss_violation import RssViolation, RssViolationSettings
from pydantic import ValidationError

from eidrive_scenario.api.criteria import Verdict, evaluate_criteria


def judge(frames: list[Any], **settings: Any) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [RssViolation(RssViolationSettings(of="Ego", **settings))])
    return verdict


@pytest.mark.parametrize(("gap", "passed"), [(41.39, True), (41.37, False)])
def test_following_distance(frame: Any, car: Any, gap: float, passed: bool) -> None:
    """Both at 13.89 m/s: 13.89 + 1.75 + 37.8015 - 12.0583 = 41.383 m."""
    cars = {"Ego": car(0, speed=13.89), "Lead": car(gap + 4.0, speed=13.89)}
    verdict = judge([frame(0.0, cars)])
    assert (verdict.passed, verdict.value) == (passed, 0.0 if passed else 1.0)


@pytest.mark.parametrize(("gap", "passed"), [(10.54, True), (10.53, False)])
def test_standing_car(frame: Any, car: Any, gap: float, passed: bool) -> None:
    """5.83 m/s with 0.5 s: 2.915 + 0.4375 + 7.1821 = 10.535 m."""
    cars = {"Ego": car(0, speed=5.83), "Lead": car(gap + 4.0)}
    assert judge([frame(0.0, cars)], reaction_time=0.5).passed is passed


@pytest.mark.parametrize(("side", "passed"), [(0.36, True), (0.34, False)])
def test_car_alongside(frame: Any, car: Any, side: float, passed: bool) -> None:
    """Both straight ahead: 0.1 + 2 x 0.125 = 0.35 m on either side."""
    for sign in (1.0, -1.0):
        cars = {"Ego": car(0, speed=10.0), "Other": car(1.0, sign * (2.0 + side), speed=10.0)}
        assert judge([frame(0.0, cars)]).passed is passed


@pytest.mark.parametrize(
    ("other", "what"),
    [
        ((-6, 0, 0, 15), "behind"),
        ((-3.5, 0, 0.1, 10), "coupled trailer"),
        ((8, 0, math.pi / 2, 5), "crossing"),
        ((20, 6, math.pi, 10), "oncoming beside"),
    ],
)
def test_actors_without_duty_of_distance(frame: Any, car: Any, other: Any, what: str) -> None:
    verdict = judge([frame(0.0, {"Ego": car(0, speed=10.0), "Other": car(*other)})])
    assert (verdict.passed, verdict.value) == (True, 0.0), what


@pytest.mark.parametrize("yaw", [0.0, math.pi / 4.0])
@pytest.mark.parametrize(("gap", "passed"), [(390.85, True), (390.8, False), (246.0, False)])
def test_oncoming_distance_in_any_direction(frame: Any, car: Any, gap: float, passed: bool, yaw: float) -> None:
    """Both at 30 m/s: 2 x (30 + 1.75) + 33.5 ** 2 / 6 + 33.5 ** 2 / 8 = 390.823 m."""
    away = gap + 4.0
    other = car(away * math.cos(yaw), away * math.sin(yaw), yaw + math.pi, 30.0)
    assert judge([frame(0.0, {"Ego": car(0, yaw=yaw, speed=30.0), "Other": other})]).passed is passed


@pytest.mark.parametrize(("side", "passed"), [(276.0, True), (275.0, False)])
def test_actor_far_beside_that_approaches(frame: Any, car: Any, side: float, passed: bool) -> None:
    """20 m/s to the side need 0.1 + 20.1 + 20.2 ** 2 / 1.6 + 0.125 = 275.35 m; the body extends 3 m / sqrt(2)."""
    other = car(0.0, side + 1.0 + 3.0 / math.sqrt(2.0), -math.pi / 4.0, 20.0 * math.sqrt(2.0))
    assert judge([frame(0.0, {"Ego": car(0, speed=10.0), "Other": other})]).passed is passed


def test_infinite_distance_is_never_kept(frame: Any, car: Any) -> None:
    """10 m/s divided by 2e-310 m/s² is more than a number can be."""
    places = {"Ego": car(0, speed=10.0), "Other": car(1e6, yaw=math.pi, speed=10.0)}
    assert not judge([frame(0.0, places)], min_braking=1e-310, min_braking_correct=1e-310).passed


def test_standing_ego_causes_no_violation(frame: Any, car: Any) -> None:
    assert judge([frame(0.0, {"Ego": car(0), "Lead": car(5)})]).passed


def test_share_of_the_time_is_compared(frame: Any, car: Any) -> None:
    places = enumerate([99, 99, 99, 9])
    frames = [frame(float(tick), {"Ego": car(0, speed=10.0), "Lead": car(x)}) for tick, x in places]
    verdict = judge(frames)
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 0.25, 3.0)
    assert judge(frames, share=0.25).passed
    assert judge(frames[1:], share=0.333333).passed
    assert not judge(frames[1:], share=0.33333).passed
    assert not judge([], share=1.0).passed


def test_settings_are_checked() -> None:
    for wrong in ({"max_braking": 3.0}, {"to": "Ego"}, {"share": 1.5}, {"min_braking": 0.0}):
        with pytest.raises(ValidationError):
            RssViolationSettings(of="Ego", **wrong)
