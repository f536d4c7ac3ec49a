"""Trajectories: backward motion, distances along them, and synchronized arrivals. All streets are straight."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import Any

import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml
from openscenario_xml import round_car_xml
from recorded_scene import RunScene
from storyboard_xml import element_state_xml, global_xml, init_xml, speed_xml, teleport_xml
from street_scene import NOTHING, after
from trajectories import curve, follow, on_road, world
from whole_run import RecordedRun, Run

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.storyboard.positions.distances import distance

HALF_TURN = math.pi


WALKER = """<ScenarioObject name="Walker"><Pedestrian name="w" pedestrianCategory="pedestrian" mass="70">
  <BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.5" height="1.8"/></BoundingBox>
  </Pedestrian></ScenarioObject>"""
FINE = RunSettings(dt=0.01)


def row(played: RecordedRun, time: float, name: str = "Ego", dt: float = 0.05) -> tuple[float, float, float, float]:
    view = played.frames[round(time / dt)].view
    index = view.rows[name]
    x, y, _ = view.position[index].tolist()
    return x, y, math.remainder(float(view.yaw[index]), math.tau), float(view.speed[index])


def drive(run: Run, *actions: str, end: float = 3.0) -> RecordedRun:
    """Run Ego with these actions in Init."""
    return run(end, driven=False, init=f'<Private entityRef="Ego">{"".join(actions)}</Private>')


AHEAD = curve(world(150.0, -2.0), world(900.0, -2.0))
AHEAD_WITH_HEADING = curve(world(150.0, -2.0, 0.0), world(900.0, -2.0, 0.0))
BACK_ON_ROAD = curve(on_road(500.0, 0.0), on_road(50.0, 0.0))


@pytest.mark.element("FollowTrajectoryAction")
@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("way", [AHEAD, AHEAD_WITH_HEADING])
@pytest.mark.parametrize("order", ["teleport speed follow", "speed follow teleport", "follow teleport speed"])
def test_trajectory_with_negative_speed_leads_backwards_in_any_order(run: Run, mode: str, way: str, order: str) -> None:
    """At -5 m/s from x = 150, facing along the curve: x = 150 - 5 t."""
    parts = {"teleport": teleport_xml(world(150.0, -2.0, 0.0)), "speed": speed_xml(-5.0), "follow": follow(way, mode)}
    played = drive(run, *(parts[name] for name in order.split()))
    for time in (0.05, 1.0, 3.0):
        assert row(played, time) == pytest.approx((150.0 - 5.0 * time, -2.0, 0.0, -5.0), abs=1e-6)


@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("order", ["teleport speed follow", "speed follow teleport", "follow speed teleport"])
def test_trajectory_against_the_heading_is_driven_in_reverse(run: Run, mode: str, order: str) -> None:
    """Reversing car of Euro NCAP's CPRA: it faces along the road, and its trajectory leads back on it."""
    parts = {
        "teleport": teleport_xml(world(500.0, 0.0, 0.0)),
        "speed": speed_xml(-5.0),
        "follow": follow(BACK_ON_ROAD, mode),
    }
    played = drive(run, *(parts[name] for name in order.split()))
    for time in (0.0, 0.05, 1.0, 3.0):
        assert row(played, time) == pytest.approx((500.0 - 5.0 * time, 0.0, 0.0, -5.0), abs=1e-6)


