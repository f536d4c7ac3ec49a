"""Criterion `time_to_collision`: boxes 4 m by 2 m on straight courses, times calculated by hand."""

import math
from typing import Any

import numpy as np
import pytest
from eidrive_criteria.accelerated_contact import Course, accelerated_contact
from eidrive_criteria.time_to_collision import TimeToCollision, TimeToCollisionSettings
from msgspec.structs import replace

from eidrive_scenario.api.common import Contact
from eidrive_scenario.api.criteria import Verdict, evaluate_criteria
from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.evaluation.nearest_actor import time_to_contact


def box(x: float, y: float = 0.0, yaw: float = 0.0, z: float = 0.75) -> list[float]:
    return [x, y, z, 4.0, 2.0, 1.5, yaw]


@pytest.mark.parametrize(
    ("other", "velocity", "expected"),
    [
        (box(14), (-5, 0, 0), 2.0),  # a gap of 10 m closes at 5 m/s
        (box(14), (5, 0, 0), math.inf),  # away
        (box(14), (0, 0, 0), math.inf),  # standing still
        (box(14), (-1e-140, 1e-140, 0), math.inf),  # at the decayed speed of a vehicle that has stopped
        (box(14, 2.5), (-5, 0, 0), math.inf),  # passes at 0.5 m
        (box(13, yaw=math.pi / 2), (-5, 0, 0), 2.0),  # broadside: half a length and half a width are 3 m
        (box(0, 13, -math.pi / 2), (0, -5, 0), 2.0),  # crosses into the side: 13 - 1 - 2
        (box(8, 9), (-4, -7, 0), 1.0),  # both axes must close: x after 1 s, y after 1 s
        (box(0, 13, -math.pi / 2), (30, -5, 0), math.inf),  # has crossed ahead before it is near
        (box(1), (-5, 0, 0), 0.0),  # overlaps already
        (box(14, z=5.0), (-5, 0, 0), math.inf),  # on a bridge
        (box(24), (-5, 0, 0), 4.0),  # 15 m/s behind 10 m/s, gap 20 m
        (box(16), (-8, 0, 0), 1.5),  # 8 m/s towards a standing car, gap 12 m
    ],
)
def test_time_to_contact(other: list[float], velocity: tuple[float, float, float], expected: float) -> None:
    assert time_to_contact(box(0), other, velocity) == pytest.approx(expected)


def test_time_to_contact_of_successive_passages_is_infinite() -> None:
    """The ego is in the common zone from 2.000 s to 3.433 s, the other one from 4.286 s on."""
    ego = [-2.0 - 12.0 - 2.3, 0.0, 0.75, 4.6, 3.0, 1.5, 0.0]
    other = [0.0, -1.5 - 30.0 - 2.4, 0.75, 4.8, 4.0, 1.5, math.pi / 2]
    assert time_to_contact(ego, other, (-6.0, 7.0, 0.0)) == math.inf
    other[1] += 16.0
    assert time_to_contact(ego, other, (-6.0, 7.0, 0.0)) == pytest.approx(2.0), "both arrive after 2 s"


def criterion(**settings: Any) -> TimeToCollision:
    return TimeToCollision(TimeToCollisionSettings.model_validate({"of": "Ego", "to": "Lead", **settings}))


def test_time_to_collision_minimum_is_compared(frame: Any, car: Any) -> None:
    frames = [
        frame(0.0, {"Ego": car(0, speed=10), "Lead": car(34, speed=5)}),  # 30 m at 5 m/s
        frame(1.0, {"Ego": car(10, speed=10), "Lead": car(24, speed=5)}),  # 10 m at 5 m/s
        frame(2.0, {"Ego": car(20, speed=4), "Lead": car(29, speed=5)}),  # opens
    ]
    minimum = criterion(at_least=2.5)
    (verdict,) = evaluate_criteria(frames, [minimum])
    assert (verdict.passed, verdict.first_violation) == (False, 1.0)
    assert verdict.value == pytest.approx(2.0)
    assert minimum.metrics() == {"time_to_collision.Ego.Lead": pytest.approx(2.0)}


@pytest.mark.parametrize("accelerations", [False, True])
def test_time_to_collision_of_a_contact_within_a_step_is_zero(frame: Any, car: Any, accelerations: bool) -> None:
    """At the end of the step the bodies are 0.2 m apart and move away from each other."""
    contact = Contact("Lead", "Ego", (2.0, 0.0, 0.5), 5.0)
    crash = frame(0.05, {"Ego": car(0, speed=3.0), "Lead": car(4.2, speed=7.0)}, contacts=[contact])
    (verdict,) = evaluate_criteria([crash], [criterion(at_least=0.01, accelerations=accelerations)])
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 0.0, 0.05)


def test_time_to_collision_without_collision_course_passes(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0), "Lead": car(9)})], [criterion(at_least=2)])
    assert (verdict.passed, verdict.value) == (True, None)


def test_time_to_collision_of_absent_actor_fails(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0)})], [criterion(at_least=2)])
    assert not verdict.passed
    assert verdict.reason.startswith("Lead was never present")


def along_x(speed: float, rate: float = 0.0) -> Course:
    return Course((speed, 0.0, 0.0), (rate, 0.0, 0.0), speed / -rate if rate < 0.0 else math.inf)


