"""Lifting of image boxes to the world, with the ground plane and with lidar points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from image_boxes import HEIGHT, USUAL, WIDTH, box, camera, outline
from msgspec.structs import replace
from opendrive_xml import elevation_xml, map_xml, road_xml

from eidrive_scenario.base.geometry import iou_bev
from eidrive_scenario.perception.geometry.lidar_geometry import pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import pixels, straight_boxes
from eidrive_scenario.perception.lifting.ground import _find_edges
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount


def test_pixels_of_known_points_equal_hand_calculation() -> None:
    """Straight ahead is the center; 1 m to the left and 0.5 m below the axis at 10 m is 40 px left, 20 px down."""
    found, depth = pixels(np.array([[10.0, 0.0, 1.5], [10.0, 1.0, 1.0], [-5.0, 0.0, 1.5]]), camera())
    np.testing.assert_allclose(found[:2], [[400, 300], [360, 320]], atol=1e-9)
    assert np.isnan(found[2]).all()
    np.testing.assert_allclose(depth, [10, 10, -5])


def test_points_beyond_the_fold_of_a_lens_have_no_pixels() -> None:
    """With k1 = -0.1 the radius r (1 - 0.1 r²) decreases from r = sqrt(10/3) on, so that r = 3 would appear at 0.3."""
    view = camera(distortion=np.array([-0.1, 0.0, 0.0, 0.0, 0.0]))
    fold = np.sqrt(10.0 / 3.0)
    tangents = np.array([1.5, fold - 0.01, fold + 0.01, 3.0])
    places, _ = pixels(np.column_stack([np.ones(4), -tangents, np.full(4, 1.5)]), view)
    focal, (middle, _) = view.intrinsics[0, 0], view.intrinsics[:2, 2]
    expected = middle + focal * tangents * (1.0 - 0.1 * tangents**2)
    assert places[:2, 0] == pytest.approx(expected[:2])
    assert np.isnan(places[2:]).all()


def test_straight_boxes_inverts_distortion() -> None:
    """Points at the middles of edges return to the plane of their origin."""
    view = camera(distortion=np.array([-0.2, 0.03, 0.001, -0.002, 0.0]))
    points = np.array([[10.0, 2.0, 1.5], [10.0, -1.0, 1.5], [10.0, 0.5, 2.5], [10.0, 0.5, 0.2]])
    (left, _), (right, _), (_, top), (_, bottom) = pixels(points, view)[0].tolist()
    straight = straight_boxes(np.array([[left, top, right, bottom]]), view)[0]
    np.testing.assert_allclose(straight, [-0.2, -0.1, 0.1, 0.13], atol=0.004)


@pytest.mark.parametrize("distortion", [(-0.28, 0.07, 0.001, -0.0005, 0.0), (0.3, 0.0, 0.0, 0.0, 0.0)])
def test_straight_boxes_inverts_strong_distortion_in_whole_image(distortion: tuple[float, ...]) -> None:
    """Boxes without extent at the images of points with tangents of up to 1.1 return to these tangents."""
    view = camera(distortion=np.array(distortion))
    tangents = np.stack(np.meshgrid(np.linspace(-1.1, 1.1, 12), np.linspace(-0.8, 0.8, 8)), axis=-1).reshape(-1, 2)
    places, _ = pixels(np.column_stack([np.ones(96), -tangents[:, 0], 1.5 - tangents[:, 1]]), view)
    straight = straight_boxes(np.tile(places, 2), view)
    np.testing.assert_allclose(straight, np.tile(tangents, 2), atol=1e-6)


@pytest.mark.parametrize("name", ["car", "truck", "pedestrian"])
@pytest.mark.parametrize("distance", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("degrees", [0, 90, 150])
def test_lift_without_lidar_locates_object_of_usual_size(name: str, distance: float, degrees: float) -> None:
    """Exact boxes around the rendered bodies, with the usual size.

    The position is exact to a tenth of the distance from a height of 1.5 m: an error of the lower edge of 0.08 m
    (SHAPE_DEVIATION) is 5 % of the distance, and headings in steps of 15 degrees move the end of a truck by 0.5 m. It
    is within the 95 % region of the stated covariance.
    """
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


def test_lift_from_mast_has_small_position_error() -> None:
    """A camera at 7 m, pitched down by 20 degrees; with box errors of a pixel, position errors are below a meter."""
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


@pytest.mark.exhaustive
def test_lift_covariance_grows_with_distance_and_is_consistent() -> None:
    """Cars of varied size, box errors of a pixel: squared Mahalanobis distances of two degrees of freedom."""
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


def test_lift_object_cut_by_border_locates_complete_object() -> None:
    """A car half outside the image on the left: the result is the position of the complete car."""
    view = camera()
    target = box("car", 9.0, 9.0, math.pi / 2)
    edges = outline(target, view)
    assert edges[0] == 0.0
    found = lift(np.array([edges]), ["car"], [1.0], view, time=0.0)
    assert math.dist(found.boxes[0, :2], target[:2]) < 1.0


def test_lift_ignores_edges_behind_nearer_box() -> None:
    """A nearer car hides the lower and right parts of a car; as a complete one, it would be far behind its position."""
    view = camera()
    target, other = box("car", 20.0, 1.0, math.pi / 2), box("car", 9.0, -0.8, math.pi / 2)
    complete, near = outline(target, view), outline(other, view)
    visible = [complete[0], complete[1], complete[2], near[1]]
    assert visible[3] < complete[3]
    alone = lift(np.array([visible]), ["car"], [1.0], view, time=0.0)
    both = lift(np.array([visible, near]), ["car", "car"], [1.0, 1.0], view, time=0.0)
    error = [float(np.hypot(*(found.boxes[0, :2] - target[:2]))) for found in (alone, both)]
    assert error[1] < error[0]
    off = both.boxes[0, :2] - target[:2]
    assert off @ np.linalg.solve(both.covariance[0], off) < 9.21


@pytest.mark.parametrize("x", [14.0, 11.0, 9.0, 7.0, 6.0, 5.0])
def test_lift_truck_leaving_view_keeps_position(street: Any, x: float) -> None:
    """A truck across the road on the left, passed by, with the default sensors: a camera of 100 and a lidar of 110
    degrees.

    Its visible part shrinks. Its center stays within the 99 % region of the stated covariance, and within 2 m.
    """
    truck = street.thing("Truck", x, 6.2, math.pi / 2, "truck")
    lidar = LidarSettings(field_of_view=110.0)
    sensors = {"front": CameraSettings(width=512, height=384), "roof": lidar}
    readings = street.readings([street.thing("Ego", 0, 0), truck], sensors)
    view, cloud = readings.cameras["front"], readings.lidars["roof"]
    rows, columns = np.nonzero(view.segmentation == 1)
    edges = np.array([[columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]], dtype=float)
    pattern = pattern_from_settings(lidar)
    found = lift(edges, ["truck"], [1.0], view, cloud, time=0.0, pattern=pattern)
    off = found.boxes[0, :2] - truck.box[:2]
    assert np.hypot(*off) < 2.0
    assert off @ np.linalg.solve(found.covariance[0], off) < 9.21


def test_lift_returns_one_row_per_box_in_order() -> None:
    """Three boxes, one above the horizon, which no pedestrian fills; its distance follows from its height."""
    view = camera()
    boxes = np.array([outline(box("car", 30, 4), view), [380, 100, 420, 150], outline(box("truck", 20, -3), view)])
    found = lift(boxes, ["car", "pedestrian", "truck"], [0.3, 0.2, 0.1], view, time=0.0)
    assert found.classes == ("car", "pedestrian", "truck")
    assert found.scores.tolist() == [0.3, 0.0, 0.1]
    assert np.isfinite(found.boxes).all()
    assert np.all(np.linalg.eigvalsh(found.covariance) > 0.0)
    assert len(lift(np.empty((0, 4)), [], [], view, time=0.0)) == 0


def test_lift_in_rotated_or_mirrored_view_returns_rotated_or_mirrored_boxes() -> None:
    view, turned = camera(1.0, 2.0, yaw=0.2), camera(1.0, 2.0, yaw=1.7)
    edges = np.array([outline(box("car", 18, 7, 0.8), view)])
    straight = lift(edges, ["car"], [1.0], view, time=0.0).boxes[0]
    rotated = lift(edges, ["car"], [1.0], turned, time=0.0).boxes[0]
    offset = straight[:2] - (1.0, 2.0)
    cos, sin = math.cos(1.5), math.sin(1.5)
    expected = np.array([1.0 + cos * offset[0] - sin * offset[1], 2.0 + sin * offset[0] + cos * offset[1]])
    np.testing.assert_allclose(rotated[:2], expected, atol=1e-6)
    assert math.remainder(float(rotated[6] - straight[6]) - 1.5, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    left, top, right, bottom = edges[0].tolist()
    ahead = camera()
    one = lift(edges, ["car"], [1.0], ahead, time=0.0).boxes[0]
    other = lift(np.array([[WIDTH - right, top, WIDTH - left, bottom]]), ["car"], [1.0], ahead, time=0.0).boxes[0]
    np.testing.assert_allclose(other[:2], one[:2] * (1, -1), atol=1e-6)


def road(height: float = 0.0, slope: float = 0.0) -> MapContext:
    """Return a road along x from -20 m with a lane in each direction."""
    return MapContext(
        RoadNetwork.parse(map_xml(road_xml(length=120.0, x=-20.0, profiles=elevation_xml(height, slope))))
    )


def test_lift_with_map_uses_lane_direction() -> None:
    view = camera(y=-1.75)
    oncoming = box("car", 25, 1.75, math.pi)
    edges = np.array([outline(oncoming, view)])
    found = lift(edges, ["car"], [1.0], view, time=0.0, surroundings=road())
    assert math.cos(found.boxes[0, 6]) == pytest.approx(-1.0, abs=1e-6)
    assert math.cos(lift(edges, ["car"], [1.0], view, time=0.0).boxes[0, 6]) > 0.5


def test_axis_of_distant_car_is_that_of_the_lane() -> None:
    """A car 70 m away is 5 pixels high. Edges that are off by up to a pixel say nothing about its heading: it stays
    within 5 degrees of the lane, and the axis of the best single fit does not."""
    view = camera(y=-1.75)
    edges = outline(box("car", 70, 1.75, math.pi), view)
    rng = np.random.default_rng(1)
    boxes = edges + rng.uniform(-1.0, 1.0, (40, 4))
    lifted = lift(boxes, ["car"] * 40, [1.0] * 40, view, time=0.0, surroundings=road())
    assert np.abs(np.sin(lifted.boxes[:, 6])).max() < math.sin(math.radians(5.0))


def test_lift_with_map_uses_road_height() -> None:
    """A road with a slope of 5 % and a level camera: 30 m ahead the road is 1.5 m higher."""
    view = camera(y=-1.75)
    target = box("car", 30, -1.75, 0.0, ground=1.5)
    edges = np.array([outline(target, view)])
    found = lift(edges, ["car"], [1.0], view, time=0.0, surroundings=road(-1.0, 0.05))
    assert math.dist(found.boxes[0, :2], target[:2]) < 1.0
    assert found.boxes[0, 2] == pytest.approx(target[2], abs=0.15)


def test_car_below_a_bridge_is_lifted_to_its_own_road() -> None:
    """A bridge crosses 6.5 m above the car, which is 0.5 m beside the center of its lane and below that of the bridge.
    On the height of the bridge, above the camera, no car fills the box."""
    lower = road_xml("1", length=120.0, x=-20.0)
    upper = road_xml("2", length=120.0, x=26.75, y=57.75, hdg=-math.pi / 2.0, profiles=elevation_xml(6.5, 0.0))
    surroundings = MapContext(RoadNetwork.parse(map_xml(lower, upper)))
    view = camera(y=-1.75)
    target = box("car", 25, -2.25, 0.0)
    lifted = lift(np.array([outline(target, view)]), ["car"], [1.0], view, time=0.0, surroundings=surroundings)
    assert math.dist(lifted.boxes[0, :2], target[:2]) < 1.0
    assert lifted.boxes[0, 2] == pytest.approx(target[2], abs=0.15)
    assert math.cos(lifted.boxes[0, 6]) > 0.99


@pytest.mark.parametrize("distance", [9.0, 16.0, 25.0])
@pytest.mark.parametrize("degrees", [0, 40, 90])
def test_lift_with_lidar_is_accurate(street: Any, distance: float, degrees: float) -> None:
    """A simulated camera and lidar; the image box has an error of two pixels, which the points compensate."""
    car = street.thing("Car", distance, 2.5, math.radians(degrees))
    sensors = {"front": CameraSettings(width=WIDTH, height=HEIGHT), "roof": LidarSettings()}
    readings = street.readings([street.thing("Ego", 0, 0), car], sensors)
    view, cloud = readings.cameras["front"], readings.lidars["roof"]
    edges = np.array([outline(car.box, view)]) + np.array([2.0, -2.0, -2.0, 2.0])
    found = lift(edges, ["car"], [1.0], view, cloud, time=0.0)
    assert math.dist(found.boxes[0, :2], car.box[:2]) < 0.5
    off = math.remainder(float(found.boxes[0, 6]) - car.yaw, math.pi)
    assert abs(off) < math.radians(12)
    assert iou_bev(found.boxes, car.box[None])[0, 0] > 0.6


def test_lift_with_lidar_separates_foreground_and_background(street: Any) -> None:
    """A car in front of a truck: the box of the car contains points of the truck, and vice versa."""
    objects = [street.thing("Ego", 0, 0), street.thing("Car", 12, 0.5), street.thing("Truck", 26, 1.5, 0.0, "truck")]
    sensors = {"front": CameraSettings(width=WIDTH, height=HEIGHT), "roof": LidarSettings()}
    readings = street.readings(objects, sensors)
    view, cloud = readings.cameras["front"], readings.lidars["roof"]
    edges = np.array([outline(thing.box, view) for thing in objects[1:]])
    found = lift(edges, ["car", "truck"], [1.0, 1.0], view, cloud, time=0.0)
    for row, thing in enumerate(objects[1:]):
        assert math.dist(found.boxes[row, :2], thing.box[:2]) < 0.8


def test_lift_without_points_in_box_uses_ground_plane(street: Any) -> None:
    """A point cloud without objects has the same result as none."""
    view = camera()
    edges = np.array([outline(box("car", 20, 2), view)])
    cloud = street.readings([street.thing("Ego", 0, 0)], {"roof": LidarSettings()}).lidars["roof"]
    none = replace(cloud, points=np.empty((0, 3)), intensity=np.empty(0))
    by_ground = lift(edges, ["car"], [1.0], view, time=0.0)
    for lidar in (cloud, none):
        np.testing.assert_allclose(lift(edges, ["car"], [1.0], view, lidar, time=0.0).boxes, by_ground.boxes)


def test_lift_from_mast_with_lidar_is_accurate(street: Any) -> None:
    car = street.thing("Car", 15, 4, 0.5)
    mount = Mount(x=0.0, y=0.0, z=5.0, pitch=15.0)
    sensors = {"mast": CameraSettings(width=WIDTH, height=HEIGHT, mount=mount), "roof": LidarSettings()}
    readings = street.readings([car], sensors, mast=(0.0, 0.0, 0.2))
    view = readings.cameras["mast"]
    found = lift(np.array([outline(car.box, view)]), ["car"], [1.0], view, readings.lidars["roof"], time=0.0)
    assert iou_bev(found.boxes, car.box[None])[0, 0] > 0.7


def test_lift_from_mast_separates_cars_parked_bumper_to_bumper(street: Any) -> None:
    """The gap of 0.5 m is smaller than the distance of points along the sides, so both are one cluster.

    The image box of the nearer car extends over half of the other one, as boxes of networks do.
    """
    near, far = street.thing("Near", 10, -3.0), street.thing("Far", 15.1, -3.0)
    mount = Mount(x=0.0, y=0.0, z=5.0, pitch=15.0)
    sensors = {"mast": CameraSettings(width=WIDTH, height=HEIGHT, mount=mount), "roof": LidarSettings()}
    readings = street.readings([near, far], sensors, mast=(0.0, 5.0, 0.2))
    view = readings.cameras["mast"]
    edges = np.array([outline(thing.box, view) for thing in (near, far)])
    edges[0, 1] = 0.5 * (edges[0, 1] + edges[1, 1])
    edges[0, 2] = max(edges[0, 2], 0.5 * (edges[1, 0] + edges[1, 2]))
    found = lift(edges, ["car", "car"], [1.0, 1.0], view, readings.lidars["roof"], time=0.0)
    for row, thing in enumerate((near, far)):
        assert iou_bev(found.boxes, thing.box[None])[row, 0] > 0.6


def test_edges_of_projected_hulls_equal_those_of_their_points() -> None:
    """The borders of the image cut the second of two objects, which has points on both sides."""
    rng = np.random.default_rng(5)
    corners, place = rng.uniform(-1.0, 1.0, (2, 16, 3)), np.array([8.0, 0.0]) + rng.uniform(-1.0, 1.0, (3, 2, 4, 2))
    headings, cut, borders = (
        rng.uniform(-3.0, 3.0, (2, 4)),
        np.array([False, True]),
        np.array([[-9.0, 9.0], [-0.1, 0.1]]),
    )
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    edges, depth = np.empty((3, 2, 4, 4)), np.empty((3, 2, 4))
    _find_edges(corners, np.cos(headings), np.sin(headings), place, turn, 0.1, cut, borders, edges, depth)
    for trial, row, number in np.ndindex(3, 2, 4):
        cos, sin = math.cos(headings[row, number]), math.sin(headings[row, number])
        plan = corners[row, :, :2] @ [[cos, sin], [-sin, cos]] + place[trial, row, number]
        u, v = -plan[:, 1] / plan[:, 0], -corners[row, :, 2] / plan[:, 0]
        shown = v[np.abs(u) <= 0.1] if row == 1 else v
        expected = u.min(), shown.min(), u.max(), shown.max()
        np.testing.assert_allclose(edges[trial, row, number], expected, rtol=1e-12)
        assert depth[trial, row, number] == pytest.approx(plan[:, 0].mean(), rel=1e-12)