def test_trajectory_of_absent_reversing_actor_uses_the_lane_heading(run: Run) -> None:
    lane = '<LanePosition roadId="1" laneId="-1" s="{}"/>'
    back = curve(lane.format(500), lane.format(50))
    walker = WALKER
    for order in ((speed_xml(-5.0), follow(back)), (follow(back), speed_xml(-5.0))):
        init = f'<Private entityRef="Walker">{"".join(order)}</Private>'
        played = run(2.0, driven=False, more=walker, init=init)
        for time in (0.0, 1.0, 2.0):
            assert row(played, time, "Walker") == pytest.approx((500.0 - 5.0 * time, -2.0, 0.0, -5.0), abs=1e-6)


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_trajectory_with_change_of_direction_is_driven_back(run: Run, mode: str) -> None:
    """10 m/s forwards for 1 s, to -10 m/s within 2 s: it reverses after 2 s, 5 m farther on, and drives back."""
    way = curve(world(100.0, -2.0), world(900.0, -2.0))
    played = run(
        4.0,
        ("Ego", speed_xml(-10.0, 2.0), after(0.995)),
        driven=False,
        ego=(-1, 100.0, 10.0),
        init=f'<Private entityRef="Ego">{follow(way, mode)}</Private>',
        settings=FINE,
    )
    assert row(played, 1.0, dt=0.01)[0] == pytest.approx(110.0, abs=0.11)
    assert row(played, 2.0, dt=0.01)[0] == pytest.approx(115.0, abs=0.2)
    x, y, h, v = row(played, 4.0, dt=0.01)
    assert x == pytest.approx(100.0, abs=0.3)
    assert (y, h, v) == pytest.approx((-2.0, 0.0, -10.0))


def test_trajectory_in_reverse_respects_the_maximum_steering_angle(run: Run) -> None:
    """The maximum curvature is tan 0.5 / 3 m; the corner is behind the car, at (80, -2)."""
    way = curve(world(100.0, -2.0), world(80.0, -2.0), world(80.0, -42.0))
    played = drive(run, teleport_xml(world(100.0, -2.0, 0.0)), speed_xml(-5.0), follow(way, "follow"), end=11.0)
    largest = math.tan(0.5) / 3.0
    places = [row(played, 0.05 * n) for n in range(len(played.frames))]
    for before, now in pairwise(places):
        turn, way_gone = math.remainder(now[2] - before[2], math.tau), math.dist(before[:2], now[:2])
        assert abs(turn) <= largest * way_gone * 1.01 + 1e-6
        ahead = (now[0] - before[0]) * math.cos(before[2]) + (now[1] - before[1]) * math.sin(before[2])
        assert ahead < 0.0
    assert places[-1][:2] == pytest.approx((80.0, -36.0), abs=1.5)
    assert places[-1][2] == pytest.approx(math.pi / 2, abs=0.05)


def test_timed_trajectory_with_opposite_headings_has_negative_speed(run: Run) -> None:
    timed = curve(world(200.0, -2.0, 0.0), world(180.0, -2.0, 0.0), times=(0.0, 2.0))
    reference = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'
    played = drive(run, follow(timed, reference=reference), end=4.0)
    assert row(played, 0.0) == pytest.approx((200.0, -2.0, 0.0, -10.0))
    assert row(played, 1.0) == pytest.approx((190.0, -2.0, 0.0, -10.0), abs=1e-6)
    assert row(played, 3.0) == pytest.approx((170.0, -2.0, 0.0, -10.0), abs=1e-6)


@pytest.mark.element("FollowTrajectoryAction", "Timing")
@pytest.mark.parametrize(("first", "offset", "speed"), [(0.0, 0, 5.0), (0.0, 1, 0.0), (-1.0, 0, 1.25)])
def test_timed_trajectory_in_init_begins_with_its_speed(run: Run, first: float, offset: int, speed: float) -> None:
    """10 m in 1 s, then 5 m in 2 s, with doubled times: 5 m/s, 1.25 m/s, and 0 before the time of the first point."""
    timed = curve(world(200.0, -2.0), world(210.0, -2.0), world(215.0, -2.0), times=(first, first + 1.0, first + 3.0))
    reference = f'<Timing domainAbsoluteRelative="absolute" scale="2" offset="{offset}"/>'
    view = drive(run, follow(timed, reference=reference), end=0.1).frames[0].view
    assert view.speed[view.row("Ego")] == pytest.approx(speed)


def together(target: str, final: str, master: str = '<LanePosition roadId="1" laneId="-1" s="146"/>') -> str:
    return f"""<PrivateAction><SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>{master}
      </TargetPositionMaster><TargetPosition>{target}</TargetPosition><FinalSpeed>{final}</FinalSpeed>
      </SynchronizeAction></PrivateAction>"""


