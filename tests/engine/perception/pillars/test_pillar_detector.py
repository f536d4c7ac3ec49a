"""Detector `pillars`: from readings to boxes in the world, with weights whose result is known by calculation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from opendrive_xml import map_xml, road_xml
from pillar_weights import Arrays, plain_arrays, random_arrays, save
from scenario_1 import FrameCollector, simulate

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import iou_bev
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import parse_settings
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.perception.learned.pillars.detector import PillarDetector, PillarSettings
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.tracking.method import TrackerSettings
from eidrive_scenario.perception.tracking.motion_models import KNOWN_SPEED
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState, LidarReading, Readings
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.world.actor import ActorSpec

SPEC = ActorSpec("Ego", "car", "car", (4.6, 1.9, 1.5), (0.0, 0.0, 0.75), wheelbase=2.7)
CENTERS = np.array([[10.0, 2.0], [-20.4, 7.6], [30.8, -31.6], [0.4, -12.4]])
"""Centers of 0.8 m cells of a grid at the origin, with a post each."""


def detector(folder: Path, arrays: Arrays | None = None, **settings: Any) -> PillarDetector:
    path = save(folder / "weights.npz", plain_arrays() if arrays is None else arrays)
    return PillarDetector(parse_settings(PillarSettings, {"weights": str(path), **settings}))


def level_ground() -> Array:
    x, y = (values.ravel() for values in np.meshgrid(np.arange(-40.0, 40.0, 1.3), np.arange(-40.0, 40.0, 1.3)))
    return np.stack([x, y, np.zeros(len(x))], axis=1)


def posts(centers: Array = CENTERS) -> Array:
    """Return eight points (N, 3) at each center (N, 2), 0.6 m to 1.4 m above the ground."""
    spread = np.array([(dx, dy, z) for dx in (-0.1, 0.1) for dy in (-0.1, 0.1) for z in (0.6, 1.4)])
    return np.concatenate([spread + np.array([x, y, 0.0]) for x, y in centers])


def cloud(points: Array, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, height: float = 2.0) -> LidarReading:
    """Return the reading of a lidar at this pose that measures points (N, 3) of the world."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    pose = np.array([[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, height], [0.0, 0.0, 0.0, 1.0]])
    return LidarReading((points - pose[:3, 3]) @ pose[:3, :3], np.full(len(points), 0.3), pose)


