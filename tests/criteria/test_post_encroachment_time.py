"""Criterion `post_encroachment_time`: two straight paths that cross at a right angle."""

import math
from typing import Any

import pytest
from eidrive_criteria.post_encroachment_time import PostEncroachmentTime, PostEncroachmentTimeSettings

from eidrive_scenario.api.common import Contact
from eidrive_scenario.api.criteria import Frame, Verdict, evaluate_criteria

EGO, OTHER = (4.6, 3.0, 1.5), (4.8, 4.0, 1.5)
"""The zone is as long for each as the other one is wide: 4 m for the ego, 3 m for the other."""


def judge(frames: list[Any], **settings: Any) -> Verdict:
    criterion = PostEncroachmentTime(PostEncroachmentTimeSettings(of="Ego", to="Other", **settings))
    (verdict,) = evaluate_criteria(frames, [criterion])
    return verdict


def crossing(frame: Any, car: Any, other_front: float, until: float = 8.0, dt: float = 0.05) -> list[Any]:
    """Ego: front 12 m before the zone at 6 m/s along x; the other: front `other_front` before it at 7 m/s along y."""
    frames = []
    for tick in range(round(until / dt) + 1):
        time = tick * dt
        ego = car(-2.0 - 12.0 - 2.3 + 6.0 * time, 0.0, 0.0, 6.0)
        other = car(0.0, -1.5 - other_front - 2.4 + 7.0 * time, math.pi / 2, 7.0)
        frames.append(frame(time, {"Ego": ego, "Other": other}, sizes={"Ego": EGO, "Other": OTHER}))
    return frames


@pytest.mark.parametrize("dt", [0.05, 0.04])
def test_time_between_departure_and_arrival(frame: Any, car: Any, dt: float) -> None:
    """The ego is in the zone until (12 + 4 + 4.6) / 6 s, the other one arrives after 30 / 7 s."""
    verdict = judge(crossing(frame, car, 30.0, dt=dt), at_least=1.0)
    assert verdict.value == pytest.approx(30 / 7 - 20.6 / 6, abs=1e-4)
    assert not verdict.passed
    assert verdict.first_violation == pytest.approx(30 / 7, abs=dt)
    assert judge(crossing(frame, car, 30.0, dt=dt), at_least=0.85).passed


def test_order_of_the_names_is_irrelevant(frame: Any, car: Any) -> None:
    criterion = PostEncroachmentTime(PostEncroachmentTimeSettings(of="Other", to="Ego"))
    (verdict,) = evaluate_criteria(crossing(frame, car, 30.0), [criterion])
    assert verdict.value == pytest.approx(30 / 7 - 20.6 / 6, abs=1e-4)


def test_simultaneous_occupation_is_zero(frame: Any, car: Any) -> None:
    """The other one is in the zone from 2.000 s to 3.114 s, together with the ego."""
    verdict = judge(crossing(frame, car, 14.0), at_least=0.1)
    assert (verdict.passed, verdict.value) == (False, 0.0)


def test_contact_within_a_step_is_zero(frame: Any, car: Any) -> None:
    """The bodies are 0.2 m apart before and after the step of the contact."""
    cars = {"Ego": car(0), "Other": car(4.2)}
    contact = Contact("Ego", "Other", (2.0, 0.0, 0.5), 5.0)
    verdict = judge([frame(0.0, cars), frame(0.05, cars, contacts=[contact])], at_least=0.1)
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 0.0, 0.05)


def test_zone_that_one_actor_never_reaches_is_undefined(frame: Any, car: Any) -> None:
    verdict = judge(crossing(frame, car, 30.0, until=4.2), at_least=1.5)
    assert (verdict.passed, verdict.value) == (True, None)
    assert "no common place" in verdict.reason


def test_arrival_after_the_horizon_is_undefined(frame: Any, car: Any) -> None:
    frames = crossing(frame, car, 120.0, until=20.0)
    assert judge(frames, at_least=1.5).value is None


def test_actor_that_has_disappeared_counts(frame: Any, car: Any) -> None:
    """The ego disappears in the zone after 2.5 s, the other one arrives after 30 / 7 s."""
    frames = [
        Frame(each.view.without(["Ego"])) if each.view.time > 2.5 else each for each in crossing(frame, car, 30.0)
    ]
    assert judge(frames).value == pytest.approx(30 / 7 - 2.5, abs=1e-4)


def test_teleport_does_not_cover_the_way_between(frame: Any, car: Any) -> None:
    """The ego jumps over the path of the other one."""
    frames = [
        frame(0.0, {"Ego": car(-20, speed=5.0), "Other": car(0, -20, math.pi / 2, 10.0)}),
        frame(0.05, {"Ego": car(20, speed=5.0), "Other": car(0, -19.5, math.pi / 2, 10.0)}),
        *(
            frame(0.1 + n * 0.05, {"Ego": car(20), "Other": car(0, -19 + n * 0.5, math.pi / 2, 10.0)})
            for n in range(80)
        ),
    ]
    assert judge(frames, at_least=5.0).value is None


def test_following_car_arrives_where_the_first_one_was(frame: Any, car: Any) -> None:
    """20 m of gap at 10 m/s: the second front is 2 s behind the first tail."""
    frames = [
        frame(0.05 * tick, {"Ego": car(0.5 * tick, speed=10.0), "Other": car(24 + 0.5 * tick, speed=10.0)})
        for tick in range(100)
    ]
    assert judge(frames).value == pytest.approx(2.0, abs=1e-4)


@pytest.mark.parametrize("dt", [0.05, 0.1])
def test_oblique_body_counts_by_its_nearest_places(frame: Any, car: Any, dt: float) -> None:
    """A square on its corner leaves the path at 4 m/s, the ego arrives at 2 m/s.

    Its half diagonal is h. Its widest part, at x = -h, leaves the path of the ego, y < 1 m, at y = 1 m, and the front
    of the ego arrives there h / 2 s before x = 0.
    """
    half = math.sqrt(0.5)
    frames = []
    for tick in range(round(6.0 / dt) + 1):
        time = tick * dt
        cars = {"Ego": car(-12.03 + 2.0 * time, 0.0, 0.0, 2.0), "Other": car(0.0, -1.0 + 4.0 * time, math.pi / 4, 2.8)}
        frames.append(frame(time, cars, sizes={"Ego": (4.0, 2.0, 1.5), "Other": (1.0, 1.0, 1.5)}))
    assert judge(frames).value == pytest.approx((10.03 - half) / 2.0 - 2.0 / 4.0, abs=1e-6)


def test_fast_body_covers_the_way_between_frames(frame: Any, car: Any) -> None:
    """At 30 m/s and a step of 0.1 s, a body of 2 m skips 1 m, where a pedestrian arrives 0.4 m beside its center."""
    frames = []
    for tick in range(40):
        time = tick * 0.1
        cars = {"Ego": car(-30.0 + 30.0 * time, 0.0, 0.0, 30.0), "Other": car(1.5, -4.0 + 1.5 * time, 0.0, 1.5)}
        frames.append(frame(time, cars, sizes={"Ego": (2.0, 0.8, 1.5), "Other": (0.5, 0.5, 1.8)}))
    assert judge(frames).value == pytest.approx((4.0 - 0.4 - 0.25) / 1.5 - (30.0 + 1.5 + 0.25 + 1.0) / 30.0, abs=1e-6)


def test_absent_actor_fails(frame: Any, car: Any) -> None:
    verdict = judge([frame(0.0, {"Ego": car(0)})])
    assert (verdict.passed, verdict.value) == (False, None)
    assert verdict.reason.startswith("Other was never present")
