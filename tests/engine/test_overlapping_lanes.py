"""Lane of a vehicle at a pose where lanes overlap: in a junction, and on or below a bridge."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import (
    elevation_xml,
    junction_xml,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)
from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from planned_drive import detections
from signal_street import CAR
from storyboard_xml import end_xml, init_xml, lane_position_xml, speed_xml, teleport_xml

from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.openscenario import load_scenario, model
from eidrive_scenario.roads import LaneLocation, Road, RoadNetwork
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion import Motion
from eidrive_scenario.storyboard.kinematics.route import build_route
from eidrive_scenario.storyboard.positions.resolution import resolve_position


def state(x: float, y: float, yaw: float, z: float = 0.0) -> EgoState:
    return EgoState(0.0, np.array([x, y, z]), yaw, 0.0, 0.0, 8.0, 0.0, 0.0)


def end_of_plan(roads: RoadNetwork, ego: EgoState) -> np.ndarray:
    planner = RoutePlanner(AgentSettings(target_speed=8.0), CAR, roads, dt=0.05, seed=0)
    return np.asarray(planner.plan(ego, detections(0.0), None, 0.0).points[-1])


@pytest.fixture(scope="module")
def junction() -> RoadNetwork:
    """Return a junction about (42, 1.75) with a lane of 3.5 m in each direction on its four arms."""
    return RoadNetwork.load(library_path() / "roads/four_way_junction.xodr")


def connecting_roads(junction: RoadNetwork) -> list[Road]:
    return [road for road in junction.roads.values() if road.junction_id is not None]


@pytest.mark.parametrize("turn", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize(
    ("x", "y", "yaw"),
    [(42.0, 0.0, 0.0), (42.0, 3.5, math.pi), (43.75, 1.75, math.pi / 2.0), (40.25, 1.75, -math.pi / 2.0)],
)
def test_vehicle_in_a_junction_follows_the_lane_along_its_heading(
    junction: RoadNetwork, x: float, y: float, yaw: float, turn: float
) -> None:
    """The connecting roads straight ahead lead from each arm to the opposite one, whose lane is straight on."""
    location = junction.locate_pose(x, y, yaw + turn, 0.0, drivable=True)
    assert location is not None
    end = end_of_plan(junction, state(x, y, yaw + turn))
    ahead, aside = math.cos(yaw), math.sin(yaw)
    assert (end[0] - x) * ahead + (end[1] - y) * aside > 30.0
    assert abs((end[1] - y) * ahead - (end[0] - x) * aside) < 0.2


@pytest.mark.parametrize("teleports", [True, False], ids=["WorldPosition", "end of a trajectory"])
def test_scripted_vehicle_in_a_junction_follows_the_lane_along_its_heading(
    junction: RoadNetwork, teleports: bool
) -> None:
    """It is on the center of a lane, which it follows for 50 m."""
    for road in connecting_roads(junction):
        for share in (0.3, 0.5, 0.7):
            location = junction.location(road.id, -1, share * road.length)
            pose = junction.pose(location)
            motion = Motion(junction)
            if teleports:
                context = RuntimeContext(load_scenario(scenario_xml()), junction, dt=0.1, seed=0)
                position = model.WorldPosition(x=pose.x, y=pose.y, h=pose.h)
                motion.teleport(resolve_position(model.Position(world_position=position), context))
            else:
                motion.move_to(pose, land=True)
            motion.set_speed(5.0)
            end = [motion.step(0.1) for _ in range(101)][-1]
            ahead = junction.advance(location, 50.0)
            assert ahead is not None
            expected = junction.pose(ahead)
            assert math.hypot(end.x - expected.x, end.y - expected.y) < 0.3, location


def test_location_in_a_junction_moves_to_the_lane_that_the_vehicle_follows(junction: RoadNetwork) -> None:
    """Each of the twelve connecting roads coincides with two others at first, of which one is passed before."""
    for road in connecting_roads(junction):
        location = None
        for s in np.arange(0.0, 0.6 * road.length, 0.5).tolist():
            pose = junction.pose(junction.location(road.id, -1, s))
            location = junction.locate_pose(pose.x, pose.y, pose.h, pose.z, location)
        assert location is not None
        assert location.road == road.id


@pytest.mark.parametrize(
    ("rule", "curvatures", "default"),
    [
        ("RHT", {"straight": 0.0, "right": -1 / 300.0}, "straight"),
        ("LHT", {"straight": 0.0, "left": 1 / 300.0}, "straight"),
        ("RHT", {"left": 1 / 300.0, "right": -1 / 300.0}, "right"),
        ("LHT", {"left": 1 / 300.0, "right": -1 / 300.0}, "left"),
    ],
)
@pytest.mark.parametrize("reverse", [False, True])
def test_vehicle_that_enters_a_fork_is_on_the_default_route(
    rule: str, curvatures: dict[str, float], default: str, reverse: bool
) -> None:
    """Lanes that coincide at first part by 0.03 m in 4 m, independently of the order of roads and connections."""
    lane = -1 if rule == "RHT" else 1
    link = lane_xml(lane, link=lane_links_xml(lane, lane))
    lanes = section_xml(*((link,) if lane > 0 else ("", link)))
    branches = [
        road_xml(name, x=100.0, curvature=bend, junction="J", link=predecessor_xml("in"), lanes=lanes, rule=rule)
        for name, bend in curvatures.items()
    ]
    way = -1 if reverse else 1
    start = road_xml("in", link=successor_xml(junction="J"), lanes=lanes, rule=rule)
    fork = junction_xml("J", "in", dict.fromkeys(list(curvatures)[::way], lane), to=lane)
    roads = RoadNetwork.parse(map_xml(start, *branches[::way], rest=fork))
    before, y = roads.location("in", lane, 99.0), 1.75 * lane
    location: LaneLocation | None = before
    for x in (101.0, 102.0, 103.0, 104.0):
        location, entered = roads.locate_pose(x, y, 0.0, None, location), roads.locate_at(x, y, before)
        assert location is not None
        assert entered is not None
        assert (location.road, entered.road) == (default, default)


@pytest.mark.parametrize("order", [("straight", "left", "right"), ("right", "left", "straight")])
@pytest.mark.parametrize("offset", [0.0, 1234.56789, -0.1])
def test_point_at_a_fork_is_on_the_lane_of_the_default_route(order: tuple[str, ...], offset: float) -> None:
    """Three lanes coincide at the start; at 2.5 m the two that bend are 0.16 m beside the straight one."""
    lanes = section_xml(right=lane_xml(-1, link=lane_links_xml(-1, -1)))
    bends = {"straight": 0.0, "left": 0.05, "right": -0.05}
    branches = [
        road_xml(name, x=offset, y=offset, curvature=bends[name], junction="J", lanes=lanes, link=predecessor_xml("in"))
        for name in order
    ]
    start = road_xml("in", x=offset - 100.0, y=offset, lanes=lanes, link=successor_xml(junction="J"))
    roads = RoadNetwork.parse(map_xml(start, *branches, rest=junction_xml("J", "in", dict.fromkeys(order, -1))))
    for x in (0.02, 0.5, 1.5, 2.5):
        location = roads.locate_at(offset + x, offset - 1.75)
        assert location is not None
        assert location.road == "straight"


@pytest.mark.parametrize("heights", [{"along": 0.0, "across": 8.0}, {"along": 8.0, "across": 0.0}])
def test_point_in_a_junction_is_on_the_level_of_its_height(heights: dict[str, float]) -> None:
    """The point is on the center of the lane along x, and 0.75 m beside that of the lane along y."""
    lanes = section_xml(right=lane_xml(-1))
    places = {"along": (-50.0, 1.75, 0.0), "across": (1.0, -50.0, math.pi / 2.0)}
    roads = RoadNetwork.parse(
        map_xml(
            *(
                road_xml(name, x=x, y=y, hdg=heading, junction="J", lanes=lanes, profiles=elevation_xml(heights[name]))
                for name, (x, y, heading) in places.items()
            )
        )
    )
    for name, z in heights.items():
        location = roads.locate_at(2.0, 0.0, z=z)
        assert location is not None
        assert location.road == name


def test_vehicle_handed_over_in_a_junction_stays_on_its_route(junction: RoadNetwork) -> None:
    """At 2 m after the start of a connecting road the lanes to all directions coincide within centimeters."""
    for road in connecting_roads(junction):
        start, end = junction.location(road.id, -1, 2.0), junction.location(road.id, -1, road.length)
        motion = Motion(junction)
        motion.set_route(junction.route(start, end))
        motion.set_observed_state(junction.pose(start), 5.0)
        motion.snap_to_lane()
        assert motion.location is not None
        assert motion.location.road == road.id


@pytest.mark.parametrize(("bridge", "ground"), [("1", "2"), ("2", "1")])
def test_vehicle_where_a_bridge_crosses_follows_its_own_road(bridge: str, ground: str) -> None:
    """Road 1 leads along x, road 2 along y. Their right lanes overlap at (150 + 1.75, -1.75)."""
    heights = {bridge: 6.5, ground: 0.0}
    along = road_xml("1", length=300.0, profiles=elevation_xml(heights["1"], 0.0))
    across = road_xml(
        "2", length=300.0, x=150.0, y=-150.0, hdg=math.pi / 2.0, profiles=elevation_xml(heights["2"], 0.0)
    )
    roads = RoadNetwork.parse(map_xml(along, across))
    for road, yaw in (("1", 0.0), ("2", math.pi / 2.0)):
        for turn in (-0.7, 0.0, 0.7):
            location = roads.locate_pose(151.75, -1.75, yaw + turn, heights[road], drivable=True)
            assert location is not None
            assert location.road == road


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("position", ["lane", "world", "world without z"])
@pytest.mark.parametrize("road", ["1", "2"])
def test_vehicle_that_starts_where_a_bridge_crosses_keeps_its_height(
    tmp_path: Path, road: str, position: str, driven: bool
) -> None:
    """Road 1 leads along x, road 2 along y and 6.5 m above; the vehicle starts where their right lanes overlap."""
    lower = road_xml("1", length=300.0)
    upper = road_xml("2", length=300.0, x=150.0, y=-150.0, hdg=math.pi / 2.0, profiles=elevation_xml(6.5, 0.0))
    (tmp_path / "bridge.xodr").write_text(map_xml(lower, upper))
    x, y, z, yaw = (151.0, -1.75, 0.0, 0.0) if road == "1" else (151.75, -1.2, 6.5, math.pi / 2.0)
    height = f'z="{z}"' if position == "world" else ""
    position_xml = f'<WorldPosition x="{x}" y="{y}" h="{yaw}" {height}/>'
    if position == "lane":
        position_xml = lane_position_xml(-1, x if road == "1" else y + 150.0, road)
    path = tmp_path / "bridge.xosc"
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("bridge.xodr"),
            entities=object_xml("Ego", controller=agent_xml(detector="oracle") if driven else ""),
            init=init_xml("Ego", teleport_xml(position_xml), speed_xml(5)),
            stop=end_xml(2.0),
        )
    )
    poses, end = [], None
    with Simulation(path) as simulation:
        while end is None:
            frame, end = simulation.tick()
            poses.append(frame.view.position[0].tolist())
    assert len(poses) > 30
    assert [pose[2] for pose in poses] == pytest.approx([z] * len(poses), abs=0.05)
    aside = [pose[1] - y if road == "1" else pose[0] - x for pose in poses]
    assert aside == pytest.approx([0.0] * len(poses), abs=0.2)


@pytest.mark.parametrize("spacing", [3.0, 7.0])
def test_waypoints_in_a_junction_are_on_the_lanes_of_the_shortest_route(junction: RoadNetwork, spacing: float) -> None:
    """Positions along a way over the junction, without headings and up to 0.3 m beside it, give the same way."""
    generator = np.random.default_rng(5)
    context = RuntimeContext(load_scenario(scenario_xml()), junction, dt=0.1, seed=0)
    for road in connecting_roads(junction):
        middle = junction.location(road.id, -1, 0.5 * road.length)
        before, after = junction.advance(middle, -30.0), junction.advance(middle, 30.0)
        assert before is not None
        assert after is not None
        way = junction.route(before, after, via=[middle])
        points = way.polyline(spacing)[:, :2] + generator.uniform(-0.2, 0.2, (len(way.polyline(spacing)), 2))
        waypoints = tuple(
            model.Waypoint(
                position=model.Position(world_position=model.WorldPosition(x=x, y=y)),
                route_strategy=model.RouteStrategy.SHORTEST,
            )
            for x, y in points.tolist()
        )
        route = model.Route(name="way", closed=False, waypoint=waypoints)
        built = build_route(route, junction, lambda position: resolve_position(position, context))
        assert built.lanes == way.lanes


@pytest.mark.parametrize("road", ["1", "2"])
@pytest.mark.parametrize("has_height", [False, True])
def test_waypoint_where_a_bridge_crosses_is_on_the_road_of_the_route(road: str, has_height: bool) -> None:
    """Road 1 leads along x, road 2 along y and 6.5 m above."""
    lower = road_xml("1", length=300.0)
    upper = road_xml("2", length=300.0, x=150.0, y=-150.0, hdg=math.pi / 2.0, profiles=elevation_xml(6.5, 0.0))
    roads = RoadNetwork.parse(map_xml(lower, upper))
    context = RuntimeContext(load_scenario(scenario_xml()), roads, dt=0.1, seed=0)
    crossing = model.WorldPosition(x=151.75, y=-1.75, z={"1": 0.0, "2": 6.5}[road] if has_height else None)
    waypoints = tuple(
        model.Waypoint(position=position, route_strategy=model.RouteStrategy.SHORTEST)
        for position in (
            model.Position(lane_position=model.LanePosition(road_id=road, lane_id="-1", s=20.0)),
            model.Position(world_position=crossing),
            model.Position(lane_position=model.LanePosition(road_id=road, lane_id="-1", s=280.0)),
        )
    )
    route = model.Route(name="way", closed=False, waypoint=waypoints)
    built = build_route(route, roads, lambda position: resolve_position(position, context))
    assert {lane.road for lane in built.lanes} == {road}


def test_lane_position_in_a_junction_determines_the_lane_of_a_waypoint(junction: RoadNetwork) -> None:
    """At 1 m after its start, the road straight ahead coincides with those to the left and right."""
    context = RuntimeContext(load_scenario(scenario_xml()), junction, dt=0.1, seed=0)
    for road in connecting_roads(junction):
        before = junction.advance(junction.location(road.id, -1, 1.0), -20.0)
        assert before is not None
        waypoints = tuple(
            model.Waypoint(
                position=model.Position(lane_position=model.LanePosition(road_id=road_id, lane_id=str(lane), s=s)),
                route_strategy=model.RouteStrategy.SHORTEST,
            )
            for road_id, lane, s in (before[:3], (road.id, -1, 1.0))
        )
        route = model.Route(name="way", closed=False, waypoint=waypoints)
        lanes = build_route(route, junction, lambda position: resolve_position(position, context)).lanes
        assert lanes[-1].road == road.id
