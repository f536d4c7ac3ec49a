"""Reasons of failures under latency: first violation, decision, perception and ages of messages, by the recorded log.

The expected texts follow from the recorded frames by plain loops over contacts, plans, objects and messages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.api.run import RunResult, RunSettings, read_recording
from eidrive_scenario.experiments.judgement import judge_recording
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.pytest_plugin.failures import explain
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.run_files import read_result


def delayed(seconds: float, own: bool = False) -> str:
    """Return a channel with a constant delay, of the own detections as well if `own`."""
    return f"{{delay: {{kind: constant, seconds: {seconds}}}, own_perception: {str(own).lower()}}}"


CASES = {
    "coop/scenario_1": ("latency_300ms", {"collision", "driven_distance"}),
    "coop/scenario_1_late_rsu": (delayed(0.5), {"collision", "driven_distance"}),
    "coop/scenario_2": (delayed(0.5), {"collision", "driven_distance"}),
    "coop/scenario_3": (delayed(1.0, own=True), {"detection_count"}),
    "coop/scenario_4": (delayed(1.0, own=True), {"detection_count"}),
    "coop/scenario_5": (delayed(2.5), {"collision", "reached_region"}),
    "ncap/crossing_car": (delayed(1.0), {"collision", "reach_position"}),
    "ncap/crossing_child": (delayed(1.0), {"collision", "reach_position"}),
    "driving/lead_braking": (delayed(1.9, own=True), {"collision"}),
    "ei/scenario_01": (delayed(1.5, own=True), {"reach_position", "time_limit"}),
}
"""Channel and failed criteria of ten scenarios of the library, all of which pass without a delay."""
LONG = {"coop/scenario_5", "driving/lead_braking", "ei/scenario_01"}
"""Runs that take several seconds with their recording."""
TIME_LIMIT = 60.0
"""Setting `within` of the criterion `time_limit` of the EIScenarios [s]."""


def first_contact(frames: Sequence[Frame]) -> tuple[int, str]:
    """Return the index of the first frame in which the ego touches another actor, and this actor."""
    for index, frame in enumerate(frames):
        for contact in frame.view.contacts:
            if "Ego" in (contact.first, contact.second):
                return index, contact.second if contact.first == "Ego" else contact.first
    raise AssertionError("the ego touches no actor")


def center(frame: Frame, name: str) -> tuple[float, float]:
    x, y = frame.view.boxes[frame.view.names.index(name)][:2]
    return float(x), float(y)


def nearest(boxes: Any, point: tuple[float, float]) -> float:
    """Return the distance of the nearest box from a point [m]."""
    return min((math.hypot(box[0] - point[0], box[1] - point[1]) for box in boxes), default=math.inf)


def newest_measurement(frames: Sequence[Frame], actor: str) -> tuple[float, str]:
    """Return time [s] and source of the newest detections in which an object is within 2 m of the actor."""
    measured: list[tuple[float, str]] = []
    truth = {round(frame.view.time, 6): center(frame, actor) for frame in frames}
    for frame in frames:
        step = frame.steps["Ego"]
        received = [(one.message.detections, f"message of {one.message.sender}") for one in step.inbox]
        for detections, source in [(step.detections, "own detection"), *received]:
            point = truth.get(round(detections.time, 6))
            if point is not None and nearest(detections.boxes, point) <= 2.0:
                measured.append((detections.time, source))
    return max(measured, key=lambda one: one[0])


def expected_state(frames: Sequence[Frame], index: int, title: str, other: str = "") -> list[str]:
    """Return the lines about the ego at a frame, without the numbers of its decision."""
    frame = frames[index]
    now = frame.view.time
    before = [one for one in frames[: index + 1] if one.view.time >= now - 2.0 - 1e-6]
    plan = frame.steps["Ego"].plan
    lines = [title] if plan is None else [title, plan.reason]
    if other:
        distance = nearest(frame.steps["Ego"].fused.boxes, center(frame, other))
        time, source = newest_measurement(before, other)
        lines.append(f"Ego perceived {other} {distance:.2f} m from the truth, age {now - time:.2f} s ({source})")
    generated: dict[str, float] = {}
    for one in before:
        for received in one.steps["Ego"].inbox:
            sender = received.message.sender
            generated[sender] = max(generated.get(sender, -math.inf), received.message.generated)
    ages = sorted((now - time, sender) for sender, time in generated.items())
    listed = ", ".join(f"{sender} {age:.2f} s" for age, sender in ages[:3])
    more = f" and {len(ages) - 3} more up to {ages[-1][0]:.2f} s" if len(ages) > 3 else ""
    return [*lines, f"age of the newest messages at Ego: {listed}{more}"]


@pytest.mark.parametrize(
    "scenario", [pytest.param(name, marks=[pytest.mark.exhaustive] * (name in LONG)) for name in CASES]
)
def test_failure_reason_under_latency_names_first_violation(scenario: str, tmp_path: Path) -> None:
    channel, failed = CASES[scenario]
    result = run_and_save(scenario, settings=RunSettings(channel=channel), below=tmp_path)
    verdicts = {verdict.name: verdict for verdict in result.criteria if not verdict.passed}
    assert set(verdicts) == failed
    assert isinstance(result, RunResult)
    assert result.recording is not None
    assert result.folder is not None
    frames = list(read_recording(result.recording).frames())
    for name, verdict in verdicts.items():
        index, other = len(frames) - 1, ""
        if name == "collision":
            index, other = first_contact(frames)
        elif name == "time_limit":
            index = next(number for number, frame in enumerate(frames) if frame.view.time > TIME_LIMIT + 1e-6)
        instant = f"{frames[index].view.time:.2f} s"
        at_end = name not in ("collision", "time_limit")
        title = f"state at the last tick, {instant}" if at_end else f"first violation at {instant}"
        state = [
            line.rpartition("²: ")[2] if line.startswith("decision of Ego: ") else line
            for line in verdict.violation_state
            if "Ego" in line or line.startswith(title[:5])
        ]
        assert state == expected_state(frames, index, title, other)
    assert_surfaces_agree(result, tmp_path)


def assert_surfaces_agree(result: RunResult, folder: Path) -> None:
    """The file of the result, the judged recording and the text of pytest have the states of the result."""
    states = {verdict.name: list(verdict.violation_state) for verdict in result.criteria}
    assert result.folder is not None
    stored = read_result(result.folder / "result.json")["criteria"]
    assert {one["name"]: one["violation_state"] for one in stored} == states
    judged = judge_recording(result.folder)
    assert {one.name: list(one.violation_state) for one in judged.criteria} == states
    assert judged.warnings == ()
    text = explain(result).splitlines()
    for lines in states.values():
        for line in lines:
            assert f"  {line}" in text