CROSSING = curve(world(150.0, -6.0, math.pi / 2), world(150.0, 2.0, math.pi / 2))
ON_IT = f'<TrajectoryPosition s="3.61"><TrajectoryRef>{CROSSING}</TrajectoryRef></TrajectoryPosition>'
STEADY = '<AbsoluteSpeed value="1.389"><TargetDistanceSteadyState distance="3"/></AbsoluteSpeed>'


@pytest.mark.exhaustive
@pytest.mark.element("SynchronizeAction")
@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("target", [ON_IT, world(150.0, -2.39)])
@pytest.mark.parametrize("begin", [None, 0.45])
def test_synchronize_measures_along_the_followed_trajectory(
    run: Run, mode: str, target: str, begin: float | None
) -> None:
    """Ego needs 46 m / 8.333 m/s = 5.52 s; the walker stands until then, and ends with 3 m at 1.389 m/s."""
    steps = ("Walker", together(target, STEADY), *(() if begin is None else (after(begin),)))
    played = run(
        7.0,
        steps,
        driven=False,
        ego=(-1, 100.0, 8.333),
        more=WALKER,
        init=f'<Private entityRef="Walker">{follow(CROSSING, mode)}</Private>',
        settings=FINE,
    )
    arrived = next(f.view.time for f in played.frames if row(played, f.view.time, "Walker", 0.01)[1] >= -2.39)
    assert arrived == pytest.approx(46.0 / 8.333, abs=0.03)
    for time in (3.5, 4.5, 5.4):
        assert row(played, time, "Walker", 0.01)[3] == pytest.approx(1.389, abs=1e-3)
    assert row(played, 1.0, "Walker", 0.01)[3] < 0.3
    (end,) = [
        c.time for f in played.frames for c in f.changes if c.element == "action 0" and c.after.value == "completeState"
    ]
    assert end == pytest.approx(46.0 / 8.333, abs=0.03)


def test_synchronize_with_reversing_master_arrives_with_it(run: Run) -> None:
    """The master is at the target after 20 m at -5 m/s, at 4 s; the walker arrives with it at 1 m/s."""
    master_way = curve(on_road(500.0, 0.0), on_road(50.0, 0.0))
    at_480 = f'<TrajectoryPosition s="20"><TrajectoryRef>{master_way}</TrajectoryRef></TrajectoryPosition>'
    init = f'<Private entityRef="Ego">{teleport_xml(world(500.0, 0.0, 0.0))}'
    init += f'{speed_xml(-5.0)}{follow(master_way)}</Private><Private entityRef="Walker">{follow(CROSSING)}</Private>'
    played = run(
        5.0,
        ("Walker", together(ON_IT, '<AbsoluteSpeed value="1"/>', at_480)),
        driven=False,
        more=WALKER,
        init=init,
        settings=FINE,
    )
    assert row(played, 4.0, dt=0.01)[0] == pytest.approx(480.0, abs=1e-6)
    assert row(played, 4.0, "Walker", 0.01)[1] == pytest.approx(-6.0 + 3.61, abs=0.03)


def test_distance_on_self_crossing_trajectory_refers_to_the_current_pass(scene: RunScene) -> None:
    """A loop passes (200, -2) after 100 m and, across, after 100 + 4 · 60 m."""
    corners = [(100.0, -2.0), (260.0, -2.0), (260.0, 58.0), (200.0, 58.0), (200.0, -100.0)]
    way = curve(*(world(x, y) for x, y in corners))
    far = """<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>
      </TriggeringEntities><EntityCondition><DistanceCondition coordinateSystem="trajectory" freespace="false"
      relativeDistanceType="longitudinal" rule="lessThan" value="0.5"><Position><WorldPosition x="200" y="-2"/>
      </Position></DistanceCondition></EntityCondition></ByEntityCondition>"""
    nothing = '<PrivateAction><VisibilityAction graphics="true" sensors="true" traffic="true"/></PrivateAction>'
    played = scene(18, ("Ego", follow(way)), ("Ego", nothing, far), executions=2, edge="rising")
    times = [c.time for c in played.changes if c.element == "event 1" and c.after.value == "runningState"]
    lengths = [100.0, 160.0 + 60.0 + 60.0 + 60.0]
    assert times == pytest.approx([length / 20.0 for length in lengths], abs=0.15)


