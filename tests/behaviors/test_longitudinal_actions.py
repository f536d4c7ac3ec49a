"""Speeds and distances along the road with values calculated by hand.

Ego drives at 20 m/s from x = 100 in steps of 0.1 s.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from eidrive_behaviors.actions.speed import duration_over
from eidrive_behaviors.actions.speed_profile import smoothed_segments
from opendrive_xml import lanes_xml, map_xml, road_xml
from recorded_scene import RunScene
from street_scene import after
from whole_run import Run


def speed(target: str, shape: str = "linear", dimension: str = "time", value: float = 0.0) -> str:
    return f"""<PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
      <SpeedActionTarget>{target}</SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>"""


def absolute(value: float) -> str:
    return f'<AbsoluteTargetSpeed value="{value}"/>'


def relative(value: float, kind: str, continuous: bool = False) -> str:
    return (
        f'<RelativeTargetSpeed entityRef="Other" value="{value}" speedTargetValueType="{kind}" '
        f'continuous="{str(continuous).lower()}"/>'
    )


@pytest.mark.element("SpeedAction")
@pytest.mark.parametrize(
    ("shape", "dimension", "value", "half", "end"),
    [
        ("linear", "time", 2.0, 25.0, 2.0),
        ("cubic", "time", 2.0, 25.0, 2.0),
        ("sinusoidal", "time", 2.0, 25.0, 2.0),
        ("linear", "rate", 5.0, 25.0, 2.0),
        ("linear", "distance", 50.0, 25.0, 2.0),
    ],
)
def test_speed_action_reaches_the_target_by_its_dynamics(
    scene: RunScene, shape: str, dimension: str, value: float, half: float, end: float
) -> None:
    """From 20 to 30 m/s in 2 s, at 5 m/s², or over 50 m at a mean of 25 m/s: all end at the same time."""
    played = scene(3, ("Ego", speed(absolute(30), shape, dimension, value)))
    assert played.at(1.0).speed == pytest.approx(half)
    assert played.at(2.0).speed == 30.0
    assert played.when("action 0", "completeState") == pytest.approx(end)


def test_speed_action_rate_is_the_maximum_slope_of_a_cubic(scene: RunScene) -> None:
    """Δ = 10 m/s at 5 m/s² takes 1.5 · 10 / 5 = 3 s."""
    played = scene(4, ("Ego", speed(absolute(30), "cubic", "rate", 5)))
    assert played.at(1.5).speed == pytest.approx(25.0)
    assert played.when("action 0", "completeState") == pytest.approx(3.0)


def test_speed_step_applies_within_the_same_time_step(scene: RunScene) -> None:
    played = scene(0.2, ("Ego", speed(absolute(30), "step")))
    assert played.at(0.1).x == pytest.approx(103.0)
    assert played.when("action 0", "completeState") == pytest.approx(0.1)


def test_speed_action_is_limited_by_the_performance(scene: RunScene) -> None:
    """From 20 to 60 m/s in 1 s would be 40 m/s²; at 10 m/s² it takes 4 s. 80 m/s exceed the maximum of 70 m/s."""
    played = scene(8, ("Ego", speed(absolute(60), "linear", "time", 1)))
    assert played.at(2.0).speed == pytest.approx(40.0)
    assert scene(8, ("Ego", speed(absolute(80), "linear", "rate", 10))).at(8.0).speed == 70.0


@pytest.mark.parametrize(("value", "kind", "expected"), [(5, "delta", 15.0), (1.5, "factor", 15.0), (-4, "delta", 6.0)])
def test_speed_action_relative_target_is_reached(scene: RunScene, value: float, kind: str, expected: float) -> None:
    played = scene(1, ("Ego", speed(relative(value, kind), "step")))
    assert played.at(0.5).speed == expected


@pytest.mark.element("SpeedAction")
def test_speed_action_continuous_follows_until_it_is_preempted(scene: RunScene) -> None:
    later = after(2.95)
    played = scene(
        4,
        ("Other", speed(absolute(20), "linear", "rate", 5)),
        ("Ego", speed(relative(0, "delta", continuous=True), "step")),
        ("Ego", speed(absolute(3), "step"), later),
    )
    assert played.at(1.1).speed == pytest.approx(played.at(1.0, "Other").speed)
    assert played.when("action 1", "completeState") == pytest.approx(3.0)
    assert played.at(3.1).speed == 3.0


@pytest.mark.parametrize(("dimension", "value"), [("time", 2.0), ("rate", 2.5), ("distance", 45.0)])
@pytest.mark.parametrize(("kind", "amount"), [("delta", 5.0), ("factor", 1.25)])
@pytest.mark.parametrize("continuous", [False, True])
def test_speed_relative_to_the_actor_itself_refers_to_its_start(
    scene: RunScene, dimension: str, value: float, kind: str, amount: float, continuous: bool
) -> None:
    """From 20 to 25 m/s in 2 s, at 2.5 m/s², or over 45 m at a mean of 22.5 m/s."""
    target = relative(amount, kind, continuous).replace("Other", "Ego")
    played = scene(3, ("Ego", speed(target, "linear", dimension, value)))
    assert [played.at(time).speed for time in (1.0, 2.0, 3.0)] == pytest.approx([22.5, 25.0, 25.0])
    assert played.when("action 0", "completeState") == (None if continuous else pytest.approx(2.0))


@pytest.mark.parametrize(
    ("dimension", "value", "before", "slope", "reached"),
    [("time", 4.0, 14.75, 10.0, 4.7), ("distance", 60.0, 14.75, 10.0, 4.7), ("rate", 2.0, 15.8, 2.0, 14.2)],
)
def test_speed_relative_to_a_jumping_reference_keeps_the_limits(
    scene: RunScene, dimension: str, value: float, before: float, slope: float, reached: float
) -> None:
    """From 20 m/s toward 10 m/s in 4 s, over 60 m at a mean of 15 m/s, or at 2 m/s², until the other car drives at
    40 m/s at 2.1 s: from then on at the maximum acceleration of 10 m/s², or at the given rate.
    """
    played = scene(
        15,
        ("Ego", speed(relative(0, "delta"), "linear", dimension, value)),
        ("Other", speed(absolute(40), "step"), after(1.95)),
    )
    assert played.at(2.1).speed == pytest.approx(before)
    assert played.at(3.1).speed == pytest.approx(before + slope)
    assert played.when("action 0", "completeState") == pytest.approx(reached)


@pytest.mark.parametrize(
    ("start", "target", "expected"), [(10, 20, 4.0), (10, 10, 0.0), (20, 0, 6.0), (-10, 10, 2 * 30 / 10 + 2 * 30 / 10)]
)
def test_duration_over_a_distance_of_60_m(start: float, target: float, expected: float) -> None:
    assert duration_over(start, target, 60.0) == pytest.approx(expected)


def test_speed_action_of_driven_vehicle_sets_the_goal(scene: RunScene) -> None:
    """No engine moves the vehicle here, so that the goal remains and the action continues."""
    played = scene(3, ("Ego", speed(absolute(30), "linear", "time", 1)), driven=True)
    assert played.commands[0].driven == {"Ego"}
    assert "Ego" not in played.commands[5].placements
    assert played.commands[-1].goals["Ego"].speed == 30.0
    assert played.when("action 0", "completeState") is None


RATES = 'maxAccelerationRate="4" maxDecelerationRate="4"'


def profile(
    mode: str,
    *entries: tuple[float | None, float],
    rates: str = "",
    limits: str = 'maxAcceleration="5" maxDeceleration="4"',
) -> str:
    rows = "".join(
        f'<SpeedProfileEntry {"" if time is None else f"time={chr(34)}{time}{chr(34)}"} speed="{value}"/>'
        for time, value in entries
    )
    constraints = f"<DynamicConstraints {limits} {rates}/>"
    return f"""<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="{mode}">{constraints}{rows}
      </SpeedProfileAction></LongitudinalAction></PrivateAction>"""


@pytest.mark.element("SpeedAction", "SpeedProfileAction")
@pytest.mark.parametrize("step_first", [True, False])
def test_speed_step_beside_profile_sets_the_start_of_the_profile(scene: RunScene, step_first: bool) -> None:
    """At 0.5 s from 20 m/s to 0 at once, from there to 4 m/s within 4 s: v = t - 0.5 s."""
    later = after(0.45)
    step, rise = speed(absolute(0), "step"), profile("position", (4.0, 4.0))
    actions = [step, rise] if step_first else [rise, step]
    played = scene(6, ("Ego", '</Action><Action name="second">'.join(actions), later))
    assert played.at(0.5).speed == 20.0
    for time in (0.6, 1.5, 3.0, 4.4):
        assert played.at(time).speed == pytest.approx(time - 0.5)
    assert played.at(5.0).speed == 4.0
    step_name, rise_name = ("action 0", "second") if step_first else ("second", "action 0")
    ends = {c.element: c.transition.value for c in played.changes if c.after.value == "completeState" and c.transition}
    assert (ends[step_name], ends[rise_name]) == ("endTransition", "endTransition")
    assert (played.when(step_name, "completeState"), played.when(rise_name, "completeState")) == pytest.approx(
        (0.5, 4.5)
    )


@pytest.mark.element("SpeedProfileAction")
def test_speed_profile_in_position_mode_is_linear(scene: RunScene) -> None:
    played = scene(6, ("Ego", profile("position", (2.0, 30.0), (2.5, 20.0))))
    assert [played.at(t).speed for t in (1.0, 2.0, 3.0, 4.5)] == pytest.approx([25, 30, 26, 20])
    assert played.when("action 0", "completeState") == pytest.approx(4.5)


def test_speed_profile_entry_without_time_uses_the_limits(scene: RunScene) -> None:
    """10 m/s more at 5 m/s², then 8 m/s less at 4 m/s²: 2 s each."""
    played = scene(5, ("Ego", profile("position", (None, 30.0), (None, 22.0))))
    assert [played.at(t).speed for t in (1.0, 2.0, 3.0, 4.0)] == pytest.approx([25, 30, 26, 22])


@pytest.mark.element("SpeedProfileAction")
def test_speed_profile_in_follow_mode_has_parabolic_corners() -> None:
    """To 10 m/s in 4 s, to 4 m/s in 4 s more; slopes 2.5 and -1.5 m/s², rates 4 and 3 m/s³, calculated by hand.

    The first slope is reached after 0.625 s with 0.78125 m/s. From then v = 2.5 t - 0.78125, which meets the second
    line 16 - 1.5 t at 4.1953 s. The transition takes 4/3 s, centered there. The last slope ends 0.25 s after the end.
    """
    segments = smoothed_segments([(0.0, 0.0), (4.0, 10.0), (8.0, 4.0)], up=4.0, down=3.0)
    assert segments is not None
    times = [segment.time for segment in segments]
    assert times == pytest.approx([0, 0.625, 4.1953 - 2 / 3, 4.1953 + 2 / 3, 8 - 1.5 / 8, 8 + 1.5 / 8], abs=1e-4)
    assert segments[1].at(2.0) == pytest.approx(2.5 * 2.0 - 0.78125)
    assert segments[3].at(6.0) == pytest.approx(16.0 - 9.0)
    assert segments[-1].speed == pytest.approx(4.0)


def test_speed_profile_single_change_starts_and_ends_without_acceleration() -> None:
    """8 m/s in 5 s at 4 m/s³: a (5 - a/4) = 8 gives a = 1.754 m/s²."""
    segments = smoothed_segments([(0.0, 0.0), (5.0, 8.0)], up=4.0, down=4.0)
    assert segments is not None
    slope = 10.0 - math.sqrt(100.0 - 32.0)
    assert segments[1].slope == pytest.approx(slope)
    assert segments[2].at(segments[3].time) == pytest.approx(8.0)
    assert segments[3].time == 5.0


@pytest.mark.parametrize("before", [-6.0, -3.0, -0.5, 0.5, 3.0, 6.0])
@pytest.mark.parametrize(("first", "last"), [(10.0, 4.0), (4.0, 10.0), (10.0, 10.0), (10.0, 9.0)])
@pytest.mark.parametrize("span", [0.1, 2.0, 6.0])
def test_speed_profile_continues_the_acceleration_before_it(
    before: float, first: float, last: float, span: float
) -> None:
    up, down, rise, fall = 4.0, 3.0, 5.0, 8.0
    segments = smoothed_segments([(0.0, first), (span, last)], up, down, rise, fall, before)
    assert segments is not None
    assert (segments[0].speed, segments[0].slope) == (first, before)
    for segment, later in pairwise(segments):
        assert later.speed == pytest.approx(segment.at(later.time))
        assert later.slope == pytest.approx(segment.slope_at(later.time), abs=1e-9)
        assert segment.bend == pytest.approx(0.0) or segment.bend in (up, -down)
        assert -max(fall, -before) - 1e-9 <= later.slope <= max(rise, before) + 1e-9
    assert (segments[-1].speed, segments[-1].slope) == (last, 0.0)
    assert segments[-1].time >= span - 1e-9


def test_speed_profile_with_initial_acceleration_has_the_speeds_of_esmini() -> None:
    """Values of its test TestSpeedProfileNonZeroInitalAcc: from 10 m/s and 1 m/s² to 4 m/s in 5 s."""
    segments = smoothed_segments([(0.0, 10.0), (5.0, 4.0)], 5.0, 4.0, 4.0, 10.0, 1.0)
    assert segments is not None
    places = {time: next(segment for segment in reversed(segments) if segment.time <= time) for time in (0.3, 4.9, 5.1)}
    assert [segment.at(time) for time, segment in places.items()] == pytest.approx([10.12, 4.025, 4.0], abs=1e-3)


def test_speed_profile_interrupts_a_braking_in_the_shortest_time(scene: RunScene) -> None:
    """A stop from 15 m/s while braking with 5 m/s²: the slope falls to -a at 3 m/s³ and rises to 0 at 4 m/s³.

    (a² - 25) / 6 + a² / 8 = 15 m/s gives a = 8.106 m/s², after 1.035 s, and 2.027 s more.
    """
    rates = 'maxAccelerationRate="4" maxDecelerationRate="3"'
    stop = profile("follow", (None, 0.0), rates=rates, limits='maxAcceleration="5" maxDeceleration="20"')
    played = scene(6, ("Ego", speed(absolute(0.0), "linear", "rate", 5.0)), ("Ego", stop, after(0.95)))
    assert played.at(1.0).speed == pytest.approx(15.0)
    assert played.at(1.5).speed == pytest.approx(15.0 - 5.0 * 0.5 - 1.5 * 0.5**2)
    assert played.at(2.0).speed == pytest.approx(15.0 - 5.0 * 1.0 - 1.5 * 1.0**2)
    assert played.when("action 1", "completeState") == pytest.approx(1.0 + 1.035 + 2.027, abs=0.11)


@pytest.mark.element("SpeedProfileAction")
@pytest.mark.parametrize("own", [False, True])
def test_speed_profile_limits_of_the_action_precede_the_vehicle(scene: RunScene, own: bool) -> None:
    """8 m/s more in 5 s at 4 m/s³ as above: 2 m/s³ · (0.438 s)² and 1.754 m/s² · 0.562 s in the first second."""
    action = profile("follow", (5.0, 28.0), rates='maxAccelerationRate="4" maxDecelerationRate="4"' if own else "")
    rate = 100 if own else 4
    played = scene(6, ("Ego", action), performance=f'maxAccelerationRate="{rate}" maxDecelerationRate="{rate}"')
    assert [played.at(t).speed for t in (1.0, 2.5, 5.0)] == pytest.approx([21.3693, 24.0, 28.0], abs=1e-3)


def test_speed_profile_is_limited_to_the_maximum_speed(scene: RunScene) -> None:
    played = scene(11, ("Ego", profile("position", (10.0, 90.0))))
    assert played.at(10.0).speed == 70.0
    played = scene(3, ("Ego", profile("position", (2.0, 90.0), rates='maxSpeed="30"')))
    assert played.at(2.0).speed == 30.0


@pytest.mark.element("SpeedProfileAction")
@pytest.mark.parametrize(
    ("mode", "entry", "limits", "rates", "samples", "end"),
    [
        # 10 m/s more at 1 m/s²
        ("position", (2.0, 30.0), 'maxAcceleration="1"', None, {5.0: 25.0, 9.0: 29.0}, 10.0),
        ("follow", (2.0, 30.0), 'maxAcceleration="1"', None, {5.0: 25.0, 9.0: 29.0}, 10.0),
        # the limits of the action have precedence over the 10 m/s² of the Performance, which apply without them
        ("position", (0.5, 30.0), 'maxAcceleration="40"', None, {0.5: 30.0}, 0.5),
        ("position", (None, 30.0), 'maxAcceleration="40"', None, {0.2: 28.0, 0.5: 30.0}, 0.25),
        ("position", (0.5, 30.0), "", None, {0.5: 25.0}, 1.0),
        ("position", (None, 30.0), "", None, {0.5: 25.0}, 1.0),
        # 1 m/s² after 0.5 s and 0.25 m/s; it falls within 1 s and 0.5 m/s
        ("follow", (2.0, 30.0), 'maxAcceleration="1"', (2, 1), {0.5: 20.25, 5.0: 24.75, 9.7: 29.45}, 10.75),
        # -2 m/s² after 0.5 s, by 0.5 m/s
        ("follow", (1.0, 10.0), 'maxDeceleration="2"', (4, 4), {0.5: 19.5, 3.0: 14.5, 5.0: 10.5}, 5.5),
        # the rates alone allow 1 m/s² only after 1 s, and 0 after 1 s more
        ("follow", (1.0, 21.0), 'maxAcceleration="5"', (1, 1), {1.0: 20.5}, 2.0),
    ],
)
def test_speed_profile_entry_beyond_the_limits_is_reached_later(
    scene: RunScene,
    mode: str,
    entry: tuple[float | None, float],
    limits: str,
    rates: tuple[float, float] | None,
    samples: dict[float, float],
    end: float,
) -> None:
    given = f'maxAccelerationRate="{rates[0]}" maxDecelerationRate="{rates[1]}"' if rates else ""
    played = scene(12, ("Ego", profile(mode, entry, limits=limits, rates=given)))
    assert {time: played.at(time).speed for time in samples} == pytest.approx(samples)
    assert played.when("action 0", "completeState") == pytest.approx(end, abs=0.051)
    assert played.at(12.0).speed == entry[1]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speed_profile_with_overlapping_corners_keeps_acceleration_and_rate(scene: RunScene, sign: float) -> None:
    """Entries of 5 m/s² every 0.2 s leave no space for corners at 4 m/s³.

    In steps of 0.1 s, 0.4, 0.8, … 4.0, … 0.4 m/s² make 4 m/s in 19 steps, the fewest at 4 m/s³.
    """
    entries = [(0.2, sign * (20.0 + number)) for number in (1, 2, 3, 4)] + [(1.0, sign * 24.0)]
    action = profile("follow", *entries, rates='maxAccelerationRate="4" maxDecelerationRate="4"')
    played = scene(4, ("Ego", action), ego=(-1, 300.0, sign * 20.0))
    speeds = [row["Ego"].speed * sign for row in played.rows]
    accelerations = [0.0, *((after - before) / 0.1 for before, after in pairwise(speeds))]
    assert max(accelerations) <= 5.0
    assert min(accelerations) >= -1e-9
    assert max(abs(after - before) for before, after in pairwise(accelerations)) <= 0.4 + 1e-9
    assert speeds[-1] == pytest.approx(24.0)
    assert played.when("action 0", "completeState") == pytest.approx(1.9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speed_profile_with_overlapping_corners_does_not_pass_its_turns(scene: RunScene, sign: float) -> None:
    """It turns at 21 m/s after 1.2 s, and ends at 5 m/s: 16 m/s at 2 m/s³ take 2 √(16 / 2) s = 5.7 s.

    At the turn an acceleration of up to 1 m/s², which falls to 0 within 0.5 s, remains.
    """
    entries = [(1.0, sign * 20.5), (0.2, sign * 21.0), (3.0, sign * 5.0)]
    action = profile(
        "follow",
        *entries,
        limits='maxAcceleration="9" maxDeceleration="9"',
        rates='maxAccelerationRate="2" maxDecelerationRate="2"',
    )
    played = scene(9, ("Ego", action), ego=(-1, 300.0, sign * 20.0))
    speeds = [row["Ego"].speed * sign for row in played.rows]
    accelerations = [0.0, *((after - before) / 0.1 for before, after in pairwise(speeds))]
    assert max(abs(after - before) for before, after in pairwise(accelerations)) <= 0.2 + 1e-9
    assert max(speeds) <= 21.0 + 1e-9
    assert min(speeds) == speeds[-1] == pytest.approx(5.0)
    assert played.when("action 0", "completeState") == pytest.approx(1.2 + 2.0 * math.sqrt(8.0), abs=0.5)


def test_speed_profile_in_follow_mode_keeps_its_last_speed_until_its_time(scene: RunScene) -> None:
    """Two entries of equal slope, 1 m/s², then the same speed for 3 s."""
    action = profile("follow", (2.0, 22.0), (2.0, 24.0), (3.0, 24.0), rates=RATES)
    assert scene(8, ("Ego", action)).when("action 0", "completeState") == pytest.approx(7.0)


@pytest.mark.parametrize("limit", ["maxAcceleration", "maxAccelerationRate"])
def test_speed_profile_with_a_limit_of_0_keeps_the_speed(scene: RunScene, limit: str) -> None:
    played = scene(3, ("Ego", profile("follow", (2.0, 30.0), limits=f'{limit}="0"')))
    assert played.at(3.0).speed == pytest.approx(20.0, abs=1e-4)
    assert played.when("action 0", "completeState") is None


@pytest.mark.parametrize(("mode", "speed_at_start"), [("position", 26.0), ("follow", 20.0)])
def test_speed_profile_first_entry_at_time_0_depends_on_the_mode(
    scene: RunScene, mode: str, speed_at_start: float
) -> None:
    played = scene(3, ("Ego", profile(mode, (0.0, 26.0), (2.0, 28.0))))
    assert [played.at(t).speed for t in (1.0, 2.0)] == pytest.approx([0.5 * (speed_at_start + 28.0), 28.0])


@pytest.mark.element("SpeedAction", "SpeedProfileAction")
@pytest.mark.parametrize(
    ("action", "warning"),
    [
        (speed(absolute(40.0), value=1.0), "takes 2.00 s instead of 1.00 s: maxAcceleration is 10 m/s²"),
        (speed(absolute(0.0), value=1.0), "takes 2.00 s instead of 1.00 s: maxDeceleration is 10 m/s²"),
        # half the distance at the mean speed of 30 m/s
        (speed(absolute(40.0), dimension="distance", value=30.0), "takes 2.00 s instead of 1.00 s: maxAcceleration"),
        (speed(absolute(40.0), "cubic", "rate", 20.0), "takes 3.00 s instead of 1.50 s: maxAcceleration"),
        (speed(absolute(80.0), value=10.0), "the target speed is reduced to 70 m/s (got 80 m/s)"),
        (profile("position", (2.0, 30.0), (1.0, 22.0)), "entry 2 takes 2.00 s instead of 1.00 s: maxDeceleration"),
        (profile("follow", (1.0, 24.0), rates=RATES), "limited to 4 and 4 m/s³"),
        (profile("follow", (1.0, 24.0), (1.0, 20.0), rates=RATES), "limited to 4 and 4 m/s³"),
        (speed(absolute(40.0), value=2.0), None),
        (speed(absolute(40.0), "step"), None),
        (profile("position", (2.0, 30.0), (2.5, 20.0)), None),
        (profile("follow", (2.0, 24.0), rates=RATES), None),
    ],
)
def test_speed_change_delayed_by_a_limit_warns_once(run: Run, action: str, warning: str | None) -> None:
    warnings = [str(one) for one in run(1.0, ("Ego", action), driven=False).result.warnings]
    texts = [text for text in warnings if "SpeedAction" in text or "SpeedProfileAction" in text]
    assert len(texts) == (warning is not None)
    assert warning is None or warning in texts[0]


def keep(attributes: str, limits: str = "") -> str:
    return f"""<PrivateAction><LongitudinalAction>
      <LongitudinalDistanceAction entityRef="Other" {attributes}>{limits}</LongitudinalDistanceAction>
      </LongitudinalAction></PrivateAction>"""


@pytest.mark.element("LongitudinalDistanceAction")
@pytest.mark.parametrize(
    ("attributes", "gap"),
    [
        ('distance="30" freespace="false" continuous="true"', 30.0),
        ('distance="30" freespace="true" continuous="true"', 35.0),
        ('timeGap="2" freespace="false" continuous="true"', 20.0),
        ('distance="15" freespace="false" continuous="true" displacement="leadingReferencedEntity"', -15.0),
    ],
)
def test_longitudinal_distance_without_limits_applies_at_once(scene: RunScene, attributes: str, gap: float) -> None:
    played = scene(1, ("Ego", keep(attributes)))
    for time in (0.1, 1.0):
        assert played.at(time, "Other").x - played.at(time).x == pytest.approx(gap)
    assert played.at(1.0).speed == 10.0


@pytest.mark.element("LongitudinalDistanceAction")
@pytest.mark.parametrize("continuous", ["true", "false"])
def test_longitudinal_distance_without_limits_applies_during_a_lane_change(scene: RunScene, continuous: str) -> None:
    """The gap is 50 m. The lane change takes 4 s; a lateral step of 0.1 m shortens a step of 1 m by 5 mm."""
    change = """<PrivateAction><LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="4"/>
      <LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction>
      </PrivateAction>"""
    gap = keep(f'distance="30" freespace="false" continuous="{continuous}" coordinateSystem="road"')
    played = scene(2, ("Ego", change), ("Ego", gap))
    for time in (0.1, 0.2, 1.0):
        assert played.at(time, "Other").x - played.at(time).x == pytest.approx(30.0, abs=0.06)


@pytest.mark.element("LongitudinalDistanceAction")
def test_longitudinal_distance_with_a_maximum_speed_only_is_approached_at_it(scene: RunScene) -> None:
    """Ego closes the gap of 50 m to 20 m by 25 - 10 = 15 m/s in 2 s, and then follows at 10 m/s."""
    limits = '<DynamicConstraints maxSpeed="25"/>'
    played = scene(3, ("Ego", keep('distance="20" freespace="false" continuous="true"', limits)))
    for time, gap, speed in ((1.0, 35.0, 25.0), (1.8, 23.0, 25.0), (3.0, 20.0, 10.0)):
        assert played.at(time, "Other").x - played.at(time).x == pytest.approx(gap)
        assert played.at(time).speed == pytest.approx(speed)


@pytest.mark.element("LongitudinalDistanceAction")
def test_longitudinal_distance_with_limits_is_reached_within_them(scene: RunScene) -> None:
    limits = '<DynamicConstraints maxAcceleration="3" maxDeceleration="3" maxSpeed="25"/>'
    played = scene(40, ("Ego", keep('distance="20" freespace="false" continuous="false"', limits)))
    end = played.when("action 0", "completeState")
    assert end is not None
    assert played.at(end, "Other").x - played.at(end).x == pytest.approx(20.0, abs=0.15)
    changes = [abs(b["Ego"].speed - a["Ego"].speed) for a, b in zip(played.rows, played.rows[1:], strict=False)]
    assert max(changes) <= 0.3 + 1e-9


@pytest.mark.element("SynchronizeAction")
def test_synchronize_arrives_with_the_master_at_the_final_speed(scene: RunScene) -> None:
    """Other needs (400 - 150) / 10 = 25 s; Ego covers 500 m in that time, with 22 m/s at arrival."""
    position = '<Position><LanePosition roadId="1" laneId="{}" s="{}"/></Position>'
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster>{position.format(-1, 400)[10:-11]}</TargetPositionMaster>
      <TargetPosition>{position.format(-1, 600)[10:-11]}</TargetPosition>
      <FinalSpeed><AbsoluteSpeed value="22"/></FinalSpeed></SynchronizeAction></PrivateAction>"""
    played = scene(30, ("Ego", action), dt=0.05)
    end = played.when("action 0", "completeState")
    assert end is not None
    assert end == pytest.approx(25.0, abs=0.15)
    assert played.at(25.0).x == pytest.approx(600.0, abs=1.0)
    assert played.at(end + 0.1).speed == 22.0


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.05, 0.1, 0.5])
def test_synchronize_at_any_time_step_ends_at_the_arrival(scene: RunScene, dt: float) -> None:
    """Ego needs (200 - 100) / 20 = 5 s, a multiple of all these steps."""
    action = """<PrivateAction><SynchronizeAction masterEntityRef="Ego">
      <TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="200"/></TargetPositionMaster>
      <TargetPosition><LanePosition roadId="1" laneId="-2" s="220"/></TargetPosition>
      </SynchronizeAction></PrivateAction>"""
    played = scene(6, ("Other", action), dt=dt, other=(-2, 150.0, 10.0))
    assert played.when("action 0", "completeState") == pytest.approx(5.0)
    assert played.at(5.0, "Other").x == pytest.approx(220.0)


