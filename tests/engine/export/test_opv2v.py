"""Scenario folders of OPV2V: layout, conventions and truth, against formulas and a reader of PCD of these tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from opendrive_xml import elevation_xml, map_xml, road_xml, superelevation_xml
from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from scenario_1 import FrameCollector
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    end_xml,
    event_xml,
    global_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import points_in_box, rotation_matrix
from eidrive_scenario.errors import SettingError, SimulationError
from eidrive_scenario.export.opv2v.dataset import read_sensors
from eidrive_scenario.export.opv2v.frame_files import frame_text, write_pcd
from eidrive_scenario.export.opv2v.poses import opv2v_pose, pose_matrix
from eidrive_scenario.export.opv2v.reader_limits import ReaderLimits
from eidrive_scenario.export.opv2v.writer import Opv2vWriter
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.world.view import WorldView

NO_STATION = Path(__file__).parents[2] / "data" / "passing_by.xosc"
SENSORS = read_sensors(
    "{roof: {kind: lidar, channels: 16, points_per_second: 60000, rotation: 10, range: 80, range_noise: 0},"
    " front: {kind: camera, width: 160, height: 120}}"
)


def carla_matrix(pose: Sequence[float]) -> Array:
    """Return `Rz(yaw) Ry(-pitch) Rx(-roll)`, as readers of OPV2V do, with its rotations written out."""
    x, y, z, *angles = pose
    roll, yaw, pitch = np.radians(angles)
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    about_y = np.array([[math.cos(pitch), 0, -math.sin(pitch)], [0, 1, 0], [math.sin(pitch), 0, math.cos(pitch)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(roll), math.sin(roll)], [0, -math.sin(roll), math.cos(roll)]])
    matrix = np.eye(4)
    matrix[:3, :3] = about_z @ about_y @ about_x
    matrix[:3, 3] = x, y, z
    return matrix


def read_pcd(path: Path) -> tuple[Array, NDArray[np.uint32]]:
    """Return points (N, 3) and colors (N,) by the header of the file."""
    head, _, data = path.read_bytes().partition(b"DATA binary\n")
    fields = dict(line.split(maxsplit=1) for line in head.decode().splitlines() if not line.startswith("#"))
    assert (fields["FIELDS"], fields["SIZE"], fields["TYPE"]) == ("x y z rgb", "4 4 4 4", "F F F U")
    cloud = np.frombuffer(data, dtype=[("xyz", "<f4", 3), ("rgb", "<u4")])
    assert int(fields["POINTS"]) == int(fields["WIDTH"]) == len(cloud)
    return cloud["xyz"].astype(float), cloud["rgb"]


@dataclass(frozen=True)
class Exported:
    folder: Path
    writer: Opv2vWriter
    views: dict[int, WorldView]
    trace_hash: str

    def frame(self, station: int, number: int) -> dict[str, Any]:
        content: dict[str, Any] = yaml.safe_load((self.folder / str(station) / f"{number:06d}.yaml").read_text())
        return content


def export(folder: Path, scenario: str | Path, time_limit: float, sensors: Any = SENSORS, **settings: Any) -> Exported:
    writer, collector = Opv2vWriter(folder, sensors), FrameCollector()
    given = RunSettings(time_limit=time_limit, **settings)
    result = run_file(scenario, settings=given, observers=[writer, collector])
    views = {frame.view.tick: frame.view for frame in collector.frames}
    return Exported(folder, writer, views, result.trace_hash)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """Return scenario 1 of the paper: the firetruck hides the crossing car from the ego, not from the roadside unit."""
    return export(tmp_path_factory.mktemp("opv2v") / "scene", "coop/scenario_1", 0.5)


def test_poses_equal_mirrored_matrices_of_the_formula_of_opv2v() -> None:
    """Reflection at y = 0 of any right-handed pose is the matrix that readers build from the six numbers."""
    draws = np.random.default_rng(5)
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    for _ in range(200):
        pose = np.eye(4)
        yaw, pitch, roll = draws.uniform(-1.0, 1.0, 3) * (math.pi, 1.5, math.pi)
        pose[:3, :3] = rotation_matrix(yaw, pitch, roll)
        pose[:3, 3] = draws.uniform(-500.0, 500.0, 3)
        np.testing.assert_allclose(carla_matrix(opv2v_pose(pose)), mirror @ pose @ mirror, atol=1e-7)
        np.testing.assert_allclose(pose_matrix(opv2v_pose(pose)), pose, atol=1e-7)


def test_folder_has_one_file_of_each_kind_per_station_and_frame(scene: Exported) -> None:
    assert scene.writer.stations == {"Ego": 1001, "RSU": -1}
    assert scene.writer.frames == [0, 2, 4, 6, 8, 10]
    assert sorted(path.name for path in scene.folder.iterdir()) == ["-1", "1001"]
    expected = {f"{number:06d}{end}" for number in scene.writer.frames for end in (".pcd", ".yaml", "_camera0.png")}
    for station in ("-1", "1001"):
        assert {path.name for path in (scene.folder / station).iterdir()} == expected


def test_keys_of_frames_are_those_of_opv2v_and_three_additions(scene: Exported) -> None:
    frame = scene.frame(-1, 4)
    keys = {"camera0", "ego_speed", "lidar_pose", "plan_trajectory", "predicted_ego_pos", "true_ego_pos", "vehicles"}
    assert set(frame) == keys | {"ego_extent", "pedestrians"}
    for entry in frame["vehicles"].values():
        assert set(entry) == {"angle", "center", "extent", "location", "speed"} | {"obj_type"}
        assert all(isinstance(value, float) for key in ("angle", "center", "extent") for value in entry[key])


def test_true_boxes_are_the_mirrored_boxes_of_the_world(scene: Exported) -> None:
    view = scene.views[10]
    vehicles = scene.frame(-1, 10)["vehicles"]
    by_category = sorted((entry["obj_type"], number) for number, entry in vehicles.items())
    assert [category for category, _ in by_category] == ["car", "car", "truck"]
    for entry in vehicles.values():
        center = np.add(entry["location"], entry["center"]) * (1.0, -1.0, 1.0)
        row = int(np.argmin(np.linalg.norm(view.boxes[:, :3] - center, axis=1)))
        np.testing.assert_allclose(view.boxes[row, :3], center, atol=1e-8)
        np.testing.assert_allclose(view.size[row], 2.0 * np.array(entry["extent"]), atol=1e-8)
        assert math.radians(-entry["angle"][1]) == pytest.approx(view.yaw[row], abs=1e-8)
        assert entry["speed"] == pytest.approx(3.6 * abs(view.speed[row]), abs=1e-6)


def test_station_lists_the_vehicles_with_a_point_except_itself(scene: Exported) -> None:
    """The number of listed vehicles is that of the boxes with a point more than 0.1 m above the ground."""
    for number in scene.writer.frames:
        view = scene.views[number]
        vehicles = [row for row, category in enumerate(view.categories) if category != "misc"]
        assert len(vehicles) == 3
        for station, own in ((1001, "Ego"), (-1, "RSU")):
            frame = scene.frame(station, number)
            points, _ = read_pcd(scene.folder / str(station) / f"{number:06d}.pcd")
            pose = carla_matrix(frame["lidar_pose"])
            world = (points @ pose[:3, :3].T + pose[:3, 3]) * (1.0, -1.0, 1.0)
            hits = [points_in_box(world[world[:, 2] > 0.1], _grown(view.boxes[row])).any() for row in vehicles]
            expected = {view.names[row] for row, hit in zip(vehicles, hits, strict=True) if hit} - {own}
            assert len(frame["vehicles"]) == len(expected)
            assert scene.writer.stations[own] not in frame["vehicles"]
    assert frame["vehicles"].keys() > {1001}


def _grown(box: Array) -> Array:
    """Return a box (7,) that contains mirrors and lamps."""
    grown: Array = box + np.array([0.0, 0.0, 0.0, 0.16, 0.16, 0.0, 0.0])
    return grown


@pytest.mark.parametrize("station", [1001, -1])
def test_points_lie_on_the_ground_and_in_boxes_of_listed_vehicles(scene: Exported, station: int) -> None:
    """Without noise of ranges: points in the world of OPV2V are on the plane z = 0, or in a listed box.

    Mirrors, handles and lamps reach beyond the box by up to 0.07 m.
    """
    frame = scene.frame(station, 10)
    points, colors = read_pcd(scene.folder / str(station) / "000010.pcd")
    assert len(points) > 1000
    assert not np.any(colors & 0xFF00FFFF)
    world = points @ carla_matrix(frame["lidar_pose"])[:3, :3].T + carla_matrix(frame["lidar_pose"])[:3, 3]
    others = world[np.abs(world[:, 2]) > 0.02]
    inside = np.zeros(len(others), dtype=bool)
    for entry in frame["vehicles"].values():
        pose = carla_matrix([*np.add(entry["location"], entry["center"]), *entry["angle"]])
        local = (others - pose[:3, 3]) @ pose[:3, :3]
        own = (np.abs(local) <= np.array(entry["extent"]) + 0.08).all(axis=1)
        assert own.any()
        inside |= own
    near = [np.linalg.norm(others[:, :2] - entry["location"][:2], axis=1) < 7.0 for entry in frame["vehicles"].values()]
    assert inside[np.any(near, axis=0)].all()


def test_boxes_and_points_on_a_banked_slope_have_pitch_and_roll(tmp_path: Path) -> None:
    """The road along x climbs by 10 % and is banked by 0.15 rad: it is the plane through the origin with normal n.

    The ego drives up, the other car down, so that their pitch and roll have opposite signs. Bases of boxes lie on the
    plane, and points on the plane or in a box: mirrors, handles and lamps reach beyond it by up to 0.07 m.
    """
    slope, bank = math.atan(0.1), 0.15
    road = tmp_path / "banked.xodr"
    profiles = elevation_xml(slope=0.1) + superelevation_xml(bank)
    road.write_text(map_xml(road_xml(length=300.0, profiles=profiles)))
    (tmp_path / "banked.xosc").write_bytes(
        scenario_xml(
            entities=object_xml("Ego", controller=agent_xml()) + object_xml("Car"),
            init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 100)))
            + init_xml("Car", teleport_xml(lane_position_xml(1, 120))),
            stop=end_xml(0.2),
            road=road_file_xml(road),
        )
    )
    exported = export(tmp_path / "out", tmp_path / "banked.xosc", 0.2)
    frame = exported.frame(1001, 0)
    (car,) = frame["vehicles"].values()
    half_height = frame["ego_extent"][2]
    own = [*np.add(frame["true_ego_pos"][:3], (0.0, 0.0, half_height)), *frame["true_ego_pos"][3:]]
    ahead = np.array([math.cos(slope), 0.0, math.sin(slope)])
    left = np.array([-math.sin(slope) * math.sin(bank), math.cos(bank), math.cos(slope) * math.sin(bank)])
    normal = np.cross(ahead, left)
    boxes = [
        (carla_matrix(own), np.array(frame["ego_extent"])),
        (carla_matrix([*np.add(car["location"], car["center"]), *car["angle"]]), np.array(car["extent"])),
    ]
    for (pose, extent), direction in zip(boxes, (1.0, -1.0), strict=True):
        base = [(pose @ (a * extent[0], b * extent[1], -extent[2], 1.0))[:3] for a in (-1, 1) for b in (-1, 1)]
        assert np.abs(np.array(base) * (1.0, -1.0, 1.0) @ normal).max() < 1e-6
        np.testing.assert_allclose(pose[:3, 0] * (1.0, -1.0, 1.0), direction * ahead, atol=1e-8)
    assert (own[5], own[3]) == pytest.approx(np.degrees((slope, bank)), abs=1e-6)  # nose up, right side down
    assert (car["angle"][2], car["angle"][0]) == pytest.approx(np.degrees((-slope, -bank)), abs=1e-6)
    points, _ = read_pcd(exported.folder / "1001" / "000000.pcd")
    lidar = carla_matrix(frame["lidar_pose"])
    world = points @ lidar[:3, :3].T + lidar[:3, 3]
    local = (world - boxes[1][0][:3, 3]) @ boxes[1][0][:3, :3]
    in_box = (np.abs(local) <= boxes[1][1] + 0.08).all(axis=1)
    on_road = np.abs(world * (1.0, -1.0, 1.0) @ normal) < 0.02
    assert min(in_box.sum(), on_road.sum()) > 10
    near = np.linalg.norm(world[:, :2] - boxes[0][0][:2, 3], axis=1) < 40.0
    assert (in_box | on_road)[near].all()


def test_intensity_is_the_red_byte(tmp_path: Path) -> None:
    write_pcd(tmp_path / "cloud.pcd", np.array([[1.0, -2.0, 3.0], [0.5, 0.0, 0.0]]), np.array([1.0, 0.5]))
    points, colors = read_pcd(tmp_path / "cloud.pcd")
    np.testing.assert_array_equal(points, [[1.0, -2.0, 3.0], [0.5, 0.0, 0.0]])
    assert colors.tolist() == [0xFF0000, 0x800000]


def test_camera_projects_the_truck_to_the_pixel_of_its_position(scene: Exported) -> None:
    """`extrinsic` maps lidar to camera in left-handed axes; `cords` and `lidar_pose` give the same matrix.

    The camera is 2.5 m ahead of the center of the ego at a height of 1 m and looks along x, so that the pixel of a
    point is (80 - f y / x, 60 - f (z - 1) / x) with its distance x ahead and y to the left.
    """
    frame = scene.frame(1001, 10)
    camera = frame["camera0"]
    extrinsic, intrinsic = np.array(camera["extrinsic"]), np.array(camera["intrinsic"])
    expected = np.linalg.inv(carla_matrix(camera["cords"])) @ carla_matrix(frame["lidar_pose"])
    np.testing.assert_allclose(extrinsic, expected, atol=1e-7)
    assert intrinsic[0, 0] == pytest.approx(80.0 / math.tan(math.radians(50.0)))
    (truck,) = (entry for entry in frame["vehicles"].values() if entry["obj_type"] == "truck")
    world = np.append(np.add(truck["location"], truck["center"]), 1.0)
    x, y, z, _ = extrinsic @ np.linalg.inv(carla_matrix(frame["lidar_pose"])) @ world
    column, row, _ = intrinsic @ (y, -z, x) / x
    view = scene.views[10]
    ahead, left, _ = view.boxes[view.row("Firetruck"), :3] - view.boxes[view.row("Ego"), :3] - (2.5, 0.0, 0.0)
    above = view.boxes[view.row("Firetruck"), 2] - 1.0
    assert column == pytest.approx(80.0 - intrinsic[0, 0] * left / ahead, abs=1e-6)
    assert row == pytest.approx(60.0 - intrinsic[0, 0] * above / ahead, abs=1e-6)
    image = cv2.imread(str(scene.folder / "1001" / "000010_camera0.png"))
    assert image is not None
    assert image.shape == (120, 160, 3)


def test_run_is_the_same_with_and_without_export(scene: Exported) -> None:
    assert run_file("coop/scenario_1", settings=RunSettings(time_limit=0.5)).trace_hash == scene.trace_hash


def test_frames_without_a_late_station_are_omitted(tmp_path: Path) -> None:
    exported = export(tmp_path / "late", "coop/scenario_1_late_rsu", 2.2)
    first = exported.writer.frames[0]
    assert first > 0
    assert exported.writer.frames == list(range(first, 45, 2))
    for station in ("-1", "1001"):
        numbers = sorted(int(path.name[:6]) for path in (exported.folder / station).glob("*.yaml"))
        assert numbers == exported.writer.frames
    assert f"{first // 2} frames are omitted, in which a station is absent" in exported.writer.warnings


def test_limits_of_readers_are_those_of_the_frames_that_remain(tmp_path: Path) -> None:
    """The ego leaves at 0.25 s. Then the station 100 m ahead of it is the first one, and would be 0 m from the ego."""
    road = tmp_path / "road.xodr"
    road.write_text(map_xml(road_xml(length=300.0)))
    leave = global_xml('<EntityAction entityRef="Ego"><DeleteEntityAction/></EntityAction>')
    due = trigger_xml(condition_xml(time_xml(0.25, "greaterOrEqual")))
    at_once = trigger_xml(condition_xml(time_xml(0, "greaterOrEqual"), name="start"))
    (tmp_path / "leaves.xosc").write_bytes(
        scenario_xml(
            entities=object_xml("Ego", controller=agent_xml()) + object_xml("Ahead", controller=agent_xml()),
            init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 50)))
            + init_xml("Ahead", teleport_xml(lane_position_xml(-1, 150))),
            story=acts_xml(act_xml(group_xml(maneuver_xml(event_xml("leave", leave, due)), ""), at_once)),
            stop=end_xml(0.6),
            road=road_file_xml(road),
        )
    )
    exported = export(tmp_path / "out", tmp_path / "leaves.xosc", 1.0)
    assert exported.writer.frames == [0, 2, 4]
    omitted, far = exported.writer.warnings
    assert omitted == "4 frames are omitted, in which a station is absent"
    assert "never uses station 'Ahead': its lidar is at least 100 m from that of 'Ego'" in far


def test_absent_station_alone_makes_no_empty_dataset(tmp_path: Path) -> None:
    exported = export(tmp_path / "early", "coop/scenario_1_late_rsu", 0.3)
    assert exported.writer.stations == {"Ego": 1001}
    assert "stations never enter and have no folder: RSU" in exported.writer.warnings


def test_second_roadside_unit_gets_an_id_of_vehicles_with_warning(tmp_path: Path) -> None:
    exported = export(tmp_path / "units", "coop/scenario_7", 0.1)
    assert sorted(exported.writer.stations.values()) == [-1, 1001, 1002, 1003]
    assert any("roadside unit 'RSU2' has the id 1003" in warning for warning in exported.writer.warnings)


def test_camera_with_distortion_is_a_warning(scene: Exported, tmp_path: Path) -> None:
    """The frames of OPV2V have no field for the coefficients, so that readers project as through a pinhole."""
    lens = {"front": SENSORS["front"].model_copy(update={"distortion": (-0.05, 0.0, 0.0, 0.0, 0.0)})}
    warnings = export(tmp_path / "lens", "coop/scenario_1", 0.1, {**SENSORS, **lens}).writer.warnings
    assert sum("the pixels of camera 'front' of 'Ego': the format has no distortion" in text for text in warnings) == 1
    assert not any("distortion" in text for text in scene.writer.warnings)


def test_export_without_station_or_with_other_time_steps_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"no station; give entities a driving stack by RunSettings.drive"):
        export(tmp_path / "none", NO_STATION, 0.1)
    with pytest.raises(SettingError, match="time step does not divide"):
        export(tmp_path / "step", "coop/scenario_1", 0.1, dt=0.03)


def test_limits_of_readers_are_warnings() -> None:
    def lidar(x: float, z: float) -> Array:
        pose = np.eye(4)
        pose[:3, 3] = x, 0.0, z
        return pose

    def box(x: float, height: float) -> Array:
        return np.array([[x + a, b, c] for a in (-2.0, 2.0) for b in (-1.0, 1.0) for c in (0.0, height)])

    limits = ReaderLimits()
    corners = {"Car": box(20.0, 1.5), "Bus": box(30.0, 3.1), "Far": box(200.0, 3.1)}
    limits.observe({"Ego": lidar(0.0, 1.9), "Mast": lidar(80.0, 5.0)}, {"Ego": [], "Mast": ["Car"]}, corners)
    far, of_ego, of_mast = limits.warnings()
    assert "never uses station 'Mast': its lidar is at least 80 m" in far
    assert "omits 'Bus' from the truth of some frames" in of_ego
    assert "omits 'Car' from the truth of late fusion" in of_mast


def test_numbers_of_frames_have_no_exponents_and_no_negative_zero() -> None:
    text = frame_text({"lidar_pose": [1e-7, -0.0, 1e6, 0.0, -1e-12, 0.1]})
    assert text == "lidar_pose: [0.0000001, 0.0, 1000000.0, 0.0, 0.0, 0.1]\n"


@pytest.mark.parametrize("sensors", ["truth", "{a: {kind: lidar}, b: {kind: lidar}}", "camera"])
def test_sensors_without_exactly_one_lidar_are_an_error(sensors: str, tmp_path: Path) -> None:
    path = tmp_path / "sensors.yaml"
    path.write_text(sensors)
    with pytest.raises(SettingError, match=r"sensors\.yaml: a frame of OPV2V has one lidar and cameras"):
        read_sensors(path)


def test_sensor_with_another_rate_than_that_of_frames_is_an_error() -> None:
    with pytest.raises(SettingError, match=r"sensor 'front' measures in each frame, at 10 Hz \(got rate 5\)"):
        read_sensors("{roof: {kind: lidar, rate: 10}, front: {kind: camera, rate: 5}}")


def test_run_without_a_common_frame_is_an_error(tmp_path: Path) -> None:
    writer = Opv2vWriter(tmp_path)
    writer.stations = {"A": 1001, "B": 1002}
    writer._written = {"A": [0], "B": [2]}
    with pytest.raises(SimulationError, match="no frame has all stations"):
        writer.conclude(None)  # type: ignore[arg-type]
