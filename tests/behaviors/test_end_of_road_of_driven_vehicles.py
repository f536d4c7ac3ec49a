"""EndOfRoadCondition of driven vehicles, which stop near the end of the road instead of exactly at it."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    by_entity_xml,
    condition_xml,
    end_xml,
    event_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    trigger_xml,
)

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation

LENGTH, DURATION, DT = 100.0, 0.5, 0.05
TURNED = '<Orientation type="relative" h="3.141592653589793"/>'


class Positions:
    """Observer of the distance of the reference point from the start of the road [m], and of the start of the event."""

    def __init__(self) -> None:
        self.x: list[tuple[float, float]] = []
        self.started: float | None = None

    def observe(self, frame: Frame) -> None:
        self.x.append((frame.view.time, float(frame.view.position[frame.view.row("Ego"), 0])))
        if self.started is None and any(
            change.element == "e" and "startTransition" in str(change) for change in frame.changes
        ):
            self.started = frame.view.time

    def close(self) -> None:
        """Keep the values."""


def drive(folder: Path, start: float, speed: float, until: float, *, wrong_way: bool = False) -> Positions:
    """Drive on a road without continuation; the event starts after DURATION at its end."""
    (folder / "road.xodr").write_text(map_xml(road_xml(lanes=lanes_xml(right=1), length=LENGTH)))
    condition = by_entity_xml(f'<EndOfRoadCondition duration="{DURATION}"/>')
    event = event_xml("e", speed_xml(speed), trigger_xml(condition_xml(condition)))
    position = lane_position_xml(-1, start, inside=TURNED if wrong_way else "")
    path = folder / "a.xosc"
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("road.xodr"),
            entities=object_xml("Ego", controller=agent_xml(planner="route")),
            init=init_xml("Ego", teleport_xml(position), speed_xml(speed)),
            story=acts_xml(act_xml(group_xml(maneuver_xml(event)), "<StartTrigger/>")),
            stop=end_xml(until),
        )
    )
    found = Positions()
    Simulation(path, observers=[found]).run()
    return found


@pytest.mark.element("EndOfRoadCondition")
def test_driven_vehicle_at_the_end_of_its_road(tmp_path: Path) -> None:
    """The vehicle brakes to a standstill at the end; the condition holds from 1 m before it."""
    found = drive(tmp_path, 70.0, 8.0, 12.0)
    assert found.x[-1][1] == pytest.approx(LENGTH, abs=0.5)
    reached = next(time for time, x in found.x if x > LENGTH - 1.0)
    assert found.started == pytest.approx(reached + DURATION, abs=DT / 2.0)


def test_driven_vehicle_that_stands_before_the_end(tmp_path: Path) -> None:
    found = drive(tmp_path, LENGTH - 1.5, 0.001, 2.0)
    assert found.x[-1][1] < LENGTH - 1.4
    assert found.started is None


def test_driven_vehicle_with_its_back_to_the_end(tmp_path: Path) -> None:
    """Against the driving direction the start of the road is ahead."""
    assert drive(tmp_path, LENGTH - 0.5, 0.001, 1.0, wrong_way=True).started is None
    assert drive(tmp_path, 0.5, 0.001, 1.0, wrong_way=True).started == pytest.approx(DURATION, abs=DT / 2.0)
