"""Detector `lidar` on point clouds of the simulated world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from opendrive_xml import elevation_xml, map_xml, road_xml

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import iou_bev, overlap
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame, pattern_from_points, pattern_from_settings
from eidrive_scenario.perception.lidar import objects
from eidrive_scenario.perception.lidar.box_fit import Fit
from eidrive_scenario.perception.lidar.detector import LidarDetector, LidarDetectorSettings
from eidrive_scenario.perception.oracle import OracleDetector
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import LidarSettings, TruthSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.view import NOTHING
from eidrive_scenario.world.weather import Weather

CLEAN = LidarSettings(range_noise=0.0)


def detect(readings: Readings, **settings: Any) -> Detections:
    return LidarDetector(LidarDetectorSettings(**settings)).detect(readings)


def nearest(found: Detections, box: np.ndarray) -> int:
    assert len(found)
    row = int(np.argmin(np.hypot(*(found.boxes[:, :2] - box[:2]).T)))
    assert math.dist(found.boxes[row, :2], box[:2]) < 2.0
    return row


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_detect_mixed_scene_returns_all_objects(street: Any, noise: float) -> None:
    """A car ahead, an oncoming one, a crossing one, a truck and a pedestrian are detected at their positions, and
    nothing else."""
    objects = [
        street.thing("Ego", 0, 0),
        street.thing("Ahead", 15, 0),
        street.thing("Oncoming", 16, 4.5, math.pi),
        street.thing("Crossing", 12, -9, math.pi / 2),
        street.thing("Truck", -14, 5, 0.3, "truck"),
        street.thing("Walker", 7, 5, 0, "pedestrian"),
    ]
    found = detect(street.readings(objects, {"roof": LidarSettings(range_noise=noise)}))
    assert len(found) == 5
    for thing in objects[1:]:
        row = nearest(found, thing.box)
        assert found.classes[row] == thing.kind
        assert math.dist(found.boxes[row, :2], thing.box[:2]) < 0.5
        if thing.kind != "pedestrian":
            assert iou_bev(found.boxes[row : row + 1], thing.box[None])[0, 0] > 0.6
            off = math.remainder(float(found.boxes[row, 6]) - thing.yaw, math.pi)
            assert abs(off) < math.radians(8)
    assert np.isnan(found.velocity).all()
    assert np.all((found.scores > 0.05) & (found.scores <= 1.0))
    assert np.all(np.linalg.eigvalsh(found.covariance) > 0.0)


@pytest.mark.parametrize(
    "weather",
    [
        Weather(visual_range=90.0),
        Weather(visual_range=200.0),
        Weather(precipitation="rain", precipitation_intensity=25.0, visual_range=2000.0),
        Weather(precipitation="snow", precipitation_intensity=2.0, visual_range=1000.0),
    ],
    ids=["dense fog", "fog", "rain", "snow"],
)
def test_returns_of_the_air_are_no_objects(street: Any, weather: Weather) -> None:
    """The air returns hundreds of rays; the cars and the pedestrian near the sensor are all that is detected."""
    objects = [
        street.thing("Ego", 0, 0),
        street.thing("Ahead", 9, 0),
        street.thing("Oncoming", 12, 4.5, math.pi),
        street.thing("Walker", 7, -4, 0, "pedestrian"),
    ]
    readings = street.readings(objects, {"roof": LidarSettings()}, weather=weather)
    assert np.count_nonzero(readings.lidars["roof"].rows == NOTHING) > 100
    detections = detect(readings)
    assert len(detections) == 3
    for thing in objects[1:]:
        assert detections.classes[nearest(detections, thing.box)] == thing.kind


def test_points_without_intensity_are_detected(street: Any) -> None:
    readings = street.readings([street.thing("Ego", 0, 0), street.thing("Ahead", 9, 0)], {"roof": CLEAN})
    cloud = readings.lidars["roof"]
    without = replace(readings, lidars={"roof": replace(cloud, intensity=np.zeros(len(cloud.points)))})
    assert len(detect(without)) == len(detect(readings)) == 1


@pytest.mark.parametrize("distance", [8.0, 16.0, 24.0, 32.0])
@pytest.mark.parametrize("degrees", [0, 35, 90])
def test_detect_car_at_distance_has_small_position_error(street: Any, distance: float, degrees: float) -> None:
    """The far side is not visible.

    The center error is half of the excess of the car over the usual 4.6 m, of which three standard deviations are 0.5
    m, and up to half of the gap between the columns of rays, of which there are 156.
    """
    car = street.thing("Car", distance, 2.0, math.radians(degrees))
    found = detect(street.readings([street.thing("Ego", 0, 0), car], {"roof": LidarSettings()}))
    row = nearest(found, car.box)
    assert math.dist(found.boxes[row, :2], car.box[:2]) < math.hypot(0.5, distance * math.pi / 156)


def test_detect_empty_street_returns_no_objects(street: Any) -> None:
    assert len(detect(street.readings([street.thing("Ego", 0, 0)], {"roof": LidarSettings()}))) == 0


def test_detect_ignores_mast(street: Any) -> None:
    """5 m high and 0.3 m wide, 12 m ahead."""
    ego = street.thing("Ego", 0, 0)
    with World(None, dt=0.05) as world:
        world.add(street.spec(ego), Placement(0, 0))
        world.add(street.mast, Placement(12, 2))
        readings = Rig(street.spec(ego), {"roof": LidarSettings()}, seed=1).read(world, world.view())
    assert np.count_nonzero(readings.lidars["roof"].points[:, 2] > -1.0) > 5
    assert len(detect(readings)) == 0


def test_detect_from_mast_returns_cars(street: Any) -> None:
    cars = [street.thing("A", 12, 3, 0.4), street.thing("B", -8, -15, 2.0)]
    readings = street.readings(cars, {"roof": LidarSettings()}, mast=(0.0, 0.0, 1.0))
    cloud = readings.lidars["roof"]
    ground = cloud.world_points[:, 2]
    assert np.count_nonzero(np.abs(ground) < 0.1) > 1000
    found = detect(readings)
    assert len(found) == 2
    for car in cars:
        row = nearest(found, car.box)
        assert iou_bev(found.boxes[row : row + 1], car.box[None])[0, 0] > 0.6


@pytest.mark.parametrize(("x", "y"), [(10.0, 2.0), (12.0, 10.0)])
def test_pitched_lidar_completes_the_height_of_cut_cars(street: Any, x: float, y: float) -> None:
    """Its highest ring points 10° downwards, from 1.9 m: it shows the lower part of the car."""
    car = street.thing("Car", x, y)
    pitched = LidarSettings.model_validate({"range_noise": 0.0, "mount": [0.0, 0.0, 1.9, 0.0, 20.0]})
    detections = detect(street.readings([street.thing("Ego", 0, 0), car], {"roof": pitched}))
    assert detections.classes == ("car",)
    assert detections.boxes[0, 5] == pytest.approx(car.box[5], abs=0.15)


def test_detect_partly_hidden_car_is_completed_behind_truck(street: Any) -> None:
    """Only its front half is visible: the box extends behind the truck."""
    objects = [
        street.thing("Ego", 0, 0),
        street.thing("Truck", 12, 6.0, math.pi / 2, "truck"),
        street.thing("Car", 20, 1.4, -math.pi / 2),
    ]
    found = detect(street.readings(objects, {"roof": CLEAN}))
    row = nearest(found, objects[2].box)
    assert found.classes[row] == "car"
    assert math.dist(found.boxes[row, :2], objects[2].box[:2]) < 0.8


SCENE = [
    ("Ahead", 15.3, 0.7, 0.2, "car"),
    ("Oncoming", 24.1, 4.6, 3.0, "car"),
    ("Truck", -13.2, 6.1, 0.5, "truck"),
    ("Crossing", 9.7, -8.4, 1.3, "car"),
]


def sorted_rows(boxes: np.ndarray) -> np.ndarray:
    return boxes[np.lexsort(np.round(boxes[:, :2], 1).T)]


def assert_same_boxes(found: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Assert that rectangles are equal except for rounding; headings may be opposite."""
    assert found.shape == expected.shape
    found, expected = sorted_rows(found), sorted_rows(expected)
    np.testing.assert_allclose(found[:, :6], expected[:, :6], atol=tolerance)
    off = found[:, 6] - expected[:, 6]
    np.testing.assert_allclose(np.abs(np.sin(off)), 0.0, atol=tolerance)