@pytest.mark.parametrize(("heading", "front"), [(0.0, 4.0), (math.pi, 1.0)])
def test_free_space_along_a_trajectory_of_a_reversing_actor(run: Run, heading: float, front: float) -> None:
    """After the steps until 0.55 s at 10 m/s the reference points are 44.5 m apart. A box reaches from -1 m to 4 m.

    Ego moves tail first with the heading π, so that its rear is ahead.
    """
    spaces: dict[float, tuple[float, float]] = {}

    def look(simulation: Simulation, frame: Frame) -> None:
        measured = partial(distance, simulation.storyboard.context, "Ego", "Other", frame="trajectory")
        along = partial(measured, kind="longitudinal")
        spaces[round(frame.view.time, 2)] = along(freespace=False), along(freespace=True)

    way = curve(*(world(x, -2.0, heading) for x in (100.0, 200.0, 300.0)))
    init = f'<Private entityRef="Ego">{follow(way)}</Private>'
    run(1, driven=False, init=init, ego=(-1, 100.0, 10.0), others={"Other": (-1, 150.0, 0.0)}, during=look)
    assert spaces[0.5] == pytest.approx((44.5, 44.5 - front - 1.0))


@pytest.mark.element("TrajectoryPosition")
def test_trajectory_position_refers_to_the_tangent_not_vertex_headings(run: Run) -> None:
    way = curve(world(100.0, 0.0, 0.0), world(200.0, 0.0, math.pi / 2))
    place = f'<TrajectoryPosition s="50" t="-10"><TrajectoryRef>{way}</TrajectoryRef>{{}}</TrajectoryPosition>'
    turned = '<Orientation type="relative" h="0.3"/>'
    for orientation, h in (("", 0.0), (turned, 0.3)):
        played = drive(run, teleport_xml(place.format(orientation)), speed_xml(0.0), end=0.1)
        assert row(played, 0.0) == pytest.approx((150.0, -10.0, h, 0.0), abs=1e-9)


@pytest.mark.parametrize("trajectory_first", [True, False])
def test_synchronize_started_with_the_trajectory_measures_along_it(run: Run, trajectory_first: bool) -> None:
    """Along the road the walker is already at its target; along its trajectory 3.61 m remain."""
    start = f'<Private entityRef="Walker">{teleport_xml(world(150.0, -6.0, math.pi / 2))}{speed_xml(0.0)}</Private>'
    steps = [("Walker", follow(CROSSING)), ("Walker", together(world(150.0, -2.39), STEADY))]
    played = run(
        7.0,
        *(steps if trajectory_first else steps[::-1]),
        driven=False,
        ego=(-1, 100.0, 8.333),
        more=WALKER,
        init=start,
        settings=FINE,
    )
    arrived = next(f.view.time for f in played.frames if row(played, f.view.time, "Walker", 0.01)[1] >= -2.39)
    assert arrived == pytest.approx(46.0 / 8.333, abs=0.03)


@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("order", ["speed follow", "follow speed", "follow speed add", "speed follow add"])
def test_trajectory_of_an_absent_vehicle_adds_it_at_its_start(run: Run, mode: str, order: str) -> None:
    """At 1 s it enters at x = 150, the next view shows it there, and it moves on at 10 m/s: 150 + 10 (t - 1.05)."""
    add = f"<AddEntityAction><Position>{world(140.0, -2.0)}</Position></AddEntityAction>"
    parts = {
        "speed": speed_xml(10.0),
        "follow": follow(AHEAD, mode),
        "add": global_xml(f'<EntityAction entityRef="New">{add}</EntityAction>'),
    }
    steps = [("New", parts[name], after(0.975)) for name in order.split()]
    played = run(2.0, *steps, driven=False, ego=(-2, 500.0, 0.0), more=round_car_xml("New"))
    for time in (1.05, 1.1, 2.0):
        assert row(played, time, "New") == pytest.approx((150.0 + 10.0 * (time - 1.05), -2.0, 0.0, 10.0), abs=1e-6)


