"""Positions and distances with numbers by hand, on the street: lane 1 y = 2 (towards -x), lanes -1, -2 y = -2, -6."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from opendrive_xml import (
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.context.contexts import EntityAbsentError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.distances import closing_speed, distance
from eidrive_scenario.storyboard.positions.position_types import count_lanes
from eidrive_scenario.storyboard.positions.resolution import resolve_position
from eidrive_scenario.world.view import WorldView


@pytest.fixture
def on_street(context: Any, street: Any) -> Any:
    """A at x = 50 in lane -1, B at x = 80 in lane 1 (coming towards A)."""
    scenario = context.scenario
    made = RuntimeContext(scenario, street, dt=0.1, seed=0)
    for name, lane, s in (("A", -1, 50.0), ("B", 1, 80.0)):
        here = street.location("1", lane, s)
        made.add_actor(name, ResolvedPosition(street.pose(here), here))
    return made


@pytest.mark.element("RelativeRoadPosition", "RelativeLanePosition")
@pytest.mark.parametrize(
    ("frame", "y"),
    [
        (model.RelativeRoadPosition(entity_ref="A", ds=150, dt=0), -6.0),
        (model.RelativeRoadPosition(entity_ref="A", ds=150, dt=1), -5.0),
        (model.RelativeLanePosition(entity_ref="A", d_lane=0, ds=150), -5.0),
    ],
)
def test_relative_position_beyond_a_lane_section_without_the_lane_keeps_its_t(
    context: Any, frame: Any, y: float
) -> None:
    """Lanes of 4 m become one of 10 m before the road ends: A is in lane -2 at y = -6, the wide one is at -5."""
    narrow = section_xml(right=lane_xml(-1, 4.0) + lane_xml(-2, 4.0))
    wide = section_xml(right=lane_xml(-1, 10.0, link=lane_links_xml(after=-1)), s=100.0)
    beyond = section_xml(right=lane_xml(-1, 10.0, link=lane_links_xml(-1)))
    first = road_xml("1", length=200.0, link=successor_xml("2"), lanes=narrow + wide)
    second = road_xml("2", length=200.0, x=200.0, link=predecessor_xml("1"), lanes=beyond)
    roads = RoadNetwork.parse(map_xml(first, second))
    made = RuntimeContext(context.scenario, roads, dt=0.1, seed=0)
    here = roads.location("1", -2, 80.0)
    made.add_actor("A", ResolvedPosition(roads.pose(here), here))
    key = {model.RelativeRoadPosition: "relative_road_position", model.RelativeLanePosition: "relative_lane_position"}
    pose = resolve_position(model.Position(**{key[type(frame)]: frame}), made).pose
    assert (pose.x, pose.y) == pytest.approx((230.0, y))


def relative(h: Any) -> Any:
    return model.Orientation(h=h, type=model.ReferenceContext.RELATIVE)


@pytest.mark.element(
    "WorldPosition",
    "RelativeWorldPosition",
    "RelativeObjectPosition",
    "LanePosition",
    "RelativeLanePosition",
    "RoadPosition",
    "RelativeRoadPosition",
)
@pytest.mark.parametrize(
    ("frame", "x", "y", "h"),
    [
        (model.WorldPosition(x=3, y=4, h=1.0), 3, 4, 1.0),
        (model.RelativeWorldPosition(entity_ref="A", dx=5, dy=1), 55, -1, 0.0),
        (model.RelativeObjectPosition(entity_ref="B", dx=10, dy=4), 70, -2, math.pi),
        (model.RelativeObjectPosition(entity_ref="B", dx=10, dy=4, orientation=relative(0.5)), 70, -2, math.pi + 0.5),
        (model.RoadPosition(road_id="1", s=20, t=-3), 20, -3, 0.0),
        (model.RoadPosition(road_id="1", s=20, t=1), 20, 1, math.pi),
        (model.RelativeRoadPosition(entity_ref="A", ds=10, dt=1), 60, -1, 0.0),
        (model.LanePosition(road_id="1", lane_id="-2", s=30), 30, -6, 0.0),
        (model.LanePosition(road_id="1", lane_id="1", s=30, offset=0.5), 30, 2.5, math.pi),
        (model.LanePosition(road_id="1", lane_id="1", s=30, orientation=model.Orientation(h=0.2)), 30, 2, 0.2),
        (model.RelativeLanePosition(entity_ref="A", d_lane=-1, ds=10), 60, -6, 0.0),
        (model.RelativeLanePosition(entity_ref="A", d_lane=1, ds=-10), 40, 2, math.pi),
        (model.RelativeLanePosition(entity_ref="B", d_lane=0, ds_lane=10), 70, 2, math.pi),
        (model.RelativeLanePosition(entity_ref="B", d_lane=0, ds_lane=-10), 90, 2, math.pi),
        (model.RelativeLanePosition(entity_ref="B", d_lane=0, ds=10), 90, 2, math.pi),
        (model.RelativeLanePosition(entity_ref="B", d_lane=0, ds=-10), 70, 2, math.pi),
        (model.RelativeLanePosition(entity_ref="B", d_lane=-1, ds=10, offset=0.5), 90, -1.5, 0.0),
        (model.RelativeLanePosition(entity_ref="B", d_lane=0, ds=10, offset=0.5), 90, 2.5, math.pi),
        (model.RelativeLanePosition(entity_ref="B", d_lane=1, ds_lane=10, offset=0.5), 70, -2.5, 0.0),
        (model.RelativeLanePosition(entity_ref="B", d_lane=0, ds_lane=10, offset=0.5), 70, 1.5, math.pi),
        (model.RelativeLanePosition(entity_ref="A", d_lane=-1, ds_lane=10, offset=0.5), 60, -5.5, 0.0),
    ],
)
def test_position_types_resolve_to_expected_pose(on_street: Any, frame: Any, x: Any, y: Any, h: Any) -> None:
    names = {
        model.WorldPosition: "world_position",
        model.RelativeWorldPosition: "relative_world_position",
        model.RelativeObjectPosition: "relative_object_position",
        model.RoadPosition: "road_position",
        model.RelativeRoadPosition: "relative_road_position",
        model.LanePosition: "lane_position",
        model.RelativeLanePosition: "relative_lane_position",
    }
    place = resolve_position(model.Position(**{names[type(frame)]: frame}), on_street)
    assert place.pose[:2] == pytest.approx((x, y))
    assert math.cos(place.pose.h - h) == pytest.approx(1.0)


def waypoint(lane: Any, s: Any) -> Any:
    lane_position = model.LanePosition(road_id="1", lane_id=str(lane), s=s)
    return model.Waypoint(
        route_strategy=model.RouteStrategy.SHORTEST, position=model.Position(lane_position=lane_position)
    )


@pytest.mark.element("RoutePosition")
@pytest.mark.parametrize(
    ("within", "x", "y"),
    [
        (
            {"from_lane_coordinates": model.PositionInLaneCoordinates(lane_id="-2", path_s=15, lane_offset=0.5)},
            25,
            -5.5,
        ),
        ({"from_road_coordinates": model.PositionInRoadCoordinates(path_s=15, t=-5)}, 25, -5),
        ({"from_current_entity": model.PositionOfCurrentEntity(entity_ref="A")}, 50, -2),
    ],
)
def test_route_position_counts_from_the_first_waypoint(on_street: Any, within: Any, x: Any, y: Any) -> None:
    route = model.Route(closed=False, name="way", waypoint=(waypoint(-1, 10.0), waypoint(-1, 100.0)))
    frame = model.RoutePosition(
        route_ref=model.RouteRef(route=route), in_route_position=model.InRoutePosition(**within)
    )
    assert resolve_position(model.Position(route_position=frame), on_street).pose[:2] == pytest.approx((x, y), abs=1e-6)


@pytest.mark.parametrize(
    ("within", "start", "is_static"),
    [
        ({"from_lane_coordinates": model.PositionInLaneCoordinates(lane_id="-1", path_s=15)}, None, True),
        ({"from_road_coordinates": model.PositionInRoadCoordinates(path_s=15, t=-5)}, None, True),
        ({"from_road_coordinates": model.PositionInRoadCoordinates(path_s=15, t=-5)}, "A", False),
        ({"from_current_entity": model.PositionOfCurrentEntity(entity_ref="A")}, None, False),
    ],
    ids=["lane", "road", "from entity", "of entity"],
)
def test_route_position_is_searched_once_unless_it_refers_to_an_entity(
    on_street: Any, within: Any, start: str | None, is_static: bool
) -> None:
    first = waypoint(-1, 10.0)
    if start is not None:
        moving = model.Position(relative_lane_position=model.RelativeLanePosition(entity_ref=start, d_lane=0, ds=0))
        first = model.Waypoint(route_strategy=model.RouteStrategy.SHORTEST, position=moving)
    route = model.Route(closed=False, name="way", waypoint=(first, waypoint(-1, 100.0)))
    frame = model.RoutePosition(
        route_ref=model.RouteRef(route=route), in_route_position=model.InRoutePosition(**within)
    )
    position = model.Position(route_position=frame)
    assert (resolve_position(position, on_street) is resolve_position(position, on_street)) is is_static


def on_trajectory(s: float, *, closed: bool = False) -> model.Position:
    """Return a position 2 m to the left of a line of 40 m along y."""
    corners = tuple(
        model.Vertex(position=model.Position(world_position=model.WorldPosition(x=x, y=y)))
        for x, y in ((0, 50), (0, 90))
    )
    way = model.Trajectory(closed=closed, name="way", shape=model.Shape(polyline=model.Polyline(vertex=corners)))
    frame = model.TrajectoryPosition(s=s, t=2, trajectory_ref=model.TrajectoryRef(trajectory=way))
    return model.Position(trajectory_position=frame)


@pytest.mark.element("TrajectoryPosition")
@pytest.mark.parametrize("s", [0.0, 10.0, 40.0005])
def test_trajectory_position_has_s_and_t_of_the_trajectory(on_street: Any, s: float) -> None:
    pose = resolve_position(on_trajectory(s), on_street).pose
    assert (pose.x, pose.y, pose.h) == pytest.approx((-2.0, 50.0 + s, math.pi / 2), abs=1e-3)


@pytest.mark.parametrize(("s", "closed"), [(40.01, False), (-0.01, False), (80.01, True), (-5.0, True)])
def test_trajectory_position_outside_of_its_trajectory_is_rejected(on_street: Any, s: float, closed: bool) -> None:
    """A line back to the start closes the trajectory of 80 m."""
    end = 80.0 if closed else 40.0
    with pytest.raises(ScenarioError, match=rf"s is outside of the trajectory.*got {s:g} m; expected 0 to {end:.1f} m"):
        resolve_position(on_trajectory(s, closed=closed), on_street)


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        ({"lane_position": model.LanePosition(road_id="9", lane_id="-1", s=3)}, "unknown road '9'"),
        ({"lane_position": model.LanePosition(road_id="1", lane_id="-5", s=3)}, "expected one of 1, -1, -2"),
        ({"relative_lane_position": model.RelativeLanePosition(entity_ref="A", d_lane=-3, ds=0)}, "unknown lane -4"),
        ({"geo_position": model.GeoPosition(latitude_deg=1, longitude_deg=2)}, "has no geoReference; add"),
    ],
)
def test_unresolvable_position_is_rejected(on_street: Any, frame: Any, text: Any) -> None:
    with pytest.raises(ScenarioError, match=text):
        resolve_position(model.Position(**frame), on_street)


def test_positions_in_a_lane_section_without_lanes(context: Any) -> None:
    lanes = section_xml(right=lane_xml(-1, 4.0)) + section_xml(s=60.0)
    roads = RoadNetwork.parse(map_xml(road_xml(lanes=lanes)))
    made = RuntimeContext(context.scenario, roads, dt=0.1, seed=0)
    here = roads.location("1", -1, 50.0)
    made.add_actor("A", ResolvedPosition(roads.pose(here), here))
    with pytest.raises(ScenarioError, match="unknown lane -1 of road '1' at s = 70; the road has no lanes there"):
        resolve_position(model.Position(lane_position=model.LanePosition(road_id="1", lane_id="-1", s=70)), made)
    road = model.RoadPosition(road_id="1", s=70, t=-3)
    relative_road = model.RelativeRoadPosition(entity_ref="A", ds=20, dt=-1)
    for position in (model.Position(road_position=road), model.Position(relative_road_position=relative_road)):
        pose = resolve_position(position, made).pose
        assert (pose.x, pose.y) == pytest.approx((70.0, -3.0))


def test_position_beyond_road_end_is_limited_with_warning(on_street: Any) -> None:
    frame = model.LanePosition(road_id="1", lane_id="-1", s=300)
    location = resolve_position(model.Position(lane_position=frame), on_street).location
    assert location is not None
    assert location.s == 200.0
    assert "got s = 300; expected 0 to 200.00" in str(on_street.warnings[-1])


def test_position_relative_to_absent_entity_raises_error(on_street: Any) -> None:
    on_street.remove_actor("B")
    with pytest.raises(EntityAbsentError):
        resolve_position(
            model.Position(relative_world_position=model.RelativeWorldPosition(entity_ref="B", dx=0, dy=0)), on_street
        )


@pytest.mark.parametrize(
    ("lane", "steps", "target"), [(-1, 1, 1), (1, -1, -1), (-2, 1, -1), (-2, 3, 2), (2, -3, -2), (-1, 0, -1)]
)
def test_lane_count_skips_lane_zero(lane: Any, steps: Any, target: Any) -> None:
    assert count_lanes(lane, steps) == target


@pytest.mark.parametrize(
    ("frame", "kind", "freespace", "expected"),
    [
        ("entity", "longitudinal", False, 30.0),
        ("entity", "lateral", False, 4.0),
        ("entity", "euclidianDistance", False, math.hypot(30, 4)),
        ("road", "longitudinal", False, 30.0),
        ("lane", "lateral", False, 4.0),
        ("world", "longitudinal", False, 30.0),
        ("entity", "longitudinal", True, 30.0 - 4.0 - 4.0),
        ("road", "longitudinal", True, 30.0 - 4.0 - 4.0),
        ("entity", "lateral", True, 2.0),
        ("entity", "euclidianDistance", True, math.hypot(22, 2)),
    ],
)
def test_distances_to_oncoming_actor(on_street: Any, frame: Any, kind: Any, freespace: Any, expected: Any) -> None:
    """Both reach 4 m ahead of their reference point, 1 m behind it and 1 m to each side."""
    found = distance(on_street, "A", "B", frame=frame, kind=kind, freespace=freespace)
    assert found == pytest.approx(expected)


def test_distances_behind_and_right_are_negative(on_street: Any) -> None:
    here = on_street.roads.location("1", -2, 20.0)
    on_street.add_actor("B", ResolvedPosition(on_street.roads.pose(here), here))
    assert distance(on_street, "A", "B", frame="road", kind="longitudinal", freespace=False) == pytest.approx(-30.0)
    assert distance(on_street, "A", "B", frame="road", kind="lateral", freespace=False) == pytest.approx(-4.0)
    assert distance(on_street, "A", "B", frame="road", kind="longitudinal", freespace=True) == pytest.approx(-25.0)


def test_boxes_side_by_side_have_no_longitudinal_free_space(on_street: Any) -> None:
    on_street.add_actor("B", ResolvedPosition(Pose(52.0, 2.0, 0.0, 0.0, 0.0, 0.0)))
    assert distance(on_street, "A", "B", frame="entity", kind="longitudinal", freespace=True) == 0.0


def test_euclidean_distance_is_three_dimensional(on_street: Any) -> None:
    """B on a bridge 8 m above the street, 6 m beside A: 10 m; boxes 2 m wide and 1.5 m high leave 4 m and 6.5 m."""
    on_street.add_actor("B", ResolvedPosition(Pose(50.0, 4.0, 8.0, 0.0, 0.0, 0.0)))
    straight = partial(distance, on_street, "A", frame="entity", kind="euclidianDistance")
    assert straight("B", freespace=False) == pytest.approx(10.0)
    assert straight("B", freespace=True) == pytest.approx(math.hypot(4.0, 6.5))
    above = ResolvedPosition(Pose(50.0, 4.0, 8.0, 0.0, 0.0, 0.0))
    assert straight(above, freespace=False) == pytest.approx(10.0)
    assert straight(above, freespace=True) == pytest.approx(math.hypot(5.0, 6.5))


def test_road_distance_in_bend_exceeds_euclidean_distance(context: Any, bend: Any) -> None:
    """A quarter circle of the reference line's 50 m lies between the two; both drive in lane -1, a circle of 52 m."""
    made = RuntimeContext(context.scenario, bend, dt=0.1, seed=0)
    for name, s in (("A", 0.0), ("B", 25 * math.pi)):
        here = bend.location("1", -1, s)
        made.add_actor(name, ResolvedPosition(bend.pose(here), here))
    along = distance(made, "A", "B", frame="road", kind="longitudinal", freespace=False)
    assert along == pytest.approx(25 * math.pi, abs=1e-6)
    sight = distance(made, "A", "B", frame="entity", kind="longitudinal", freespace=False)
    assert sight == pytest.approx(52.0, abs=1e-6)


