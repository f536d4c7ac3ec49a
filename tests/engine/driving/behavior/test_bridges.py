"""Drives below and on a bridge: traffic on the other level is not in the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from criteria_scenario import write_scenario
from opendrive_xml import elevation_xml, map_xml, road_xml
from signal_street import SIGNAL

from eidrive_scenario.api.run import RunSettings, run_file
from eidrive_scenario.driving.planning.behavior.conflict_ways import ConflictWays
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import JunctionRules
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.perception.traffic_lights import SignalsAhead
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import RoadNetwork

LIGHT = SIGNAL.format(s=150, t=-4.5, id="light", dynamic="yes", orientation="+", z=5.0, type="1000001")
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
    stack: Mapping[str, object] = MappingProxyType({"planner": "behavior"}),
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
    driven = {"detector": "oracle", "target_speed": 12.0, **stack}
    result = run_file(path, settings=RunSettings(drive={"Ego": driven}), observers=[speeds])
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


@pytest.mark.parametrize("ego_height", [0.0, CLEARANCE])
def test_object_on_the_other_level_is_in_no_conflict_area(tmp_path: Path, ego_height: float) -> None:
    standing = {"Other": (148.25, -1.0, math.pi / 2.0, 0.0)}
    area = {"planner": "conflict_area", "conflict_area": [145.0, 155.0, -5.0, 5.0]}
    assert lowest_speed(tmp_path, ego_height, standing, stack=area) > 11.5


@pytest.mark.parametrize("slope", [-0.08, 0.08])
def test_object_on_a_hill_is_in_the_conflict_area(tmp_path: Path, slope: float) -> None:
    """The vehicle is 5.6 m above or below the area at the start. It brakes with 5 m/s² and stands after 14.4 m."""
    standing = {"Other": (148.25, 20.0, math.pi / 2.0, 0.0)}
    area = {"planner": "conflict_area", "conflict_area": [145.0, 155.0, 15.0, 25.0]}
    lowest = lowest_speed(tmp_path, 150.0 * -slope, standing, slope=slope, other=0.0, stack=area)
    assert lowest < 0.1


HIGH_AND_LOW = pytest.mark.parametrize(("height", "meets"), [(0.0, True), (CLEARANCE, False)])


def reference_line(height: float, other: str) -> tuple[RoadNetwork, ReferenceLine]:
    """Return a line along x on a road of this height, and its network with another road."""
    along = road_xml("1", length=300.0, profiles=elevation_xml(height, 0.0))
    roads = RoadNetwork.parse(map_xml(along, other))
    points = np.column_stack([np.linspace(10.0, 290.0, 281), np.full(281, -1.75)])
    return roads, ReferenceLine(PlannedPath(points, ends=True), roads, height)


@HIGH_AND_LOW
def test_crosswalk_below_a_bridge_does_not_meet_its_way(height: float, meets: bool) -> None:
    crosswalk = '<objects><object id="9" type="crosswalk" s="148.25" t="0" length="4" width="7" hdg="0"/></objects>'
    across = road_xml("2", length=300.0, x=150.0, y=-150.0, hdg=math.pi / 2.0, extra=crosswalk)
    roads, line = reference_line(height, across)
    ways = ConflictWays(roads, JunctionRules(roads), (4.9, 1.8)).along(line, ())
    assert [way.kind for way in ways] == (["crosswalk"] * 2 if meets else [])


@HIGH_AND_LOW
def test_signals_below_a_bridge_do_not_hold_its_traffic(height: float, meets: bool) -> None:
    """The other road crosses at 30°, which is the same direction for signals; its stop line is on the way."""
    hdg = math.radians(30.0)
    back = 150.0 - 1.75 * math.tan(hdg / 2.0)
    start = (150.0 - back * math.cos(hdg) - 1.75 * math.sin(hdg), -1.75 - back * math.sin(hdg) + 1.75 * math.cos(hdg))
    roads, line = reference_line(
        height, road_xml("2", length=300.0, x=start[0], y=start[1], hdg=hdg, extra=f"<signals>{LIGHT}</signals>")
    )
    signals = SignalsAhead(roads)
    signals.follow(line.points, line.heights)
    assert [one.signal for one in signals.ahead(0.0)] == (["light"] if meets else [])
