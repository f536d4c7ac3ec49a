"""Boxes of pictures in the world: by the ground alone, and by points."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.geometry import iou_bev, rotation_matrix
from eidrive_scenario.perception.geometry.lidar_geometry import pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import pixels, straight_boxes
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.meshes import actor_mesh

WIDTH, HEIGHT, FOCAL = 800, 600, 400.0
USUAL = {"car": (4.6, 1.85, 1.55), "truck": (8.2, 2.6, 3.5), "pedestrian": (0.55, 0.55, 1.72)}


def camera(
    x: float = 0.0, y: float = 0.0, z: float = 1.5, yaw: float = 0.0, pitch: float = 0.0, **options: Any
) -> CameraReading:
    """A camera that looks along yaw, downwards by pitch; no picture in it."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    pose = np.eye(4)
    pose[:3, 2] = cy * cp, sy * cp, -sp
    pose[:3, 0] = sy, -cy, 0.0
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = x, y, z
    intrinsics = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
    return CameraReading(
        np.zeros((HEIGHT, WIDTH, 3), np.uint8),
        np.zeros((HEIGHT, WIDTH), np.float32),
        np.zeros((HEIGHT, WIDTH), np.int32),
        intrinsics,
        pose,
        **options,
    )


def box(name: str, x: float, y: float, yaw: float = 0.0, ground: float = 0.0) -> np.ndarray:
    length, width, height = USUAL[name]
    return np.array([x, y, ground + height / 2, length, width, height, yaw])


@cache
def body(name: str, size: tuple[float, float, float]) -> np.ndarray:
    """(N, 3) corners of the body as the world draws it, from the middle of its foot."""
    length, _, height = size
    spec = ActorSpec(
        name, name, name, size, (0.3 * length, 0.0, height / 2.0), wheelbase=0.6 * length, wheel_radius=0.33
    )
    return np.concatenate(list(actor_mesh(spec).values())).reshape(-1, 3)


def outline(target: np.ndarray, view: CameraReading, name: str = "car") -> list[float]:
    """The box of a picture around an object, cut off at its borders."""
    x, y, z, length, width, height, yaw = target.tolist()
    points = body(name, (length, width, height)) @ rotation_matrix(yaw, 0.0, 0.0).T + (x, y, z - height / 2.0)
    places, _ = pixels(points, view)
    low, high = places.min(axis=0), places.max(axis=0)
    return [*np.clip(low, 0, (WIDTH, HEIGHT)).tolist(), *np.clip(high, 0, (WIDTH, HEIGHT)).tolist()]


def test_the_pixel_of_a_known_point() -> None:
    """Straight ahead in the middle; 1 m to the left and 0.5 m below the axis at 10 m: 40 px left, 20 px down."""
    found, depth = pixels(np.array([[10.0, 0.0, 1.5], [10.0, 1.0, 1.0], [-5.0, 0.0, 1.5]]), camera())
    np.testing.assert_allclose(found[:2], [[400, 300], [360, 320]], atol=1e-9)
    assert np.isnan(found[2]).all()
    np.testing.assert_allclose(depth, [10, 10, -5])


def test_distortion_is_undone() -> None:
    """Points along the edges' middles come back to the plane that they came from."""
    view = camera(distortion=np.array([-0.2, 0.03, 0.001, -0.002, 0.0]))
    points = np.array([[10.0, 2.0, 1.5], [10.0, -1.0, 1.5], [10.0, 0.5, 2.5], [10.0, 0.5, 0.2]])
    (left, _), (right, _), (_, top), (_, bottom) = pixels(points, view)[0].tolist()
    straight = straight_boxes(np.array([[left, top, right, bottom]]), view)[0]
    np.testing.assert_allclose(straight, [-0.2, -0.1, 0.1, 0.13], atol=0.004)