def view_of(*velocities: tuple[float, float], yaw_rate: float = 0.0) -> WorldView:
    """Return a view of A and B with these velocities [m/s]; A has the yaw rate [rad/s]."""
    zero, points = np.zeros(2), np.zeros((2, 3))
    return WorldView(
        time=0.0,
        tick=0,
        names=("A", "B"),
        categories=("car", "car"),
        position=points,
        yaw=zero,
        pitch=zero,
        roll=zero,
        velocity=np.array([(*velocity, 0.0) for velocity in velocities]),
        acceleration=points,
        yaw_rate=np.array([yaw_rate, 0.0]),
        speed=np.array([math.hypot(*velocity) for velocity in velocities]),
        size=points,
        offset=points,
    )


@pytest.mark.parametrize(
    ("x", "yaw_rate", "expected"),
    [
        (52.0, 0.0, 0.0),
        (63.0, 0.0, 10.0 * 8.0 / math.hypot(8.0, 2.0)),
        (63.0, 0.5, (8.0 * (10.0 + 0.5) - 2.0 * 4.0 * 0.5) / math.hypot(8.0, 2.0)),
    ],
)
def test_closing_speed_of_free_space_is_that_of_the_boxes(
    on_street: Any, x: float, yaw_rate: float, expected: float
) -> None:
    """A drives 20 m/s at x = 50, B 10 m/s in the lane to its right, 2 m beside A.

    The box of A ends at x = 54, that of B begins 1 m behind its axle.
    The front right corner of A is 4 m ahead of its axle and 1 m beside it: it turns forward and away from B.
    """
    on_street.add_actor("B", ResolvedPosition(Pose(x, -6.0, 0.0, 0.0, 0.0, 0.0)))
    on_street.view = view_of((20.0, 0.0), (10.0, 0.0), yaw_rate=yaw_rate)
    measured = partial(closing_speed, on_street, "A", frame="entity", kind="euclidianDistance", freespace=True)
    assert measured("B") == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("frame", "kind", "expected"),
    [
        ("road", "longitudinal", (20.0 - 8.0) * 50.0 / 52.0),
        ("entity", "longitudinal", 20.0 - 8.0 * math.cos(1.2)),
        ("entity", "lateral", -8.0 * math.sin(1.2)),
        ("world", "lateral", -8.0 * math.sin(1.2)),
        ("entity", "euclidianDistance", (20.0 - 8.0) * math.cos(0.6)),
    ],
)
def test_closing_speed_in_bend_follows_the_measured_distance(
    context: Any, bend: Any, frame: str, kind: str, expected: float
) -> None:
    """A drives 20 m/s at the start of the bend, B 8 m/s after 60 m of road (1.2 rad); 52 m of lane are 50 m of road."""
    made = RuntimeContext(context.scenario, bend, dt=0.1, seed=0)
    for name, s in (("A", 0.0), ("B", 60.0)):
        here = bend.location("1", -1, s)
        made.add_actor(name, ResolvedPosition(bend.pose(here), here))
    made.view = view_of((20.0, 0.0), (8.0 * math.cos(1.2), 8.0 * math.sin(1.2)))
    assert closing_speed(made, "A", "B", frame=frame, kind=kind) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("frame", ["road", "lane"])
