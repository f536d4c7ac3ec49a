"""Scenarios from recorded datasets: replayed poses against the recordings, and damaged folders."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from command_fixtures import Eidrive, eidrive
from scenario_1 import FrameCollector

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import box_corners, rotation_matrix
from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import SettingError
from eidrive_scenario.export.dataset_import import import_recordings
from eidrive_scenario.export.opv2v.dataset import export_dataset, plan_dataset, read_sensors
from eidrive_scenario.export.traffic_recording.dair_v2x import read_scenes
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.simulation import RunSettings, Simulation, run_file
from eidrive_scenario.world.view import WorldView

__all__ = ["eidrive"]
SMALL = "{lidar: {channels: 8, points_per_second: 16000, rotation: 10, range: 80}}"


def with_small_lidar(path: Path) -> Path:
    """Give the stations of a scenario a small lidar at the recorded mount."""
    path.write_text(path.read_text().replace("channels: 64", "channels: 8").replace("1300000", "16000"))
    return path


def play(scenario: str | Path, settings: RunSettings) -> dict[int, WorldView]:
    """Return the views of a run by tick."""
    collector = FrameCollector()
    run_file(scenario, settings=settings, observers=[collector])
    return {frame.view.tick: frame.view for frame in collector.frames}


def replay(path: Path) -> dict[int, WorldView]:
    """Return the views of a replay by tick."""
    return play(with_small_lidar(path), RunSettings(no_criteria=True))


def center_of(view: WorldView, name: str) -> Array:
    row = view.row(name)
    turn = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    center: Array = view.position[row] + turn @ view.offset[row]
    return center


@pytest.mark.parametrize(
    ("scenario", "time"),
    [("coop/scenario_1", 3.0), ("corner_cases/pedestrian_parked_cars", 2.0), ("corner_cases/emergency_vehicle", 2.0)],
)
def test_replayed_scene_is_within_a_centimeter_of_its_source(scenario: str, time: float, tmp_path: Path) -> None:
    """Each listed road user of each frame of the export has its box in the replay, in the world of its source."""
    jobs = plan_dataset([scenario], tmp_path / "opv2v", RunSettings(time_limit=time), sensors=read_sensors(SMALL))
    export_dataset(jobs, workers=1)
    (path,) = (written for written, _ in import_recordings(tmp_path / "opv2v", tmp_path / "replay"))
    assert check_scenario(path).errors == ()
    source, views = play(scenario, RunSettings(time_limit=time)), replay(path)
    stations = json.loads((jobs[0].path / "manifest.json").read_text())["stations"]
    for name, number in stations.items():
        if number >= 0:
            for tick in range(0, round(time / 0.05) + 1, 2):
                moved = center_of(views[tick], f"Station{number}") - center_of(source[tick], name)
                assert np.linalg.norm(moved) < 0.01
    listed = 0
    for file in jobs[0].path.glob("*/*.yaml"):
        view = views[int(file.stem)]
        content = yaml.safe_load(file.read_text())
        for number, entry in (content["vehicles"] | content["pedestrians"]).items():
            name = f"Station{number}" if number in stations.values() else f"Vehicle{number}"
            expected = np.add(entry["location"], entry["center"]) * (1.0, -1.0, 1.0)
            assert np.linalg.norm(center_of(view, name) - expected) < 0.01
            assert view.yaw[view.row(name)] == pytest.approx(-math.radians(entry["angle"][1]), abs=1e-6)
            np.testing.assert_allclose(view.size[view.row(name)], 2.0 * np.array(entry["extent"]), atol=1e-8)
            assert view.categories[view.row(name)] == entry["obj_type"]
            listed += 1
    assert listed > 20


def test_replayed_stations_measure_at_recorded_poses_and_send_over_a_channel(tmp_path: Path) -> None:
    jobs = plan_dataset(["coop/scenario_1"], tmp_path / "a", RunSettings(time_limit=1.0), sensors=read_sensors(SMALL))
    export_dataset(jobs, workers=1)
    (path,) = (written for written, _ in import_recordings(jobs[0].path, tmp_path / "b"))
    with Simulation(with_small_lidar(path), settings=RunSettings(channel="80211p_urban")) as simulation:
        received = 0
        for _ in range(21):
            frame, _ = simulation.tick()
            received += sum(len(step.inbox) for step in frame.steps.values())
            for station, name in ((1001, "Station1001"), (-1, "RoadsideUnit1")):
                file = jobs[0].path / str(station) / f"{frame.view.tick:06d}.yaml"
                readings = simulation.stack.readings[name]
                if file.exists() and readings.lidars:
                    expected = yaml.safe_load(file.read_text())["lidar_pose"]
                    lidar: LidarReading = readings.lidars["lidar"]
                    np.testing.assert_allclose(lidar.pose[:3, 3] * (1, -1, 1), expected[:3], atol=1e-4)
                    yaw = math.atan2(lidar.pose[1, 0], lidar.pose[0, 0])
                    assert math.cos(yaw + math.radians(expected[4])) == pytest.approx(1.0, abs=1e-9)
    assert received > 10


def write_frame(folder: Path, station: int, number: int, content: object) -> Path:
    path = folder / str(station) / f"{number:06d}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return path


def vehicle(x: float, y: float, yaw: float = 0.0, **others: Any) -> dict[str, Any]:
    """Return an object as a file of CARLA has it."""
    entry = {"location": [x, y, 0.1], "center": [0.0, 0.0, 0.7], "angle": [0.0, yaw, 0.0], "extent": [2.4, 1.0, 0.75]}
    return {**entry, "speed": 10.0, **others}


def frame(x: float, **vehicles: Any) -> dict[str, Any]:
    objects = {int(name[1:]): entry for name, entry in vehicles.items()}
    return {
        "lidar_pose": [x, 5.0, 1.9, 0.0, 90.0, 0.0],
        "true_ego_pos": [x, 5.0, 0.1, 0.0, 90.0, 0.0],
        "vehicles": objects,
    }


def imported(folder: Path, out: Path) -> tuple[Path, list[str]]:
    (scenario,) = import_recordings(folder, out)
    return scenario


def test_recording_of_carla_is_mirrored_and_vehicles_enter_and_leave(tmp_path: Path) -> None:
    """Frame numbers begin at 68; vehicle 7 is recorded from 0.1 s to 0.3 s and drives 1 m in each tenth.

    The folder is that of OPV2V, with its file of the simulation beside the stations.
    """
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "data_protocol.yaml").write_text("world: &world {}\n")
    for number in range(6):
        seen = {"v7": vehicle(20.0 + number, -4.0, 180.0)} if 1 <= number <= 3 else {}
        write_frame(tmp_path / "in", 214, 68 + 2 * number, frame(0.0, **seen))
    path, warnings = imported(tmp_path / "in", tmp_path / "out")
    assert path == tmp_path / "out" / "in.xosc"
    assert warnings == ["station 214 has the size 4.9 x 2.06 x 1.5 m: no file states it"]
    report = check_scenario(path)
    assert (report.errors, report.warnings, [note.rule for note in report.notes]) == ((), (), [""])
    views = replay(path)
    for tick in range(0, 11, 2):
        assert ("Vehicle7" in views[tick].rows) is (2 <= tick <= 6)
        assert center_of(views[tick], "Station214") == pytest.approx((0.0, -5.0, 0.85), abs=1e-6)
        assert views[tick].yaw[views[tick].row("Station214")] == pytest.approx(-math.pi / 2)
    for tick in (2, 3, 4, 5, 6):
        assert center_of(views[tick], "Vehicle7") == pytest.approx((20.0 + tick / 2, 4.0, 0.8), abs=1e-6)
        assert views[tick].speed[views[tick].row("Vehicle7")] == pytest.approx(-10.0, abs=1e-4)  # tail first
    assert max(views) == 10


def test_pitch_of_carla_raises_the_nose_and_roll_lowers_the_right_side(tmp_path: Path) -> None:
    """The rows of `Rz(yaw) Ry(-pitch) Rx(-roll)`, with y mirrored, of roll 8, yaw 30 and pitch 5 degrees."""
    for number in (68, 70):
        write_frame(tmp_path / "in", 5, number, frame(0.0, v7=vehicle(20.0, -4.0, angle=[8.0, 30.0, 5.0])))
    view = replay(imported(tmp_path / "in", tmp_path)[0])[2]
    row = view.row("Vehicle7")
    turn = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    roll, yaw, pitch = np.radians([8.0, 30.0, 5.0])
    ahead = (math.cos(pitch) * math.cos(yaw), -math.cos(pitch) * math.sin(yaw), math.sin(pitch))
    assert turn[:, 0] == pytest.approx(ahead, abs=1e-8)
    assert -turn[2, 1] == pytest.approx(-math.cos(pitch) * math.sin(roll), abs=1e-8)
    assert center_of(view, "Vehicle7") == pytest.approx((20.0, 4.0, 0.8), abs=1e-6)


def test_numbers_with_exponents_are_numbers_as_for_readers_of_opv2v(tmp_path: Path) -> None:
    """YAML 1.1 takes numbers without a point, or without the sign of the exponent, as text."""
    text = "lidar_pose: [1e-05, -5.0, 19e-1, 0, -9e+01, 0]\ntrue_ego_pos: [1.5e1, 2E0, 0.0, 0, 0, 0]\nvehicles: {}\n"
    for number in (0, 2):
        write_frame(tmp_path / "in", 5, number, text)
    path, _ = imported(tmp_path / "in", tmp_path)
    assert center_of(replay(path)[0], "Station5") == pytest.approx((15.0, -2.0, 0.75), abs=1e-6)


def test_current_folder_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_frame(tmp_path / "scene", 1, 0, frame(0.0))
    monkeypatch.chdir(tmp_path / "scene")
    assert imported(Path("."), tmp_path)[0] == tmp_path / "scene.xosc"
    monkeypatch.chdir(tmp_path / "scene" / "1")
    assert imported(Path(".."), tmp_path)[0] == tmp_path / "scene.xosc"


def test_roadside_lidar_keeps_its_roll_and_that_of_a_vehicle_warns(tmp_path: Path) -> None:
    """The lidar of a roadside unit at 5 m: roll 10, yaw 30 and pitch -20 degrees of the left-handed world of OPV2V."""
    for number in (0, 2):
        write_frame(tmp_path / "in", 5, number, frame(0.0) | {"lidar_pose": [0.0, 5.0, 1.9, 8.0, 90.0, 0.0]})
        write_frame(tmp_path / "in", -1, number, frame(0.0) | {"lidar_pose": [10.0, 5.0, 5.0, 10.0, 30.0, -20.0]})
    path, warnings = imported(tmp_path / "in", tmp_path)
    assert "the lidar of Station5 has no roll: mounts have none (recorded: 8.0 degrees)" in warnings
    assert sum("roll" in text for text in warnings) == 1
    with Simulation(with_small_lidar(path)) as simulation:
        simulation.tick()
        lidar: LidarReading = simulation.stack.readings["RoadsideUnit1"].lidars["lidar"]
    expected = rotation_matrix(math.radians(-30.0), math.radians(20.0), math.radians(10.0))
    np.testing.assert_allclose(lidar.pose[:3, :3], expected, atol=1e-6)
    np.testing.assert_allclose(lidar.pose[:3, 3], (10.0, -5.0, 5.0), atol=1e-6)


def test_heights_of_a_recording_are_those_above_its_lowest_road_user(tmp_path: Path) -> None:
    for number in (0, 2):
        low, high = vehicle(30.0, 0.0, location=[30.0, 0.0, 200.0]), vehicle(60.0, 0.0, location=[60.0, 0.0, 203.0])
        content = frame(0.0, v1=low, v2=high) | {
            "lidar_pose": [0, 0, 202.0, 0, 0, 0],
            "true_ego_pos": [0, 0, 200.0, 0, 0, 0],
        }
        write_frame(tmp_path / "hill", 5, number, content)
    path, warnings = imported(tmp_path / "hill", tmp_path)
    assert any("all heights are reduced by 199.950 m" in warning for warning in warnings)
    assert any("road users are up to 3.00 m above it" in warning for warning in warnings)
    view = replay(path)[0]
    assert center_of(view, "Vehicle1")[2] == pytest.approx(0.75)
    assert center_of(view, "Vehicle2")[2] == pytest.approx(3.75)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{}", r"lidar_pose is missing"),
        ("lidar_pose: [0, 0, 0, 0, 0, 0]\n", r"vehicles is missing"),
        ("lidar_pose: [0, 0, 0]\nvehicles: {}\n", r"000000\.yaml:1: lidar_pose is \[0, 0, 0\] \(expected 6 numbers\)"),
        ("lidar_pose: [0, 0, 0, 0, 0, .nan]\nvehicles: {}\n", r"yaml:1: lidar_pose has a number that is out of range"),
        ("lidar_pose: [0, 0, 0, 0, 0, 1e300]\nvehicles: {}\n", r"yaml:1: lidar_pose has a number that is out of range"),
        (f"lidar_pose: [{'9' * 39}, 0, 0, 0, 0, 0]\nvehicles: {{}}\n", r"yaml:1: lidar_pose has a number that is out"),
        ("lidar_pose: [yes, 0, 0, 0, 0, 0]\nvehicles: {}\n", r"yaml:1: lidar_pose is \[True, 0, 0, 0, 0, 0\]"),
        ("lidar_pose: [0, 0, 0, 0, 0, 0]\nvehicles:\n- 1\n", r"yaml:2: vehicles is \[1\] \(expected a mapping"),
        ("lidar_pose: [0, 0, 0, 0, 0, 0]\nvehicles:\n  a: {}\n", r"yaml:3: vehicles\.a is no object with an integer"),
        ("lidar_pose: [0, 0, 0, 0, 0, 0]\nvehicles:\n  1:\n    angle: 3\n", r"yaml:3: vehicles\.1\.extent is missing"),
        ("lidar_pose: [0, 0, 0, 0, 0, 0]\nego_extent: [1, 0, 1]\nvehicles: {}\n", r"yaml:2: ego_extent is not posit"),
        (
            "lidar_pose: [0, 0, 0, 0, 0, 0]\nvehicles:\n  1:\n    extent: [1, 0, 1]\n",
            r"yaml:4: vehicles\.1\.extent is not positive",
        ),
        ("lidar_pose: &a [0, 0, 0, 0, 0, 0]\nvehicles: *a\n", r"yaml:1: not valid YAML: anchors and aliases"),
        ("lidar_pose: !!python/object/apply:os.system [exit]\n", r"yaml:1: not valid YAML: tags are not supported"),
        ("lidar_pose: [" + "[" * 100 + "]" * 100 + "]\n", r"nested too deeply"),
        ("lidar_pose: [0, 0, 0, 0, 0, 0]\n" + "# filler\n" * 100_000, r"larger than|more than \d+ characters"),
        ("[1]", r"no mapping of keys"),
        ("\x00\x01", r"not valid YAML"),
    ],
)
def test_damaged_frame_is_an_error_with_file_and_line(content: str, message: str, tmp_path: Path) -> None:
    write_frame(tmp_path / "scene", 1, 0, content)
    with pytest.raises(SettingError, match=message):
        list(import_recordings(tmp_path, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["641/000000", "0641/000002"], r"scene/641: 641 has the number of 0641; rename or remove one of them$"),
        (["641/000002", "641/002"], r"scene/641/002\.yaml: 002\.yaml has the number of 000002\.yaml; rename"),
    ],
)
def test_two_folders_or_frames_of_one_number_are_an_error(names: list[str], message: str, tmp_path: Path) -> None:
    for name in names:
        path = tmp_path / "scene" / f"{name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(yaml.safe_dump(frame(0.0)))
    with pytest.raises(SettingError, match=message):
        list(import_recordings(tmp_path / "scene", tmp_path / "out"))


def test_vehicle_and_pedestrian_of_one_id_are_an_error(tmp_path: Path) -> None:
    """Ids of CARLA are unique over all actors: also those of different frames are of one road user."""
    write_frame(tmp_path / "scene", 1, 0, frame(0.0, v7=vehicle(20.0, 0.0)))
    write_frame(tmp_path / "scene", 1, 2, frame(0.0) | {"pedestrians": {7: vehicle(30.0, 5.0)}})
    with pytest.raises(SettingError, match=r"000002\.yaml:9: pedestrians\.7 has the id of an object in vehicles"):
        list(import_recordings(tmp_path / "scene", tmp_path / "out"))


def test_frame_that_is_no_regular_file_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "scene" / "1").mkdir(parents=True)
    os.mkfifo(tmp_path / "scene" / "1" / "000000.yaml")
    with pytest.raises(SettingError, match="leads to a pipe"):
        list(import_recordings(tmp_path, tmp_path / "out"))


def test_station_folder_without_frames_is_a_warning(tmp_path: Path) -> None:
    """A folder whose frames are compressed, for example, is no station of the scenario."""
    write_frame(tmp_path / "in" / "scene", 1, 0, frame(0.0))
    compressed = write_frame(tmp_path / "in" / "scene", 2, 0, frame(5.0))
    compressed.rename(compressed.with_suffix(".yaml.gz"))
    _, warnings = imported(tmp_path / "in", tmp_path / "out")
    assert "folder 2 has no frame NUMBER.yaml, so that its station is missing" in warnings


def test_roadside_unit_that_moves_is_a_warning(tmp_path: Path) -> None:
    for number, x in ((0, 0.0), (2, 3.0)):
        write_frame(tmp_path / "in" / "scene", 1, number, frame(0.0))
        write_frame(tmp_path / "in" / "scene", -1, number, frame(x))
        write_frame(tmp_path / "in" / "scene", -2, number, frame(10.0))
    _, warnings = imported(tmp_path / "in", tmp_path / "out")
    moving = "roadside unit -1 moves by up to 3.0 m, but stays at its first pose in the scenario"
    assert [text for text in warnings if "roadside" in text] == [moving]


def test_folder_without_recording_is_invalid_input(eidrive: Eidrive, tmp_path: Path) -> None:
    for folder, message in ((tmp_path, "the folder contains no recording"), (tmp_path / "missing", "cannot read")):
        result = eidrive("dataset", "--import", folder, "--out", tmp_path / "out")
        assert result.exit_code == 2
        assert message in result.stderr


def test_command_imports_each_scenario_folder(eidrive: Eidrive, tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_frame(tmp_path / "in" / name, 1, 0, frame(0.0))
        write_frame(tmp_path / "in" / name, 1, 2, frame(0.5))
    (tmp_path / "in" / "manifest.json").write_text("{}")
    result = eidrive("dataset", "--import", tmp_path / "in", "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert result.stdout == f"{tmp_path / 'out' / 'first.xosc'}\n{tmp_path / 'out' / 'second.xosc'}\n"
    assert "first.xosc: station 1 has the size" in result.stderr
    assert load_scenario(tmp_path / "out" / "first.xosc").entities.keys() == {"Station1"}


LABELS = "cooperative/label_world/{}.json"
UNIT_CORNERS = box_corners(np.array([[0.0, 0.0, 0.0, 2.0, 1.0, 1.0, 0.0]]))[0]
CORNERS_IN_CIRCLES = sorted(
    range(8), key=lambda row: (UNIT_CORNERS[row, 2], -UNIT_CORNERS[row, 0], UNIT_CORNERS[row, 1] * UNIT_CORNERS[row, 0])
)
"""Corners of a box in the order of DAIR-V2X: bottom, then top, each in a circle that begins at the front."""


def write_json(path: Path, content: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def transform(yaw: float, x: float, y: float, z: float) -> dict[str, Any]:
    return {"rotation": rotation_matrix(yaw).tolist(), "translation": [[x], [y], [z]]}


def dair(folder: Path, frames: int = 6) -> Path:
    """Write a recording: the vehicle drives 1 m per frame along y, one car drives 0.8 m per frame against it.

    The world has its ground at 20 m. The roadside unit is at (110, 230) with a correction of (0.5, -0.25).
    """
    index, side, unit = [], [], []
    for number in range(frames):
        vehicle_id, unit_id = f"{100 + number:06d}", f"{300 + number:06d}"
        index.append(
            {
                "vehicle_pointcloud_path": f"vehicle-side/velodyne/{vehicle_id}.pcd",
                "infrastructure_pointcloud_path": f"infrastructure-side/velodyne/{unit_id}.pcd",
                "cooperative_label_path": LABELS.format(vehicle_id),
                "system_error_offset": {"delta_x": 0.5, "delta_y": -0.25},
            }
        )
        stamp = str(1_626_155_123_456_789 + 100_000 * number)
        side.append({"pointcloud_path": f"velodyne/{vehicle_id}.pcd", "pointcloud_timestamp": stamp, "batch_id": "12"})
        unit.append({"pointcloud_path": f"velodyne/{unit_id}.pcd", "pointcloud_timestamp": stamp, "batch_id": "12"})
        calibration = folder / "vehicle-side" / "calib"
        write_json(calibration / f"lidar_to_novatel/{vehicle_id}.json", {"transform": transform(0.0, 0.5, 0.0, 1.6)})
        write_json(
            calibration / f"novatel_to_world/{vehicle_id}.json", transform(math.pi / 2, 100.0, 200.0 + number, 20.3)
        )
        write_json(
            folder / f"infrastructure-side/calib/virtuallidar_to_world/{unit_id}.json",
            transform(0.3, 110.0, 230.0, 25.0),
        )
        boxes = np.array(
            [
                [100.0, 200.2 + number, 20.8, 4.6, 1.9, 1.6, math.pi / 2],
                [97.0, 240.0 - 0.8 * number, 20.75, 4.2, 1.8, 1.5, -math.pi / 2],
                [97.0, 250.0, 21.5, 9.0, 2.5, 3.0, -math.pi / 2],
            ]
        )
        kinds = ["Car", "car", "Truck"]
        corners = box_corners(boxes)[:, CORNERS_IN_CIRCLES]
        labels = [
            {"type": kind, "world_8_points": box.tolist()}
            for kind, box in list(zip(kinds, corners, strict=True))[:: (-1) ** number]
        ]
        write_json(folder / LABELS.format(vehicle_id), [*labels, {"type": "Trafficcone", "world_8_points": []}])
    write_json(folder / "cooperative/data_info.json", index)
    write_json(folder / "vehicle-side/data_info.json", side)
    write_json(folder / "infrastructure-side/data_info.json", unit)
    return folder


def test_recording_of_dair_v2x_is_replayed_with_associated_labels(tmp_path: Path) -> None:
    path, warnings = imported(dair(tmp_path / "cooperative-vehicle-infrastructure"), tmp_path / "out")
    assert path.name == "sequence_12.xosc"
    assert warnings == ["all heights are reduced by 20.000 m: the ground without roads is at the height 0"]
    views = replay(path)
    assert views[0].names == ("Station1", "Vehicle1", "Vehicle2", "RoadsideUnit1")
    by_category = {views[0].categories[views[0].row(name)]: name for name in ("Vehicle1", "Vehicle2")}
    assert by_category.keys() == {"car", "truck"}
    for tick in range(0, 11, 2):
        number = tick / 2
        view = views[tick]
        assert center_of(view, "Station1") == pytest.approx((100.0, 200.2 + number, 0.8), abs=1e-6)
        assert center_of(view, by_category["car"]) == pytest.approx((97.0, 240.0 - 0.8 * number, 0.75), abs=1e-6)
        assert center_of(view, by_category["truck"]) == pytest.approx((97.0, 250.0, 1.5), abs=1e-6)
        assert view.yaw[view.row(by_category["car"])] == pytest.approx(-math.pi / 2)
        np.testing.assert_allclose(view.size[view.row("Station1")], (4.6, 1.9, 1.6), atol=1e-9)
        mast = view.row("RoadsideUnit1")
        assert view.position[mast] == pytest.approx((110.5, 229.75, 0.0))
        assert view.size[mast, 2] == pytest.approx(5.0)
    text = path.read_text()
    assert "mount: {x: " in text
    assert "z: 1.9, yaw: 0.0, pitch: 0.0}" in text  # 20.3 + 1.6 - 20 above the ground


def test_repeated_track_id_in_frame_is_another_road_user(tmp_path: Path) -> None:
    """Each frame has two cars of one id, 10 m apart: no road user is at two positions at one time."""
    folder = dair(tmp_path / "in", frames=3)
    for path in (folder / "cooperative/label_world").iterdir():
        boxes = np.array([[x, 240.0, 20.75, 4.2, 1.8, 1.5, 0.0] for x in (80.0, 90.0)])
        corners = box_corners(boxes)[:, CORNERS_IN_CIRCLES].tolist()
        write_json(path, [{"type": "car", "track_id": "7", "world_8_points": box} for box in corners])
    (scene,) = read_scenes(folder)
    for track in scene.tracks:
        assert np.all(np.diff(track.times) > 0.0)


def test_labels_with_null_as_track_id_are_associated_by_position(tmp_path: Path) -> None:
    folder = dair(tmp_path / "in")
    expected = {track.name: track.poses for track in next(read_scenes(folder)).tracks}
    for path in (folder / "cooperative/label_world").iterdir():
        write_json(path, [{**label, "track_id": None} for label in json.loads(path.read_text())])
    tracks = {track.name: track.poses for track in next(read_scenes(folder)).tracks}
    assert tracks.keys() == expected.keys()
    assert all(np.array_equal(tracks[name], poses) for name, poses in expected.items())


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("cooperative/data_info.json", "[]", "the index has no frame"),
        ("cooperative/data_info.json", "{", r"data_info\.json: cannot read"),
        ("cooperative/data_info.json", "[{}]", r"\[0\]\.vehicle_pointcloud_path is missing"),
        ("vehicle-side/data_info.json", "[]", r"frame '000100' is not in vehicle-side"),
        (
            "vehicle-side/data_info.json",
            '[{"pointcloud_path": "000100.pcd", "pointcloud_timestamp": "now"}]',
            r"pointcloud_timestamp is 'now'",
        ),
        (
            "vehicle-side/data_info.json",
            f'[{{"pointcloud_path": "000100.pcd", "pointcloud_timestamp": 1{"0" * 400}}}]',
            r"data_info\.json: pointcloud_timestamp is an integer beyond",
        ),
        (
            LABELS.format("000100"),
            f'[{{"type": "Car", "world_8_points": [{f"[1{chr(48) * 400}, 0, 0]," * 7}[0, 0, 0]]}}]',
            r"\[0\]\.world_8_points is .*expected 24 numbers",
        ),
        ("vehicle-side/calib/novatel_to_world/000100.json", "{}", r"000100\.json: rotation is missing"),
        (
            "vehicle-side/calib/novatel_to_world/000100.json",
            '{"rotation": [[2, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [0, 0, 0]}',
            "rotation is no rotation matrix",
        ),
        (LABELS.format("000100"), '[{"type": "Car", "world_8_points": [[1, 2]]}]', r"\[0\]\.world_8_points is"),
        (
            LABELS.format("000100"),
            '[{"type": "Car", "world_8_points": [' + "[0, 0, 0]," * 7 + "[0, 0, 0]]}]",
            "no corners",
        ),
        (LABELS.format("000100"), "[" * 500 + "]" * 500, "nested"),
    ],
)
def test_damaged_recording_of_dair_v2x_is_an_error(file: str, content: str, message: str, tmp_path: Path) -> None:
    folder = dair(tmp_path / "in", frames=1)
    (folder / file).write_text(content)
    with pytest.raises(SettingError, match=message):
        list(import_recordings(folder, tmp_path / "out"))


def test_time_in_another_unit_is_an_error_with_its_frame(tmp_path: Path) -> None:
    folder = dair(tmp_path / "in", frames=2)
    index = folder / "vehicle-side/data_info.json"
    entries = json.loads(index.read_text())
    entries[1]["pointcloud_timestamp"] = str(10**18)  # nanoseconds
    write_json(index, entries)
    with pytest.raises(SettingError, match=r"data_info\.json: pointcloud_timestamp of frame '000101' is .* after"):
        list(import_recordings(folder, tmp_path / "out"))


def test_pairs_without_labels_are_omitted_with_a_warning(tmp_path: Path) -> None:
    """The published index lists the pairs of the test data, of which no other file is published."""
    folder = dair(tmp_path / "in", frames=4)
    expected = [track.times.tolist() for track in next(read_scenes(dair(tmp_path / "two", frames=2))).tracks]
    for number in (102, 103):
        for path in folder.glob(f"*/**/*{number:06d}.json"):
            path.unlink()
    write_json(
        folder / "vehicle-side/data_info.json", json.loads((folder / "vehicle-side/data_info.json").read_text())[:2]
    )
    (scene,) = read_scenes(folder)
    assert [track.times.tolist() for track in scene.tracks] == expected
    assert scene.warnings == ["2 of 4 pairs of frames are omitted: cooperative/label_world lacks their labels"]


def test_missing_calibration_is_an_error_with_its_path(tmp_path: Path) -> None:
    folder = dair(tmp_path / "in", frames=1)
    (folder / "infrastructure-side/calib/virtuallidar_to_world/000300.json").unlink()
    with pytest.raises(SettingError, match=r"virtuallidar_to_world/000300\.json: cannot read: No such file"):
        list(import_recordings(folder, tmp_path / "out"))
