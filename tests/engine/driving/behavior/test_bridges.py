"""Drives below and on a bridge: traffic on the other level is not in the way."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from criteria_scenario import write_scenario
from opendrive_xml import elevation_xml, map_xml, road_xml

from eidrive_scenario.api.run import RunSettings, run_file
from eidrive_scenario.recording.frame import Frame

CLEARANCE = 6.5
"""Height of the bridge above the road [m]."""


class Speeds:
    """Lowest speed of the ego."""

    def __init__(self) -> None:
        self.lowest = math.inf

    def observe(self, frame: Frame) -> None:
        self.lowest = min(self.lowest, float(frame.view.speed[frame.view.rows["Ego"]]))

    def close(self) -> None:
        """Do nothing."""


def lowest_speed(
    folder: Path,
    ego_height: float,
    others: dict[str, tuple[float, float, float, float]],
    *,
    slope: float = 0.0,
    other: float | None = None,
) -> float:
    """Return the lowest speed of an ego that drives with 12 m/s along x, on a road of this height and slope.

    other  height of the road along y [m]; None: the other one of 0 and CLEARANCE
    """
    other = CLEARANCE - ego_height if other is None else other
    along = road_xml("1", length=300.0, profiles=elevation_xml(ego_height, slope))
    across = road_xml("2", length=300.0, x=150.0, y=-150.0, hdg=math.pi / 2.0, profiles=elevation_xml(other))
    road = folder / "bridge.xodr"
    road.write_text(map_xml(along, across), encoding="utf-8")
    path = write_scenario(folder, "collision: {of: Ego}", {"Ego": (80.0, -1.75, 0.0, 12.0), **others}, road)
    text = path.read_text(encoding="utf-8")
    for name, (x, y, _, _) in {"Ego": (80.0, -1.75, 0.0, 0.0), **others}.items():
        height = ego_height + 80.0 * slope if name == "Ego" else other
        text = text.replace(f'<WorldPosition x="{x}" y="{y}" ', f'<WorldPosition x="{x}" y="{y}" z="{height}" ')
    path.write_text(text.replace('SimulationTimeCondition value="4"', 'SimulationTimeCondition value="9"'))
    speeds = Speeds()
    stack = {"planner": "behavior", "detector": "oracle", "target_speed": 12.0}
    result = run_file(path, settings=RunSettings(drive={"Ego": stack}), observers=[speeds])
    assert result.passed
    return speeds.lowest


@pytest.mark.parametrize("ego_height", [0.0, CLEARANCE])
def test_traffic_on_the_other_level_does_not_slow_the_vehicle(tmp_path: Path, ego_height: float) -> None:
    standing = {"Above": (148.25, -1.0, math.pi / 2.0, 0.0), "Beside": (151.75, 1.0, -math.pi / 2.0, 0.0)}
    assert lowest_speed(tmp_path, ego_height, standing) > 11.5


@pytest.mark.parametrize("ego_height", [0.0, CLEARANCE])
def test_crossing_traffic_on_the_other_level_does_not_slow_the_vehicle(tmp_path: Path, ego_height: float) -> None:
    crossing = {"Up": (151.75, -62.0, math.pi / 2.0, 10.0), "Down": (148.25, 66.0, -math.pi / 2.0, 10.0)}
    assert lowest_speed(tmp_path, ego_height, crossing) > 11.5


@pytest.mark.parametrize("slope", [-0.08, 0.08])
def test_crossing_traffic_at_the_same_height_on_a_hill_slows_the_vehicle(tmp_path: Path, slope: float) -> None:
    """The vehicle is 5.6 m above or below the crossing when it detects the crossing car."""
    crossing = {"Up": (151.75, -62.0, math.pi / 2.0, 10.0)}
    assert lowest_speed(tmp_path, 150.0 * -slope, crossing, slope=slope, other=0.0) < 8.0
