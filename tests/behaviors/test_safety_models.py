"""Performance models of UN R157 compared with values of the regulation and with values calculated by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from eidrive_behaviors.controllers.reference_driver import DriverPhase, ReferenceDriver, ReferenceDriverSettings
from eidrive_behaviors.controllers.road_ahead import LeadObject
from eidrive_behaviors.controllers.safety_models import EgoKinematics, Fsm, Regulation, Rss

DT = 0.01


def ahead(**more: Any) -> LeadObject:
    """Return a lead object in the own lane, 30 m ahead, 5 m/s slower."""
    values: dict[str, Any] = {
        "name": "lead",
        "gap": 30.0,
        "aside": 0.0,
        "closing": 5.0,
        "nearing": 0.0,
        "speed": 15.0,
        "change": 0.0,
        "sideways": 0.0,
        "lanes": 0,
        "towards": 0.0,
        "intrusion": 2.0,
        "covers": False,
        "across": 0.0,
        "walks": False,
    }
    return LeadObject(**{**values, **more})


def ego(speed: float = 20.0, acceleration: float = 0.0) -> EgoKinematics:
    return EgoKinematics(speed, acceleration, DT)


@pytest.mark.parametrize(
    ("kmh", "distance"), [(7.2, 2.0), (10, 3.1), (20, 6.7), (30, 10.8), (40, 15.6), (50, 20.8), (60, 26.7)]
)
def test_regulation_following_distances_match_the_table(kmh: float, distance: float) -> None:
    """R157, 5.2.3.3; the table is rounded to 0.1 m."""
    assert Regulation().following_distance(ego(kmh / 3.6), ahead()) == pytest.approx(distance, abs=0.06)


def test_regulation_cut_in_is_critical_below_its_time_to_collision() -> None:
    """At 10 m/s: 10 / 12 + 0.35 s, plus 0.1 s of sampling: 1.283 s or 12.83 m."""
    model = Regulation()
    assert model.decide(ego(), [ahead(closing=10.0, gap=12.9)]) is None
    assert model.decide(ego(), [ahead(closing=10.0, gap=12.8)]) == -6.0


def test_regulation_cut_in_counts_from_0_3_m_of_intrusion() -> None:
    model = Regulation()
    assert model.decide(ego(), [ahead(closing=10.0, gap=5.0, lanes=1, intrusion=0.29)]) is None
    assert model.decide(ego(), [ahead(closing=10.0, gap=5.0, lanes=1, intrusion=0.31)]) == -6.0


def test_regulation_with_full_stop_continues_braking() -> None:
    for full_stop, expected in ((False, None), (True, -6.0)):
        model = Regulation(full_stop=full_stop)
        model.decide(ego(), [ahead(closing=10.0, gap=5.0)])
        assert model.decide(ego(), []) == expected


def test_rss_safe_distances_match_its_lemmas() -> None:
    """20 m/s behind 20 m/s: 0.5 (20 + 22.25) 0.75 + 22.25² / (2 · 7.593) - 20² / (2 · 7.593) = 22.10 m.

    Beside an object with a lateral speed of 1 m/s: 0.3 + 0.5 (1 + 1.75) 0.75 + 1.75² / 2 = 2.86 m.
    """
    model = Rss()
    assert model.following_distance(ego(), ahead(speed=20.0)) == pytest.approx(22.10, abs=0.005)
    assert model.matters(ego(), ahead(lanes=1, aside=2.86, sideways=1.0))
    assert not model.matters(ego(), ahead(lanes=1, aside=2.87, sideways=1.0))


def test_rss_braking_starts_after_the_reaction_time_and_is_jerk_limited() -> None:
    model, acceleration, course = Rss(), 0.0, []
    for _ in range(150):
        acceleration = model.decide(ego(20.0, acceleration), [ahead(gap=10.0)]) or 0.0
        course.append(acceleration)
    assert course[74] == 0.0
    assert course[75] == pytest.approx(-0.774 * 9.81 / 0.6 * DT)
    assert course[134] == pytest.approx(-0.774 * 9.81)
    assert course[149] == pytest.approx(-0.774 * 9.81)


def test_fsm_metrics_halfway_are_one_half() -> None:
    """Both metrics are 0.5 halfway between the unsafe and the safe distance.

    Proactive, 20 m/s behind 15 m/s: unsafe at 15 + 33.33 - 16.07 = 32.26 m, safe at 15 + 50 - 16.07 + 2 = 50.93 m, each
    plus 2 m of standstill distance. Critical, closing by 10 m/s: 7.5 + 100 / 12 = 15.83 m and 7.5 + 100 / 8 = 20 m.
    """
    model = Fsm()
    proactive = (32.262 + 50.929) / 2 + 2.0
    assert model.proactive_safety(ego(), ahead(gap=proactive)) == pytest.approx(0.5, abs=1e-3)
    assert model.critical_safety(ego(), ahead(gap=(15.8333 + 20.0) / 2, closing=10.0)) == pytest.approx(0.5, abs=1e-3)
    assert model.critical_safety(ego(), ahead(gap=1.0, closing=-1.0)) == 0.0


def test_fsm_with_full_stop_brakes_by_the_metrics_of_each_step() -> None:
    """Critical from the proactive distance of 52.9 m on. At 10 m, closing by 10 m/s, the critical metric is 1: 6 m/s².

    While braking by 4 m/s² the unsafe distance is 8.5 · 0.75 + 7² / 12 = 10.46 m. The last deceleration applies without
    the object, too.
    """
    model, acceleration = Fsm(full_stop=True), 0.0
    for step in range(200):
        seen = [ahead(gap=52.9 if step == 0 else 10.0, closing=10.0)]
        acceleration = model.decide(ego(20.0, acceleration), seen) or 0.0
    assert acceleration == -6.0
    assert model.decide(ego(20.0, acceleration), []) == -6.0


def test_fsm_ignores_a_cut_in_that_is_too_late() -> None:
    """3 m lateral gap at 1 m/s takes 3 s. The object is met within 2.9 s (plus 0.1 s) or passed before."""
    model = Fsm()
    near = {"lanes": 1, "aside": 3.0, "nearing": 1.0, "closing": 10.0}
    assert model.matters(ego(), ahead(gap=29.1, **near))
    assert not model.matters(ego(), ahead(gap=28.9, **near))


def course(driver: ReferenceDriver, steps: int, lead: Callable[[int], LeadObject]) -> list[float | None]:
    """Return the decision of the driver in each step; `lead(step)` returns the object ahead."""
    acceleration, found = 0.0, []
    for step in range(steps):
        decided = driver.decide(ego(20.0, acceleration), [lead(step)])
        acceleration = decided or 0.0
        found.append(decided)
    return found


def test_reference_driver_brakes_after_evaluation_and_reaction_time() -> None:
    """Table 1: perceived in step 0, braking from step 115, full deceleration 0.6 s later."""
    driver = ReferenceDriver()
    decided = course(driver, 200, lambda _: ahead(change=-6.0))
    assert decided[:115] == [None] * 115
    assert decided[115] == pytest.approx(-0.774 * 9.81 / 0.6 * DT)
    assert decided[174] == pytest.approx(-0.774 * 9.81)
    assert decided[199] == pytest.approx(-0.774 * 9.81)


def test_reference_driver_ignores_soft_or_distant_braking() -> None:
    assert set(course(ReferenceDriver(), 200, lambda _: ahead(change=-4.9))) == {None}
    assert set(course(ReferenceDriver(), 200, lambda _: ahead(change=-6.0, gap=41.0))) == {None}


def test_reference_driver_cut_in_thresholds_are_0_375_m_and_2_s() -> None:
    near = {"lanes": 1, "nearing": 1.0, "closing": 10.0, "gap": 19.0, "aside": 1.0}
    decided = course(ReferenceDriver(), 200, lambda step: ahead(towards=0.3 + 0.01 * step, **near))
    assert decided.index(next(one for one in decided if one is not None)) == 8 + 115
    later = {**near, "gap": 21.0}
    assert set(course(ReferenceDriver(), 200, lambda step: ahead(towards=0.3 + 0.01 * step, **later))) == {None}


def test_reference_driver_by_distance_evaluates_over_0_72_m() -> None:
    """At 2 m/s that takes 0.36 s instead of 0.4 s."""
    near = {"lanes": 1, "nearing": 2.0, "closing": 10.0, "gap": 19.0, "aside": 1.0, "towards": 0.5}
    driver = ReferenceDriver(ReferenceDriverSettings(distance=0.72))
    decided = course(driver, 200, lambda step: ahead(across=3.0 - 0.02 * step, **near))
    assert decided.index(next(one for one in decided if one is not None)) == 37 + 75


def test_reference_driver_cut_out_reveals_a_standing_object() -> None:
    driver = ReferenceDriver()
    leaving = ahead(name="leaving", gap=15.0, closing=0.1, towards=-0.4, nearing=-1.0)
    standing = ahead(name="standing", gap=35.0, closing=20.0, speed=0.0)
    for _ in range(116):
        decided = driver.decide(ego(), [leaving, standing])
    assert driver.lead is standing
    assert driver.phase is DriverPhase.BRAKING
    assert decided is not None


def test_reference_driver_after_full_wrap_uses_the_emergency_brake() -> None:
    """0.85 G in 0.6 s, below 1.5 s to collision."""
    driver = ReferenceDriver()
    decided = course(driver, 61, lambda _: ahead(gap=20.0, closing=14.0, covers=True))
    assert decided[0] == pytest.approx(-0.85 * 9.81 / 0.6 * DT)
    assert decided[59] == pytest.approx(-0.85 * 9.81)
    assert set(course(ReferenceDriver(), 10, lambda _: ahead(gap=20.0, closing=14.0))) == {None}