@pytest.mark.parametrize("curvature", [0.0, 0.01])
def test_synchronize_in_a_bend_keeps_its_constant_deceleration(scene: RunScene, curvature: float) -> None:
    """Other drives 102 m to its target in 10.2 s, Ego 88 m at 10 m/s and then 2 · 88 / 10.2 - 10 = 7.25 m/s.

    In the bend of 100 m to the left the radius is 102 m in lane -1 and 110 m in lane -3.
    """
    ways = 102.0 / (1.0 + 2.0 * curvature), 88.0 / (1.0 + 10.0 * curvature)
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="{100.0 + ways[0]}"/></TargetPositionMaster>
      <TargetPosition><LanePosition roadId="1" laneId="-3" s="{100.0 + ways[1]}"/></TargetPosition>
      </SynchronizeAction></PrivateAction>"""
    street = map_xml(road_xml(length=600.0, curvature=curvature, lanes=lanes_xml(1, 3, 4)))
    played = scene(10.1, ("Ego", action), ego=(-3, 100.0, 10.0), other=(-1, 100.0, 10.0), street=street, dt=0.02)
    last = 2.0 * 88.0 / 10.2 - 10.0
    for time in (2.0, 5.0, 8.0, 10.0):
        assert played.at(time).speed == pytest.approx(10.0 + (last - 10.0) * time / 10.2, abs=0.03)


@pytest.mark.element("SynchronizeAction")
def test_synchronize_of_much_too_fast_actor_arrives_with_the_master(scene: RunScene) -> None:
    """Other needs (350 - 150) / 10 = 20 s; Ego has 100 m.

    At constant deceleration from 20 m/s Ego would be there after 6.7 s, and would have to reverse.
    """
    position = '<Position><LanePosition roadId="1" laneId="{}" s="{}"/></Position>'
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster>{position.format(-1, 350)[10:-11]}</TargetPositionMaster>
      <TargetPosition>{position.format(-1, 200)[10:-11]}</TargetPosition></SynchronizeAction></PrivateAction>"""
    played = scene(25, ("Ego", action), dt=0.05)
    assert played.when("action 0", "completeState") == pytest.approx(20.0, abs=0.1)
    assert played.at(20.0).x == pytest.approx(200.0, abs=0.5)
    assert min(row["Ego"].speed for row in played.rows) >= 0.0
    assert played.at(20.0).speed == pytest.approx(100.0 / 20.0, abs=0.1), "the mean speed"


