"""Scenarios that the standard allows and nobody would write: played to the end, or refused by file and line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from street_scene import NOTHING, after, everywhere, private

from eidrive_scenario.errors import InputError

GROUPS = """<EntitySelection name="all"><Members><ByType objectType="vehicle"/></Members></EntitySelection>"""
PROFILE = private(
    '<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/>'
    '<SpeedActionTarget><AbsoluteTargetSpeed value="5"/></SpeedActionTarget></SpeedAction></LongitudinalAction>'
)
FOLLOW = """<RoutingAction><FollowTrajectoryAction>{trajectory}<TimeReference><None/></TimeReference>
  <TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"""
CLOTHOID = """<TrajectoryRef><Trajectory name="way" closed="false"><Shape><Clothoid curvature="0" curvaturePrime="0"
  length="{length}"><Position><LanePosition roadId="1" laneId="-1" s="100"/></Position></Clothoid></Shape></Trajectory>
  </TrajectoryRef>"""


def assert_everybody_is_somewhere(played: Any) -> None:
    for frame in played.frames:
        view = frame.view
        for quantity in (view.position, view.yaw, view.pitch, view.roll, view.speed, view.velocity, view.acceleration):
            assert np.isfinite(quantity).all()


@pytest.mark.parametrize("actors", [("Ego", "Ego"), ("Ego", "all"), ("all", "all")])
def test_who_is_named_twice_acts_once(run: Any, actors: tuple[str, str]) -> None:
    played = run(3, ('"/><EntityRef entityRef="'.join(actors), PROFILE), driven=False, more=GROUPS)
    assert played.of("Ego", "speed")[-1] == 5
    assert played.of("Ego", "speed")[20] == pytest.approx(12.5)


def test_a_trajectory_that_is_nowhere_is_refused_by_its_line(run: Any) -> None:
    with pytest.raises(
        InputError, match=r"scene\.xosc:\d+: FollowTrajectoryAction has no Trajectory; give it in place"
    ):
        run(1, ("Ego", private(FOLLOW.format(trajectory=""))), driven=False)


def test_a_trajectory_of_a_thousand_kilometers_is_begun(run: Any) -> None:
    played = run(1, ("Ego", private(FOLLOW.format(trajectory=CLOTHOID.format(length=1e6)))), driven=False)
    assert played.x("Ego")[-1] == pytest.approx(120.0)


WEATHER = """<EnvironmentAction><Environment name="storm"><Weather><Wind direction="0" speed="{wind}"/>
  <Fog visualRange="{fog}"/></Weather></Environment></EnvironmentAction>"""


def test_air_without_end_and_wind_without_example(run: Any) -> None:
    """An infinite visual range is the standard's word for no fog."""
    played = run(0.2, ("Ego", everywhere(WEATHER.format(wind=300, fog="INF"))), driven=False)
    environment = played.frames[-1].environment
    assert environment is not None
    assert environment.fog_range == math.inf
    assert_everybody_is_somewhere(played)


def test_a_negative_wind_is_refused(run: Any) -> None:
    with pytest.raises(InputError, match=r"scene\.xosc:\d+: speed of Wind is -1; give a number that is not negative"):
        run(0.2, ("Ego", everywhere(WEATHER.format(wind=-1, fog=100))), driven=False)


ON_ROUTE = """<TeleportAction><Position><RoutePosition><RouteRef><Route name="way" closed="false">
  <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="100"/></Position></Waypoint>
  <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="300"/></Position></Waypoint>
  </Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="50" laneId="7"/></InRoutePosition></RoutePosition>
  </Position></TeleportAction>"""


def test_a_lane_beside_the_route_is_refused_by_its_line(run: Any) -> None:
    told = r"scene\.xosc:\d+: RoutePosition means no place: road '1' has no lane 7 at s = 150"
    with pytest.raises(InputError, match=told):
        run(1, ("Ego", private(ON_ROUTE)), driven=False)


FAR = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="way" closed="false"><Shape><Polyline>
  <Vertex time="0"><Position><WorldPosition x="500" y="-2"/></Position></Vertex>
  <Vertex time="10"><Position><WorldPosition x="700" y="-2"/></Position></Vertex></Polyline></Shape></Trajectory>
  </TrajectoryRef><TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/>
  </FollowTrajectoryAction></RoutingAction>"""
CLOCK = '<Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/>'


@pytest.mark.parametrize(
    ("timing", "start"), [("<None/>", 501.0), (CLOCK, 521.0)], ids=["own speed", "late by the clock"]
)
def test_who_is_put_on_a_trajectory_far_away_has_not_driven_there(run: Any, timing: str, start: float) -> None:
    """At 20 m/s from x = 100 m; at 1 s on, by the clock, the place of that time: 500 m + 20 m."""
    traveled = """<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>
      </TriggeringEntities><EntityCondition><TraveledDistanceCondition value="50"/></EntityCondition>
      </ByEntityCondition>"""
    steps = (("Ego", private(FAR.format(timing=timing)), after(0.975)), ("Ego", NOTHING, traveled))
    played = run(3, *steps, driven=False)
    assert played.x("Ego")[19:22] == pytest.approx([119.0, 120.0, start])
    assert played.of("Ego", "speed") == pytest.approx([20.0] * len(played.frames))
    assert max(abs(frame.view.velocity).max() for frame in played.frames) == pytest.approx(20.0)
    assert played.begun("event 1")[0] == pytest.approx(2.55)


def test_who_keeps_a_distance_drives_no_faster_than_it_can(run: Any) -> None:
    """A time gap to oneself is never reached; the Performance of the car ends at 70 m/s."""
    gap = private(
        '<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" continuous="true" freespace="false" '
        'timeGap="10"><DynamicConstraints maxAcceleration="100"/></LongitudinalDistanceAction></LongitudinalAction>'
    )
    played = run(4, ("Ego", gap), driven=False)
    assert max(map(abs, played.of("Ego", "speed"))) == pytest.approx(70.0)