@pytest.mark.parametrize("detector", [LidarDetector, OracleDetector])
@pytest.mark.parametrize("degrees", [30.0, 137.0, -90.0])
def test_detect_rotated_scene_returns_rotated_boxes(street: Any, detector: Any, degrees: float) -> None:
    """The whole scene is rotated about the origin, including the station."""
    angle = math.radians(degrees)
    objects = [street.thing("Ego", 1.0, 2.0, 0.1), *(street.thing(*entry) for entry in SCENE)]
    sensors = {"roof": CLEAN, "truth": TruthSettings()}
    before = detector().detect(street.readings(objects, sensors))
    after = detector().detect(street.readings([thing.turned(angle) for thing in objects], sensors))
    assert len(before) == 4
    expected = before.boxes.copy()
    expected[:, 0] = math.cos(angle) * before.boxes[:, 0] - math.sin(angle) * before.boxes[:, 1]
    expected[:, 1] = math.sin(angle) * before.boxes[:, 0] + math.cos(angle) * before.boxes[:, 1]
    expected[:, 6] += angle
    assert_same_boxes(after.boxes, expected, 1e-9)
    assert sorted(after.classes) == sorted(before.classes)


@pytest.mark.parametrize("detector", [LidarDetector, OracleDetector])
def test_detect_mirrored_scene_returns_mirrored_boxes(street: Any, detector: Any) -> None:
    """The triangles of meshes are not mirrored: uneven faces have one diagonal, which is off the other by 2 mm."""
    objects = [street.thing("Ego", 1.0, 2.0, 0.1), *(street.thing(*entry) for entry in SCENE)]
    sensors = {"roof": CLEAN, "truth": TruthSettings()}
    before = detector().detect(street.readings(objects, sensors))
    after = detector().detect(street.readings([thing.mirrored() for thing in objects], sensors))
    assert len(before) == 4
    assert_same_boxes(after.boxes, before.boxes * (1, -1, 1, 1, 1, 1, -1), 2e-3)
    assert sorted(after.classes) == sorted(before.classes)