def readings(time: float, *clouds: LidarReading) -> Readings:
    ego = EgoState(time, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Readings(time, ego, lidars={f"lidar {number}": reading for number, reading in enumerate(clouds)})


def scene(time: float = 0.0, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Readings:
    return readings(time, cloud(np.concatenate([level_ground(), posts()]), x, y, yaw))


def by_position(boxes: Array) -> Array:
    return boxes[np.lexsort(np.round(boxes[:, :2], 2).T)]


def test_detect_occupied_cells_returns_cars_of_weights(tmp_path: Path) -> None:
    detections = detector(tmp_path).detect(scene())
    expected = np.array([(x, y, 0.75, 4.0, 2.0, 1.5, 0.0) for x, y in CENTERS])
    np.testing.assert_allclose(by_position(detections.boxes), by_position(expected), atol=1e-5)
    assert set(detections.classes) == {"car"}
    # Eight points are in four 0.4 m cells of two points each, whose sum the weights form.
    score = 1.0 / (1.0 + math.exp(0.5 - 4.0 * 4.0 * math.log(3.0) / 3.0))
    np.testing.assert_allclose(detections.scores, np.full(4, score), rtol=1e-6)
    assert np.isnan(detections.velocity).all()
    np.testing.assert_allclose(detections.covariance, np.broadcast_to(np.eye(2) * 0.09, (4, 2, 2)), rtol=1e-6)


@pytest.mark.parametrize("degrees", [-135.0, 0.0, 30.0, 90.0, 180.0])
def test_detect_boxes_and_velocities_have_axes_of_world(degrees: float, tmp_path: Path) -> None:
    """The station is elsewhere, so that a box is within half a diagonal of a cell of its post."""
    yaw = math.radians(degrees)
    own = detector(tmp_path, plain_arrays((2.0, -1.0)))
    own.detect(scene(0.0, 3.3, -1.7, yaw))
    detections = own.detect(scene(0.2, 3.3, -1.7, yaw))
    assert len(detections) >= 4
    for center in CENTERS:
        nearest = np.argmin(np.hypot(*(detections.boxes[:, :2] - center).T))
        assert math.dist(detections.boxes[nearest, :2], center) < 0.4 * math.sqrt(2.0) + 0.15
    np.testing.assert_allclose(np.cos(detections.boxes[:, 6]), 1.0)
    np.testing.assert_allclose(detections.velocity, np.broadcast_to((10.0, -5.0), detections.velocity.shape), atol=1e-5)


def test_detect_overlapping_boxes_returns_best_one(tmp_path: Path) -> None:
    """Posts 1.6 m apart, two cells, with more points at the second."""
    centers = np.array([[10.0, 2.0], [11.6, 2.0]])
    points = np.concatenate([posts(centers), posts(centers[1:]) + np.array([0.0, 0.0, 0.05])])
    detections = detector(tmp_path).detect(readings(0.0, cloud(np.concatenate([level_ground(), points]))))
    np.testing.assert_allclose(detections.boxes[:, :2], centers[1:], atol=1e-5)


def test_detect_same_readings_returns_equal_bits(tmp_path: Path) -> None:
    def run() -> list[Detections]:
        own = detector(tmp_path, random_arrays(), confidence=0.2)
        return [own.detect(scene(0.1 * tick, x=0.3 * tick)) for tick in range(4)]

    first, second = run(), run()
    assert any(len(detections) for detections in first)
    for before, after in zip(first, second, strict=True):
        assert before.classes == after.classes
        for name in ("boxes", "scores", "velocity", "covariance"):
            np.testing.assert_array_equal(getattr(before, name), getattr(after, name))


def test_detect_fused_features_equal_to_own_returns_equal_bits(tmp_path: Path) -> None:
    """Features that no other station changed give the own result; the own feature map stays."""
    own, another = (detector(tmp_path, random_arrays(), confidence=0.2) for _ in range(2))
    own.detect(scene(0.0))
    detections = own.detect(scene(0.2))
    features = own.feature_map
    assert features is not None
    assert features.interval == pytest.approx(0.2)
    for receiver in (own, another):
        again = receiver.detect(replace(scene(0.2), features=features))
        np.testing.assert_array_equal(again.boxes, detections.boxes)
        np.testing.assert_array_equal(again.scores, detections.scores)
        np.testing.assert_array_equal(again.velocity, detections.velocity)
    assert own.feature_map is features
    assert another.feature_map is None


def test_detect_fused_features_returns_objects_of_others(tmp_path: Path) -> None:
    """The first feature of a free cell is raised to that of the others."""
    own = detector(tmp_path)
    own.detect(scene())
    features = own.feature_map
    assert features is not None
    fused = features.features.copy()
    i, j = math.floor((-30.0 + 51.2) / 0.8), math.floor((-30.0 + 51.2) / 0.8)
    fused[0, i, j] = fused[0].max()
    detections = own.detect(replace(scene(), features=replace(features, features=fused)))
    added = detections.boxes[np.argmin(np.hypot(*(detections.boxes[:, :2] + 30.0).T)), :2]
    assert len(detections) == 5
    np.testing.assert_allclose(added, np.array([i + 0.5, j + 0.5]) * 0.8 - 51.2, atol=1e-5)


def test_feature_map_states_pose_and_contents(tmp_path: Path) -> None:
    own = detector(tmp_path)
    detections = own.detect(scene(0.7, 3.0, -4.0, 0.5))
    features = own.feature_map
    assert features is not None
    assert (features.time, features.yaw, features.height, features.foot) == (0.7, 0.0, 2.0, 0.0)
    assert (features.x, features.y) == pytest.approx((3.2, -4.0))  # multiples of the cell nearest to the lidar
    assert features.cell == pytest.approx(0.8)
    assert features.interval is None
    assert features.features.shape == (96, 128, 128)
    assert features.latent.shape == (8, 128, 128)
    assert features.confidence.max() == pytest.approx(detections.scores.max(), rel=1e-6)
    assert np.all(features.features >= 0.0)


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_detect_points_of_several_lidars_are_one_cloud(parts: int, tmp_path: Path) -> None:
    points = np.concatenate([level_ground(), posts()])
    poses = [(0.0, 0.0, 0.0, 2.0), (1.0, -0.6, 2.5, 0.8), (-2.0, 0.4, -1.0, 1.4)]
    clouds = [cloud(points[number::parts], *poses[number]) for number in range(parts)]
    detections = detector(tmp_path).detect(readings(0.0, *clouds))
    np.testing.assert_allclose(by_position(detections.boxes)[:, :2], by_position(CENTERS), atol=1e-5)


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.array([[300.0, 0.0, 1.0]]), np.zeros((1, 3))])
def test_detect_without_points_in_grid_returns_no_objects(points: Array, tmp_path: Path) -> None:
    own = detector(tmp_path)
    for time in (0.0, 0.1, 0.2):
        assert len(own.detect(readings(time, cloud(points)))) == 0