@pytest.mark.parametrize(
    ("gap", "own", "lead", "expected"),
    [
        (20, along_x(12), along_x(12, -4), 38 / 12),  # the lead stops after 3 s and 18 m; the formula gives 3.162 s
        (20, along_x(12, -4), along_x(12, -4), math.inf),  # both stop
        (10, along_x(10), along_x(10, -5), 2.0),  # 10 m = 2.5 t², at the standstill of the lead
        (10, along_x(0, 5), along_x(0), 2.0),  # starts from rest
        (10, along_x(10, -4), along_x(0), (10 - math.sqrt(20)) / 4),  # 10 t - 2 t² = 10
        (13, along_x(10, -4), along_x(0), math.inf),  # stops after 12.5 m
        (10, along_x(5), along_x(10, -5), 4.0),  # the lead stops after 2 s and 10 m, the ego drives 20 m
        (-1, along_x(5), along_x(5), 0.0),  # overlap
        (20, along_x(15), along_x(10), 4.0),  # constant velocities
        (20, along_x(5), along_x(5, 2), math.inf),  # accelerates away
        (10, along_x(1e-140, 1e-140), along_x(0), math.inf),  # stands; its speed has decayed
    ],
)
def test_contact_with_accelerations(gap: float, own: Course, lead: Course, expected: float) -> None:
    assert accelerated_contact(box(0), box(4 + gap), own, lead) == pytest.approx(expected)


def test_contact_of_courses_that_cross() -> None:
    """The ego front is at 0 at the start and at 8 m after 2 s: 2 t². The other one is 4 m wide, its front 8 m away.

    It enters the path, 2 m wide, at 8 = 4 t + 0.5 a t² after 2 s without acceleration and stops before it at -2 m/s².
    """
    own = Course((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), math.inf)
    other = [12.0, -11.0, 0.75, 4.0, 8.0, 1.5, math.pi / 2]
    drives = Course((0.0, 4.0, 0.0), (0.0, 0.0, 0.0), math.inf)
    brakes = Course((0.0, 4.0, 0.0), (0.0, -2.0, 0.0), 2.0)
    assert accelerated_contact(box(0), other, own, drives) == pytest.approx(2.0)
    assert accelerated_contact(box(0), other, own, brakes) == math.inf


def test_accelerations_agree_with_constant_velocities_without_acceleration() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        x, y, yaw = rng.uniform((-20, -20, -3), (20, 20, 3)).tolist()
        other = box(x, y, yaw)
        first, second = ((*rng.uniform(-10, 10, 2), 0.0) for _ in range(2))
        still = (0.0, 0.0, 0.0)
        found = accelerated_contact(box(0), other, Course(first, still, math.inf), Course(second, still, math.inf))
        relative = [b - a for a, b in zip(first, second, strict=True)]
        assert found == pytest.approx(time_to_contact(box(0), other, relative), abs=1e-9)


def braking_lead(frame: Any, car: Any, rate: float, **settings: Any) -> Verdict:
    """Return the verdict on one frame of the worked example with a gap of 20 m, both at 12 m/s."""
    plain = frame(0.0, {"Ego": car(0, speed=12), "Lead": car(24, speed=12)})
    view = replace(plain.view, acceleration=np.array([[0.0, 0.0, 0.0], [rate, 0.0, 0.0]]))
    (verdict,) = evaluate_criteria([replace(plain, view=view)], [criterion(**settings)])
    return verdict


def test_criterion_with_accelerations(frame: Any, car: Any) -> None:
    assert braking_lead(frame, car, -4.0, accelerations=True).value == pytest.approx(3.167, abs=5e-4)
    assert braking_lead(frame, car, -4.0, accelerations=True, at_least=3.16).passed
    assert not braking_lead(frame, car, -4.0, accelerations=True, at_least=3.17).passed
    assert braking_lead(frame, car, -4.0).value is None
    assert braking_lead(frame, car, -200.0, accelerations=True).value is None, "a step of the speed"


def test_contact_with_accelerations_agrees_with_stepped_motion() -> None:
    """Random courses, followed in steps of 10 ms with the overlap test of the geometry, for 6 s."""
    rng = np.random.default_rng(5)
    times = np.arange(0.0, 6.0, 0.01)
    contacts = 0
    for _ in range(120):
        boxes, courses = [], []
        for place in ((0.0, 0.0), rng.uniform(-12, 12, 2)):
            yaw, speed, rate = rng.uniform(-math.pi, math.pi), rng.uniform(0, 15), rng.uniform(-6, 4)
            along = math.cos(yaw), math.sin(yaw), 0.0
            stop = speed / -rate if rate < 0.0 else math.inf
            courses.append(
                Course(
                    (speed * along[0], speed * along[1], 0.0),
                    (rate * along[0], rate * along[1], 0.0),
                    stop,
                )
            )
            boxes.append(box(float(place[0]), float(place[1]), yaw))
        found = accelerated_contact(boxes[0], boxes[1], courses[0], courses[1])
        stepped = next((time for time in times if overlap(*_moved(boxes, courses, time))), math.inf)
        if stepped < 5.98 or found < 5.98:
            assert found == pytest.approx(stepped, abs=0.0101)
            contacts += 1
    assert contacts > 10


def _moved(boxes: list[list[float]], courses: list[Course], time: float) -> list[list[float]]:
    moved = []
    for body, way in zip(boxes, courses, strict=True):
        until = min(time, way.stop)
        shift = [v * until + a * until * until / 2.0 for v, a in zip(way.velocity, way.acceleration, strict=True)]
        moved.append([body[0] + shift[0], body[1] + shift[1], *body[2:]])
    return moved