@pytest.mark.parametrize(("mode", "x"), [("position", 141.0), ("follow", 701.0)])
def test_teleport_from_a_running_trajectory_is_no_motion(run: Run, mode: str, x: float) -> None:
    """At 20 m/s from x = 100 to x = 700, the view of 2.05 s; then back onto the trajectory, or on from there."""
    way = curve(world(100.0, -2.0), world(900.0, -2.0))
    init = f'<Private entityRef="Ego">{follow(way, mode)}</Private>'
    played = run(
        6.0, ("Ego", teleport_xml(world(700.0, -6.0)), after(1.975)), driven=False, ego=(-1, 100.0, 20.0), init=init
    )
    assert [row(played, time)[0] for time in (2.0, 2.05)] == pytest.approx([140.0, 700.0])
    assert row(played, 2.1)[0] == pytest.approx(x, abs=1e-3)
    assert row(played, 6.0)[1] == pytest.approx(-2.0, abs=0.01)
    assert max(math.hypot(*frame.view.velocity[frame.view.rows["Ego"]]) for frame in played.frames) < 20.2


@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("order", [list, reversed])
def test_teleport_at_the_start_of_a_followed_trajectory_in_any_order(run: Run, order: Any, mode: str) -> None:
    """At 20 m/s along y = -6 from x = 700, which the view of 1.05 s shows."""
    way = follow(curve(world(700.0, -6.0), world(900.0, -6.0)), mode)
    steps = [("Ego", way, after(0.975)), ("Ego", teleport_xml(world(700.0, -6.0)), after(0.975))]
    played = run(3.0, *order(steps), driven=False, ego=(-1, 100.0, 20.0))
    for time in (1.05, 1.1, 3.0):
        assert row(played, time) == pytest.approx((700.0 + 20.0 * (time - 1.05), -6.0, 0.0, 20.0), abs=1e-3)


def test_trajectory_end_off_the_road_continues_straight(run: Run) -> None:
    """The street is 12 m wide: at y = 20 the car does not move along it at 90°."""
    way = curve(world(150.0, -6.0), world(150.0, 20.0))
    played = drive(run, speed_xml(10.0), teleport_xml(world(150.0, -6.0, math.pi / 2)), follow(way), end=4.0)
    assert row(played, 4.0) == pytest.approx((150.0, 34.0, math.pi / 2, 10.0), abs=1e-6)


def test_trajectory_initial_offset_is_limited_to_its_length(run: Run) -> None:
    action = follow(AHEAD.replace('x="900.0"', 'x="160.0"')).replace(
        "<FollowTrajectoryAction>", '<FollowTrajectoryAction initialDistanceOffset="25">'
    )
    played = drive(run, speed_xml(10.0), action, end=1.0)
    assert row(played, 0.0)[0] == pytest.approx(160.0)
    assert row(played, 1.0) == pytest.approx((170.0, -2.0, 0.0, 10.0), abs=1e-6)


@pytest.mark.element("LongitudinalDistanceAction")
@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("system", ["trajectory", "lane"])
def test_longitudinal_distance_without_limits_applies_at_once_on_trajectory(run: Run, mode: str, system: str) -> None:
    keep = f"""<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Other" distance="20"
      freespace="false" continuous="true" coordinateSystem="{system}"/></LongitudinalAction></PrivateAction>"""
    way = curve(world(100.0, -2.0), world(900.0, -2.0))
    played = run(
        2.0,
        ("Ego", keep, after(0.45)),
        driven=False,
        ego=(-1, 100.0, 5.0),
        others={"Other": (-1, 150.0, 10.0)},
        init=f'<Private entityRef="Ego">{follow(way, mode)}</Private>',
    )
    for time in (0.6, 1.0, 2.0):
        gap = row(played, time, "Other")[0] - row(played, time)[0]
        assert (gap, row(played, time)[3]) == pytest.approx((20.0, 10.0), abs=1e-6)


