"""Unusual scenarios that the standard allows: they run to the end, or are rejected with file and line."""

from __future__ import annotations

import math

import numpy as np
import pytest
from storyboard_xml import global_xml, private_xml, speed_xml
from street_scene import NOTHING, after
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import InputError

GROUPS = """<EntitySelection name="all"><Members><ByType objectType="vehicle"/></Members></EntitySelection>"""
PROFILE = speed_xml(5, 2)
FOLLOW = """<RoutingAction><FollowTrajectoryAction>{trajectory}<TimeReference><None/></TimeReference>
  <TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"""
CLOTHOID = """<TrajectoryRef><Trajectory name="way" closed="false"><Shape><Clothoid curvature="0" curvaturePrime="0"
  length="{length}"><Position><LanePosition roadId="1" laneId="-1" s="100"/></Position></Clothoid></Shape></Trajectory>
  </TrajectoryRef>"""


def assert_states_are_finite(played: RecordedRun) -> None:
    for frame in played.frames:
        view = frame.view
        for quantity in (view.position, view.yaw, view.pitch, view.roll, view.speed, view.velocity, view.acceleration):
            assert np.isfinite(quantity).all()


@pytest.mark.parametrize("actors", [("Ego", "Ego"), ("Ego", "all"), ("all", "all")])
def test_actor_listed_twice_acts_once(run: Run, actors: tuple[str, str]) -> None:
    played = run(3, (" ".join(actors), PROFILE), driven=False, more=GROUPS)
    assert played.of("Ego", "speed")[-1] == 5
    assert played.of("Ego", "speed")[20] == pytest.approx(12.5)


def test_missing_trajectory_is_rejected_with_its_line(run: Run) -> None:
    with pytest.raises(
        InputError, match=r"scene\.xosc:\d+: FollowTrajectoryAction: Trajectory is missing; define it in place"
    ):
        run(1, ("Ego", private_xml(FOLLOW.format(trajectory=""))), driven=False)


def test_trajectory_of_a_thousand_kilometers_starts(run: Run) -> None:
    played = run(1, ("Ego", private_xml(FOLLOW.format(trajectory=CLOTHOID.format(length=1e6)))), driven=False)
    assert played.x("Ego")[-1] == pytest.approx(120.0)


WEATHER = """<EnvironmentAction><Environment name="storm"><Weather><Wind direction="0" speed="{wind}"/>
  <Fog visualRange="{fog}"/></Weather></Environment></EnvironmentAction>"""


def test_infinite_visual_range_and_extreme_wind_are_accepted(run: Run) -> None:
    """An infinite visual range is the standard's notation for no fog."""
    played = run(0.2, ("Ego", global_xml(WEATHER.format(wind=300, fog="INF"))), driven=False)
    environment = played.frames[-1].environment
    assert environment is not None
    assert environment.fog_range == math.inf
    assert_states_are_finite(played)


@pytest.mark.parametrize(
    ("attributes", "inside", "number"),
    [
        ("", '<Wind direction="0" speed="-1"/>', "speed of Wind"),
        ("", '<Fog visualRange="-1"/>', "visualRange of Fog"),
        ("", '<Sun azimuth="0" elevation="0" illuminance="-1"/>', "illuminance of Sun"),
        ("", '<Sun azimuth="0" elevation="0" intensity="-1"/>', "intensity of Sun"),
        ('temperature="-1"', "", "temperature of Weather"),
        ('atmosphericPressure="-1"', "", "atmosphericPressure of Weather"),
    ],
)
def test_negative_weather_is_rejected(run: Run, attributes: str, inside: str, number: str) -> None:
    """All have the range [0..inf[ in the standard; temperatures are in Kelvin."""
    weather = f"<Weather {attributes}>{inside}</Weather>"
    action = global_xml(f'<EnvironmentAction><Environment name="storm">{weather}</Environment></EnvironmentAction>')
    with pytest.raises(InputError, match=rf"scene\.xosc:\d+: {number} is -1; a number of at least 0 is expected"):
        run(0.2, ("Ego", action), driven=False)


ON_ROUTE = """<TeleportAction><Position><RoutePosition><RouteRef><Route name="way" closed="false">
  <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="100"/></Position></Waypoint>
  <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="300"/></Position></Waypoint>
  </Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="50" laneId="7"/></InRoutePosition></RoutePosition>
  </Position></TeleportAction>"""