ROAD = map_xml(road_xml(x=-50.0))


def test_detect_with_map_uses_roads_and_lane_directions(street: Any) -> None:
    """A road along x with a lane in each direction, a car on each, and one 10 m beside it."""
    objects = [
        street.thing("Ego", -20, -1.75),
        street.thing("Lead", -2, -1.75),
        street.thing("Oncoming", 4, 1.75, math.pi),
        street.thing("Beside", -5, 11),
    ]
    readings = street.readings(objects, {"roof": CLEAN})
    detector = LidarDetector()
    detector.setup(DetectorContext(street.spec(objects[0]), {"roof": CLEAN}, RoadNetwork.parse(ROAD)))
    found = detector.detect(readings)
    assert len(found) == 2
    assert math.cos(found.boxes[nearest(found, objects[1].box), 6]) > 0.99
    assert math.cos(found.boxes[nearest(found, objects[2].box), 6]) < -0.99
    everywhere = LidarDetector(LidarDetectorSettings(off_road=None))
    everywhere.setup(DetectorContext(street.spec(objects[0]), {"roof": CLEAN}, RoadNetwork.parse(ROAD)))
    assert len(everywhere.detect(readings)) == 3


@pytest.mark.parametrize("attribute", ['type="bidirectional"', 'type="driving" direction="both"'])
@pytest.mark.parametrize("yaw", [0.0, math.pi])
def test_lane_for_both_directions_does_not_turn_cars(street: Any, attribute: str, yaw: float) -> None:
    """Without a lane the front points away from the sensor, which is behind the car or ahead of it."""
    ego, car = street.thing("Ego", -20 if yaw == 0.0 else 20, -1.75, yaw), street.thing("Car", 0, -1.75, yaw)
    roads = RoadNetwork.parse(ROAD.replace('type="driving"', attribute))
    detector = LidarDetector()
    detector.setup(DetectorContext(street.spec(ego), {"roof": CLEAN}, roads))
    detections = detector.detect(street.readings([ego, car], {"roof": CLEAN}))
    assert math.cos(detections.boxes[nearest(detections, car.box), 6] - yaw) > 0.99