def test_detect_without_lidar_reading_returns_no_objects(tmp_path: Path) -> None:
    assert len(detector(tmp_path).detect(readings(0.0))) == 0


def test_detect_on_slope_returns_heights_of_road(tmp_path: Path) -> None:
    """A road rises by 5 %: the box of a car 10 m ahead is 0.5 m higher than that of one beside the station."""
    profile = '<elevationProfile><elevation s="0" a="-2.5" b="0.05" c="0" d="0"/></elevationProfile>'
    roads = RoadNetwork.parse(map_xml(road_xml(x=-50.0, profiles=profile)))
    own = detector(tmp_path)
    own.setup(DetectorContext(SPEC, {}, roads))
    points = np.concatenate([level_ground(), posts(CENTERS[:1])])
    points[:, 2] += 0.05 * points[:, 0]
    detections = own.detect(readings(0.0, cloud(points)))
    np.testing.assert_allclose(detections.boxes[:, :3], [[10.0, 2.0, 0.5 + 0.75]], atol=0.02)


def test_in_view_is_zero_outside_of_grid(tmp_path: Path) -> None:
    """The lidar has a range of 100 m and shows all of a free object."""
    own = detector(tmp_path)
    own.setup(DetectorContext(SPEC, {"lidar 0": LidarSettings(range=100.0)}))
    boxes = np.array([(x, y, 0.75, 4.0, 2.0, 1.5, 0.0) for x, y in ((40.0, 0.0), (60.0, 0.0), (0.0, -55.0))])
    shares = own.in_view(boxes, scene(), Detections(0.0))
    np.testing.assert_array_equal(shares, [1.0, 0.0, 0.0])
    assert own.in_view(boxes[:0], scene(), Detections(0.0)).shape == (0,)
    assert not own.in_view(boxes, readings(0.0), Detections(0.0)).any()


def test_perception_without_tracker_keeps_velocities(tmp_path: Path) -> None:
    perception = Perception(detector(tmp_path, plain_arrays((2.0, 0.0))))
    perception.perceive(scene(0.0))
    detections = perception.perceive(scene(0.2))
    assert detections is not None
    np.testing.assert_allclose(detections.velocity, [[10.0, 0.0]] * 4, atol=1e-5)


def test_default_station_has_scans_at_10_hz_and_tracker(tmp_path: Path) -> None:
    path = save(tmp_path / "weights.npz", plain_arrays())
    settings = AgentSettings(detector="pillars", detector_settings={"weights": str(path)})
    agent = build_agent(settings, SPEC, None, seed=1, dt=0.05)
    assert agent.perception._tracker is not None
    sensors = settings.rig_sensors(PillarDetector.needs, PillarDetector.default_sensors)
    assert [(sensor.kind, sensor.rate) for sensor in sensors.values()] == [("lidar", 10.0)]


