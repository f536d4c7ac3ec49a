"""Receiving stations that do not drive."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from perception_metrics import metric_sample, recall_by_sight
from scenario_1 import ONE, FrameCollector, simulate, with_properties

from eidrive_scenario.driving import stations
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InputError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult
from eidrive_scenario.world.actor import ActorSpec

MAST = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))


def listening(folder: Path, **properties: str) -> Path:
    """Write scenario 1 with additional properties of its roadside unit."""
    return with_properties(folder, "RsuStack", *properties.items(), name=f"scenario_{len(list(folder.iterdir()))}.xosc")


def play(
    source: Path, channel: str = "ideal", *, time_limit: float = 4.0, **more: Any
) -> tuple[RunResult, list[Frame]]:
    collector = FrameCollector()
    return simulate(source, channel, collector, time_limit=time_limit, **more), collector.frames


def links(frames: list[Frame]) -> set[tuple[str, str]]:
    return {(event.sender, event.receiver) for frame in frames for event in frame.links}


def places(boxes: np.ndarray) -> set[tuple[float, float]]:
    return {(round(x, 3), round(y, 3)) for x, y in boxes[:, :2].tolist()}


def test_mast_without_cooperates_with_receives_nothing() -> None:
    _, frames = play(ONE)
    assert links(frames) == {("RSU", "Ego")}
    assert all(not frame.steps["RSU"].inbox for frame in frames)


@pytest.mark.parametrize("names", ["[Ego]", "Ego", "all"])
def test_mast_with_cooperates_with_fuses_received_and_sends_own_detections(tmp_path: Path, names: str) -> None:
    _, deaf = play(listening(tmp_path, sensors="{truth: {range: 8}}"))
    _, hearing = play(listening(tmp_path, sensors="{truth: {range: 8}}", cooperates_with=names))
    assert links(hearing) == {("RSU", "Ego"), ("Ego", "RSU")}
    learned = 0
    for before, after in zip(deaf, hearing, strict=True):
        unit, received = after.steps["RSU"], after.steps["RSU"].inbox
        assert after.view.position.tobytes() == before.view.position.tobytes(), "the knowledge of a mast moves no actor"
        assert after.steps["Ego"].fused.boxes.tobytes() == before.steps["Ego"].fused.boxes.tobytes()
        for message in unit.outbox:
            assert message.detections.boxes.tobytes() == unit.detections.boxes.tobytes()
        of_others = {place for item in received for place in places(item.message.detections.boxes)}
        learned += len(of_others - places(unit.detections.boxes) & of_others)
        assert len(unit.fused) >= len(unit.detections)
        mast = after.view.position[after.view.row("RSU")]
        if len(unit.fused):
            away = np.hypot(unit.fused.boxes[:, 0] - mast[0], unit.fused.boxes[:, 1] - mast[1])
            assert away.min() > 1.0, "the list of a mast does not contain the mast"
    assert learned > 0


def test_batch_of_all_stations_equals_fusion_by_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = listening(tmp_path, cooperates_with="Ego")
    path.write_text(path.read_text().replace('"average"', '"covariance_intersection"'))
    batch, frames = play(path, "bursty")
    assert max(len(frame.steps["RSU"].fused) for frame in frames) > 1
    monkeypatch.setattr(
        stations,
        "fuse_reports",
        lambda agents, sensed, now: {name: agent.fuse(sensed[name]) for name, agent in agents.items()},
    )
    assert play(path, "bursty")[0].trace_hash == batch.trace_hash


def test_fused_objects_of_mast_count_in_perception_metrics(tmp_path: Path) -> None:
    _, deaf = play(listening(tmp_path, sensors="{truth: {range: 8}}"))
    _, hearing = play(listening(tmp_path, sensors="{truth: {range: 8}}", cooperates_with="Ego"))
    alone, joined = (
        recall_by_sight([metric_sample(frame, "RSU", reach=60.0) for frame in frames[2:]], 0.1)
        for frames in (deaf, hearing)
    )
    assert alone.others is not None
    assert joined.others is not None
    assert alone.others.share == 0.0
    assert joined.others.share > 0.9


def test_cooperate_option_applies_to_receiving_stations_only(tmp_path: Path) -> None:
    hearing = listening(tmp_path, cooperates_with="Ego")
    assert links(play(ONE, cooperate=("Ego", "RSU"))[1]) == {("RSU", "Ego")}
    assert links(play(hearing, cooperate=("Ego", "RSU"))[1]) == {("RSU", "Ego"), ("Ego", "RSU")}
    assert links(play(hearing, cooperate=("RSU",))[1]) == {("RSU", "Ego")}
    assert links(play(hearing, cooperate=())[1]) == set()


def test_mast_receives_over_radio_channel(tmp_path: Path) -> None:
    radio = "{model: radio, jitter: 0.001}"
    alone, _ = play(ONE, radio)
    both, frames = play(listening(tmp_path, cooperates_with="Ego"), radio)
    assert both.links["RSU", "Ego"] == alone.links["RSU", "Ego"], "receivers do not change transmissions"
    assert both.links["Ego", "RSU"].received > 70
    assert any(item.message.sender == "Ego" for frame in frames for item in frame.steps["RSU"].inbox)


@pytest.mark.exhaustive
def test_mast_merges_points_of_selected_senders(tmp_path: Path) -> None:
    frames = {}
    for names in ("none", "Ego"):
        path = listening(tmp_path, cooperates_with=names)
        text = path.read_text().replace('"average"', '"early"').replace('"oracle"', '"lidar"')
        path.write_text(re.sub(r'<Property name="(range|field_of_view|visibility)" value="[^"]*"/>', "", text))
        frames[names] = play(path, time_limit=0.6)[1]
    deaf, hearing = frames["none"][-1].steps["RSU"], frames["Ego"][-1].steps["RSU"]
    assert [item.message.points is not None for item in hearing.inbox] == [True]
    assert hearing.detections.boxes.tobytes() == deaf.detections.boxes.tobytes(), "what it reports are its own points"
    assert places(hearing.fused.boxes) != places(deaf.fused.boxes)
    assert len(hearing.fused) >= len(deaf.fused) > 0


def test_own_perception_of_channel_applies_to_receiving_stations_only(tmp_path: Path) -> None:
    late = "{delay: {kind: constant, seconds: 0.3}, own_perception: true}"
    _, frames = play(ONE, late)
    assert len(frames[0].steps["RSU"].fused) > 0, "a mast that does not receive uses its own detections"
    _, frames = play(listening(tmp_path, cooperates_with="Ego"), late)
    known = [len(frame.steps["RSU"].fused) for frame in frames]
    assert known[:6] == [0] * 6
    assert known[6] > 0


def test_unknown_sender_is_reported_with_line(tmp_path: Path) -> None:
    wrong = listening(tmp_path, cooperates_with="Egoo")
    line = wrong.read_text()[: wrong.read_text().index("Egoo")].count("\n") + 1
    with pytest.raises(InputError, match=re.escape(f"{wrong}:{line}: 'RSU' cooperates with 'Egoo'")):
        play(wrong)


def test_planner_without_wheels_is_reported_with_line_before_run(tmp_path: Path) -> None:
    wrong = listening(tmp_path, planner="route")
    line = wrong.read_text()[: wrong.read_text().index('value="route"')].count("\n") + 1
    with pytest.raises(InputError, match=re.escape(f"{wrong}:{line}: 'RSU' has no wheels for planner 'route'")):
        play(wrong)


@pytest.mark.parametrize(("names", "receives"), [(None, False), ("none", False), ("all", True), ("Ego", True)])
def test_station_without_wheels_receives_only_with_selected_senders(names: str | None, receives: bool) -> None:
    given = {} if names is None else {"cooperates_with": names}
    settings = AgentSettings.model_validate({"detector": "lidar", "fusion": "early", **given})
    station = build_agent(settings, MAST, None, seed=0, dt=0.05)
    assert station.receives_messages is receives
    assert station.receives_from("Ego", own_perception=False) is receives
    assert station.receives_from(MAST.name, own_perception=True) is receives
    assert not station.receives_from(MAST.name, own_perception=False)
