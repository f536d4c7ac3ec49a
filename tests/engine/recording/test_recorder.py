"""Recordings: lossless round trip, and reading of truncated files."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from msgspec.structs import replace

from eidrive_scenario.errors import InputError, SettingError, SimulationError
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import Frame, check_frame
from eidrive_scenario.recording.json_text import JsonText
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.simulation.recorded_outcome import RunRecorder

MakeFrame = Callable[..., Frame]
RECORDERS = (Recorder, RunRecorder)


def record(path: Path, frames: list[Frame], kind: type[Recorder] = Recorder) -> Path:
    recorder = kind(path, metadata={"scenario": "cut_in", "seed": "7"}, attachments={"road.xodr": b"<OpenDRIVE/>"})
    for frame in frames:
        recorder.observe(frame)
    recorder.close()
    return path


def fingerprint(frames: list[Frame]) -> str:
    trace = TraceHash()
    for frame in frames:
        trace.observe(frame)
    return trace.hexdigest()


def test_recorded_frames_are_read_bit_for_bit(tmp_path: Path, make_frame: MakeFrame) -> None:
    frames = [make_frame(tick) for tick in range(20)]
    recording = read_recording(record(tmp_path / "run.mcap", frames))
    again = list(recording.frames())
    assert fingerprint(again) == fingerprint(frames)
    for first, second in zip(frames, again, strict=True):
        assert codec(Frame).encode(first) == codec(Frame).encode(second)
        assert first.changes == second.changes
        assert first.links == second.links
        assert first.view.contacts == second.view.contacts
        assert first.view.position.tobytes() == second.view.position.tobytes()
        assert second.steps["Ego"].detections.boxes.shape == (0, 7)
        assert np.array_equal(first.steps["Rsu"].detections.velocity, second.steps["Rsu"].detections.velocity, True)


@pytest.mark.parametrize("version", ["2", "3"])
def test_frame_of_former_format_has_no_expired_messages(
    tmp_path: Path, make_frame: MakeFrame, monkeypatch: pytest.MonkeyPatch, version: str
) -> None:
    frame = make_frame(3)
    text = json.loads(JsonText(Frame).encode(frame))
    for step in text["steps"].values():
        assert step.pop("expired") == []
    monkeypatch.setattr(JsonText, "encode", lambda self, record: json.dumps(text).encode())
    monkeypatch.setattr("eidrive_scenario.recording.recorder.FORMAT", version)
    (again,) = read_recording(record(tmp_path / "run.mcap", [frame])).frames()
    assert {tuple(step.expired) for step in again.steps.values()} == {()}
    assert fingerprint([again]) == fingerprint([frame])


@pytest.mark.parametrize("row", [1, -1])
def test_frame_with_expired_message_that_was_not_received_is_damage(make_frame: MakeFrame, row: int) -> None:
    frame = make_frame(0)
    ego = replace(frame.steps["Ego"], inbox=frame.steps["Ego"].inbox[:1], expired=(row,))
    with pytest.raises(ValueError, match="expired messages of Ego were not received"):
        check_frame(replace(frame, steps={**frame.steps, "Ego": ego}))


def test_recording_contains_metadata_and_attachments(tmp_path: Path, make_frame: MakeFrame) -> None:
    recording = read_recording(record(tmp_path / "deep" / "run.mcap", [make_frame(0), make_frame(1)]))
    assert (recording.scenario, recording.seed, recording.frame_count) == ("cut_in", 7, 2)
    assert recording.attachments == {"road.xodr": b"<OpenDRIVE/>"}
    assert recording.metadata["numpy"] == np.__version__


def test_recordings_of_equal_frames_are_equal_files(tmp_path: Path, make_frame: MakeFrame) -> None:
    files = [record(tmp_path / name, [make_frame(tick) for tick in range(5)]) for name in ("a.mcap", "b.mcap")]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize("count", [0, 1, 7, 45])
def test_recorder_of_a_run_writes_the_same_file(tmp_path: Path, make_frame: MakeFrame, count: int) -> None:
    frames = [make_frame(tick) for tick in range(count)]
    files = [record(tmp_path / f"{kind.__name__}.mcap", frames, kind) for kind in RECORDERS]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_recorder_of_a_run_keeps_about_one_chunk_of_large_frames(tmp_path: Path, make_frame: MakeFrame) -> None:
    """Frames of 0.2 MB every 0.01 s: a kill must not lose a whole second of them."""
    recorder = RunRecorder(tmp_path / "run.mcap", metadata={"scenario": "cut_in", "seed": "7"})
    rng = np.random.default_rng(1)
    for tick in range(40):
        frame = make_frame(tick)
        routes = {"Ego": rng.random((3500, 3))}
        recorder.observe(replace(frame, routes=routes, view=replace(frame.view, time=0.01 * tick)))
    left = (tmp_path / "run.mcap").read_bytes()
    recorder.close()
    (tmp_path / "left.mcap").write_bytes(left)
    ticks = [frame.view.tick for frame in read_recording(tmp_path / "left.mcap").frames()]
    assert ticks[-1] >= 36


def test_interrupted_writing_loses_one_frame_of_a_run(
    tmp_path: Path, make_frame: MakeFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An interruption while the frames of a second are written, as by Ctrl+C, does not lose the others."""
    recorder = RunRecorder(tmp_path / "run.mcap", metadata={"scenario": "cut_in", "seed": "7"})
    write = RunRecorder.write

    def interrupted(self: RunRecorder, frame: Frame) -> int:
        if frame.view.tick == 9:
            raise KeyboardInterrupt
        return write(self, frame)

    monkeypatch.setattr(RunRecorder, "write", interrupted)
    for tick in range(20):
        recorder.observe(make_frame(tick))
    with pytest.raises(KeyboardInterrupt):
        recorder.observe(make_frame(20))
    recorder.close()
    ticks = [frame.view.tick for frame in read_recording(tmp_path / "run.mcap").frames()]
    assert ticks == [*range(9), *range(10, 21)]