@pytest.mark.parametrize("name", ["car", "truck", "pedestrian"])
@pytest.mark.parametrize("distance", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("degrees", [0, 90, 150])
def test_objects_of_usual_size_are_found_by_the_ground(name: str, distance: float, degrees: float) -> None:
    """Exact boxes around the bodies that the world draws, as large as is usual. The place is exact to a tenth of the
    distance, seen from 1.5 m: a lower edge that is off by 0.08 m (SHAPE_DEVIATION) is 5 % of that, a heading tried in
    steps of 15 degrees moves the end of a truck by 0.5 m; and it lies in the 95 % of the stated covariance."""
    view = camera(yaw=0.1)
    target = box(name, distance, 0.1 * distance, math.radians(degrees))
    found = lift(np.array([outline(target, view, name)]), [name], [0.9], view, time=1.5)
    assert (found.time, found.classes, found.scores.tolist()) == (1.5, (name,), [0.9])
    off = found.boxes[0, :2] - target[:2]
    assert np.hypot(*off) < 0.1 * distance
    assert off @ np.linalg.solve(found.covariance[0], off) < 5.99
    assert found.boxes[0, 2] == pytest.approx(target[2], abs=0.01)
    np.testing.assert_allclose(found.boxes[0, 3:6], USUAL[name])
    assert np.isnan(found.velocity).all()


def test_from_a_mast_the_ground_decides() -> None:
    """A camera 7 m up that looks down by 20 degrees; boxes off by a pixel: errors stay below a meter."""
    view = camera(z=7.0, pitch=math.radians(20), yaw=-0.5)
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(40):
        reach, aside = rng.uniform(12, 35), rng.uniform(-0.5, 0.5)
        x, y = reach * math.cos(-0.5 + aside), reach * math.sin(-0.5 + aside)
        target = box("car", x, y, rng.uniform(-3, 3))
        blurred = np.array([outline(target, view)]) + rng.normal(0, 1.0, (1, 4))
        errors.append(math.dist(lift(blurred, ["car"], [1.0], view, time=0.0).boxes[0, :2], target[:2]))
    assert np.median(errors) < 0.5
    assert np.percentile(errors, 90) < 1.2


def test_uncertainty_grows_with_distance_and_covers_the_errors() -> None:
    """Cars of varied size, boxes off by a pixel: squared Mahalanobis distances of two degrees of freedom."""
    view, rng = camera(z=1.5), np.random.default_rng(6)
    distances, spreads = [], []
    for _ in range(120):
        reach, bearing = rng.uniform(8, 40), rng.uniform(-0.4, 0.4)
        target = box("car", reach * math.cos(bearing), reach * math.sin(bearing), rng.uniform(-3, 3))
        target[3:6] *= rng.normal(1.0, 0.05, 3)
        target[2] = target[5] / 2
        blurred = np.array([outline(target, view)]) + rng.normal(0, 1.0, (1, 4))
        found = lift(blurred, ["car"], [1.0], view, time=0.0)
        off = found.boxes[0, :2] - target[:2]
        distances.append(float(off @ np.linalg.solve(found.covariance[0], off)))
        spreads.append((reach, float(np.sqrt(np.linalg.eigvalsh(found.covariance[0])[1]))))
    assert np.mean(np.array(distances) < 9.21) > 0.9
    near = np.median([spread for reach, spread in spreads if reach < 15])
    far = np.median([spread for reach, spread in spreads if reach > 30])
    assert far > 2.0 * near


def test_what_the_border_cuts_goes_on_there() -> None:
    """A car half out of the picture on the left: the place found is that of the whole car, not of what is shown."""
    view = camera()
    target = box("car", 9.0, 9.0, math.pi / 2)
    edges = outline(target, view)
    assert edges[0] == 0.0
    found = lift(np.array([edges]), ["car"], [1.0], view, time=0.0)
    assert math.dist(found.boxes[0, :2], target[:2]) < 1.0


def test_edges_behind_a_nearer_box_are_not_those_of_the_object() -> None:
    """A car whose lower and right parts a nearer car hides: taken for a whole one, it would be far behind its place."""
    view = camera()
    target, other = box("car", 20.0, 1.0, math.pi / 2), box("car", 9.0, -0.8, math.pi / 2)
    whole, near = outline(target, view), outline(other, view)
    shown = [whole[0], whole[1], whole[2], near[1]]
    assert shown[3] < whole[3]
    alone = lift(np.array([shown]), ["car"], [1.0], view, time=0.0)
    both = lift(np.array([shown, near]), ["car", "car"], [1.0, 1.0], view, time=0.0)
    error = [float(np.hypot(*(found.boxes[0, :2] - target[:2]))) for found in (alone, both)]
    assert error[1] < error[0]
    off = both.boxes[0, :2] - target[:2]
    assert off @ np.linalg.solve(both.covariance[0], off) < 9.21


@pytest.mark.parametrize("x", [14.0, 11.0, 9.0, 7.0, 6.0, 5.0])
def test_truck_that_leaves_the_view_stays_where_it_is(street: Any, x: float) -> None:
    """A truck across the road on the left, passed by: a camera of 100 and a LiDAR of 110 degrees, the usual sensors.

    Less and less of it is in view. Its center stays within the 99 % of the stated covariance, and within 2 m.
    """
    truck = street.thing("Truck", x, 6.2, math.pi / 2, "truck")
    sensors = {"front": CameraSettings(width=512, height=384), "roof": LidarSettings(field_of_view=110.0)}
    readings = street.readings([street.thing("Ego", 0, 0), truck], sensors)
    view, sweep = readings.cameras["front"], readings.lidars["roof"]
    rows, columns = np.nonzero(view.segmentation == 1)
    edges = np.array([[columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]], dtype=float)
    pattern = pattern_from_settings(sensors["roof"])
    found = lift(edges, ["truck"], [1.0], view, sweep, time=0.0, pattern=pattern)
    off = found.boxes[0, :2] - truck.box[:2]
    assert np.hypot(*off) < 2.0
    assert off @ np.linalg.solve(found.covariance[0], off) < 9.21


def test_rows_stay_in_order_and_none_is_lost() -> None:
    """Three boxes, one above the horizon, where no ground is: it stands where its height says."""
    view = camera()
    boxes = np.array([outline(box("car", 30, 4), view), [380, 100, 420, 150], outline(box("truck", 20, -3), view)])
    found = lift(boxes, ["car", "pedestrian", "truck"], [0.3, 0.2, 0.1], view, time=0.0)
    assert found.classes == ("car", "pedestrian", "truck")
    assert found.scores.tolist() == [0.3, 0.2, 0.1]
    assert np.isfinite(found.boxes).all()
    assert np.all(np.linalg.eigvalsh(found.covariance) > 0.0)
    assert len(lift(np.empty((0, 4)), [], [], view, time=0.0)) == 0


def test_a_turned_and_mirrored_view_finds_turned_and_mirrored_boxes() -> None:
    view, turned = camera(1.0, 2.0, yaw=0.2), camera(1.0, 2.0, yaw=1.7)
    edges = np.array([outline(box("car", 18, 7, 0.8), view)])
    straight = lift(edges, ["car"], [1.0], view, time=0.0).boxes[0]
    round_ = lift(edges, ["car"], [1.0], turned, time=0.0).boxes[0]
    offset = straight[:2] - (1.0, 2.0)
    cos, sin = math.cos(1.5), math.sin(1.5)
    expected = np.array([1.0 + cos * offset[0] - sin * offset[1], 2.0 + sin * offset[0] + cos * offset[1]])
    np.testing.assert_allclose(round_[:2], expected, atol=1e-6)
    assert math.remainder(float(round_[6] - straight[6]) - 1.5, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    left, top, right, bottom = edges[0].tolist()
    ahead = camera()
    one = lift(edges, ["car"], [1.0], ahead, time=0.0).boxes[0]
    other = lift(np.array([[WIDTH - right, top, WIDTH - left, bottom]]), ["car"], [1.0], ahead, time=0.0).boxes[0]
    np.testing.assert_allclose(other[:2], one[:2] * (1, -1), atol=1e-6)


ROAD = """<OpenDRIVE><header revMajor="1" revMinor="6"/><road name="" length="120" id="1" junction="-1">
<planView><geometry s="0" x="-20" y="0" hdg="0" length="120"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="{a}" b="{b}" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
</road></OpenDRIVE>"""


def test_a_map_tells_which_way_a_car_heads() -> None:
    view = camera(y=-1.75)
    oncoming = box("car", 25, 1.75, math.pi)
    edges = np.array([outline(oncoming, view)])
    roads = MapContext(RoadNetwork.parse(ROAD.format(a=0.0, b=0.0)))
    found = lift(edges, ["car"], [1.0], view, time=0.0, surroundings=roads)
    assert math.cos(found.boxes[0, 6]) == pytest.approx(-1.0, abs=1e-6)
    assert math.cos(lift(edges, ["car"], [1.0], view, time=0.0).boxes[0, 6]) > 0.5


def test_a_map_tells_how_high_the_road_is() -> None:
    """A road that climbs by 5 %, the camera level: 30 m ahead it is 1.5 m higher."""
    view = camera(y=-1.75)
    target = box("car", 30, -1.75, 0.0, ground=1.5)
    edges = np.array([outline(target, view)])
    roads = MapContext(RoadNetwork.parse(ROAD.format(a=-1.0, b=0.05)))
    found = lift(edges, ["car"], [1.0], view, time=0.0, surroundings=roads)
    assert math.dist(found.boxes[0, :2], target[:2]) < 1.0
    assert found.boxes[0, 2] == pytest.approx(target[2], abs=0.15)


@pytest.mark.parametrize("distance", [9.0, 16.0, 25.0])
@pytest.mark.parametrize("degrees", [0, 40, 90])
def test_points_make_it_exact(street: Any, distance: float, degrees: float) -> None:
    """A simulated camera and LiDAR; the box of the picture is off by two pixels, which the points make up for."""
    car = street.thing("Car", distance, 2.5, math.radians(degrees))
    sensors = {"front": CameraSettings(width=WIDTH, height=HEIGHT), "roof": LidarSettings()}
    readings = street.readings([street.thing("Ego", 0, 0), car], sensors)
    view, sweep = readings.cameras["front"], readings.lidars["roof"]
    edges = np.array([outline(car.box, view)]) + np.array([2.0, -2.0, -2.0, 2.0])
    found = lift(edges, ["car"], [1.0], view, sweep, time=0.0)
    assert math.dist(found.boxes[0, :2], car.box[:2]) < 0.5
    off = math.remainder(float(found.boxes[0, 6]) - car.yaw, math.pi)
    assert abs(off) < math.radians(12)
    assert iou_bev(found.boxes, car.box[None])[0, 0] > 0.6


def test_foreground_and_background_are_told_apart(street: Any) -> None:
    """A car before a truck: the box of the car holds points of the truck too, and the other way round."""
    things = [street.thing("Ego", 0, 0), street.thing("Car", 12, 0.5), street.thing("Truck", 26, 1.5, 0.0, "truck")]
    sensors = {"front": CameraSettings(width=WIDTH, height=HEIGHT), "roof": LidarSettings()}
    readings = street.readings(things, sensors)
    view, sweep = readings.cameras["front"], readings.lidars["roof"]
    edges = np.array([outline(thing.box, view) for thing in things[1:]])
    found = lift(edges, ["car", "truck"], [1.0, 1.0], view, sweep, time=0.0)
    for row, thing in enumerate(things[1:]):
        assert math.dist(found.boxes[row, :2], thing.box[:2]) < 0.8


def test_without_points_on_it_a_box_stands_on_the_ground(street: Any) -> None:
    """An empty sweep is as good as none."""
    view = camera()
    edges = np.array([outline(box("car", 20, 2), view)])
    sweep = street.readings([street.thing("Ego", 0, 0)], {"roof": LidarSettings()}).lidars["roof"]
    none = replace(sweep, points=np.empty((0, 3)), intensity=np.empty(0))
    by_ground = lift(edges, ["car"], [1.0], view, time=0.0)
    for lidar in (sweep, none):
        np.testing.assert_allclose(lift(edges, ["car"], [1.0], view, lidar, time=0.0).boxes, by_ground.boxes)


def test_a_mast_with_camera_and_lidar(street: Any) -> None:
    car = street.thing("Car", 15, 4, 0.5)
    mount = Mount(x=0.0, y=0.0, z=5.0, pitch=15.0)
    sensors = {"eye": CameraSettings(width=WIDTH, height=HEIGHT, mount=mount), "roof": LidarSettings()}
    readings = street.readings([car], sensors, mast=(0.0, 0.0, 0.2))
    view = readings.cameras["eye"]
    found = lift(np.array([outline(car.box, view)]), ["car"], [1.0], view, readings.lidars["roof"], time=0.0)
    assert iou_bev(found.boxes, car.box[None])[0, 0] > 0.7
