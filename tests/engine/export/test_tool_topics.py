"""Topics for Foxglove and OSI in a recording, which remains one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from osi3trace.osi_trace import OSITrace
from written_recording import view, write_run

from eidrive_scenario.api.run import add_topics, judge_recording, read_recording, run_and_save
from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.export.foxglove.writer import write_foxglove
from eidrive_scenario.export.osi.trace import write_osi
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.export.tool_topics import ALL_TOPICS, write_with_topics
from eidrive_scenario.pytest_plugin.option_values import TOPICS
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.simulation import RunSettings


def messages(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Return times [ns] and content of the messages of each topic."""
    found: dict[str, list[tuple[int, bytes]]] = {}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of a run with messages and criteria."""
    settings = RunSettings(channel="latency_300ms", time_limit=4.0)
    result = run_and_save("coop/scenario_1", settings=settings, out=tmp_path_factory.mktemp("run"))
    assert result.recording is not None
    return result.recording


@pytest.fixture(scope="module")
def complete(recording: Path) -> Iterator[Path]:
    """Copy with all topics."""
    path = recording.with_name("complete.mcap")
    write_with_topics(open_run(recording), path)
    yield path
    path.unlink()


def test_file_has_the_topics_of_all_separate_files(recording: Path, complete: Path, tmp_path: Path) -> None:
    run, found = open_run(recording), messages(complete)
    expected = messages(recording)
    write_foxglove(run, tmp_path / "foxglove.mcap")
    write_osi(run, tmp_path / "osi.mcap")
    expected |= messages(tmp_path / "foxglove.mcap") | messages(tmp_path / "osi.mcap")
    assert found.keys() == expected.keys() >= {"/frame", "/tf", "/ground_truth", "ground_truth"}
    assert found == expected


def test_file_is_read_by_osi_tools(complete: Path) -> None:
    trace: Any = OSITrace(str(complete), "GroundTruth", topic="ground_truth")
    truth = list(trace)
    assert len(truth) == 81
    assert {one.name for one in trace.get_file_metadata()} >= {"net.asam.osi.trace", "run"}
    trace.close()
    frames = list(read_recording(complete).frames())
    for frame, message in zip(frames, truth, strict=True):
        centers = {(one.base.position.x, one.base.position.y) for one in message.moving_object}
        assert centers == {(x, y) for x, y in frame.view.centers[:, :2].tolist()}


def test_file_remains_an_undamaged_recording(recording: Path, complete: Path) -> None:
    before, after = read_recording(recording), read_recording(complete)
    assert after.damage == ()
    assert (after.metadata, after.attachments, after.frame_count) == (before.metadata, before.attachments, 81)
    assert judge_recording(complete).criteria == judge_recording(recording).criteria


@pytest.mark.exhaustive
def test_added_topics_replace_former_ones(recording: Path, complete: Path, tmp_path: Path) -> None:
    path = tmp_path / "recording.mcap"
    path.write_bytes(recording.read_bytes())
    assert add_topics(path) == ()
    assert path.read_bytes() == complete.read_bytes()
    assert add_topics(path) == ()
    assert path.read_bytes() == complete.read_bytes()
    add_topics(path, ["osi"])
    assert not {"/tf", "/ground_truth"} & messages(path).keys()
    add_topics(path, [])
    assert messages(path) == messages(recording)
    assert read_recording(path).damage == ()


def test_topics_are_added_to_the_file_behind_a_link(recording: Path, complete: Path, tmp_path: Path) -> None:
    path = tmp_path / "kept" / "recording.mcap"
    path.parent.mkdir()
    path.write_bytes(recording.read_bytes())
    link = tmp_path / "link.mcap"
    link.symlink_to(path)
    assert add_topics(link) == ()
    assert link.is_symlink()
    assert path.read_bytes() == complete.read_bytes()


def test_pytest_option_has_the_same_topics() -> None:
    assert sorted(TOPICS) == sorted(ALL_TOPICS)


def test_unknown_topics_leave_the_recording_unchanged(recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "recording.mcap"
    path.write_bytes(recording.read_bytes())
    with pytest.raises(SettingError, match="there are no topics 'rviz'"):
        add_topics(path, ["osi", "rviz"])
    with pytest.raises(SettingError, match="topics is 'osi'; give a list"):
        add_topics(path, "osi")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no recording\.mcap"):
        add_topics(tmp_path / "empty")
    assert path.read_bytes() == recording.read_bytes()


def test_topics_of_truncated_recording_leave_it_marked_as_damaged(complete: Path, tmp_path: Path) -> None:
    path = tmp_path / "recording.mcap"
    with complete.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    path.write_bytes(complete.read_bytes()[: summary.chunk_indexes[3].chunk_start_offset])
    before = read_recording(path)
    assert 10 < before.frame_count < 81
    warnings = add_topics(path)
    assert any("damaged" in line for line in warnings)
    after = read_recording(path)
    assert after.frame_count == before.frame_count
    assert after.damage == ("the seal at the end is missing: the run did not end, or the file was truncated",)
    assert len(messages(path)["ground_truth"]) == after.frame_count


def test_messages_of_other_topics_are_no_frames(tmp_path: Path) -> None:
    """Frames with a gap are damage; messages of another topic with any number are none."""
    path = tmp_path / "r.mcap"
    recorder = Recorder(path, metadata={"scenario": "x", "seed": "1"})
    other: Any = recorder.writer
    channel = other.register_channel("/other", "json", 0)
    for tick in range(3):
        recorder.observe(Frame(view({"Ego": {}}, tick=tick)))
        other.add_message(channel, 0, b"not a frame", 0, sequence=7)
    recorder.close(sealed=False)
    found = read_recording(path)
    assert found.frame_count == len(list(found.frames())) == 3
    assert found.damage == ("the seal at the end is missing: the run did not end, or the file was truncated",)


def test_all_topics_of_empty_recording_are_an_error(tmp_path: Path) -> None:
    run = write_run(tmp_path, [])
    with pytest.raises(SettingError, match="no readable frame"):
        write_with_topics(run, tmp_path / "all.mcap", ALL_TOPICS)
    assert not (tmp_path / "all.mcap").exists()
