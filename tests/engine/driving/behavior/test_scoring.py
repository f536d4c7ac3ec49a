"""Evaluation of proposals: time gaps to crossing traffic, by the right of way, and the emergency brake."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from eidrive_scenario.driving.planning.behavior.merging import costs_of_waiting
from eidrive_scenario.driving.planning.behavior.proposals import (
    Body,
    LateralProfile,
    Option,
    Proposal,
    Wall,
    inside_way,
)
from eidrive_scenario.driving.planning.behavior.rollout import Rollout, SpeedLimits
from eidrive_scenario.driving.planning.behavior.scoring import WEIGHTS, Evaluation, Options, evaluate
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

TIMES = np.arange(0.0, 8.01, 0.25)
SETTINGS = BehaviorSettings()
SPEED = 10.0
LIMITS = SpeedLimits(np.array([0.0, 1000.0]), np.array([SPEED, SPEED]), SPEED)


def crossing_car(place: float, arrival: float, *, yields: bool) -> Surroundings:
    """Return a car of 4 m by 2 m that crosses the line from the right with 10 m/s; its center is there at `arrival`."""
    ones, no = np.ones((1, len(TIMES))), np.zeros(1, bool)
    return Surroundings(
        place * ones,
        (SPEED * (TIMES - arrival))[None],
        ones,
        2.0 * ones,
        0.0 * ones,
        np.full(1, SETTINGS.lateral_margin),
        (0,),
        np.ones(1, bool),
        np.ones(1, bool),
        np.zeros(1),
        ones > 0,
        no,
        np.array([yields]),
    )


def risk(arrival: float, *, yields: bool) -> float:
    """Return the risk of a car with 10 m/s that passes the place of crossing after 3 s."""
    rolled = Rollout((SPEED * TIMES)[None], np.full((1, len(TIMES)), SPEED), np.full((1, 4), -1))
    route, body = LateralProfile("route", (0.0,), (0.0,)), Body(1.4, 2.4, 0.9, 2.85)
    scene = crossing_car(3.0 * SPEED, arrival, yields=yields)
    way = inside_way(scene, route, body.half_width)
    options = [Option(Proposal(0, 1.0, "all", 4.0), route, [], way, SETTINGS.time_gap)]
    kept = frozenset({"route"})
    evaluation = evaluate(options, rolled, scene, TIMES, body, SETTINGS, limits=LIMITS, kept=kept)
    return float(evaluation.risk[0])


@pytest.mark.parametrize(
    ("arrival", "without", "with_right_of_way"),
    # The rear passes the car's way at 3.2 s; its front is there 0.3 s before its center.
    [(4.0, True, True), (4.5, False, True), (5.5, False, True), (6.0, False, False), (1.5, False, False)],
)
def test_traffic_with_the_right_of_way_needs_a_larger_gap(
    arrival: float, without: bool, with_right_of_way: bool
) -> None:
    assert (risk(arrival, yields=False) > 0.0) == without
    assert (risk(arrival, yields=True) > 0.0) == with_right_of_way


@pytest.mark.parametrize(
    ("deceleration", "place", "cost"),
    # It stops after 25 m with 2 m/s², and after 12.5 m with 4 m/s²; 0.5 m too far is the error of a stop.
    [(2.0, 24.5, 0.0), (2.0, 23.0, 1.5), (2.0, 10.0, 3.0), (4.0, 10.0, 0.0)],
)
def test_stop_behind_its_place_costs_by_distance_unless_none_is_possible(
    deceleration: float, place: float, cost: float
) -> None:
    speed = np.maximum(SPEED - deceleration * TIMES, 0.0)
    s = (SPEED**2 - speed**2) / (2.0 * deceleration)
    rolled = Rollout(np.tile(s, (2, 1)), np.tile(speed, (2, 1)), np.full((2, 4), -1))
    route, nothing = LateralProfile("route", (0.0,), (0.0,)), np.zeros((0, len(TIMES)), dtype=bool)
    walls: tuple[list[Wall], ...] = ([], [Wall(place, math.inf, "stop line")])
    options = [Option(Proposal(0, 1.0, "all", 4.0), route, wall, nothing, SETTINGS.time_gap) for wall in walls]
    kept, body = frozenset({"route"}), Body(1.4, 2.4, 0.9, 2.85)
    scene = crossing_car(0.0, 0.0, yields=True).rows(np.empty(0, dtype=np.intp))
    free, stopped = evaluate(options, rolled, scene, TIMES, body, SETTINGS, limits=LIMITS, kept=kept).score
    assert free - stopped == pytest.approx(cost)


@pytest.mark.parametrize(("beyond", "more"), [(0.4, 0.0), (0.6, WEIGHTS.gap + WEIGHTS.refused)])
def test_stop_within_its_error_of_the_last_place_has_a_gap(beyond: float, more: float) -> None:
    """The other lane is free. A stop may be 0.5 m too far; farther there is no space to change lanes."""
    s = np.array([[0.0], [beyond]]) * np.ones(len(TIMES))
    rolled = Rollout(s, 0.0 * s, np.full((2, 4), -1))
    scene = crossing_car(0.0, 0.0, yields=True).rows(np.empty(0, dtype=np.intp))
    before, behind = costs_of_waiting(3.5, rolled, scene, TIMES, 1.0, Body(1.4, 2.4, 0.9, 2.85), (0.0, 100.0))
    assert behind - before == pytest.approx(more)


@pytest.mark.parametrize(("gap", "cost"), [(25.6, 0.0), (25.4, 3.0)])
def test_comfortable_braking_leaves_the_distance_of_a_hard_stop(gap: float, cost: float) -> None:
    """From 10 m/s with 2 m/s² it has gap - 25 m + v² / 4 to a standing leader, and needs 0.5 v + v² / 8 for a stop with
    4 m/s² after 0.5 s: that is just enough at 2 m/s for a gap of 25.5 m."""
    speed = np.maximum(SPEED - 2.0 * TIMES, 0.0)
    rolled = Rollout(np.tile((SPEED**2 - speed**2) / 4.0, (2, 1)), np.tile(speed, (2, 1)), np.full((2, 4), -1))
    route, body = LateralProfile("route", (0.0,), (0.0,)), Body(1.4, 2.4, 0.9, 2.85)
    ones = np.ones((1, len(TIMES)))
    leader = msgspec.structs.replace(
        crossing_car(body.front + gap + 1.0, 0.0, yields=True), d=0.0 * ones, crosses=ones < 0.0
    )
    proposals = (Proposal(0, 1.0, "all", deceleration) for deceleration in (4.0, 2.0))
    options = [Option(proposal, route, [], ones > 0.0, SETTINGS.time_gap) for proposal in proposals]
    kept = frozenset({"route"})
    hard, comfortable = evaluate(options, rolled, leader, TIMES, body, SETTINGS, limits=LIMITS, kept=kept).score
    assert hard - comfortable == pytest.approx(cost)


@pytest.mark.parametrize(
    ("collision", "risk", "brakes"),
    [(3.9, 0.0, True), (4.1, 0.0, False), (math.inf, 0.61, True), (math.inf, 0.59, False)],
)
def test_emergency_brake_acts_for_what_is_near(collision: float, risk: float, brakes: bool) -> None:
    """The risk of a contact decreases by 0.8 to the horizon of 8 s: to 0.6 in 4 s. The other option is better only by
    its progress, for which the vehicle does not drive into what is near."""
    way = np.zeros((0, 1), dtype=bool)
    route = LateralProfile("route", (0.0,), (0.0,))
    proposals = (Proposal(0, 1.0, "all", 4.0), Proposal(0, 0.0, "all", 8.0, is_emergency=True))
    evaluation = Evaluation(
        score=np.array([-1.0, -2.0]),
        progress=np.array([4.0, 0.0]),
        collision=np.array([collision, np.inf]),
        risk=np.array([risk, 0.0]),
        cause=np.full(2, -1),
    )
    rolled = Rollout(np.zeros((2, 1)), np.zeros((2, 1)), np.full((2, 1), -1))
    alike = [Option(proposal, route, [], way, SETTINGS.time_gap) for proposal in proposals]
    options = Options(alike, rolled, evaluation, 8.0)
    assert options.best() == int(brakes)