@pytest.mark.parametrize("distance", [4.0, 6.0])
@pytest.mark.parametrize("height", [1.16, 1.27, 1.49])
def test_detect_children_as_pedestrians(street: Any, distance: float, height: float) -> None:
    """The heights are medians of the WHO for 6, 8 and 12 years."""
    child = street.thing("Child", distance, 1.0, 0.0, "pedestrian", (0.34, 0.34, height))
    detections = detect(street.readings([street.thing("Ego", 0, 0), child], {"roof": CLEAN}))
    assert detections.classes == ("pedestrian",)
    assert math.dist(detections.boxes[0, :2], child.box[:2]) < 0.3


BARRIER = (3.0, 0.61, 0.81)
POLE = (0.3, 0.3, 3.0)


@pytest.mark.parametrize(
    ("size", "y", "slope", "count"),
    [(BARRIER, -0.4, 0.0, 1), (POLE, -2.0, 0.0, 1), (POLE, -3.7, 0.0, 0), (BARRIER, -0.4, 0.25, 0)],
    ids=["barrier", "pole", "pole beside the road", "part of a rising road"],
)
def test_what_stands_on_a_lane_is_detected_though_no_road_user(
    street: Any, size: tuple[float, float, float], y: float, slope: float, count: int
) -> None:
    """The border of the lane is at -3.5 m. On a road that rises by 25 %, what is less than 1 m high after 4 m is the
    road."""
    objects = [street.thing("Ego", -20, -1.75), street.thing("X", -16, y, 0.0, "misc", size)]
    detector = LidarDetector()
    roads = RoadNetwork.parse(map_xml(road_xml(x=-50.0, profiles=elevation_xml(0.0, slope))))
    detector.setup(DetectorContext(street.spec(objects[0]), {"roof": CLEAN}, roads))
    detections = detector.detect(street.readings(objects, {"roof": CLEAN}))
    assert detections.classes == ("misc",) * count
    if count:
        assert math.dist(detections.boxes[0, :2], (-16.0, y)) < 0.5
    if count and size == BARRIER:
        assert detections.boxes[0, 3:5] == pytest.approx(size[:2], abs=0.3)


def detect_on_roads(street: Any, roads: RoadNetwork, *things: Any) -> Detections:
    """Return what the first of the objects detects; they stand on the road below them, in a world with the map."""
    with World(roads, dt=0.05) as world:
        for thing in things:
            location = roads.locate_at(thing.x, thing.y)
            assert location is not None
            pose = roads.road_pose_at(location.road, location.s, location.t)
            world.add(street.spec(thing), Placement(thing.x, thing.y, pose.z, thing.yaw, pose.p))
        readings = Rig(street.spec(things[0]), {"roof": CLEAN}, seed=1).read(world, world.view())
    detector = LidarDetector()
    detector.setup(DetectorContext(street.spec(things[0]), {"roof": CLEAN}, roads))
    return detector.detect(readings)


