"""Use of a lane of the opposite direction: view, traffic in view and out of view, waiting and giving up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml
from signal_street import CAR

from eidrive_scenario.driving.planning.behavior.decision import Decider
from eidrive_scenario.driving.planning.behavior.oncoming import (
    PAUSE,
    Motion,
    OncomingTraffic,
    Outlook,
    Verdict,
    approach,
)
from eidrive_scenario.driving.planning.behavior.proposals import Body, LateralProfile, Start, with_view
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside, ReferenceLine
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.roads import RoadNetwork

BESIDE = LanesBeside(oncoming=3.5, oncoming_limit=15.0)
TIMES = np.arange(0.0, 12.01, 0.25)
BODY = Body(1.4, 2.4, 0.9, 2.85)
SETTINGS = BehaviorSettings()
PASSING = LateralProfile("pass", (0.0, 20.0, 50.0, 70.0), (0.0, 3.0, 3.0, 0.0), side=1, border=0.75)
LINE = ReferenceLine(PlannedPath(np.array([[0.0, 0.0], [400.0, 0.0]]), ends=False), None)


def scene(*objects: tuple[float, float, float]) -> Surroundings:
    """Return objects with s, d and speed along the line, 5 m by 2 m."""
    count, steps = len(objects), len(TIMES)
    s, d, speed = np.array(objects, dtype=float).reshape(-1, 3).T
    ones = np.ones((count, steps))
    return Surroundings(
        s[:, None] + speed[:, None] * TIMES,
        d[:, None] * ones,
        2.5 * ones,
        1.0 * ones,
        speed[:, None] * ones,
        np.full(count, 0.4),
        tuple(range(count)),
        np.ones(count, dtype=bool),
        np.ones(count, dtype=bool),
        np.zeros(count),
        np.zeros((count, steps), dtype=bool),
        np.zeros(count, dtype=bool),
        np.zeros(count, dtype=bool),
    )


def traffic(view: float) -> OncomingTraffic:
    """Return the traffic of a vehicle that wants to drive 10 m/s and is held up since 0 s."""
    observed = OncomingTraffic(view, TIMES, BODY, SETTINGS)
    observed.observe(scene(), 0.0, 10.0, 0.0, held_up=True)
    return observed


def verdict(
    *objects: tuple[float, float, float],
    view: float = 150.0,
    now: float = 0.0,
    s: float = -30.0,
    current: bool = False,
    begun: bool = False,
) -> Verdict:
    """Return the verdict on PASSING at 10 m/s from `s` on, past a car of 5 m that stands at 40 m, and other objects.

    The front axle crosses the border where 3 blend(share) = 0.75, at a share of 0.36, with the rear axle at 4.4 m: up
    to -15 m, at 1.5 s, the vehicle can stop before it. It returns at 62.8 m, of which 9.5 s is the next time, with the
    front at 68.8 m.
    """
    motion = Motion(s + 10.0 * TIMES, np.full(len(TIMES), 10.0))
    there = scene(*(objects or ((40.0, 0.0, 0.0),)))
    outlook = Outlook(LINE, there, BESIDE, now)
    return traffic(view).verify(PASSING, motion, outlook, is_current=current, has_begun=begun)


def test_free_view_ends_at_its_range() -> None:
    assert traffic(100.0).first_hidden(Outlook(LINE, scene(), BESIDE, 0.0), (0.0, 0.0)) == pytest.approx(100.0, abs=4.0)


@pytest.mark.parametrize("gap", [10.0, 20.0])
def test_truck_ahead_hides_the_lane_beyond_the_line_of_sight(gap: float) -> None:
    # The line of sight over the rear left corner, at (gap, 1.0), reaches the center of the next lane at 3.5 gap.
    hidden = traffic(100.0).first_hidden(Outlook(LINE, scene((gap + 2.5, 0.0, 0.0)), BESIDE, 0.0), (0.0, 0.0))
    assert hidden == pytest.approx(3.5 * gap, abs=2.0)


def test_crest_hides_the_lane_beyond_it() -> None:
    """Slopes of 5 % up to 100 m and down from there: from 1.5 m above the road at 60 m the line of sight over the crest
    falls by (1.5 - 2) / 40, and is 1 m above the road beyond where (100 + x): 5 - 0.05 x + 1 = 5 + 0.0125 x."""
    line = ReferenceLine(PlannedPath(np.array([[0.0, 0.0], [400.0, 0.0]]), ends=False), None)
    line.__dict__["heights"] = 0.05 * (100.0 - np.abs(line.along - 100.0))
    hidden = traffic(200.0).first_hidden(Outlook(line, scene(), BESIDE, 0.0), (60.0, 0.0))
    assert hidden == pytest.approx(100.0 + 1.0 / 0.0625, abs=2.0)


def test_approach_is_a_response_time_and_braking() -> None:
    """10 m/s for 1 s, then 3 m/s²."""
    assert approach(10.0, 1.0) == pytest.approx(10.0)
    assert approach(10.0, 2.0) == pytest.approx(18.5)
    assert approach(10.0, math.inf) == pytest.approx(10.0 + 100.0 / 6.0)


def test_hidden_traffic_drives_at_the_limit_until_the_vehicle_has_waited() -> None:
    waiting = traffic(50.0)
    assert waiting.hidden_speed(BESIDE, PAUSE - 0.1) == 15.0
    assert waiting.hidden_speed(BESIDE, PAUSE) == 10.0
    waiting.observe(scene((30.0, 3.5, -8.0)), 0.0, 10.0, 4.0, held_up=True)
    assert waiting.hidden_speed(BESIDE, PAUSE + 1.0) == 15.0, "traffic in view restarts the time"
    assert waiting.hidden_speed(BESIDE, PAUSE + 4.0) == 8.0, "as fast as the traffic in view was"


@pytest.mark.parametrize(("shift", "aside", "speed"), [(None, 0.0, 15.0), (None, 3.5, 25.0), (4.0, 0.0, 25.0)])
def test_traffic_of_another_line_is_forgotten_but_not_of_the_road(
    shift: float | None, aside: float, speed: float
) -> None:
    """A car of 25 m/s came before; the limit is 15 m/s."""
    decider = Decider(SETTINGS, CAR, BODY, TIMES, (80.0, 80.0))
    decider._oncoming.observe(scene((30.0, 3.5, -25.0)), 0.0, 10.0, 0.0, held_up=False)
    decider.line_changed(shift, aside)
    decider._oncoming.observe(scene(), 0.0, 10.0, 0.1, held_up=False)
    assert decider._oncoming.hidden_speed(BESIDE, 0.1) == speed


def test_traffic_beside_three_lanes_of_the_own_direction_restarts_the_pause() -> None:
    """The lane of the opposite direction is the third one beside that of the vehicle, 10.5 m to its left."""
    waiting = traffic(50.0)
    waiting.observe(scene((30.0, 10.5, -8.0)), 0.0, 10.0, 4.0, held_up=True, oncoming=10.5)
    assert waiting.hidden_speed(BESIDE, PAUSE + 1.0) == 15.0


@pytest.mark.parametrize(
    ("headways", "longest"),
    # After n headways up to 12 s, 97.5 % of the next ones are shorter than 12 s ((n + 1) 0.025)^(-1/n), the predictive
    # distribution of the uniform one with an unknown limit; after few, the wait is bounded.
    [(1, 24.0), (3, 24.0), (5, 17.54), (9, 14.0)],
)
def test_pause_is_longer_after_vehicles_with_long_headways(headways: int, longest: float) -> None:
    """Cars at 10 m/s are in view for 8 s before they pass, so the next one is in view 8 s before its headway ends."""
    observed = traffic(80.0)
    starts, end = 12.0 * np.arange(headways + 1), 12.0 * headways + 8.0
    for now in np.arange(0.0, end + 0.05, 0.1):
        cars = [(80.0 - 10.0 * (now - start), 3.5, -10.0) for start in starts if start <= now < start + 8.0]
        observed.observe(scene(*cars), 0.0, 10.0, float(now), held_up=True)
    assert observed.hidden_speed(BESIDE, end + longest - 8.0 - 0.3) == 15.0
    assert observed.hidden_speed(BESIDE, end + longest - 8.0 + 0.3) == 10.0
    # Two pauses: 12 s, or as long as the 97.5 %, with twice the bound.
    longer = max({1: 48.0, 3: 25.85}.get(headways, longest) - 8.0, 2.0 * PAUSE)
    for quiet, expected in ((longer - 0.3, False), (longer + 0.3, True)):
        outlook = Outlook(LINE, scene(), BESIDE, end + quiet)
        assert observed.yields(outlook, (1.4, 0.0), is_last_place=True, has_view=True) is expected


def test_vehicle_that_stops_does_not_lengthen_the_pause() -> None:
    """A car brakes with 2 m/s² from 10 m/s, and stands from 5 s on."""
    observed = traffic(80.0)
    for now in np.arange(0.0, 6.05, 0.1):
        speed = max(10.0 - 2.0 * now, 0.0)
        distance = 45.0 + speed**2 / 4.0
        observed.observe(scene((distance, 3.5, -speed)), 0.0, 10.0, float(now), held_up=True)
    assert observed.hidden_speed(BESIDE, 5.0 + PAUSE + 0.1) == 10.0


def test_column_with_short_headways_does_not_lengthen_the_pause() -> None:
    observed = traffic(80.0)
    for now in np.arange(0.0, 12.05, 0.1):
        cars = [(80.0 - 10.0 * (now - start), 3.5, -10.0) for start in (0.0, 2.0, 4.0) if start <= now < start + 8.0]
        observed.observe(scene(*cars), 0.0, 10.0, float(now), held_up=True)
    assert observed.hidden_speed(BESIDE, 12.0 + PAUSE + 0.1) == 10.0


@pytest.mark.parametrize(("start", "expected"), [(185.0, Verdict.GO), (175.0, Verdict.WAIT), (-40.0, Verdict.GO)])
def test_traffic_in_view_must_not_meet_the_vehicle_before_its_return(start: float, expected: Verdict) -> None:
    """At -10 m/s, 1.5 s after the return at 9.5 s, its front 2.5 m ahead of its center is at that of the vehicle, at
    68.8 m, if it starts at 181.3 m; one that is behind has passed."""
    assert verdict((40.0, 0.0, 0.0), (start, 3.5, -10.0)) is expected


@pytest.mark.parametrize(("start", "expected"), [(170.0, Verdict.GO), (160.0, Verdict.WAIT)])
def test_current_maneuver_needs_no_reserve(start: float, expected: Verdict) -> None:
    assert verdict((40.0, 0.0, 0.0), (start, 3.5, -10.0), current=True) is expected


@pytest.mark.parametrize(
    ("view", "now", "expected"),
    [
        (140.0, 0.0, Verdict.GO),  # from -13.6 m on; traffic at 15 m/s needs at most 15 + 225 / 6 = 52.5 m to 68.8 m
        (130.0, 0.0, Verdict.WAIT),
        (130.0, PAUSE, Verdict.GO),  # none is expected from beyond the range
        (100.0, PAUSE, Verdict.GO),
        (70.0, PAUSE, Verdict.WAIT),  # the range ends before the maneuver does
    ],
)
def test_view_has_to_suffice_for_the_maneuver(view: float, now: float, expected: Verdict) -> None:
    assert verdict(view=view, now=now) is expected


@pytest.mark.parametrize(
    ("start", "speed", "expected"),
    [
        (95.0, -1.5, Verdict.GO),
        (95.0, -3.0, Verdict.WAIT),  # it is itself at 59.5 m after 11 s
        (125.0, -1.5, Verdict.WAIT),  # up to 116 m, the end of the view from -13.6 m, faster traffic may be before it
    ],
)
def test_traffic_out_of_view_does_not_come_before_that_in_view(start: float, speed: float, expected: Verdict) -> None:
    """The view of 130 m itself does not suffice. After 11 s the rear of the first car is at 76 m, beyond 68.8 m."""
    assert verdict((40.0, 0.0, 0.0), (start, 3.5, speed), view=130.0) is expected


@pytest.mark.parametrize(
    ("place", "offset", "expected"),
    [
        (95.0, 3.5, Verdict.GO),
        (95.0, 4.5, Verdict.WAIT),  # others pass a car at the edge of the lane
        (70.0, 3.5, Verdict.WAIT),  # it is in the way of the return
        (125.0, 3.5, Verdict.WAIT),  # up to 116 m, the end of the view, traffic may be before it
    ],
)
def test_no_traffic_comes_before_a_car_that_has_stopped(place: float, offset: float, expected: Verdict) -> None:
    assert verdict((40.0, 0.0, 0.0), (place, offset, 0.0), view=130.0) is expected


@pytest.mark.parametrize(("quiet", "expected"), [(120.0, Verdict.WAIT), (160.0, Verdict.GO)])
def test_traffic_is_over_if_the_next_vehicle_is_improbable(quiet: float, expected: Verdict) -> None:
    """From -13.6 m on, for 11 - 1.5 s, traffic at 8 m/s comes from 130 m farther to 68.8 m in 6 s: it can be unseen for
    3.5 s. With an unknown rate it comes then with a probability of 2.5 % after 39 times as long without traffic."""
    observed = OncomingTraffic(130.0, TIMES, BODY, SETTINGS)
    observed.observe(scene((100.0, 3.5, -8.0)), 0.0, 10.0, 0.0, held_up=True)
    observed.observe(scene(), 0.0, 10.0, quiet, held_up=True)
    motion = Motion(-30.0 + 10.0 * TIMES, np.full(len(TIMES), 10.0))
    outlook = Outlook(LINE, scene((40.0, 0.0, 0.0)), BESIDE, quiet)
    assert observed.verify(PASSING, motion, outlook, is_current=False) is expected


def test_moving_object_is_followed_until_the_view_suffices() -> None:
    assert verdict((30.0, 0.0, 4.0), view=40.0) is Verdict.FOLLOW
    # 7.5 m along the line, the vehicle is 0.75 m beyond the border, and can still return behind the object.
    assert verdict((50.0, 0.0, 4.0), (100.0, 3.5, -10.0), s=7.5, current=True) is Verdict.GIVE_UP


def test_vehicle_that_cannot_return_any_more_goes_on() -> None:
    """30 m along the line, the front is 3.7 m behind the car, and the vehicle 3 m beside its lane."""
    assert verdict((40.0, 0.0, 0.0), (100.0, 3.5, -10.0), s=30.0, current=True) is Verdict.GO


def test_vehicle_past_the_point_of_no_return_goes_on() -> None:
    """At -12 m the stop from 10 m/s would end at 7.7 m, beyond the border at 4.4 m."""
    assert verdict(view=100.0, s=-12.0, current=True) is Verdict.WAIT
    assert verdict(view=100.0, s=-12.0, current=True, begun=True) is Verdict.GO
    assert verdict((40.0, 0.0, 0.0), (90.0, 3.5, -10.0), s=-12.0, current=True, begun=True) is Verdict.WAIT


def test_vehicle_that_brakes_falls_behind_what_it_passes() -> None:
    """From 18 m/s with 8 m/s² the vehicle covers 20 m in 2 s, its front then at 23.8 m, and the rear of the other one
    at 8 m/s at 8.8 + 16 = 24.8 m: 1 m ahead. It never falls behind one that stands, or comes beside one far ahead."""
    objects = ((11.3, 0.0, 8.0), (11.3, 0.0, 0.0), (40.0, 0.0, 8.0))
    behind = [traffic(150.0).place_behind(PASSING, (0.0, 18.0), scene(other), 8.0) for other in objects]
    assert behind == [pytest.approx(20.0), None, None]


def test_without_a_lane_of_the_opposite_direction_nothing_is_expected() -> None:
    motion = Motion(10.0 * TIMES, np.full(len(TIMES), 10.0))
    outlook = Outlook(LINE, scene((40.0, 0.0, 0.0)), LanesBeside(), 0.0)
    assert traffic(10.0).verify(PASSING, motion, outlook, is_current=False) is Verdict.GO


def test_vehicle_waits_at_the_edge_of_its_lane_with_a_view() -> None:
    """From 0.55 m, 0.1 m inside of the edge, the line of sight over the corner at (37.5, 1) reaches the middle of the
    lane at 3.5 m after 2.95 / 0.45 times its distance from the corner: 15.3 m for a range of 100 m."""
    waiting = traffic(100.0)
    sufficient = waiting.place_with_view(PASSING, scene((40.0, 0.0, 0.0)), 3.5, -60.0)
    assert sufficient - BODY.wheelbase + BODY.center == pytest.approx(37.5 - 100.0 * 0.45 / 2.95, abs=0.3)
    profile = with_view(PASSING, Start(-60.0, 0.0, 0.0, 5.0), SETTINGS, BODY, sufficient, 10.0)
    assert profile is not None
    for part in (BODY.wheelbase, BODY.center):
        assert profile.offset_at(waiting.waiting_place(profile, -60.0) + part) == pytest.approx(0.65, abs=0.01)
    # Before that it swings out at 10 m/s with 4 m/s²; the peak of the second derivative of the quintic is 10 / √3.
    length = 10.0 * math.sqrt(10.0 / math.sqrt(3.0) * 2.35 / 4.0)
    assert profile.waits_at == profile.places[-4] == pytest.approx(20.0 - length)
    # If the lane is free it drives on: no motion is for less than the present speed.
    assert min(bend.speed for bend in profile.bends(SETTINGS.lateral_acceleration, 10.0)) == pytest.approx(5.0)
    too_near = Start(12.0, 0.0, 0.0, 2.0)
    assert with_view(PASSING, too_near, SETTINGS, BODY, sufficient, 2.0) is None, "there is not enough space"


@pytest.mark.parametrize(("left", "offset"), [(5.0, 0.65), (0.9, 0.65), (0.2, 0.6), (0.2, 0.7)])
def test_vehicle_at_the_edge_keeps_its_place_until_it_is_there(left: float, offset: float) -> None:
    """The motion from the edge at walking pace, 2 m/s, would begin later than that at 10 m/s."""
    far = with_view(PASSING, Start(-60.0, 0.65, 0.0, 5.0), SETTINGS, BODY, 30.0, 10.0)
    assert far is not None
    near = with_view(PASSING, Start(far.waits_at - left, offset, 0.0, 1.0), SETTINGS, BODY, 30.0, 10.0)
    assert near is not None
    assert near.waits_at == far.waits_at
    assert near.offset_at(near.waits_at) == pytest.approx(offset)


@pytest.mark.parametrize(
    ("offset", "waits_at", "expected"),
    [(0.8, 10.0, Verdict.WAIT), (1.1, 10.0, Verdict.GIVE_UP), (0.8, math.inf, Verdict.GIVE_UP)],
)
def test_vehicle_before_its_place_of_waiting_may_cross_the_border_slightly(
    offset: float, waits_at: float, expected: Verdict
) -> None:
    """It is 0.05 m or 0.35 m beyond the border at 0.75 m, and would meet a car before its return."""
    places, values = (-30.0, -20.0, 10.0, 25.0, 50.0, 70.0), (offset, 0.65, 0.65, 3.0, 3.0, 0.0)
    profile = LateralProfile("pass", places, values, side=1, border=0.75, waits_at=waits_at)
    motion = Motion(10.0 * TIMES - 30.0, np.full(len(TIMES), 10.0))
    outlook = Outlook(LINE, scene((40.0, 0.0, 0.0), (100.0, 3.5, -10.0)), BESIDE, 0.0)
    assert traffic(150.0).verify(profile, motion, outlook, is_current=True) is expected


@pytest.mark.parametrize(("beyond", "expected"), [(0.1, Verdict.GIVE_UP), (0.4, Verdict.GO)])
def test_vehicle_slightly_beyond_the_border_needs_no_return(beyond: float, expected: Verdict) -> None:
    """At 2 m/s its front is 2 m behind a car: it stops 1 m behind that, and returns by 0.1 m within 11 √(0.1 / 3.5) m,
    1.9 m. Its view of 60 m does not suffice to pass."""
    s = 37.5 - 2.0 - BODY.front
    places, values = (s + BODY.wheelbase, 40.0, 60.0, 80.0), (0.75 + beyond, 3.0, 3.0, 0.0)
    profile = LateralProfile("pass", places, values, side=1, border=0.75)
    speed = np.minimum(2.0 + 2.0 * TIMES, 10.0)
    motion = Motion(s + np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) / 8.0)), speed)
    outlook = Outlook(LINE, scene((40.0, 0.0, 0.0)), BESIDE, 0.0)
    assert traffic(60.0).verify(profile, motion, outlook, is_current=True, has_begun=True) is expected


@pytest.mark.parametrize(("slope", "expected"), [(0.05, Verdict.GIVE_UP), (0.35, Verdict.GO)])
def test_vehicle_on_its_way_out_comes_farther_while_it_brakes(slope: float, expected: Verdict) -> None:
    """At 3 m/s it stops after 3² / 6 + 0.3 · 3 = 2.4 m, on which its offset grows by half of the slope: from 0.1 m
    beyond the border to 0.16 m or 0.52 m. From there it returns by 0.22 m within 11 √(0.22 / 3.5) = 2.8 m, more than
    the 2 m to 1 m behind a car. Its view of 60 m does not suffice to pass."""
    s = 37.5 - 3.0 - BODY.front
    front = s + BODY.wheelbase
    places, values = (front, front + 4.0, 60.0, 80.0), (0.85, 3.0, 3.0, 0.0)
    profile = LateralProfile("pass", places, values, slope, side=1, border=0.75)
    speed = np.minimum(3.0 + 2.0 * TIMES, 10.0)
    motion = Motion(s + np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) / 8.0)), speed)
    outlook = Outlook(LINE, scene((40.0, 0.0, 0.0)), BESIDE, 0.0)
    assert traffic(60.0).verify(profile, motion, outlook, is_current=True, has_begun=True) is expected


@pytest.mark.parametrize("is_last_place", [True, False])
def test_vehicle_without_any_view_begins_after_two_long_pauses(is_last_place: bool) -> None:
    """A truck 2.4 m ahead hides the lane near it; traffic at 10 m/s needs 10 + 100 / 12 m to stop."""
    waiting = traffic(100.0)
    there = scene((6.3 + 2.5, 0.0, 0.0))
    for now, expected in ((13.0, False), (23.9, False), (24.0, is_last_place)):
        outlook = Outlook(LINE, there, BESIDE, now)
        assert waiting.yields(outlook, (1.4, 0.0), is_last_place=is_last_place, has_view=False) is expected


@pytest.mark.parametrize(
    ("has_view", "until_border", "since"),
    [(False, 0.0, PAUSE), (True, 0.0, 2.0 * PAUSE), (True, 2.5, 2.0 * PAUSE - 2.5), (True, 8.0, PAUSE)],
)
def test_vehicle_with_a_view_relies_on_others_after_two_pauses(
    has_view: bool, until_border: float, since: float
) -> None:
    """Within 100 m traffic at 10 m/s, which needs 10 m + 100 / 6 m, can stop."""
    waiting = traffic(100.0)
    for now, expected in ((since - 0.1, False), (since, True)):
        outlook = Outlook(LINE, scene(), BESIDE, now)
        begins = waiting.yields(outlook, (1.4, 0.0), is_last_place=True, has_view=has_view, until_border=until_border)
        assert begins is expected


def test_vehicle_can_stop_in_its_lane_until_its_braking_ends_beyond_it() -> None:
    """The stop of 10 m/s · 0.3 s + 16.7 m from 30 m before the profile ends at 4.4 m after 1.47 s; times are 0.25 s
    apart."""
    motion = Motion(-30.0 + 10.0 * TIMES, np.full(len(TIMES), 10.0))
    assert traffic(100.0).until_border(PASSING, motion) == 1.25
    assert traffic(100.0).until_border(PASSING, Motion(motion.s + 20.0, motion.speed)) == 0.0


def test_pauses_restart_if_traffic_comes_into_view() -> None:
    waiting = traffic(60.0)
    motion = Motion(-20.0 + 10.0 * TIMES, np.full(len(TIMES), 10.0))
    truck, car = (40.0, 0.0, 0.0), (35.0, 3.5, -10.0)
    outlook = Outlook(LINE, scene(truck), BESIDE, 2.0 * PAUSE)
    assert waiting.yields(outlook, (-18.6, 0.0), is_last_place=True, has_view=True)
    assert waiting.verify(PASSING, motion, outlook, is_current=True, has_begun=True) is Verdict.GO
    waiting.observe(scene(truck, car), -18.6, 10.0, 2.0 * PAUSE + 0.1, held_up=True, oncoming=3.5)
    with_car = Outlook(LINE, scene(truck, car), BESIDE, 2.0 * PAUSE + 0.1)
    assert waiting.verify(PASSING, motion, with_car, is_current=True, has_begun=True) is Verdict.WAIT
    afterwards = Outlook(LINE, scene(truck), BESIDE, 2.0 * PAUSE + 6.0)
    assert waiting.verify(PASSING, motion, afterwards, is_current=True, has_begun=True) is Verdict.WAIT


@pytest.mark.parametrize("kind", ["bidirectional", "driving"])
@pytest.mark.parametrize("reverse", [False, True])
def test_lane_for_both_directions_has_oncoming_traffic(kind: str, reverse: bool) -> None:
    """A turning lane between two lanes: from either side it is the lane in which traffic may come."""
    middle = lane_xml(1, kind=kind).replace("<lane ", '<lane direction="both" ' if kind == "driving" else "<lane ", 1)
    lanes = section_xml(left=lane_xml(2) + middle, right=lane_xml(-1))
    roads = RoadNetwork.parse(map_xml(road_xml(length=600.0, lanes=lanes)))
    line = [(600.0, 5.25), (0.0, 5.25)] if reverse else [(0.0, -1.75), (600.0, -1.75)]
    beside = ReferenceLine(PlannedPath(np.array(line), ends=True), roads).lanes_beside(100.0)
    assert math.isnan(beside.left)
    assert beside.oncoming == pytest.approx(3.5)


@pytest.mark.parametrize("kind", ["none", "driving"])
def test_lane_without_width_separates_no_lanes(kind: str) -> None:
    """Lanes of 3.5 m on both sides of the vehicle, the left one for oncoming traffic, behind lanes without width."""
    lanes = section_xml(
        left=lane_xml(2) + lane_xml(1, 0, kind=kind), right=lane_xml(-1) + lane_xml(-2, 0, kind=kind) + lane_xml(-3)
    )
    roads = RoadNetwork.parse(map_xml(road_xml(length=300.0, lanes=lanes)))
    beside = ReferenceLine(PlannedPath(np.array([(0.0, -1.75), (300.0, -1.75)]), ends=True), roads).lanes_beside(100.0)
    assert (beside.oncoming, beside.right) == pytest.approx((3.5, -3.5))
    assert (beside.left_edge, beside.right_edge, beside.far_edge) == pytest.approx((1.75, -5.25, 5.25))