AGAINST = curve(world(100.0, -2.0, math.pi), world(140.0, -2.0, math.pi))
"""40 m towards +x with headings towards -x."""
COLLISION = """<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>
</TriggeringEntities><EntityCondition><TimeToCollisionCondition freespace="false" rule="lessThan" value="2"
coordinateSystem="entity" relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget>
<EntityRef entityRef="Other"/></TimeToCollisionConditionTarget></TimeToCollisionCondition></EntityCondition>
</ByEntityCondition>"""


@pytest.mark.element("FollowTrajectoryAction")
@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("order", ["teleport speed follow", "speed follow"])
def test_positive_speed_with_headings_against_the_curve_is_a_negative_speed(run: Run, mode: str, order: str) -> None:
    """Tail first from x = 100 at 10 m/s; beyond the end at 4 s as well. 60 m ahead, TTC falls below 2 s after 4 s."""
    parts = {
        "teleport": teleport_xml(world(100.0, -2.0, math.pi)),
        "speed": speed_xml(10.0),
        "follow": follow(AGAINST, mode),
    }
    played = run(
        5.0,
        ("Ego", NOTHING, COLLISION),
        driven=False,
        others={"Other": (-1, 160.0, 0.0)},
        init=init_xml("Ego", *(parts[name] for name in order.split())),
    )
    for time in (0.0, 1.0, 3.95, 4.5):
        assert row(played, time) == pytest.approx((100.0 + 10.0 * time, -2.0, math.pi, -10.0), abs=1e-6)
    assert played.begun("event 0") == pytest.approx([4.05])


def test_speed_change_on_a_trajectory_with_headings_against_it_continues_its_motion(run: Run) -> None:
    """From 10 to 20 m/s within 2 s: 5 m/s more after 1 s, and back to the lane with that speed."""
    way = curve(world(100.0, -2.0, math.pi), world(900.0, -2.0, math.pi))
    played = run(
        4.0,
        ("Ego", speed_xml(20.0, 2.0), after(0.975)),
        driven=False,
        init=init_xml("Ego", teleport_xml(world(100.0, -2.0)), speed_xml(10.0), follow(way)),
    )
    assert [row(played, time)[3] for time in (0.5, 2.0, 3.0, 4.0)] == pytest.approx([-10.0, -15.0, -20.0, -20.0])
    assert row(played, 4.0)[0] > row(played, 3.0)[0] > row(played, 1.0)[0]


@pytest.mark.element("SpeedAction")
@pytest.mark.parametrize("trajectory_is_first", [True, False])
@pytest.mark.parametrize(("duration", "start"), [(0.0, 3.925), (2.0, 3.925), (2.0, 2.975)])
def test_speed_action_at_the_end_of_a_trajectory_keeps_the_direction(
    run: Run, trajectory_is_first: bool, duration: float, start: float
) -> None:
    """Tail first over 40 m at 10 m/s. The change to 12 m/s starts in the last step, from 3.95 to 4 s, or 1 s before."""
    steps = [("Ego", follow(AGAINST), after(-1.0)), ("Ego", speed_xml(12.0, duration), after(start))]
    played = run(
        6.5,
        *(steps if trajectory_is_first else reversed(steps)),
        driven=False,
        init=init_xml("Ego", teleport_xml(world(100.0, -2.0, math.pi)), speed_xml(10.0)),
    )
    assert row(played, 6.5)[3] == pytest.approx(-12.0)
    positions = [row(played, 0.05 * step)[0] for step in range(1, 130)]
    assert positions == sorted(positions)


