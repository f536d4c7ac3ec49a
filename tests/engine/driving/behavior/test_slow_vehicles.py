"""Passing of slow vehicles in the lane of the opposite direction."""

from __future__ import annotations

from pathlib import Path

import pytest
from criteria_scenario import write_scenario
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.api.run import RunSettings, run_file
from eidrive_scenario.driving.planning.behavior.obstacles import time_to_gain
from eidrive_scenario.recording.frame import Frame


@pytest.mark.parametrize(
    ("distance", "speed", "seconds"),
    [
        (3.0, 4.0, 2.0),
        (64.0 / 3.0, 4.0, 16.0 / 3.0),
        (64.0 / 3.0 + 24.0, 4.0, 16.0 / 3.0 + 3.0),
        (24.0, 12.0, 3.0),
        (24.0, 15.0, 3.0),
        (0.0, 4.0, 0.0),
    ],
)
def test_time_to_gain_a_distance(distance: float, speed: float, seconds: float) -> None:
    """Closed form, at 1.5 m/s² from this speed to 12 m/s, on an object with 4 m/s: from 4 m/s the vehicle gains
    1.5 m/s² t² / 2, thus 64/3 m in the 16/3 s of its acceleration, and 8 m/s later."""
    assert time_to_gain(distance, 4.0, speed, 12.0, 1.5) == pytest.approx(seconds)


class Places:
    """Places of two actors along x in the last frame, and the leftmost place of the first one."""

    def __init__(self) -> None:
        self.ego = self.slow = 0.0
        self.aside = -1.75

    def observe(self, frame: Frame) -> None:
        boxes, rows = frame.view.boxes, frame.view.rows
        self.ego, self.slow = float(boxes[rows["Ego"], 0]), float(boxes[rows["Slow"], 0])
        self.aside = max(self.aside, float(boxes[rows["Ego"], 1]))

    def close(self) -> None:
        """Do nothing."""


@pytest.mark.parametrize(("oncoming", "passes"), [(None, True), (180.0, False)])
def test_slow_vehicle_is_passed_if_the_oncoming_lane_is_free(
    tmp_path: Path, oncoming: float | None, passes: bool
) -> None:
    """The vehicle follows with 4 m/s before it passes: it accelerates beside the slow vehicle, which drives at the edge
    and does not hide the other lane. It does not pass while an oncoming car approaches."""
    road = tmp_path / "road.xodr"
    road.write_text(map_xml(road_xml("1", length=400.0)), encoding="utf-8")
    actors = {"Ego": (20.0, -1.75, 0.0, 12.0), "Slow": (60.0, -2.6, 0.0, 4.0)}
    if oncoming is not None:
        actors["Oncoming"] = (oncoming, 1.75, 3.14159, 9.0)
    path = write_scenario(tmp_path, "comfort: {of: Ego}, collision: {of: Ego}", actors, road)
    seconds = 14.0 if passes else 8.0
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('SimulationTimeCondition value="4"', f'SimulationTimeCondition value="{seconds}"'))
    places = Places()
    stack = {"planner": "behavior", "detector": "oracle", "target_speed": 12.0, "range": 300.0}
    result = run_file(path, settings=RunSettings(drive={"Ego": stack}), observers=[places])
    assert result.passed
    assert (places.ego > places.slow + 6.0) is passes
    assert (places.aside > -0.75) is passes