@pytest.mark.parametrize("x", [-6.0, 0.0, 6.0])
def test_road_that_rises_behind_a_dip_is_no_object(street: Any, x: float) -> None:
    """A road rises by 10 %, from x = 0 on with a radius of 200 m. Only the car on it is an object."""
    profile = """<elevationProfile><elevation s="0" a="0" b="0.1" c="0" d="0"/>
    <elevation s="50" a="5" b="0.1" c="0.0025" d="0"/></elevationProfile>"""
    roads = RoadNetwork.parse(map_xml(road_xml(x=-50.0, profiles=profile)))
    ego, lead = street.thing("Ego", x, -1.75), street.thing("Lead", x + 12.0, -1.75)
    assert len(detect_on_roads(street, roads, ego)) == 0
    detections = detect_on_roads(street, roads, ego, lead)
    assert detections.classes == ("car",)
    assert math.dist(detections.boxes[0, :2], lead.box[:2]) < 0.5


@pytest.mark.parametrize("x", [4.0, 6.0, 8.0])
def test_car_below_a_bridge_faces_along_its_own_lane(street: Any, x: float) -> None:
    """The car is 0.6 m beside the center of its lane. The bridge, 6.5 m above it, crosses in the opposite direction
    at an angle of 30 degrees; the center of its right lane is above the car."""
    hdg, y = math.radians(150.0), -2.35
    start = (x - 80.0 * math.cos(hdg) - 1.75 * math.sin(hdg), y - 80.0 * math.sin(hdg) + 1.75 * math.cos(hdg))
    lower = road_xml("1", x=-50.0)
    upper = road_xml("2", length=160.0, x=start[0], y=start[1], hdg=hdg, profiles=elevation_xml(6.5, 0.0))
    roads = RoadNetwork.parse(map_xml(lower, upper))
    ego, car = street.thing("Ego", x - 12.0, -1.75), street.thing("Car", x, y)
    assert [location.road for location in roads.locations_at(car.x, car.y)] == ["1", "2"]
    readings = street.readings([ego, car], {"roof": CLEAN})
    detector = LidarDetector()
    detector.setup(DetectorContext(street.spec(ego), {"roof": CLEAN}, roads))
    detections = detector.detect(readings)
    assert math.cos(detections.boxes[nearest(detections, car.box), 6]) > 0.99


@pytest.mark.parametrize(("t", "count"), [(-3.9, 1), (-1.75, 2)], ids=["beside the lane", "on the lane"])
def test_walls_of_the_map_are_objects_on_lanes_only(street: Any, t: float, count: int) -> None:
    """A wall of the map, 4 m long, from 3.7 m to 4.1 m beside the center of the road as in a tunnel, or on the lane."""
    wall = f'''<objects><object id="1" type="barrier" s="58" t="{t}" zOffset="0" hdg="0" length="4" width="0.4"
    height="2"/></objects>'''
    roads = RoadNetwork.parse(map_xml(road_xml(x=-50.0, extra=wall)))
    ego, car = street.thing("Ego", -4.0, -1.75), street.thing("Car", 6.0, 1.75, math.pi)
    detections = detect_on_roads(street, roads, ego, car)
    assert len(detections) == count
    assert detections.classes[nearest(detections, car.box)] == "car"


def test_detect_with_two_lidars_returns_each_object_once(street: Any) -> None:
    objects = [street.thing("Ego", 0, 0), street.thing("Ahead", 15, 0)]
    one = street.readings(objects, {"roof": CLEAN})
    both = street.readings(objects, {"roof": CLEAN, "front": replace_mount(CLEAN)})
    assert len(detect(one)) == len(detect(both)) == 1


def replace_mount(settings: LidarSettings) -> LidarSettings:
    return settings.model_copy(update={"mount": "front"})


