"""Rollouts against the equilibrium and the limits of the Intelligent Driver Model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.driving.planning.behavior.proposals import (
    Body,
    LateralProfile,
    Option,
    Proposal,
    Wall,
    speed_limits,
)
from eidrive_scenario.driving.planning.behavior.rollout import LimitsAhead, Roller, Rollout, SpeedLimits
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

SETTINGS = BehaviorSettings()
TIMES = np.arange(0.0, 60.01, 0.25)
BODY = Body(1.4, 2.4, 0.9, 2.85)
ALONG = np.arange(0.0, 1001.0)


def leader(gap: float, speed: float) -> Surroundings:
    """Return an object of 5 m length whose rear is `gap` ahead of the front of a vehicle at 0."""
    shape = (1, len(TIMES))
    s = (BODY.front + gap + 2.5 + speed * TIMES)[None]
    ones = np.ones(shape)
    still, yes, no = np.zeros(1), np.ones(1, bool), np.zeros(1, bool)
    return Surroundings(s, 0 * ones, 2.5 * ones, ones, speed * ones, still, (0,), yes, yes, still, ones < 0, no, no)


def roll(
    proposal: Proposal, speed: float, scene: Surroundings, walls: list[Wall] | None = None, wanted: float = 15.0
) -> Rollout:
    limits = SpeedLimits(ALONG, np.full(len(ALONG), 50.0), wanted)
    leads = np.ones((len(scene), len(TIMES)), dtype=bool)
    option = Option(proposal, LateralProfile("route", (0.0,), (0.0,)), walls or [], leads, SETTINGS.time_gap)
    return Roller(SETTINGS, TIMES, 4.5).roll([option], limits, (0.0, speed), BODY, scene)


FREE = Proposal(0, 1.0, "all", SETTINGS.hard_deceleration)


def test_gap_behind_a_steady_leader_is_the_equilibrium_of_the_model() -> None:
    # Improved IDM: s = s0 + v T below the wanted speed (Treiber and Kesting 2013, section 11.3.7)
    rolled = roll(FREE, 10.0, leader(30.0, 10.0))
    gap = 30.0 + 10.0 * TIMES[-1] - rolled.s[0, -1]
    assert rolled.speed[0, -1] == pytest.approx(10.0, abs=0.05)
    assert gap == pytest.approx(SETTINGS.standstill_gap + 10.0 * SETTINGS.time_gap, abs=0.1)


def improved_idm(speed: float, wanted: float, gap: float, approach: float) -> float:
    """Return the acceleration of the improved model below the wanted speed [m/s²].

    Its deceleration b is chosen for a comfortable one c before standing objects: c² / b - a = c.
    """
    a, c = SETTINGS.acceleration, SETTINGS.comfortable_deceleration
    b = c**2 / (a + c)
    free = a * (1.0 - (speed / wanted) ** 4)
    z = (SETTINGS.standstill_gap + speed * SETTINGS.time_gap + speed * approach / (2.0 * math.sqrt(a * b))) / gap
    return a * (1.0 - z**2) if z >= 1.0 else free * (1.0 - z ** (2.0 * a / free))


def test_standing_object_is_not_braked_for_harder_than_comfortably() -> None:
    rolled = roll(FREE, 15.0, leader(120.0, 0.0))
    braking = -np.diff(rolled.speed[0]) / 0.25
    assert 1.0 < braking.max() <= SETTINGS.comfortable_deceleration


def test_standing_leader_is_approached_to_the_standstill_gap() -> None:
    rolled = roll(FREE, 12.0, leader(80.0, 0.0))
    assert rolled.s[0, -1] <= 80.0 - SETTINGS.standstill_gap + 0.05
    assert rolled.s[0, -1] == pytest.approx(80.0 - SETTINGS.standstill_gap, abs=0.6)
    assert (np.diff(rolled.speed[0]) >= -SETTINGS.hard_deceleration * 0.25 - 1e-9).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_first_step_follows_the_leader_that_demands_the_hardest_braking(order: tuple[int, int]) -> None:
    near, far = leader(40.0, 12.0), leader(60.0, 2.0)
    parts = [(near, far)[index] for index in order]
    names = [name for name in Surroundings.__struct_fields__ if name != "owner"]
    columns: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    scene = Surroundings(owner=(0, 1), **columns)
    expected = improved_idm(10.0, 15.0, 40.0, -2.0), improved_idm(10.0, 15.0, 60.0, 8.0)
    rolled = roll(FREE, 10.0, scene)
    assert expected[1] < expected[0]
    assert (rolled.speed[0, 1] - 10.0) / 0.25 == pytest.approx(expected[1])
    assert rolled.cause[0, 0] == order.index(1)


def test_squares_of_limits_are_interpolated_and_only_those_within_reach_count() -> None:
    """With constant deceleration the square of the speed is linear."""
    along, values = np.array([0.0, 10.0, 30.0, 90.0]), np.array([20.0, 8.0, 12.0, 3.0])
    limits = LimitsAhead.of(SpeedLimits(along, values, 15.0), 5.0, 40.0)
    places = [-1.0, 0.0, 4.0, 10.0, 25.0, 45.0, 90.0, 95.0]
    assert limits is not None
    assert [limits.at(s)[0] for s in places] == pytest.approx(np.interp(places, along, values**2).tolist())
    assert LimitsAhead.of(SpeedLimits(along, values, 7.0), 5.0, 20.0) is None


def test_free_vehicle_accelerates_to_the_wanted_speed() -> None:
    none = leader(900.0, 40.0)
    rolled = roll(FREE, 0.0, none)
    assert rolled.speed[0, 4] == pytest.approx(SETTINGS.acceleration, rel=0.1)
    assert rolled.speed[0, -1] == pytest.approx(15.0, rel=0.02)


def test_vehicle_waits_before_a_wall_until_its_end() -> None:
    rolled = roll(FREE, 10.0, leader(900.0, 40.0), [Wall(60.0, 20.0, "give way")])
    waiting = (TIMES > 12.0) & (TIMES < 20.0)
    assert (rolled.s[0, waiting] <= 60.0 + 0.05).all()
    assert rolled.s[0, waiting].min() > 57.0
    assert rolled.s[0, -1] > 200.0


@pytest.mark.parametrize("place", [60.0, 60.3, 60.7])
def test_stop_takes_the_comfortable_deceleration_at_any_time_step(place: float) -> None:
    """At a wall, and at the end of a route; between multiples of the way of one time step, too."""
    nothing = leader(900.0, 40.0)
    at_wall = roll(FREE, 10.0, nothing, [Wall(place, math.inf, "stop")])
    along = np.linspace(0.0, place, 61)
    ends = speed_limits(np.zeros(61), np.append(np.full(60, 50.0), 0.0), place / 60.0, SETTINGS)
    option = Option(FREE, LateralProfile("route", (0.0,), (0.0,)), [], np.zeros((1, len(TIMES)), bool), 0.0)
    limits = SpeedLimits(along, ends, 15.0)
    at_end = Roller(SETTINGS, TIMES, 4.5).roll([option], limits, (0.0, 10.0), BODY, nothing)
    for rolled in (at_wall, at_end):
        braking = -np.diff(rolled.speed[0]) / 0.25
        assert braking.max() == pytest.approx(SETTINGS.comfortable_deceleration)
        assert rolled.s[0, -1] == pytest.approx(place, abs=0.05)


def test_emergency_braking_is_constant() -> None:
    rolled = roll(Proposal(0, 0.0, "all", 8.0, is_emergency=True), 12.0, leader(900.0, 40.0))
    assert rolled.s[0, -1] == pytest.approx(12.0**2 / 16.0, abs=0.2)


def test_speed_limit_of_a_curve_and_its_approach() -> None:
    curvature = np.where((ALONG > 100) & (ALONG < 150), 1.0 / 50.0, 0.0)
    limits = speed_limits(curvature, np.full(len(ALONG), 30.0), 1.0, SETTINGS)
    assert limits[125] == pytest.approx(math.sqrt(SETTINGS.lateral_acceleration * 50.0), rel=0.01)
    assert limits[200] == pytest.approx(30.0)
    np.testing.assert_allclose(np.diff(limits[60:95] ** 2), -2.0 * SETTINGS.comfortable_deceleration, rtol=1e-6)


@pytest.mark.parametrize(("max_acceleration", "usual", "past"), [(4.5, 1.5, 2.4), (1.6, 1.5, 1.6), (1.2, 1.2, 1.2)])
def test_vehicle_accelerates_harder_past_standing_objects_in_the_oncoming_lane(
    max_acceleration: float, usual: float, past: float
) -> None:
    """Below a third of the wanted speed the acceleration of the model is within 2 % of its maximum: that of the
    settings, 2.4 m/s², the limit of comfort of nuPlan, or what the vehicle can: a car, a fire engine, a cyclist."""
    passing = LateralProfile("pass", (0.0, 20.0, 60.0, 80.0), (0.0, 3.0, 3.0, 0.0), side=1, border=0.8)
    route = LateralProfile("route", (0.0,), (0.0,))
    limits = SpeedLimits(ALONG, np.full(len(ALONG), 50.0), 15.0)
    nobody = np.zeros((1, len(TIMES)), dtype=bool)
    roller = Roller(SETTINGS, TIMES, max_acceleration)
    for profile, expected in ((passing, past), (route, usual)):
        option = Option(FREE, profile, [], nobody, SETTINGS.time_gap)
        rolled = roller.roll([option], limits, (0.0, 0.0), BODY, leader(900.0, 15.0))
        assert rolled.speed[0, 8] == pytest.approx(2.0 * expected, rel=0.02)


def test_lateral_motion_limits_the_speed() -> None:
    """A vehicle that accelerates through a lateral motion for a lower speed keeps to 4 m/s² of lateral acceleration:
    its front axle follows the motion, and its wanted speed would need 2.5 m · 10/√3 / (9 m)² · (15 m/s)² = 40 m/s²."""
    passing = LateralProfile("pass", (0.0, 30.0, 39.0, 60.0, 90.0), (0.0, 0.0, 2.5, 2.5, 0.0), side=1, border=0.8)
    limits = SpeedLimits(ALONG, np.full(len(ALONG), 50.0), 15.0)
    option = Option(FREE, passing, [], np.zeros((1, len(TIMES)), dtype=bool), SETTINGS.time_gap)
    rolled = Roller(SETTINGS, TIMES, 4.5).roll([option], limits, (0.0, 0.0), BODY, leader(900.0, 15.0))
    bend = np.gradient(np.gradient(passing.offset(ALONG[:1000] / 10.0), 0.1), 0.1)
    sideways = np.interp(rolled.s[0] + BODY.wheelbase, ALONG[:1000] / 10.0, bend) * rolled.speed[0] ** 2
    assert np.abs(sideways).max() == pytest.approx(2.0 * SETTINGS.lateral_acceleration, rel=0.05)
    assert rolled.speed[0, -1] == pytest.approx(15.0)