def test_recording_is_readable_by_mcap_library(tmp_path: Path, make_frame: MakeFrame) -> None:
    path = record(tmp_path / "run.mcap", [make_frame(3)])
    with path.open("rb") as stream:
        ((schema, channel, message),) = make_reader(stream).iter_messages()
    assert schema is not None
    assert (schema.name, schema.encoding) == ("eidrive.Frame", "jsonschema")
    assert (channel.topic, channel.message_encoding) == ("/frame", "json")
    assert message.log_time == 150_000_000
    assert message.sequence == 3


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_truncated_recording_returns_its_first_frames(tmp_path: Path, make_frame: MakeFrame, share: float) -> None:
    whole = record(tmp_path / "run.mcap", [make_frame(tick) for tick in range(600)]).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(share * len(whole))])
    recording = read_recording(cut)
    ticks = [frame.view.tick for frame in recording.frames()]
    assert ticks == list(range(len(ticks)))
    assert len(ticks) < 600
    assert share < 0.9 or ticks


@pytest.mark.parametrize("share", [0.0005, 0.2, 0.5])
def test_recording_truncated_after_its_opening_is_an_error(tmp_path: Path, make_frame: MakeFrame, share: float) -> None:
    path = record(tmp_path / "run.mcap", [make_frame(tick) for tick in range(600)])
    recording = read_recording(path)
    os.truncate(path, int(share * path.stat().st_size))
    with pytest.raises(InputError, match=r"run\.mcap: the file has changed since it was opened"):
        list(recording.frames())


@pytest.mark.parametrize("kind", RECORDERS)
def test_unclosed_recorder_loses_at_most_one_second(
    tmp_path: Path, make_frame: MakeFrame, kind: type[Recorder]
) -> None:
    """Frames every 0.05 s up to 2.95 s; after a kill of the process, frames since 2.0 s may be missing."""
    recorder = kind(tmp_path / "run.mcap", metadata={"scenario": "cut_in", "seed": "7"})
    for tick in range(60):
        recorder.observe(make_frame(tick))
    left = (tmp_path / "run.mcap").read_bytes()
    recorder.close()
    (tmp_path / "left.mcap").write_bytes(left)
    recording = read_recording(tmp_path / "left.mcap")
    assert [frame.view.tick for frame in recording.frames()] == list(range(41))
    assert recording.scenario == "cut_in"


@pytest.mark.parametrize("kind", RECORDERS)
def test_closed_recorder_raises_error_for_second_run(
    tmp_path: Path, make_frame: MakeFrame, kind: type[Recorder]
) -> None:
    recorder = kind(tmp_path / "run.mcap", metadata={})
    recorder.observe(make_frame(0))
    recorder.close()
    with pytest.raises(SimulationError, match=r"run\.mcap: the recording is closed; a second run needs"):
        recorder.observe(make_frame(0))
    assert read_recording(tmp_path / "run.mcap").damage == ()


@pytest.mark.parametrize("kind", RECORDERS)
@pytest.mark.parametrize("step", [0.3, 1.0, 7.0])
def test_unclosed_recorder_of_long_steps_loses_less_than_one_second(
    tmp_path: Path, make_frame: MakeFrame, step: float, kind: type[Recorder]
) -> None:
    recorder = kind(tmp_path / "run.mcap", metadata={"scenario": "cut_in", "seed": "7"})
    frames = [
        replace(frame, view=replace(frame.view, time=frame.view.tick * step)) for frame in map(make_frame, range(9))
    ]
    for frame in frames:
        recorder.observe(frame)
    left = (tmp_path / "run.mcap").read_bytes()
    recorder.close()
    (tmp_path / "left.mcap").write_bytes(left)
    last = list(read_recording(tmp_path / "left.mcap").frames())[-1]
    assert last.view.time > frames[-1].view.time - 1.0


@pytest.mark.parametrize("content", [b"", b"not a recording", b"\x89MCAP0\r\n"])
def test_read_recording_of_other_file_raises_input_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "wrong.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"wrong\.mcap"):
        read_recording(path)


def test_read_recording_of_missing_file_raises_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.mcap: cannot read"):
        read_recording(tmp_path / "none.mcap")


def test_recorder_of_unwritable_path_raises_setting_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingError, match=r"run\.mcap: cannot write"):
        Recorder(tmp_path / "file" / "run.mcap", metadata={})