@pytest.mark.element("SynchronizeAction")
@pytest.mark.parametrize(
    ("final", "speed_at_end"),
    [
        ("", 40.0),
        ('<FinalSpeed><AbsoluteSpeed value="20"/></FinalSpeed>', 20.0),
        ('<FinalSpeed><RelativeSpeedToMaster value="5" speedTargetValueType="delta"/></FinalSpeed>', 15.0),
    ],
)
def test_synchronize_arrives_at_a_moving_target(run: Run, final: str, speed_at_end: float) -> None:
    """The master needs 10 s. The target, 20 m behind a car of 20 m/s, is then at 150 + 20 · 10 = 350 m.

    Ego covers 250 m from 10 m/s; at constant acceleration its speed at the end is 2 · 25 - 10 = 40 m/s. With a final
    speed below that of the car it arrives from ahead.
    """
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster><LanePosition roadId="1" laneId="-2" s="200"/></TargetPositionMaster>
      <TargetPosition><RelativeLanePosition entityRef="Car" dLane="0" dsLane="-20"/></TargetPosition>{final}
      </SynchronizeAction></PrivateAction>"""
    others = {"Other": (-2, 100.0, 10.0), "Car": (-1, 170.0, 20.0)}
    played = run(11.0, ("Ego", action), ego=(-1, 100.0, 10.0), driven=False, others=others)
    assert played.x("Ego")[200] == pytest.approx(350.0, abs=0.3)
    assert played.of("Ego", "speed")[200] == pytest.approx(speed_at_end, abs=0.7)


@pytest.mark.parametrize("final", ["", '<FinalSpeed><AbsoluteSpeed value="80"/></FinalSpeed>'])
def test_synchronize_does_not_exceed_the_maximum_speed_of_the_vehicle(scene: RunScene, final: str) -> None:
    """Other needs (250 - 150) / 10 = 10 s; in that time Ego covers less than 10 s * 70 m/s, its maximum, of 800 m."""
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="250"/></TargetPositionMaster>
      <TargetPosition><LanePosition roadId="1" laneId="-1" s="900"/></TargetPosition>{final}
      </SynchronizeAction></PrivateAction>"""
    played = scene(12, ("Ego", action), dt=0.05)
    assert max(row["Ego"].speed for row in played.rows) == 70.0
    assert played.when("action 0", "completeState") == pytest.approx(10.0, abs=0.1), "the arrival of the master"
    assert 100.0 + 20.0 * 10.0 < played.at(10.0).x < 100.0 + 70.0 * 10.0