def test_headings_that_turn_against_the_curve_change_the_sign_of_the_speed(run: Run) -> None:
    """A turn by 180° within 2 m, and back: the motion towards +x continues."""
    places = [(100.0, 0.0), (120.0, 0.0), (122.0, math.pi), (140.0, math.pi), (142.0, 0.0), (900.0, 0.0)]
    way = curve(*(world(x, -2.0, h) for x, h in places))
    played = drive(run, teleport_xml(world(100.0, -2.0, 0.0)), speed_xml(10.0), follow(way), end=5.0)
    for time, speed in ((1.0, 10.0), (3.0, -10.0), (5.0, 10.0)):
        assert row(played, time)[0] == pytest.approx(100.0 + 10.0 * time)
        assert row(played, time)[3] == speed


def test_absent_reversing_actor_outside_of_lanes_moves_tail_first_to_the_end(run: Run) -> None:
    away = curve(world(100.0, -60.0), world(110.0, -60.0))
    steps = (("Walker", follow(away)), ("Walker", speed_xml(-1.0), completion("action 0")))
    init = init_xml("Walker", speed_xml(-5.0))
    played = run(4.0, *steps, driven=False, more=WALKER, init=init)
    assert row(played, 1.0, "Walker") == pytest.approx((105.0, -60.0, math.pi, -5.0), abs=1e-6)
    assert played.begun("event 1") == pytest.approx([2.0])
    assert row(played, 3.0, "Walker")[3] == -1.0


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_trajectory_ends_at_its_start_with_a_warning(run: Run, mode: str) -> None:
    """Ego faces along the curve from 10 m after its start at -5 m/s."""
    action = follow(AHEAD, mode).replace(
        "<FollowTrajectoryAction>", '<FollowTrajectoryAction initialDistanceOffset="10">'
    )
    steps = (("Ego", action), ("Ego", speed_xml(-1.0), completion("action 0")))
    played = run(4.0, *steps, driven=False, ego=(-1, 160.0, -5.0))
    assert played.begun("event 1") == pytest.approx([2.0])
    assert row(played, 4.0) == pytest.approx((148.0, -2.0, 0.0, -1.0), abs=0.06)
    assert sum("ends at the start of the trajectory" in str(one) for one in played.result.warnings) == 1


def completion(name: str) -> str:
    return element_state_xml("action", name, "completeState")


@pytest.mark.element("FollowTrajectoryAction")
def test_actor_on_a_climbing_trajectory_is_pitched(run: Run) -> None:
    points = ((100.0, 0.0), (120.0, 0.0), (160.0, 20.0), (200.0, 20.0))
    way = curve(*(f'<WorldPosition x="{x}" y="-2" z="{z}"/>' for x, z in points))
    played = drive(run, teleport_xml(world(100.0, -2.0)), speed_xml(10.0), follow(way), end=8.0)
    pitches = played.of("Ego", "pitch")
    assert [pitches[round(time / 0.05)] for time in (1.0, 4.0, 8.0)] == pytest.approx([0.0, -math.atan(0.5), 0.0])


@pytest.mark.element("FollowTrajectoryAction")
@pytest.mark.parametrize("mode", ["position", "follow"])
def test_actor_on_a_trajectory_over_a_hill_stays_on_the_road(run: Run, mode: str) -> None:
    """The way begins 10 m ahead and 1 m beside the car, crosses the crest at 100 m, and ends on the slope at 180 m."""
    hill = map_xml(road_xml(length=200.0, profiles=elevation_xml(slope=0.1, curvature=-0.0005)))
    lane = '<LanePosition roadId="1" laneId="{}" s="{}" offset="{}"/>'
    way = curve(lane.format(-1, 15, 1.0), lane.format(1, 100, 0), lane.format(-1, 180, 0))
    played = run(16.0, driven=False, street=hill, ego=(-1, 5.0, 12.0), init=init_xml("Ego", follow(way, mode)))
    for frame in played.frames:
        x, _, z = frame.view.position[frame.view.rows["Ego"]].tolist()
        assert z == pytest.approx(0.1 * x - 0.0005 * x * x, abs=1e-3)
    assert x == pytest.approx(200.0, abs=5.0)