def test_cars_in_one_lane_of_a_bend_have_no_lateral_closing_speed(context: Any, bend: Any, frame: str) -> None:
    """Both drive along the lane. Straight on, they would leave it to the outside."""
    for offset, s in ((0.0, 20.0), (0.0, 33.3), (0.4, 50.0), (-1.0, 11.0)):
        made = RuntimeContext(context.scenario, bend, dt=0.1, seed=0)
        places = [bend.location("1", -1, 30.0), bend.location("1", -1, s, offset)]
        poses = [bend.pose(place) for place in places]
        for name, pose, place in zip("AB", poses, places, strict=True):
            made.add_actor(name, ResolvedPosition(pose, place))
        velocities = [(v * math.cos(p.h), v * math.sin(p.h)) for p, v in zip(poses, (20.0, 8.0), strict=True)]
        made.view = view_of(*velocities)
        assert closing_speed(made, "A", "B", frame=frame, kind="lateral") == pytest.approx(0.0, abs=1e-6)


@pytest.mark.element("RoutePosition")
@pytest.mark.parametrize("lane", [-1, -2])
def test_route_position_is_measured_along_the_reference_line(context: Any, bend: Any, lane: int) -> None:
    made = RuntimeContext(context.scenario, bend, dt=0.1, seed=0)
    route = model.Route(closed=False, name="way", waypoint=(waypoint(lane, 5.0), waypoint(lane, 75.0)))
    for within in (
        {"from_lane_coordinates": model.PositionInLaneCoordinates(lane_id=str(lane), path_s=69.5)},
        {"from_road_coordinates": model.PositionInRoadCoordinates(path_s=69.5, t=-2)},
    ):
        frame = model.RoutePosition(
            route_ref=model.RouteRef(route=route), in_route_position=model.InRoutePosition(**within)
        )
        found = resolve_position(model.Position(route_position=frame), made).location
        assert found is not None
        assert found.s == pytest.approx(74.5)