def test_route_position_in_missing_lane_is_rejected_with_its_line(run: Run) -> None:
    message = r"scene\.xosc:\d+: RoutePosition: not resolvable: road '1' has no lane 7 at s = 150"
    with pytest.raises(InputError, match=message):
        run(1, ("Ego", private_xml(ON_ROUTE)), driven=False)


FAR = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="way" closed="false"><Shape><Polyline>
  <Vertex time="0"><Position><WorldPosition x="500" y="-2"/></Position></Vertex>
  <Vertex time="10"><Position><WorldPosition x="700" y="-2"/></Position></Vertex></Polyline></Shape></Trajectory>
  </TrajectoryRef><TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/>
  </FollowTrajectoryAction></RoutingAction>"""
CLOCK = '<Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/>'


@pytest.mark.parametrize(
    ("timing", "start"), [("<None/>", 501.0), (CLOCK, 521.0)], ids=["own speed", "late by the clock"]
)
def test_traveled_distance_excludes_the_teleport_to_a_trajectory(run: Run, timing: str, start: float) -> None:
    """At 20 m/s from x = 100 m; by the clock the position at 1 s is 500 m + 20 m."""
    traveled = """<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>
      </TriggeringEntities><EntityCondition><TraveledDistanceCondition value="50"/></EntityCondition>
      </ByEntityCondition>"""
    steps = (("Ego", private_xml(FAR.format(timing=timing)), after(0.975)), ("Ego", NOTHING, traveled))
    played = run(3, *steps, driven=False)
    assert played.x("Ego")[19:22] == pytest.approx([119.0, 120.0, start])
    assert played.of("Ego", "speed") == pytest.approx([20.0] * len(played.frames))
    assert max(abs(frame.view.velocity).max() for frame in played.frames) == pytest.approx(20.0)
    assert played.begun("event 1")[0] == pytest.approx(2.55)


def test_longitudinal_distance_is_limited_by_the_maximum_speed(run: Run) -> None:
    """A car stands 800 m ahead; the Performance of Ego is limited to 70 m/s."""
    gap = private_xml(
        '<LongitudinalAction><LongitudinalDistanceAction entityRef="Far" continuous="true" freespace="false" '
        'timeGap="10"><DynamicConstraints maxAcceleration="100"/></LongitudinalDistanceAction></LongitudinalAction>'
    )
    played = run(4, ("Ego", gap), driven=False, others={"Far": (-1, 900.0, 0.0)})
    assert max(map(abs, played.of("Ego", "speed"))) == pytest.approx(70.0)


TO_ITSELF = {
    "lateral distance": '<LateralAction><LateralDistanceAction entityRef="Ego" distance="3" continuous="true" '
    'freespace="false"/></LateralAction>',
    "longitudinal distance": '<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="20" '
    'continuous="true" freespace="false"/></LongitudinalAction>',
    "synchronize": '<SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster><LanePosition roadId="1" '
    'laneId="-1" s="200"/></TargetPositionMaster><TargetPosition><LanePosition roadId="1" laneId="-1" s="250"/>'
    "</TargetPosition>"
    "</SynchronizeAction>",
}


@pytest.mark.parametrize("action", TO_ITSELF.values(), ids=TO_ITSELF.keys())
def test_distance_of_an_actor_to_itself_is_rejected_with_its_line(run: Run, action: str) -> None:
    with pytest.raises(InputError, match=r"scene\.xosc:\d+: .*the reference entity is the actor itself \(got 'Ego'"):
        run(1, ("Ego", private_xml(action)), driven=False)


@pytest.mark.element("SynchronizeAction")
@pytest.mark.parametrize("name", ["Ego", "Other"])
def test_synchronize_with_a_target_that_moves_with_its_entity_is_rejected(run: Run, name: str) -> None:
    targets = {entity: '<LanePosition roadId="1" laneId="-1" s="200"/>' for entity in ("Ego", "Other")}
    targets[name] = f'<RelativeLanePosition entityRef="{name}" dLane="0" dsLane="50"/>'
    action = (
        f'<SynchronizeAction masterEntityRef="Other"><TargetPositionMaster>{targets["Other"]}</TargetPositionMaster>'
        f"<TargetPosition>{targets['Ego']}</TargetPosition></SynchronizeAction>"
    )
    with pytest.raises(InputError, match=rf"scene\.xosc:\d+: .*the target position of '{name}' moves with it"):
        run(2, ("Ego", private_xml(action)), driven=False, others={"Other": (-1, 100.0, 10.0)})
