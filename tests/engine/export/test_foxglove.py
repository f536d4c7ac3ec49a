"""Foxglove topics, decoded with their published schemas."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove_topics import Topics, decoded, exported, point
from msgspec.structs import replace
from pyproj import Transformer
from scipy.spatial.transform import Rotation
from written_recording import detected, step, view, write_run

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.export.foxglove.writer import write_foxglove
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.recording.camera_images import camera_file, image_file
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.messages.point_cloud import compress

ROADS = Path(__file__).parents[3] / "xosc" / "roads"
LAYOUT = Path(__file__).parents[3] / "examples" / "foxglove_layout.json"
PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture(scope="module")
def scenario_1(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Frame], Topics, dict[str, str]]:
    """Return frames, topics and schemas of a run."""
    folder = tmp_path_factory.mktemp("foxglove")
    result = run_and_save("coop/scenario_1", settings=RunSettings(channel="latency_300ms"), out=folder)
    assert result.recording is not None
    write_foxglove(open_run(result.recording), folder / "f.mcap")
    return list(read_recording(result.recording).frames()), *decoded(folder / "f.mcap")


@pytest.mark.exhaustive
def test_topics_have_published_schemas(scenario_1: tuple[list[Frame], Topics, dict[str, str]]) -> None:
    _, _, schemas = scenario_1
    assert schemas["/tf"] == "foxglove.FrameTransforms"
    assert schemas["/log"] == schemas["/log/messages"] == "foxglove.Log"
    stations = [f"/stations/{name}/{part}" for name in ("Ego", "RSU") for part in ("detections", "received", "fused")]
    for topic in ("/map", "/ground_truth", "/messages", "/stations/Ego/plan", *stations):
        assert schemas[topic] == "foxglove.SceneUpdate"
    assert "/stations/RSU/plan" not in schemas


def test_boxes_and_frames_are_those_of_the_run(scenario_1: tuple[list[Frame], Topics, dict[str, str]]) -> None:
    frames, topics, _ = scenario_1
    assert len(frames) == len(topics["/tf"]) == len(topics["/ground_truth"]) > 100
    for frame, scene, tree in zip(frames, topics["/ground_truth"], topics["/tf"], strict=True):
        assert [entity.id for entity in scene.entities] == list(frame.view.names)
        assert {found.parent_frame_id for found in tree.transforms} == {"map"}
        for row, (entity, found) in enumerate(zip(scene.entities, tree.transforms, strict=True)):
            (cube,) = entity.cubes
            assert point(found.translation) == pytest.approx(frame.view.position[row])
            quaternion = [getattr(found.rotation, axis) for axis in "xyzw"]
            turn = Rotation.from_quat(quaternion)
            center = point(found.translation) + turn.apply(frame.view.offset[row])
            assert point(cube.pose.position) == pytest.approx(center, abs=1e-9)
            assert turn.as_euler("ZYX")[0] == pytest.approx(math.remainder(frame.view.yaw[row], math.tau))
            assert point(cube.size) == pytest.approx(frame.view.size[row])


def test_known_objects_are_boxes_of_each_station(scenario_1: tuple[list[Frame], Topics, dict[str, str]]) -> None:
    frames, topics, _ = scenario_1
    for part in ("detections", "fused"):
        for frame, scene in zip(frames, topics[f"/stations/Ego/{part}"], strict=True):
            objects = getattr(frame.steps["Ego"], part)
            (entity,) = scene.entities
            assert [point(cube.pose.position) for cube in entity.cubes] == objects.boxes[:, :3].tolist()
    assert any(entity.id == "RSU" for scene in topics["/stations/Ego/received"] for entity in scene.entities)


def test_plan_is_line_along_its_points(scenario_1: tuple[list[Frame], Topics, dict[str, str]]) -> None:
    frames, topics, _ = scenario_1
    colors = set()
    for frame, scene in zip(frames, topics["/stations/Ego/plan"], strict=True):
        plan = frame.steps["Ego"].plan
        assert plan is not None
        (line,) = scene.entities[0].lines
        assert [[one.x, one.y] for one in line.points] == plan.points.tolist()
        colors.add((plan.braking is not None, line.color.r > line.color.g))
    assert colors == {(False, False), (True, True)}


def test_log_contains_storyboard_decisions_and_outcomes(
    scenario_1: tuple[list[Frame], Topics, dict[str, str]],
) -> None:
    frames, topics, _ = scenario_1
    log = topics["/log"]
    started = sum(change.transition is not None for frame in frames for change in frame.changes)
    assert sum(entry.name == "storyboard" for entry in log) == started > 5
    reasons = {step.plan.reason for frame in frames if (step := frame.steps["Ego"]).plan is not None}
    assert {entry.message for entry in log if entry.name == "Ego"} <= reasons
    verdicts = [entry.message for entry in log if entry.name == "criterion"]
    assert {text.partition(":")[0] for text in verdicts} == {"collision", "min_distance", "driven_distance"}
    assert len(topics["/log/messages"]) == sum(len(frame.links) for frame in frames)
    stamps = [entry.timestamp.seconds + 1e-9 * entry.timestamp.nanos for entry in log]
    assert stamps == sorted(stamps)
    assert stamps[-1] == pytest.approx(frames[-1].view.time)


def test_metrics_are_numbers_for_plots(scenario_1: tuple[list[Frame], Topics, dict[str, str]]) -> None:
    frames, topics, _ = scenario_1
    speeds = [entry["speed"] for entry in topics["/metrics/actors/Ego"]]
    assert speeds == [frame.view.speed[frame.view.row("Ego")] for frame in frames]
    counts = [entry["fused"] for entry in topics["/metrics/stations/Ego"]]
    assert counts == [len(frame.steps["Ego"].fused) for frame in frames]


def panels_of(layout: Any) -> Iterator[str]:
    """Yield the panels of a layout tree, whose nodes have two parts."""
    if isinstance(layout, str):
        yield layout
    else:
        assert layout["direction"] in ("row", "column")
        assert 0 < layout["splitPercentage"] < 100
        for part in ("first", "second"):
            yield from panels_of(layout[part])


def test_layout_shows_topics_and_numbers_of_a_run(scenario_1: tuple[list[Frame], Topics, dict[str, str]]) -> None:
    """Keys are those of the type LayoutData and of the panels of Lichtblick (suite-base, MPL-2.0)."""
    _, topics, _ = scenario_1
    layout = json.loads(LAYOUT.read_bytes())
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    panels = layout["configById"]
    assert sorted(panels_of(layout["layout"])) == sorted(panels)
    assert {name.partition("!")[0] for name in panels} == {"3D", "Plot", "RosOut"}
    assert panels["3D!scene"]["followTf"] == "actor/Ego"
    assert [name for name in panels["3D!scene"]["topics"] if name not in topics] == []
    assert panels["RosOut!log"]["topicToRender"] in topics
    for name, panel in panels.items():
        for path in panel.get("paths", ()):
            topic, _, number = path["value"].rpartition(".")
            assert any(number in entry for entry in topics[topic]), (name, path["value"])


def test_violation_is_logged_at_its_time(tmp_path: Path) -> None:
    result = run_and_save(PASSING_BY, settings=RunSettings(parameters={"OtherY": "0"}), out=tmp_path)
    assert result.recording is not None
    write_foxglove(open_run(result.recording), tmp_path / "f.mcap")
    (collision,) = [one for one in result.criteria if one.name == "collision"]
    entries = [one for one in decoded(tmp_path / "f.mcap")[0]["/log"] if "collision: violated" in one.message]
    assert [type(one).Level.Name(one.level) for one in entries] == ["ERROR"]
    time = entries[0].timestamp.seconds + 1e-9 * entries[0].timestamp.nanos
    assert collision.first_violation is not None
    assert 0.0 <= time - collision.first_violation < 0.06
    assert collision.violation_state
    assert entries[0].message.splitlines()[1:] == list(collision.violation_state)


def test_camera_images_have_calibration_and_frame(tmp_path: Path) -> None:
    optical = [[0.0, 0.0, 1.0, 2.0], [-1.0, 0.0, 0.0, 0.5], [0.0, -1.0, 0.0, 1.5], [0.0, 0.0, 0.0, 1.0]]
    description = {
        "width": 64,
        "height": 48,
        "intrinsics": [[80.0, 0.0, 32.0], [0.0, 80.0, 24.0], [0.0, 0.0, 1.0]],
        "distortion": [0.1, 0.0, 0.0, 0.0, 0.0],
        "pose": optical,
    }
    folder = tmp_path / "images" / "Wagen%2F1"
    folder.mkdir(parents=True)
    _, picture = cv2.imencode(".jpg", np.full((48, 64, 3), 200, dtype=np.uint8))
    (folder / image_file("front", 1)).write_bytes(picture.tobytes())
    (folder / camera_file("front")).write_text(json.dumps(description))
    (folder / "notes.txt").write_text("not an image")
    station = {"Wagen/1": step(detected(0.0, []))}
    frames = [Frame(view({"Wagen/1": {}}, tick), station) for tick in range(3)]
    write_foxglove(write_run(tmp_path, frames), tmp_path / "f.mcap")
    topics, schemas = decoded(tmp_path / "f.mcap")
    base = "/stations/Wagen%2F1/front"
    assert schemas[f"{base}/image"] == "foxglove.CompressedImage"
    ((image,), (calibration,)) = topics[f"{base}/image"], topics[f"{base}/calibration"]
    pixels = cv2.imdecode(np.frombuffer(image.data, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    assert pixels.shape == (48, 64, 3)
    assert (calibration.width, calibration.height, calibration.D[0]) == (64, 48, 0.1)
    assert list(calibration.K) == np.array(description["intrinsics"]).ravel().tolist()
    (transform,) = [one for one in topics["/tf"][0].transforms if one.child_frame_id == image.frame_id]
    assert transform.parent_frame_id == "actor/Wagen%2F1"
    turn = Rotation.from_quat([getattr(transform.rotation, axis) for axis in "xyzw"]).as_matrix()
    assert turn == pytest.approx(np.array(optical)[:3, :3])
    assert point(transform.translation) == [2.0, 0.5, 1.5]


@pytest.mark.parametrize(
    "text", ["", "{}", '{"width": 1, "height": 1, "intrinsics": [1], "distortion": [], "pose": []}']
)
def test_invalid_description_of_camera_is_a_warning(tmp_path: Path, text: str) -> None:
    folder = tmp_path / "images" / "Ego"
    folder.mkdir(parents=True)
    (folder / image_file("front", 0)).write_bytes(b"not a JPEG")
    (folder / camera_file("front")).write_text(text)
    run = write_run(tmp_path, [Frame(view({"Ego": {}}), {"Ego": step(detected(0.0, []))})])
    write_foxglove(run, tmp_path / "f.mcap")
    assert "/stations/Ego/front/image" in decoded(tmp_path / "f.mcap")[0]
    assert any("no calibration" in warning for warning in run.warnings)


def test_shared_point_cloud_is_packed_as_floats(tmp_path: Path) -> None:
    points = np.array([[1.0, 2.0, 0.5], [3.0, -4.0, 1.5]])
    cloud = compress(points, 0.0, 0.2)
    message = Message("Ego", 0, 0.0, StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), detected(0.0, []), 100, points=cloud)
    sender = replace(step(detected(0.0, [])), outbox=(message,))
    (found,) = exported(tmp_path, Frame(view({"Ego": {}}), {"Ego": sender}))["/stations/Ego/points"]
    table = np.frombuffer(found.data, dtype="<f4").reshape(-1, found.point_stride // 4)
    assert [(field.name, field.offset) for field in found.fields] == [("x", 0), ("y", 4), ("z", 8)]
    assert table[np.argsort(table[:, 0])] == pytest.approx(points, abs=0.11)


def test_location_fix_follows_the_reference_of_the_map(tmp_path: Path) -> None:
    """The map is a transverse Mercator projection about 49°N 8°E, by its <geoReference>."""
    frame = Frame(view({"Ego": {"position": (1000.0, 2000.0, 3.0)}}), {"Ego": step(detected(0.0, []))})
    (fix,) = exported(tmp_path, frame, road=ROADS / "coop_2.xodr")["/stations/Ego/fix"]
    definition = "+proj=tmerc +lat_0=49 +lon_0=8 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
    longitude, latitude = Transformer.from_crs(definition, "EPSG:4326", always_xy=True).transform(1000.0, 2000.0)
    assert (fix.latitude, fix.longitude) == pytest.approx((latitude, longitude), abs=1e-9)
    assert fix.altitude == 3.0


def test_station_without_plan_or_finite_numbers_is_exported(tmp_path: Path) -> None:
    own = detected(0.0, [(np.nan, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0), (5.0, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0)])
    plan = Plan(np.zeros((0, 2)), np.zeros(0), "no path")
    steps = {"A": step(own), "B": step(own, plan=plan), "Mast": step(own, drives=False)}
    topics = exported(tmp_path, Frame(view({"A": {}, "B": {}}), steps))
    assert len(topics["/stations/A/detections"][0].entities[0].cubes) == 1
    assert topics["/stations/B/plan"][0].deletions
    assert "/stations/Mast/plan" not in topics


def test_recording_without_frames_raises_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="contains no readable frame"):
        exported(tmp_path)


def test_missing_library_raises_error_with_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    for module in [name for name in sys.modules if name.partition(".")[0] == "foxglove_schemas_protobuf"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "foxglove_schemas_protobuf", None)
    with pytest.raises(SettingError, match=r"foxglove-schemas-protobuf is not installed; install it: pip install"):
        write_foxglove(run, tmp_path / "f.mcap")


def test_inconsistent_frame_is_an_error_or_a_warning_of_damaged_recording(tmp_path: Path) -> None:
    """The points of a plan have one dimension in the frame 1; the seal of the copy is cut off."""
    plans = [Plan(np.zeros((2, 2)), np.zeros(2), "drive"), Plan(np.zeros(3), np.zeros(2), "drive")]
    frames = [Frame(view({"A": {}}, tick), {"A": step(detected(0.0, []), plan=plans[tick == 1])}) for tick in range(15)]
    run = write_run(tmp_path, frames)
    with pytest.raises(InputError, match="frame 1 cannot be exported: IndexError"):
        write_foxglove(run, tmp_path / "f.mcap")
    data = (tmp_path / "made.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: data.rindex(b"sha256") - 100])
    damaged = open_run(tmp_path / "cut.mcap")
    write_foxglove(damaged, tmp_path / "f.mcap")
    assert any("frame 1 cannot be exported" in warning for warning in damaged.warnings)
    assert len(decoded(tmp_path / "f.mcap")[0]["/ground_truth"]) == damaged.recording.frame_count - 1 > 0
