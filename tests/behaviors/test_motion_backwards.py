"""Actions of actors that drive backwards, stand, or face another way than their reference.

An actor always moves along its heading, forwards or backwards.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from eidrive_behaviors.actions.speed import slope_limit
from recorded_scene import RecordedScene, RunScene
from storyboard_xml import speed_xml, teleport_xml, world_position_xml
from street_scene import after
from trajectories import curve, follow, world
from whole_run import Run

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation

LIMITS = '<DynamicConstraints maxAcceleration="4" maxDeceleration="4" maxSpeed="30"/>'


def lateral(action: str) -> str:
    return f"<PrivateAction><LateralAction>{action}</LateralAction></PrivateAction>"


def longitudinal(action: str) -> str:
    return f"<PrivateAction><LongitudinalAction>{action}</LongitudinalAction></PrivateAction>"


def change(shape: str, dimension: str, value: float) -> str:
    return lateral(f"""<LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
      <LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction>""")


def offset(value: float, acceleration: float = 1.0, continuous: str = "false") -> str:
    return lateral(f"""<LaneOffsetAction continuous="{continuous}">
      <LaneOffsetActionDynamics dynamicsShape="cubic" maxLateralAcc="{acceleration}"/>
      <LaneOffsetTarget><AbsoluteTargetLaneOffset value="{value}"/></LaneOffsetTarget></LaneOffsetAction>""")


def beside(displacement: str = "any", limits: str = LIMITS) -> str:
    return lateral(f"""<LateralDistanceAction entityRef="Other" distance="1" freespace="false" continuous="true"
      coordinateSystem="lane" displacement="{displacement}">{limits}</LateralDistanceAction>""")


def keep(displacement: str, limits: str = LIMITS) -> str:
    return longitudinal(f"""<LongitudinalDistanceAction entityRef="Other" distance="20" freespace="false"
      continuous="true" coordinateSystem="lane" displacement="{displacement}">{limits}</LongitudinalDistanceAction>""")


def largest_slip(played: RecordedScene, dt: float) -> float:
    """Return the maximum speed across the mean heading of a step [m/s]; 0 without side slip."""
    worst = 0.0
    for before, now in pairwise(row["Ego"] for row in played.rows):
        heading = before.yaw + 0.5 * math.remainder(now.yaw - before.yaw, math.tau)
        across = (now.y - before.y) * math.cos(heading) - (now.x - before.x) * math.sin(heading)
        worst = max(worst, abs(across) / dt)
    return worst


@pytest.mark.element("LaneChangeAction", "LaneOffsetAction", "LateralDistanceAction")
@pytest.mark.parametrize("value", [10.0, -10.0, 3.0, -3.0, 0.3, -0.3])
@pytest.mark.parametrize(
    "action",
    [change("cubic", "time", 4.0), change("cubic", "distance", 40.0), offset(1.0), offset(1.0, 1.0, "true"), beside()],
)
def test_lateral_motion_follows_the_heading_forwards_and_backwards(scene: RunScene, action: str, value: float) -> None:
    """At steps of 0.02 s only those steps remain in which a limited motion starts or ends, at half its angle."""
    dt = 0.02
    played = scene(6, ("Ego", action), ego=(-1, 300.0, value), other=(-1, 330.0, value), dt=dt)
    cut = abs(value) * math.sin(math.pi / 8) if abs(value) < 1.0 else 0.0
    assert largest_slip(played, dt) < 0.03 + cut


@pytest.mark.element("LaneOffsetAction", "LateralDistanceAction", "LaneChangeAction")
@pytest.mark.parametrize("action", [offset(1.0), beside(), change("cubic", "time", 4.0)])
def test_lateral_motion_at_standstill_waits_for_speed(scene: RunScene, action: str) -> None:
    played = scene(
        8, ("Ego", action), ("Ego", speed_xml(5.0), after(1.95)), ego=(-1, 300.0, 0.0), other=(-1, 330.0, 0.0)
    )
    assert {played.at(0.1 * n).y for n in range(21)} == {-2.0}
    assert abs(played.at(8.0).y + 2.0) > 0.9


def test_lane_offset_at_low_speed_is_limited_to_forward_speed(scene: RunScene) -> None:
    """At 0.5 m/s, 0.354 m/s in each direction: 1 m at 1 m/s² would take 2.4 s, here about 2.9 s."""
    played = scene(6, ("Ego", offset(1.0)), ego=(-1, 100.0, 0.5))
    end = played.when("action 0", "completeState")
    assert end == pytest.approx(1.0 / (0.5 * math.sqrt(0.5)), abs=0.3)
    steps = [now["Ego"].y - before["Ego"].y for before, now in pairwise(played.rows)]
    assert max(steps) == pytest.approx(0.1 * 0.5 * math.sqrt(0.5))


@pytest.mark.element("LongitudinalDistanceAction")
@pytest.mark.parametrize("limits", [LIMITS, ""])
@pytest.mark.parametrize(
    ("displacement", "lane", "ahead"),
    [
        ("trailingReferencedEntity", -1, 20.0),
        ("leadingReferencedEntity", -1, -20.0),
        ("trailingReferencedEntity", 1, -20.0),
        ("leadingReferencedEntity", 1, 20.0),
    ],
)
def test_longitudinal_distance_displacement_refers_to_the_heading_of_the_reference(
    scene: RunScene, limits: str, displacement: str, lane: int, ahead: float
) -> None:
    """Other drives towards +x in each case: forwards in lane -1, backwards in lane 1. Ego reaches its speed."""
    other = (lane, 450.0, 10.0 if lane < 0 else -10.0)
    played = scene(30, ("Ego", keep(displacement, limits)), ego=(-1, 440.0, 10.0), other=other)
    ego, there = played.rows[-1]["Ego"], played.rows[-1]["Other"]
    assert there.x - ego.x == pytest.approx(ahead, abs=0.05)
    assert ego.speed == pytest.approx(10.0, abs=0.02)


@pytest.mark.element("LateralDistanceAction")
@pytest.mark.parametrize(
    ("displacement", "lane", "y"),
    [
        ("leftToReferencedEntity", -1, -1.0),
        ("rightToReferencedEntity", -1, -3.0),
        ("leftToReferencedEntity", 1, 1.0),
        ("rightToReferencedEntity", 1, 3.0),
    ],
)
def test_lateral_distance_displacement_refers_to_the_heading_of_the_reference(
    scene: RunScene, displacement: str, lane: int, y: float
) -> None:
    other = (lane, 400.0, 10.0 if lane < 0 else -10.0)
    played = scene(15, ("Ego", beside(displacement)), ego=(-1, 400.0, 10.0), other=other)
    assert played.rows[-1]["Ego"].y == pytest.approx(y, abs=0.02)


@pytest.mark.element("LaneOffsetAction")
@pytest.mark.parametrize(("lane", "other", "y"), [(-1, -1, -1.0), (-1, 1, 1.0), (1, 1, 1.0), (1, -1, -1.0)])
def test_lane_offset_relative_to_an_entity_counts_to_its_left(scene: RunScene, lane: int, other: int, y: float) -> None:
    """The center of lane -1 is at y = -2 towards +x, that of lane 1 at y = 2 towards -x; 1 m to the left of Other."""
    relative = '<RelativeTargetLaneOffset entityRef="Other" value="1"/>'
    action = offset(0.0).replace('<AbsoluteTargetLaneOffset value="0.0"/>', relative)
    played = scene(8, ("Ego", action), ego=(lane, 400.0, 10.0), other=(other, 400.0, 10.0))
    assert played.rows[-1]["Ego"].y == pytest.approx(y)


@pytest.mark.parametrize(
    ("start", "target", "limit"),
    [(0, 10, 3.0), (10, 0, 8.0), (0, -10, 3.0), (-10, 0, 8.0), (-5, -10, 3.0), (-10, -5, 8.0), (10, -10, 3.0)],
)
def test_slope_limit_depends_on_acceleration_or_deceleration(start: float, target: float, limit: float) -> None:
    assert slope_limit(start, target, 3.0, 8.0) == limit


@pytest.mark.element("SpeedAction")
def test_braking_from_negative_speed_is_limited_by_the_deceleration(scene: RunScene) -> None:
    """From -20 m/s at 4 m/s² to standstill takes 5 s, although the maximum acceleration is 10 m/s²."""
    played = scene(6, ("Ego", speed_xml(0.0, 50.0, dimension="rate")), ego=(-1, 500.0, -20.0), brakes=4.0)
    assert played.at(2.0).speed == pytest.approx(-12.0)
    assert played.when("action 0", "completeState") == pytest.approx(5.0)


@pytest.mark.element("LongitudinalDistanceAction")
@pytest.mark.parametrize("lane", [-1, 1])
def test_longitudinal_distance_backwards_mirrors_forwards(scene: RunScene, lane: int) -> None:
    """200 m from standstill, forwards and backwards: speed rises by 2 m/s² and falls by up to 6 m/s² both ways."""
    limits = '<DynamicConstraints maxAcceleration="2" maxDeceleration="6" maxSpeed="40"/>'
    action, way = keep("trailingReferencedEntity", limits), 1.0 if lane < 0 else -1.0
    other = (lane, 500.0, 0.0)
    far = ("Ego", action.replace('distance="20"', 'distance="220"'))
    forwards = scene(40, ("Ego", action), ego=(lane, 500.0 - way * 220.0, 0.0), other=other)
    backwards = scene(40, far, ego=(lane, 500.0 - way * 20.0, 0.0), other=other)
    speeds = [[row["Ego"].speed for row in played.rows] for played in (forwards, backwards)]
    assert speeds[1] == pytest.approx([-speed for speed in speeds[0]], abs=1e-6)
    assert speeds[1][51] - speeds[1][1] == pytest.approx(-2.0 * 5.0)
    peak = speeds[1].index(min(speeds[1]))
    braking = [(after - before) / 0.1 for before, after in pairwise(speeds[1][peak:])]
    assert max(braking) == pytest.approx(6.0)


@pytest.mark.element("LongitudinalDistanceAction", "FollowTrajectoryAction")
@pytest.mark.parametrize("limits", [LIMITS, ""])
@pytest.mark.parametrize("system", ["trajectory", "lane", "entity", "world"])
def test_longitudinal_distance_of_actor_moving_tail_first_is_kept(scene: RunScene, system: str, limits: str) -> None:
    """Ego faces +x, but moves to -x until 2 s; its trajectory ends at x = 60. Other is 80 m ahead, at 5 m/s."""
    tail_first = follow(curve(*(world(x, -2.0, 0.0) for x in (100.0, 90.0, 60.0))))
    action = keep("any", limits).replace("lane", system)
    steps = ("Ego", tail_first), ("Ego", action, after(1.95))
    played = scene(40, *steps, ego=(-1, 100.0, 10.0), other=(-1, 150.0, 5.0))
    assert played.at(2.1).speed >= played.at(2.0).speed == -10.0
    last = played.rows[-1]
    assert last["Other"].x - last["Ego"].x == pytest.approx(20.0, abs=0.05)
    assert last["Ego"].speed == pytest.approx(5.0, abs=0.02)


@pytest.mark.element("LongitudinalDistanceAction")
def test_longitudinal_distance_of_crossing_actor_applies_along_its_heading(scene: RunScene) -> None:
    """Ego moves towards +y at x = 100; Other, 40 m ahead of it, drives across its heading at 5 m/s."""
    north = '<WorldPosition x="100" y="{}" h="1.5707963267948966"/>'
    action = keep("leadingReferencedEntity", "").replace("lane", "entity")
    east = teleport_xml(world_position_xml(90.0, 0.0))
    steps = ("Ego", teleport_xml(north.format(-40.0))), ("Other", east), ("Ego", action, after(0.95))
    ego = scene(3, *steps, ego=(-1, 100.0, 10.0), other=(-1, 150.0, 5.0)).at(3.0)
    assert (ego.x, ego.speed) == pytest.approx((100.0, 0.0), abs=1e-9)
    assert abs(ego.y) == pytest.approx(20.0)


@pytest.mark.element("SynchronizeAction")
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_synchronize_with_opposite_final_speed_arrives_at_standstill(run: Run, way: float) -> None:
    """Other needs 100 m / 10 m/s = 10 s; from 10 m/s Ego covers its 50 m with 1 m/s² down to standstill."""
    place = '<LanePosition roadId="1" laneId="-1" s="{}"/>'
    start = 200.0
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster>{place.format(600)}</TargetPositionMaster>
      <TargetPosition>{place.format(start + 50.0 * way)}</TargetPosition>
      <FinalSpeed><AbsoluteSpeed value="{-3.0 * way}"/></FinalSpeed></SynchronizeAction></PrivateAction>"""
    others = {"Other": (-1, 500.0, 10.0)}
    played = run(11.0, ("Ego", action), driven=False, ego=(-1, start, 10.0 * way), others=others)
    speeds, x = played.of("Ego", "speed"), played.x("Ego")
    assert speeds[100] == pytest.approx(5.0 * way, abs=0.1)
    assert x[100] == pytest.approx(start + 37.5 * way, abs=0.5)
    assert speeds[195] == pytest.approx(0.25 * way, abs=0.15)
    assert x[199] == pytest.approx(start + 50.0 * way, abs=0.1)
    assert speeds[-1] == -3.0 * way
    bound = "forwards; specify a final speed of at least 0" if way > 0.0 else "backwards; specify a final speed of at m"
    warning = f"SynchronizeAction: the speed changes to {-3.0 * way:g} m/s at once at the target, which the actor "
    assert [text for text in played.result.warnings if f"{warning}reaches {bound}" in text]


@pytest.mark.element("EndOfRoadCondition")
def test_end_of_road_ends_after_driving_backwards(run: Run) -> None:
    """At 20 m/s from 980 m, Ego is at the end, 1000 m, after 1 s; from 2 s it drives backwards."""
    played = run(4.0, ("Ego", speed_xml(-5.0), after(1.995)), driven=False, ego=(-1, 980.0, 20.0), during=_record_end)
    assert played.x("Ego")[round(1.5 / 0.05)] == pytest.approx(1000.0)
    assert ENDS[1.5]
    assert played.x("Ego")[-1] == pytest.approx(990.0, abs=0.3)
    assert not ENDS[3.0]


ENDS: dict[float, bool] = {}


def _record_end(simulation: Simulation, frame: Frame) -> None:
    ENDS[round(frame.view.time, 3)] = simulation.storyboard.context.actors["Ego"].end_of_road_since is not None