def test_tracker_begins_with_measured_velocity(tmp_path: Path) -> None:
    """Two scans confirm a track, whose velocity is that of the detector, as the boxes move by it."""
    own = detector(tmp_path, plain_arrays((1.6, 0.0)))
    tracker = Tracker(TrackerSettings())
    own.detect(scene(0.0))
    for tick in range(2, 6):
        moved = CENTERS + np.array([0.8 * (tick - 2), 0.0])
        detections = own.detect(readings(0.1 * tick, cloud(np.concatenate([level_ground(), posts(moved)]))))
        tracks = tracker.update(detections)
    assert len(tracks) == 4
    np.testing.assert_allclose(tracks.velocity, [[8.0, 0.0]] * 4, atol=0.5)


@pytest.mark.statistical
def test_stated_deviation_of_velocities_is_that_of_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each axis, within a factor of two: 250 detections of moving, and 290 of standing vehicles."""
    detect, detected = PillarDetector.detect, list[Detections]()

    def recorded(detector: PillarDetector, given: Readings) -> Detections:
        detected.append(detect(detector, given))
        return detected[-1]

    monkeypatch.setattr(PillarDetector, "detect", recorded)
    errors: dict[bool, list[Array]] = {True: [], False: []}
    for number in (5, 7):
        detected.clear()
        collector = FrameCollector()
        simulate(resolve_scenario(f"coop/scenario_{number}"), "ideal", collector, detector="pillars", time_limit=3.0)
        views = {round(frame.view.time, 6): frame.view for frame in collector.frames}
        for detections in detected:
            view = views[round(detections.time, 6)]
            overlap = iou_bev(detections.boxes, view.boxes)
            for row in np.flatnonzero(overlap.max(axis=1, initial=0.0) > 0.3).tolist():
                true = view.velocity[overlap[row].argmax(), :2]
                speed = math.hypot(*true)
                if (speed < 0.1 or speed > 0.5) and np.isfinite(detections.velocity[row]).all():
                    errors[speed > 0.5].append(detections.velocity[row] - true)
    deviation = {moves: float(np.sqrt(np.mean(np.square(values)))) for moves, values in errors.items()}
    assert 0.5 < deviation[True] / PillarDetector.velocity_deviation < 2.0
    assert 0.5 < deviation[False] / KNOWN_SPEED < 2.0


def test_registry_loads_detector_by_entry_point() -> None:
    assert registry("detectors").load("pillars") is PillarDetector


@pytest.mark.parametrize(
    ("settings", "diagnostic"),
    [
        ({"runtime": "torch"}, "setting 'runtime' is 'torch'"),
        ({"confidence": 0.0}, "confidence"),
        ({"device": "cuda"}, "device"),
        ({"precision": "int8", "runtime": "opencv"}, "'opencv' does not execute .npz weights"),
        ({"weights": "nowhere.onnx"}, "no file 'nowhere.onnx' with weights"),
    ],
)
def test_unsuitable_settings_raise_error(settings: dict[str, Any], diagnostic: str, tmp_path: Path) -> None:
    with pytest.raises(SettingError) as error:
        detector(tmp_path, **settings)
    assert diagnostic in str(error.value)


def test_detect_car_of_world_is_near_its_body(street: Any, tmp_path: Path) -> None:
    """The simulated lidar sees the near sides of a car: occupied cells, and boxes, are on its body."""
    car = street.thing("Car", 12.0, 3.0, 0.4)
    sensors = {"lidar": LidarSettings(rate=10.0)}
    own = detector(tmp_path)
    own.setup(DetectorContext(SPEC, sensors))
    detections = own.detect(street.readings([street.thing("Ego", 0, 0), car], sensors))
    assert 1 <= len(detections) <= 4
    assert iou_bev(detections.boxes, car.box[None]).max() > 0.1
    assert np.all(np.hypot(*(detections.boxes[:, :2] - car.box[:2]).T) < math.hypot(4.892, 1.837) / 2.0 + 0.6)
