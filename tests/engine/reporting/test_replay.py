"""Replays: data of the page, and a page without external resources."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import html
from msgspec.structs import replace

from eidrive_scenario.errors import InputError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import Recording, read_recording
from eidrive_scenario.reporting.notebook import write_replay
from eidrive_scenario.reporting.replay.frame_data import replay_data
from eidrive_scenario.reporting.replay.page import make_replay
from eidrive_scenario.reporting.run_report.settings_text import run_facts, short_number
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange

Play = Callable[..., list[Frame]]


def recorded(frames: list[Frame], folder: Path) -> Path:
    parameters = json.dumps({"EgoSpeed": "8.0"})
    recorder = Recorder(folder / "run.mcap", metadata={"scenario": "street <1>", "seed": "7", "parameters": parameters})
    for frame in frames:
        recorder.observe(frame)
    recorder.close()
    return folder / "run.mcap"


def unpacked(column: list[Any]) -> list[Any]:
    """Return the column of a page with repeated entries."""
    entries: list[Any] = []
    for entry in column:
        entries.append(entries[-1] if entry == 0 and not isinstance(entry, bool) else entry)
    return entries


def test_replay_data_contains_pose_per_frame_and_actor(street: Play) -> None:
    data = replay_data(street(1))
    assert len(data["times"]) == len(data["poses"]) == 100
    assert data["times"][40] == 2.0
    assert data["poses"][40]["Incoming"] == [29.5, 11.5, -1.571, 14.0]
    assert data["actors"]["Truck"]["category"] == "truck"
    assert data["actors"]["Truck"]["size"][:2] == [8.47, 2.89]


def test_replay_data_separates_own_and_received_boxes(street: Play) -> None:
    ego = replay_data(street(6))["stations"]["Ego"][40]
    assert [box[:5] for box in ego["own"]] == [[25.4, 5.6, 8.47, 2.89, -1.571]]
    assert list(ego["received"]) == ["RSU"]
    assert sorted(box[:2] for box in ego["received"]["RSU"]) == [[25.4, 5.6], [29.5, 15.7]]
    assert ego["plan"] == "conflict area"


def test_replay_data_contains_estimated_existence(street: Play) -> None:
    frame = street(6)[40]
    step = frame.steps["Ego"]
    seen = replace(step.detections, existence=np.full(len(step.detections), 0.876))
    ego = replay_data([Frame(frame.view, {"Ego": replace(step, detections=seen)})])["stations"]["Ego"][0]
    assert ego["own"][0][:5] == [25.4, 5.6, 8.47, 2.89, -1.571]
    assert ego["own"][0][6] == 0.88


def test_replay_data_of_late_station_is_empty_before(street: Play) -> None:
    frames = street(1)
    late = [
        Frame(frame.view, {k: v for k, v in frame.steps.items() if k == "Ego"} if i < 5 else frame.steps)
        for i, frame in enumerate(frames)
    ]
    rsu = replay_data(late)["stations"]["RSU"]
    assert rsu[:5] == [None] * 5
    assert len(rsu) == 100
    assert rsu[5] is not None


def test_replay_data_lists_storyboard_transitions(street: Play) -> None:
    change = StateChange(
        0.0, "Go", "S/A/Go", "event", ElementState.STANDBY, ElementTransition.START, ElementState.RUNNING, "time > 0"
    )
    frame = street(1)[0]
    data = replay_data([Frame(frame.view, frame.steps, (change,))])
    assert data["changes"] == [[0.0, "S/A/Go", "Go", "running", "time > 0"]]


def test_replay_page_contains_run_without_external_resources(street: Play, tmp_path: Path) -> None:
    out = write_replay(recorded(street(1), tmp_path), tmp_path / "pages" / "run.html")
    text = out.read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)\s*=\s*[\"']?(?!#|data:)", text)
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    root = html.fromstring(text)
    assert root.findtext(".//h1") == "street <1>, seed 7"
    data = json.loads(root.findtext(".//script[@id='data']") or "")
    assert len(data["times"]) == 100
    assert "$EgoSpeed" in [term.text for term in root.iterfind(".//dt")]


def test_replay_of_empty_recording_raises_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="contains no readable frame"):
        write_replay(recorded([], tmp_path), tmp_path / "run.html")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("0.0332751629550011", "0.0332752"),
        ("14.4444", "14.4444"),
        ("36.50", "36.5"),
        ("1e400", "1e400"),
        ("007", "007"),
        ("1_0", "1_0"),
        ("12345678901234", "12345678901234"),
        ("-0.00123456789", "-0.00123457"),
        ("red", "red"),
    ],
)
def test_short_number_rounds_decimal_fractions_only(text: str, shown: str) -> None:
    assert short_number(text) == shown


def test_run_facts_have_strings_as_written() -> None:
    settings = {"parameters": {"Model": "1.10", "Speed": "1.10"}, "strings": ["Model"]}
    assert run_facts(settings) == {"$Model": "1.10", "$Speed": "1.1"}


def test_replay_page_without_stations_hides_station_panels(street: Play, tmp_path: Path) -> None:
    hidden = ".stations { display: none; }"
    alone = [Frame(frame.view) for frame in street(1)]
    for frames, expected in ((street(1), False), (alone, True)):
        page = write_replay(recorded(frames, tmp_path), tmp_path / "page.html")
        assert (hidden in page.read_text(encoding="utf-8")) is expected


def test_page_size_counts_frames_before_a_station(street: Play, monkeypatch: pytest.MonkeyPatch) -> None:
    """500 stations in the last of 100 frames have one entry per frame, 50 000 in total."""
    frames = street(1)
    crowd = {f"S{number}": frames[-1].steps["RSU"] for number in range(500)}
    frames[-1] = replace(frames[-1], steps=crowd)
    report = DamageReport()
    monkeypatch.setattr("eidrive_scenario.reporting.replay.frame_data._LARGEST_PAGE", 2**18)
    data = replay_data(frames, report=report)
    assert len(json.dumps(data)) < 2**18
    assert any("too large for one page" in line for line in report.lines())


@pytest.mark.parametrize(("timeout", "last"), [(0.2, 33), (1.0, 49), (2.0, 69), (None, 74), ("soon", 74), (-1.0, 74)])
def test_replay_report_timeout_of_station_ends_received_boxes(
    street: Play, tmp_path: Path, timeout: object, last: int
) -> None:
    """The message delay is 1 tick, and all messages from tick 30 are lost: the last report is from tick 29.

    A timeout of 0.2 s is 4 ticks, so the report is used until tick 33; the default of 2.28 s is 45 ticks.
    """
    settings = {"stations": {"Ego": {"report_timeout": timeout}}}
    recorder = Recorder(tmp_path / "run.mcap", metadata={"seed": "1", "settings": json.dumps(settings)})
    for frame in street(1, frozenset(range(30, 100))):
        recorder.observe(frame)
    recorder.close()
    page = write_replay(tmp_path / "run.mcap", tmp_path / "replay.html").read_text(encoding="utf-8")
    data = json.loads(html.fromstring(page).findtext(".//script[@id='data']") or "")
    column = unpacked(data["stations"]["Ego"]["received"])
    received = [tick for tick, senders in enumerate(column) if senders]
    assert received[-1] == last


def recorded_roads(folder: Path, name: str, frames: list[Frame], length: float) -> Recording:
    """Return a recording of frames on a straight road of a length [m]."""
    folder = folder / name
    folder.mkdir()
    road = (
        f'<OpenDRIVE><header revMajor="1" revMinor="8"/><road name="" length="{length}" id="1" junction="-1">'
        f'<planView><geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/></geometry></planView>'
        '<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center><right>'
        '<lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
        "</right></laneSection></lanes></road></OpenDRIVE>"
    )
    recorder = Recorder(
        folder / "recording.mcap",
        metadata={"scenario": name, "seed": "7"},
        attachments={"road.xodr": road.encode()},
    )
    for frame in frames:
        recorder.observe(frame)
    recorder.close()
    return read_recording(folder / "recording.mcap")


def test_replay_of_two_runs_contains_both_with_their_durations(street: Play, tmp_path: Path) -> None:
    first = recorded_roads(tmp_path, "first", street(1), 100.0)
    second = recorded_roads(tmp_path, "second", street(4)[:60:2], 100.0)
    make_replay(first, tmp_path / "two.html", other=second)
    page = (tmp_path / "two.html").read_text(encoding="utf-8")
    root = html.fromstring(page)
    data = json.loads(root.findtext(".//script[@id='data']") or "")
    assert (len(data["times"]), len(data["other"]["times"])) == (100, 30)
    assert data["other"]["times"][-1] == pytest.approx(2.9)
    assert data["other"]["poses"]["Incoming"][0] == data["poses"]["Incoming"][0]
    assert "A: first, seed 7" in "".join(map(str, next(root.iter("h1")).itertext()))
    assert "B: second, seed 7" in page
    assert data["other"]["stations"]["Ego"].keys() == {"plan", "braking"}


def test_replay_of_two_runs_on_different_roads_raises_input_error(street: Play, tmp_path: Path) -> None:
    first = recorded_roads(tmp_path, "first", street(1)[:2], 100.0)
    second = recorded_roads(tmp_path, "second", street(1)[:2], 90.0)
    with pytest.raises(InputError, match="the roads differ from those of"):
        make_replay(first, tmp_path / "two.html", other=second)


def test_damage_of_second_recording_names_its_file(street: Play, tmp_path: Path) -> None:
    first = recorded_roads(tmp_path, "first", street(1)[:40], 100.0)
    file = recorded_roads(tmp_path, "second", street(1)[:40], 100.0).path
    file.write_bytes(file.read_bytes()[:-40])
    damage = make_replay(first, tmp_path / "two.html", other=read_recording(file))
    assert damage
    assert all(line.startswith(f"{file}: ") for line in damage)