def test_detect_accumulates_parts_of_revolution(street: Any) -> None:
    """Half a revolution per tick: the car behind is in the other half, and is detected in both ticks."""
    half = LidarSettings(range_noise=0.0, rotation=10.0)
    objects = [street.thing("Ego", 0, 0), street.thing("Ahead", 12, 0), street.thing("Behind", -12, 0)]
    readings = street.readings(objects, {"roof": half})
    cloud = readings.lidars["roof"]
    ahead = cloud.points[:, 0] > 0
    halves = [
        replace(
            cloud,
            points=cloud.points[side],
            intensity=cloud.intensity[side],
            ring=cloud.ring[side],
            azimuth=cloud.azimuth[side],
        )
        for side in (ahead, ~ahead)
    ]
    detector = LidarDetector()
    detector.setup(DetectorContext(street.spec(objects[0]), {"roof": half}))
    counts = [
        len(detector.detect(replace(readings, time=tick * 0.05, lidars={"roof": halves[tick % 2]})))
        for tick in range(4)
    ]
    assert counts == [1, 2, 2, 2]


def test_pattern_from_points_equals_pattern_from_settings(street: Any) -> None:
    settings = LidarSettings(range_noise=0.0)
    cloud = street.readings([street.thing("Ego", 0, 0), street.thing("Ahead", 15, 0)], {"roof": settings}).lidars[
        "roof"
    ]
    known, read = pattern_from_settings(settings), pattern_from_points(cloud.points)
    assert read.azimuth == pytest.approx(known.azimuth, rel=0.01)
    assert read.elevation == pytest.approx(known.elevation, rel=0.01)
    assert known.azimuth == pytest.approx(2 * math.pi / 156)
    assert known.elevation == pytest.approx(math.radians(40 / 31))


def test_level_frame_to_local_inverts_to_world() -> None:
    frame = LevelFrame(3.0, -2.0, 1.9, 0.7)
    plan = np.array([[5.0, 1.0], [-4.0, 8.0]])
    np.testing.assert_allclose(frame.to_local(frame.to_world(plan)), plan)
    np.testing.assert_allclose(frame.to_world(np.zeros((1, 2))), [[3.0, -2.0]])
    turned = frame.covariance_to_world(np.array([[[4.0, 0.0], [0.0, 1.0]]]))
    along = np.array([math.cos(0.7), math.sin(0.7)])
    assert along @ turned[0] @ along == pytest.approx(4.0)


def test_pairs_of_objects_are_compared_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 30 cars, 8 are in two parts: with the merged ones 46 objects. The boxes of these parts are compared twice."""

    def box(number: int) -> tuple[float, float, float, float, float, float, float]:
        column, line = number % 30 % 6, number % 30 // 6
        return 12.0 * column + (number >= 30), 8.0 * line, 0.75, 3.0 if number >= 30 else 4.0, 1.8, 1.5, 0.0

    def fit(rows: np.ndarray, classes: Sequence[str]) -> Fit:
        return Fit(box(int(rows[0])), "car", np.eye(2), 0.0)

    comparisons = []

    def counted(first: Sequence[float], second: Sequence[float]) -> bool:
        comparisons.append((first, second))
        return overlap(first, second)

    monkeypatch.setattr(objects, "overlap", counted)
    parts = [objects.FittedObject(np.array([number]), fit(np.array([number]), ())) for number in range(38)]
    scan: Any = SimpleNamespace(points=np.zeros((38, 3)), pattern=SimpleNamespace(azimuth=0.01), fit=fit)
    merged = objects._merge_parts(scan, parts)
    assert sorted(sorted(part.rows.tolist()) for part in merged) == [
        *([n, n + 30] for n in range(8)),
        *([n] for n in range(8, 30)),
    ]
    assert len(comparisons) <= 46 * 45 // 2 + 8
