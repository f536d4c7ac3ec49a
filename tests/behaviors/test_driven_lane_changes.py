"""Lane changes of driven vehicles: path of the transition, completion, and the drive after it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import object_xml, road_file_xml, scenario_xml
from storyboard_xml import (
    condition_xml,
    end_xml,
    init_xml,
    lane_position_xml,
    private_xml,
    speed_xml,
    story_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.simulation import RunSettings, Simulation, run_file

WIDTH = 3.5


def change_xml(lane: int, *, dimension: str = "time", value: float = 4, offset: float = 0) -> str:
    return f"""<LateralAction><LaneChangeAction targetLaneOffset="{offset}">
    <LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="{dimension}" value="{value}"/>
    <LaneChangeTarget><AbsoluteTargetLane value="{lane}"/></LaneChangeTarget></LaneChangeAction></LateralAction>"""


def acquire(s: float) -> str:
    position = f"<Position>{lane_position_xml(-1, s)}</Position>"
    return private_xml(f"<RoutingAction><AcquirePositionAction>{position}</AcquirePositionAction></RoutingAction>")


def drive(
    folder: Path, action: str, *, init: str = "", seconds: float = 25, right: int = 2, stopped: float = 1e3
) -> tuple[Any, list[float]]:
    """Return time, x, y and speed of Ego, driven at 15 m/s in lane -1, with an action from 2 s until its act stops;
    and when the action completed [s].
    """
    story = story_xml(action=action, condition='<SimulationTimeCondition rule="greaterThan" value="2"/>')
    stop = trigger_xml(condition_xml(time_xml(stopped)), kind="StopTrigger")
    (folder / "road.xodr").write_text(map_xml(road_xml(lanes=lanes_xml(right=right), length=800.0)))
    path = folder / "a.xosc"
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("road.xodr"),
            entities=object_xml("Ego"),
            init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 20.0)), speed_xml(15), init),
            story=story.replace("</Act>", f"{stop}</Act>"),
            stop=end_xml(seconds),
        )
    )
    rows, complete = [], []
    with Simulation(path, settings=RunSettings(drive="Ego")) as simulation:
        end = None
        while end is None:
            frame, end = simulation.tick()
            row = frame.view.row("Ego")
            rows.append([frame.view.time, *frame.view.position[row, :2].tolist(), float(frame.view.speed[row])])
            complete += [
                one.time for one in frame.changes if (one.kind, one.after.value) == ("action", "completeState")
            ]
    return np.array(rows), complete


@pytest.mark.exhaustive
@pytest.mark.parametrize(("dimension", "value"), [("time", 4), ("distance", 60), ("rate", WIDTH * np.pi / 8)])
def test_driven_vehicle_follows_the_transition_and_drives_on(tmp_path: Path, dimension: str, value: float) -> None:
    """All three are a sine of 4 s at 15 m/s. Half of the offset of 3.5 m is reached after 2 s."""
    rows, _ = drive(tmp_path, change_xml(-2, dimension=dimension, value=value))
    time, y, speed = rows[:, 0], rows[:, 2], rows[:, 3]
    assert np.abs(y[time < 2.0] + 0.5 * WIDTH).max() < 0.1
    assert float(np.interp(4.0, time, y)) == pytest.approx(-WIDTH, abs=0.5)
    assert np.abs(y[time > 9.0] + 1.5 * WIDTH).max() < 0.25
    assert np.abs(speed[time > 1.0] - 15.0).max() < 0.3, "it does not stop after the lane change"


def test_lane_change_of_a_driven_vehicle_completes_in_the_new_lane(tmp_path: Path) -> None:
    rows, (done,) = drive(tmp_path, change_xml(-2))
    assert 6.0 - 0.1 <= done < 9.0
    assert float(np.interp(done, rows[:, 0], rows[:, 2])) == pytest.approx(-1.5 * WIDTH, abs=0.3)


@pytest.mark.parametrize("route", ["", acquire(700.0)])
def test_driven_vehicle_returns_if_its_lane_change_is_stopped(tmp_path: Path, route: str) -> None:
    """After 1 of 4 s it has 0.5 m of 3.5 m."""
    rows, (done,) = drive(tmp_path, change_xml(-2), init=route, seconds=12, stopped=3.0)
    time, y = rows[:, 0], rows[:, 2]
    assert done == pytest.approx(3.0, abs=0.06)
    assert y.min() > -WIDTH
    assert np.abs(y[time > 9.0] + 0.5 * WIDTH).max() < 0.1


def test_offset_in_the_new_lane_is_kept(tmp_path: Path) -> None:
    rows, _ = drive(tmp_path, change_xml(-2, offset=0.5), seconds=20)
    assert np.abs(rows[rows[:, 0] > 12.0, 2] - (0.5 - 1.5 * WIDTH)).max() < 0.2


def test_driven_vehicle_keeps_its_direction_in_an_oncoming_lane(tmp_path: Path) -> None:
    rows, _ = drive(tmp_path, change_xml(1), seconds=20)
    assert np.abs(rows[rows[:, 0] > 12.0, 2] - 0.5 * WIDTH).max() < 0.3
    assert np.diff(rows[:, 1]).min() > 0.5, "it never turns round"


@pytest.mark.exhaustive
def test_route_continues_in_the_new_lane_to_its_end(tmp_path: Path) -> None:
    """The route of 380 m ends at s = 400 m, where the vehicle stops."""
    rows, _ = drive(tmp_path, change_xml(-2), init=acquire(400.0), seconds=50)
    assert rows[-1, 3] == pytest.approx(0.0, abs=0.05)
    assert 380.0 < rows[-1, 1] < 410.0
    assert rows[-1, 2] == pytest.approx(-1.5 * WIDTH, abs=0.3)


OFFSET = """<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="step"/>
<LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>"""


def test_action_without_effect_on_a_driven_vehicle_is_a_warning(tmp_path: Path) -> None:
    drive(tmp_path, OFFSET, seconds=3)
    result = run_file(tmp_path / "a.xosc", settings=RunSettings(drive="Ego"))
    expected = "LaneOffsetAction: no effect on 'Ego', which a driving stack drives; command its speed, route, lane or"
    assert sum(expected in one for one in result.warnings) == 1
    assert not any(expected in one for one in run_file(tmp_path / "a.xosc").warnings)