@pytest.mark.parametrize(("target", "is_late"), [(740.0, False), (765.0, False), (900.0, True)])
def test_synchronize_warns_only_if_the_maximum_speed_is_too_low(run: Run, target: float, is_late: bool) -> None:
    """Other needs 10 s; Ego needs means of 64, 66.5 and 80 m/s, begins with 60 m/s, and can drive 70 m/s.

    Between two phases of equal acceleration it would have 68, 73 and 100 m/s.
    """
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster><LanePosition roadId="1" laneId="-2" s="250"/></TargetPositionMaster>
      <TargetPosition><LanePosition roadId="1" laneId="-1" s="{target}"/></TargetPosition>
      <FinalSpeed><AbsoluteSpeed value="60"/></FinalSpeed></SynchronizeAction></PrivateAction>"""
    played = run(12.0, ("Ego", action), ego=(-1, 100.0, 60.0), driven=False, others={"Other": (-2, 150.0, 10.0)})
    assert any("cannot arrive in time" in text for text in played.result.warnings) is is_late
    assert max(played.of("Ego", "speed")) <= 70.0
    if is_late:
        assert played.x("Ego")[200] < 100.0 + 10.0 * 70.0
    else:
        assert played.x("Ego")[200] == pytest.approx(target, abs=2.0)


def test_synchronize_of_a_driven_vehicle_warns_only_that_it_has_no_effect(run: Run) -> None:
    action = """<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster><LanePosition roadId="1" laneId="-2" s="250"/></TargetPositionMaster>
      <TargetPosition><LanePosition roadId="1" laneId="-1" s="990"/></TargetPosition>
      </SynchronizeAction></PrivateAction>"""
    played = run(2.0, ("Ego", action), others={"Other": (-2, 150.0, 10.0)})
    (warning,) = [text for text in played.result.warnings if "SynchronizeAction" in text or "arrive" in text]
    assert "no effect" in warning
