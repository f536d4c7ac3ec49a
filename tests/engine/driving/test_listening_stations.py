"""Stations that do not drive and hear others."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.perception_metrics import recall_by_sight, snapshot
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, run_file
from eidrive_scenario.world.actor import ActorSpec

ONE = resolve_scenario("coop/scenario_1")
MAST = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))


class Kept:
    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def observe(self, frame: Frame) -> None:
        self.frames.append(frame)

    def close(self) -> None:
        """Nothing to finish."""


def told(tmp_path: Path, **properties: str) -> Path:
    """Scenario 1 with more properties on its roadside unit."""
    text = ONE.read_text()
    start = text.index("<ObjectController", text.index('<ScenarioObject name="RSU"'))
    lines = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in properties.items())
    path = tmp_path / f"told_{len(list(tmp_path.iterdir()))}.xosc"
    text = text[:start] + text[start:].replace("<Properties>", f"<Properties>{lines}", 1)
    path.write_text(text.replace('"../', f'"{ONE.parent.parent}/'))
    return path


def play(source: Path, channel: str = "ideal", **more: object) -> tuple[RunResult, list[Frame]]:
    kept = Kept()
    settings = RunSettings(channel=channel, **{"time_limit": 4.0, **more})  # type: ignore[arg-type]
    return run_file(source, seed=1, settings=settings, observers=[kept]), kept.frames


def links(frames: list[Frame]) -> set[tuple[str, str]]:
    return {(event.sender, event.receiver) for frame in frames for event in frame.links}


def places(boxes: np.ndarray) -> set[tuple[float, float]]:
    return {(round(x, 3), round(y, 3)) for x, y in boxes[:, :2].tolist()}


def test_a_mast_that_names_nobody_hears_nobody() -> None:
    _, frames = play(ONE)
    assert links(frames) == {("RSU", "Ego")}
    assert all(not frame.steps["RSU"].inbox for frame in frames)


@pytest.mark.parametrize("names", ["[Ego]", "Ego", "all"])
def test_a_mast_knows_what_those_whom_it_names_see_and_says_what_it_sees_itself(tmp_path: Path, names: str) -> None:
    _, deaf = play(told(tmp_path, sensors="{truth: {range: 8}}"))
    _, hearing = play(told(tmp_path, sensors="{truth: {range: 8}}", cooperates_with=names))
    assert links(hearing) == {("RSU", "Ego"), ("Ego", "RSU")}
    learned = 0
    for before, after in zip(deaf, hearing, strict=True):
        unit, heard = after.steps["RSU"], after.steps["RSU"].inbox
        assert after.view.position.tobytes() == before.view.position.tobytes(), "what masts know moves nobody"
        assert after.steps["Ego"].fused.boxes.tobytes() == before.steps["Ego"].fused.boxes.tobytes()
        for message in unit.outbox:
            assert message.detections.boxes.tobytes() == unit.detections.boxes.tobytes()
        of_others = {place for item in heard for place in places(item.message.detections.boxes)}
        learned += len(of_others - places(unit.detections.boxes) & of_others)
        assert len(unit.fused) >= len(unit.detections)
        mast = after.view.position[after.view.row("RSU")]
        if len(unit.fused):
            away = np.hypot(unit.fused.boxes[:, 0] - mast[0], unit.fused.boxes[:, 1] - mast[1])
            assert away.min() > 1.0, "the ego sees the mast; to itself it is no object"
    assert learned > 0


def test_its_picture_counts_in_the_metrics_of_perception(tmp_path: Path) -> None:
    _, deaf = play(told(tmp_path, sensors="{truth: {range: 8}}"))
    _, hearing = play(told(tmp_path, sensors="{truth: {range: 8}}", cooperates_with="Ego"))
    alone, joined = (
        recall_by_sight([snapshot(frame, "RSU", reach=60.0) for frame in frames[2:]], 0.1) for frames in (deaf, hearing)
    )
    assert alone.others is not None
    assert joined.others is not None
    assert alone.others.share == 0.0
    assert joined.others.share > 0.9


def test_the_option_of_senders_is_for_those_who_listen(tmp_path: Path) -> None:
    hearing = told(tmp_path, cooperates_with="Ego")
    assert links(play(ONE, cooperate=("Ego", "RSU"))[1]) == {("RSU", "Ego")}
    assert links(play(hearing, cooperate=("Ego", "RSU"))[1]) == {("RSU", "Ego"), ("Ego", "RSU")}
    assert links(play(hearing, cooperate=("RSU",))[1]) == {("RSU", "Ego")}
    assert links(play(hearing, cooperate=())[1]) == set()


def test_a_mast_hears_over_a_radio_too(tmp_path: Path) -> None:
    radio = "{model: radio, jitter: 0.001}"
    alone, _ = play(ONE, radio)
    both, frames = play(told(tmp_path, cooperates_with="Ego"), radio)
    assert both.links["RSU", "Ego"] == alone.links["RSU", "Ego"], "who listens changes nothing on the air"
    assert both.links["Ego", "RSU"].received > 70
    assert any(item.message.sender == "Ego" for frame in frames for item in frame.steps["RSU"].inbox)


def test_points_of_others_are_joined_where_a_mast_names_them(tmp_path: Path) -> None:
    frames = {}
    for names in ("none", "Ego"):
        path = told(tmp_path, cooperates_with=names)
        text = path.read_text().replace('"average"', '"early"').replace('"oracle"', '"lidar"')
        path.write_text(re.sub(r'<Property name="(range|field_of_view|visibility)" value="[^"]*"/>', "", text))
        frames[names] = play(path, time_limit=0.6)[1]
    deaf, hearing = frames["none"][-1].steps["RSU"], frames["Ego"][-1].steps["RSU"]
    assert [item.message.points is not None for item in hearing.inbox] == [True]
    assert hearing.detections.boxes.tobytes() == deaf.detections.boxes.tobytes(), "what it reports are its own points"
    assert places(hearing.fused.boxes) != places(deaf.fused.boxes)
    assert len(hearing.fused) >= len(deaf.fused) > 0


def test_own_perception_by_the_channel_is_for_those_who_hear(tmp_path: Path) -> None:
    late = "{delay: {kind: constant, seconds: 0.3}, own_perception: true}"
    _, frames = play(ONE, late)
    assert len(frames[0].steps["RSU"].fused) > 0, "nobody takes from a deaf mast what it sees itself"
    _, frames = play(told(tmp_path, cooperates_with="Ego"), late)
    known = [len(frame.steps["RSU"].fused) for frame in frames]
    assert known[:6] == [0] * 6
    assert known[6] > 0


def test_a_sender_that_is_no_station_is_told_by_line(tmp_path: Path) -> None:
    wrong = told(tmp_path, cooperates_with="Egoo")
    line = wrong.read_text()[: wrong.read_text().index("Egoo")].count("\n") + 1
    with pytest.raises(InputError, match=re.escape(f"{wrong}:{line}: 'RSU' cooperates with 'Egoo'")):
        play(wrong)


def test_a_planner_without_wheels_is_told_by_line_before_the_run(tmp_path: Path) -> None:
    wrong = told(tmp_path, planner="route")
    line = wrong.read_text()[: wrong.read_text().index('value="route"')].count("\n") + 1
    with pytest.raises(InputError, match=re.escape(f"{wrong}:{line}: 'RSU' has no wheels for planner 'route'")):
        play(wrong)


@pytest.mark.parametrize(("names", "hears"), [(None, False), ("none", False), ("all", True), ("Ego", True)])
def test_who_listens_without_wheels(names: str | None, hears: bool) -> None:
    given = {} if names is None else {"cooperates_with": names}
    settings = AgentSettings.model_validate({"detector": "lidar", "fusion": "early", **given})
    station = build_agent(settings, MAST, None, seed=0, dt=0.05)
    assert station.receives_messages is hears
    assert station.receives_from("Ego", own_perception=False) is hears
    assert station.receives_from(MAST.name, own_perception=True) is hears
    assert not station.receives_from(MAST.name, own_perception=False)
