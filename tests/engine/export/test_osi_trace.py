"""OSI trace files: sensor data, metadata of the format, and unusual recordings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from msgspec.structs import replace
from osi3trace.osi_trace import OSITrace
from scipy.spatial.transform import Rotation
from written_recording import detected, step, view, write_run

from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.export.osi.trace import sensor_data_topic, write_osi
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.sensing.readings import EgoState

ROAD = Path(__file__).parents[3] / "xosc" / "roads" / "coop_1.xodr"


def sensor_data(path: Path, station: str, list_name: str = "detections") -> list[Any]:
    return messages(path, "SensorData", sensor_data_topic(station, list_name))


def messages(path: Path, kind: str = "GroundTruth", topic: str = "ground_truth") -> list[Any]:
    trace = OSITrace(str(path), kind, topic=topic)
    found = list(trace)
    trace.close()
    return found


def test_detections_are_in_the_frame_of_the_vehicle(tmp_path: Path) -> None:
    """The station at (10, 20) heads north with 5 m/s; an object 8 m north and 3 m west of it stands still."""
    body = {"position": (10.0, 20.0, 0.5), "angles": (np.pi / 2, 0.0, 0.0), "velocity": (0.0, 5.0, 0.0)}
    own = detected(0.0, [(7.0, 28.0, 1.25, 4.0, 2.0, 1.5, np.pi)], velocity=[(0.0, 0.0)])
    write_osi(write_run(tmp_path, [Frame(view({"Ego": body}), {"Ego": step(own)})]), tmp_path / "t.mcap")
    (message,) = sensor_data(tmp_path / "t.mcap", "Ego")
    (found,) = message.moving_object
    position, speed = found.base.position, found.base.velocity
    assert (position.x, position.y, position.z) == pytest.approx((8.0, 3.0, 0.75))
    assert found.base.orientation.yaw == pytest.approx(np.pi / 2)
    assert (speed.x, speed.y) == pytest.approx((-5.0, 0.0))
    assert found.header.existence_probability == pytest.approx(0.9)
    # "The sum of all probability must be one", given that the object exists (osi_detectedobject.proto).
    assert [candidate.probability for candidate in found.candidate] == [1.0]
    assert found.header.tracking_id.value == 1
    assert message.sensor_id.value == found.header.sensor_id[0].value


def test_sensor_is_mounted_in_the_reference_point_below_the_rear_axle(tmp_path: Path) -> None:
    """OSI states the place of a sensor from the middle of the rear axle, which is 0.3 m high here."""
    steps = {name: step(detected(0.0, []), drives=name == "Ego") for name in ("Ego", "Mast")}
    frame = Frame(view({"Ego": {}, "Mast": {"category": "misc"}}), steps)
    metadata = {"axles": '{"Ego": {"rear": [0.1, 0.3], "front": [2.8, 0.3]}}'}
    write_osi(write_run(tmp_path, [frame], metadata=metadata), tmp_path / "t.mcap")
    places = [sensor_data(tmp_path / "t.mcap", name)[0].mounting_position.position for name in ("Ego", "Mast")]
    assert [(place.x, place.y, place.z) for place in places] == [pytest.approx((-0.1, 0.0, -0.3)), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("text", ["[]", "{", '{"Ego": 3}', '{"Ego": {"rear": null, "front": null}}'])
def test_axles_that_cannot_be_read_are_unknown(tmp_path: Path, text: str) -> None:
    run = write_run(tmp_path, [Frame(view({"Ego": {}}))], metadata={"axles": text})
    assert dict(run.axles) == {}


def test_detections_are_relative_to_the_estimated_pose(tmp_path: Path) -> None:
    estimate = EgoState(0.0, np.array([1.0, 0.0, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    own = detected(0.0, [(11.0, 0.0, 0.75, 4.0, 2.0, 1.5, 0.0)])
    frame = Frame(view({"Ego": {}}), {"Ego": step(own, estimate=estimate)})
    write_osi(write_run(tmp_path, [frame]), tmp_path / "t.mcap")
    (message,) = sensor_data(tmp_path / "t.mcap", "Ego")
    assert message.moving_object[0].base.position.x == pytest.approx(10.0)
    assert not message.moving_object[0].base.HasField("velocity")


@pytest.mark.parametrize("angles", [(0.4, -0.1, 0.05), (0.0, 0.1, 0.0), (-2.0, 0.0, -0.2)])
def test_detections_on_a_slope_are_rotated_by_yaw_pitch_and_roll(
    tmp_path: Path, angles: tuple[float, float, float]
) -> None:
    """In the world the detected boxes are upright; an object with the velocity of the vehicle rests in its frame.

    A deviation along x of the level plane is one along the slope, which is longer by 1 / cos(pitch).
    """
    turn = Rotation.from_euler("ZYX", angles)
    velocity = turn.apply([10.0, 0.0, 0.0])
    body = {"position": (10.0, 20.0, 5.0), "angles": angles, "velocity": velocity}
    box = (40.0, 30.0, 6.0, 4.0, 2.0, 1.5, 0.7)
    own = replace(detected(0.0, [box], velocity=[velocity[:2].tolist()]), covariance=np.array([np.diag([4.0, 1.0])]))
    write_osi(write_run(tmp_path, [Frame(view({"Ego": body}), {"Ego": step(own)})]), tmp_path / "t.mcap")
    (found,) = sensor_data(tmp_path / "t.mcap", "Ego")[0].moving_object
    position, speed, tilt = found.base.position, found.base.velocity, found.base.orientation
    arm = np.array(box[:3]) - (10.0, 20.0, 5.0)
    assert turn.apply([position.x, position.y, position.z]) == pytest.approx(arm)
    back = turn * Rotation.from_euler("ZYX", [tilt.yaw, tilt.pitch, tilt.roll])
    assert back.as_euler("ZYX") == pytest.approx([0.7, 0.0, 0.0], abs=1e-9)
    assert (speed.x, speed.y, speed.z) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    if angles[0] == angles[2] == 0.0:
        rmse = found.base_rmse.position
        assert (rmse.x, rmse.y) == pytest.approx((2.0 / np.cos(angles[1]), 1.0))


def test_trace_has_metadata_of_the_format(tmp_path: Path) -> None:
    """Mandatory entries of ASAM OSI 3.8.0, section on multi-channel trace files."""
    frame = Frame(view({"Ego": {}}), {"Ego": step(detected(0.0, []))})
    write_osi(write_run(tmp_path, [frame]), tmp_path / "t.mcap")
    with (tmp_path / "t.mcap").open("rb") as stream:
        reader = make_reader(stream)
        (metadata,) = [one for one in reader.iter_metadata() if one.name == "net.asam.osi.trace"]
        summary = reader.get_summary()
    names = ("osi_version", "protobuf_version")
    keys = {"version", *(f"{edge}_{name}" for edge in ("min", "max") for name in names)}
    assert keys <= set(metadata.metadata)
    assert metadata.metadata["version"] == "3.8.0"
    assert summary is not None
    assert {one.name for one in summary.schemas.values()} == {"osi3.GroundTruth", "osi3.SensorData"}
    assert all(one.encoding == "protobuf" for one in summary.schemas.values())
    for channel in summary.channels.values():
        assert channel.message_encoding == "protobuf"
        assert {f"net.asam.osi.trace.channel.{name}" for name in names} <= set(channel.metadata)
    assert summary.chunk_indexes


def test_names_with_slashes_and_other_letters_are_escaped(tmp_path: Path) -> None:
    name = "Fahrzeug/ä 車 %"
    frame = Frame(view({name: {}}), {name: step(detected(0.0, [(9.0, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0)]))})
    write_osi(write_run(tmp_path, [frame]), tmp_path / "t.mcap")
    assert sensor_data_topic(name, "fused").count("/") == 2
    assert len(sensor_data(tmp_path / "t.mcap", name, "fused")[0].moving_object) == 1


def test_run_with_two_hundred_actors_is_exported(tmp_path: Path) -> None:
    bodies = {f"car {number}": {"position": (3.0 * number, 0.0, 0.0)} for number in range(200)}
    write_osi(write_run(tmp_path, [Frame(view(bodies, tick)) for tick in range(3)], road=ROAD), tmp_path / "t.mcap")
    assert [len(one.moving_object) for one in messages(tmp_path / "t.mcap")] == [200, 200, 200]


def test_frame_without_actors_has_empty_ground_truth(tmp_path: Path) -> None:
    write_osi(write_run(tmp_path, [Frame(view({}))], road=ROAD), tmp_path / "t.mcap")
    (truth,) = messages(tmp_path / "t.mcap")
    assert not truth.moving_object
    assert truth.lane


def test_recording_without_frames_raises_error_and_leaves_no_file(tmp_path: Path) -> None:
    run = write_run(tmp_path, [])
    with pytest.raises(InputError, match="contains no readable frame"):
        write_osi(run, tmp_path / "t.mcap")
    assert not (tmp_path / "t.mcap").exists()


def test_unclosed_recording_is_exported_with_warning(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.partial.mcap", metadata={"scenario": "x", "seed": "1"})
    for tick in range(30):
        recorder.observe(Frame(view({"A": {}}, tick)))
    left = (tmp_path / "run.partial.mcap").read_bytes()
    recorder.close()
    (tmp_path / "left.mcap").write_bytes(left)
    run = open_run(tmp_path / "left.mcap")
    write_osi(run, tmp_path / "t.osi")
    assert len(messages(tmp_path / "t.osi")) == 21
    assert any("the run did not end" in warning for warning in run.warnings)


def test_invalid_roads_of_recording_are_omitted_with_warning(tmp_path: Path) -> None:
    (tmp_path / "broken.xodr").write_text("<OpenDRIVE><road")
    run = write_run(tmp_path, [Frame(view({"A": {}}))], road=tmp_path / "broken.xodr")
    write_osi(run, tmp_path / "t.mcap")
    assert any("the roads are omitted" in warning for warning in run.warnings)


@pytest.mark.parametrize("name", ["trace", "trace.json"])
def test_other_suffix_raises_setting_error(tmp_path: Path, name: str) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    with pytest.raises(SettingError, match=r"give a file \*\.mcap \(multi-channel\) or \*\.osi"):
        write_osi(run, tmp_path / name)


def test_unwritable_path_raises_setting_error(tmp_path: Path) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingError, match="cannot write"):
        write_osi(run, tmp_path / "file" / "t.mcap")


def test_missing_library_raises_error_with_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    for module in [name for name in sys.modules if name.partition(".")[0] == "osi3"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "osi3", None)
    with pytest.raises(SettingError, match=r"osi-python is not installed; install it: pip install .*\["):
        write_osi(run, tmp_path / "t.mcap")
