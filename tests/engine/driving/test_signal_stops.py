"""Vehicles that stop for traffic lights and stop signs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml
from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from signal_street import CAR, EAST, ROUND, light, stop_sign, street
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    end_xml,
    event_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.control.pid_controller import PidController
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.planning.signal_stops import (
    BEFORE_LINE,
    LONGEST_RED,
    STANDING,
    WAIT,
    SignalStops,
    can_stop_for_light,
    yellow_time,
)
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.signals import SignalSensor
from eidrive_scenario.simulation import run_file
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement

FRONT = 1.4 + 2.446
"""Distance of the front of the car from its reference point [m]."""


class Drive:
    """Car that follows its lane from x = 20 m at 10 m/s with the readings of a signal sensor."""

    def __init__(self, roads: RoadNetwork, *, obeys: bool = True) -> None:
        self.world = World(roads, dt=0.05)
        self.world.add(CAR, Placement(20.0, -1.75, speed=10.0), driven=True)
        settings = AgentSettings.model_validate({"obey_signals": obeys, "target_speed": 10.0})
        self.planner = RoutePlanner(settings, CAR, roads, dt=0.05, seed=0)
        self.controller = PidController(CAR, 0.05)
        self.sensor = SignalSensor(CAR, roads)
        self.rig = Rig(CAR, {})
        self.reasons: list[str] = []

    def reads(self, front: float) -> bool:
        """Return whether the car has the lights in view with its front at a position [m]."""
        return self.planner.can_read_light is None or self.planner.can_read_light(
            "east", front - FRONT, -1.75, 0.0, 0.0
        )

    def run(self, seconds: float, states: Mapping[str, str]) -> tuple[float, float]:
        """Run for a duration [s]; return the position of its front [m] and its speed [m/s]."""
        for _ in range(round(seconds / 0.05)):
            view = self.world.view()
            ego = self.rig.read(self.world, view).ego
            if self.reads(float(view.position[0, 0]) + FRONT):
                self.planner.observe_signals(self.sensor.read(self.world, view, 0, states))
            plan = self.planner.plan(ego, Detections(view.time), Goal(), view.time)
            self.reasons.append(plan.reason)
            self.world.step({}, {"Ego": self.controller.control(ego, plan)})
        view = self.world.view()
        return float(view.position[0, 0]) + FRONT, float(view.speed[0])


def test_car_stops_at_red_and_continues_at_green() -> None:
    """The light is at 120 m: the front stops within two meters before it, and passes it at green."""
    drive = Drive(street(light("east", 120.0)))
    front, speed = drive.run(18.0, {"east": "red"})
    assert 118.0 < front < 120.0
    assert abs(speed) < 0.05
    assert drive.reasons[-1] == "stop at traffic light east"
    front, speed = drive.run(6.0, {"east": "green"})
    assert front > 130.0
    drive.world.close()


def test_car_stops_where_it_has_the_light_in_view() -> None:
    """A camera shows the light of 120 m up to 7 m before it, so that the car at its line would never see green."""
    drive = Drive(street(light("east", 120.0)))
    drive.planner.can_read_light = lambda signal, x, y, z, yaw: x + FRONT <= 113.0
    front, speed = drive.run(18.0, {"east": "red"})
    assert 110.0 < front <= 112.0
    assert abs(speed) < 0.05
    front, speed = drive.run(6.0, {"east": "green"})
    assert front > 125.0
    drive.world.close()


def test_car_can_stop_when_it_sees_a_light_late() -> None:
    """It is in view from 8.5 m before the place to stop: enough for 0.5 s · v + v² / (2 · 5 m/s²) from 7.0 m/s."""
    drive = Drive(street(light("east", 120.0)))
    drive.planner.can_read_light = lambda signal, x, y, z, yaw: x + FRONT >= 110.0
    front, speed = drive.run(18.0, {"east": "red"})
    assert 118.0 < front < 120.0
    assert abs(speed) < 0.05
    again = Drive(street(light("east", 120.0)))
    again.planner.can_read_light = drive.planner.can_read_light
    front = 0.0
    while front < 110.0:
        front, speed = again.run(0.05, {"east": "green"})
    assert 5.0 < speed <= 7.0
    assert again.run(8.0, {"east": "green"})[1] > 8.0
    drive.world.close()
    again.world.close()


def test_car_stops_at_the_line_of_a_light_that_no_place_shows() -> None:
    roads = street(light("east", 120.0))
    stops = SignalStops(roads, CAR)
    stops.follow(EAST)
    stops.signals.update([SignalReading("east", "red")])
    usual = stops.next(50.0, 10.0, 0.0)
    blind = SignalStops(roads, CAR)
    blind.follow(EAST)
    blind.signals.update([SignalReading("east", "red")])
    assert blind.next(50.0, 10.0, 0.0, lambda *place: False) == usual


def test_car_that_started_beyond_the_view_of_a_light_stops_and_continues() -> None:
    """The light of 100 m is in view up to 93 m, the front is at 95 m: at 10 m/s it cannot stop before the line."""
    roads = street(light("east", 100.0))
    for speed, expected in ((10.0, False), (0.0, True)):
        stops = SignalStops(roads, CAR)
        stops.follow(EAST)

        def holds(now: float, stops: SignalStops = stops, speed: float = speed) -> bool:
            return stops.next(95.0 - FRONT, speed, now, lambda signal, x, *pose: 50.0 <= x + FRONT <= 93.0) is not None

        assert holds(0.0) == expected
        assert holds(WAIT - 0.1) == expected
        assert not holds(WAIT)
    stops.signals.update([SignalReading("east", "red")])
    assert holds(WAIT + 1.0), "it is read before the car has started"


def test_car_stops_at_a_light_that_it_does_not_read_in_view() -> None:
    """As in fog: it comes to a stop where it would have the light in view, waits, and continues."""
    drive = Drive(street(light("east", 120.0)))
    drive.planner.can_read_light = lambda signal, x, y, z, yaw: 60.0 <= x + FRONT <= 113.0
    drive.reads = lambda front: False  # type: ignore[method-assign]
    fronts = np.array([drive.run(0.05, {"east": "red"})[0] for _ in range(400)])
    standing = np.diff(fronts) < STANDING * 0.05
    assert 110.0 < fronts[int(np.argmax(standing))] <= 113.0
    assert np.count_nonzero(standing) * 0.05 == pytest.approx(WAIT, abs=0.6)
    assert fronts[-1] > 125.0
    drive.world.close()


def test_car_that_reads_red_late_stops_out_of_view_before_the_line() -> None:
    """From 5 m/s it needs 3 m: 2 m before the end of the view it cannot stop there, but 8.5 m before its line."""
    stops = SignalStops(street(light("east", 120.0)), CAR)
    stops.follow(EAST)
    stops.signals.update([SignalReading("east", "red")])

    def holds(front: float, speed: float, now: float) -> bool:
        return stops.next(front - FRONT, speed, now, lambda signal, x, *pose: 60.0 <= x + FRONT <= 112.5) is not None

    assert holds(110.0, 5.0, 0.0)
    assert holds(113.5, 0.0, 2.0)
    assert holds(113.5, 0.0, 2.0 + LONGEST_RED - 0.1)
    assert not holds(113.5, 0.0, 2.0 + LONGEST_RED)


def test_state_of_the_earlier_lap_does_not_count() -> None:
    """The light of 100 m was green on the first lap; 160 m before it on the second one it is unread."""
    stops = SignalStops(street(light("east", 100.0)), CAR)
    stops.follow(np.concatenate([ROUND, ROUND[1:]]))
    stops.signals.update([SignalReading("east", "green")])
    assert stops.next(40.0, 10.0, 0.0) is None
    stops.next(220.0, 10.0, 30.0)
    assert next(iter(stops.signals.ahead(220.0))).state is None


def test_car_without_obey_signals_passes_red() -> None:
    drive = Drive(street(light("east", 120.0)), obeys=False)
    front, speed = drive.run(12.0, {"east": "red"})
    assert front > 130.0
    assert speed == pytest.approx(10.0, abs=0.5)
    drive.world.close()


def test_car_passes_light_that_turns_too_late() -> None:
    """Green until the front is 6 m before the line: stopping from 10 m/s would require 8 m/s²."""
    drive = Drive(street(light("east", 120.0)))
    front = 0.0
    while front < 114.0:
        front, _ = drive.run(0.05, {"east": "green"})
    front, speed = drive.run(3.0, {"east": "red"})
    assert front > 135.0
    assert speed > 9.0
    drive.world.close()


def test_car_stops_and_waits_at_stop_sign() -> None:
    drive = Drive(street(stop_sign("stop", 100.0)))
    fronts, speeds = [], []
    for _ in range(440):
        front, speed = drive.run(0.05, {})
        fronts.append(front)
        speeds.append(speed)
    standing = np.abs(speeds) < 0.1
    assert 98.0 < fronts[int(np.argmax(standing))] < 100.0
    assert np.count_nonzero(standing) * 0.05 == pytest.approx(WAIT, abs=0.6)
    assert fronts[-1] > 110.0
    drive.world.close()


def front_at(distance: float) -> float:
    """Return the place of the car on the street whose front is at a distance before the light at 120 m."""
    return 120.0 - distance - CAR.offset[0] - CAR.size[0] / 2.0


def seen_at_yellow(distance: float, speed: float = 10.0) -> tuple[SignalStops, bool]:
    """Return stops, and whether they hold the car that sees a light change to yellow at a distance [m]."""
    stops = SignalStops(street(light("east", 120.0)), CAR)
    stops.follow(EAST)
    stops.signals.update([SignalReading("east", "yellow")])
    return stops, stops.next(front_at(distance), speed, 0.0) is not None


@pytest.mark.parametrize(("speed", "expected"), [(8.33, 2.37), (13.89, 3.28)])
def test_yellow_time_is_that_of_the_ite(speed: float, expected: float) -> None:
    assert yellow_time(speed) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ("distance", "stops"),
    # At 10 m/s: 26.4 m are passed in the 2.64 s of yellow; a stop at 3.05 m/s² takes 17.4 m to a point 1.5 m before.
    [(10.0, False), (18.0, False), (20.0, True), (25.0, True), (60.0, True)],
)
def test_car_passes_at_yellow_if_it_would_have_to_brake_hard(distance: float, stops: bool) -> None:
    assert seen_at_yellow(distance)[1] == stops


def test_car_brakes_harder_if_red_would_come_before_it_passes() -> None:
    # 15.5 m before the stop point at 10 m/s: 3.05 m/s² need 17.4 m, 5 m/s² need 11 m.
    assert not can_stop_for_light(15.5, 10.0, passes_in_time=True)
    assert can_stop_for_light(15.5, 10.0, passes_in_time=False)
    assert not can_stop_for_light(10.9, 10.0, passes_in_time=False)


def test_car_that_is_delayed_at_yellow_stops_at_red() -> None:
    stops, holds = seen_at_yellow(15.0)
    assert not holds
    stops.signals.update([SignalReading("east", "red")])
    assert stops.next(front_at(8.0), 3.0, 2.6) is not None


def test_car_that_passes_at_yellow_continues_at_red() -> None:
    stops, _ = seen_at_yellow(15.0)
    stops.signals.update([SignalReading("east", "red")])
    assert stops.next(front_at(3.0), 10.0, 1.2) is None


def test_interrupted_wait_at_stop_sign_restarts() -> None:
    stops = SignalStops(street(stop_sign("stop", 100.0)), CAR)
    stops.follow(EAST)
    stops.signals.update([SignalReading("stop", "")])
    at_line = 100.0 - CAR.offset[0] - CAR.size[0] / 2.0 - BEFORE_LINE
    assert stops.next(at_line, 0.0, 0.0) is not None
    assert stops.next(at_line, 0.0, WAIT - 0.1) is not None
    assert stops.next(150.0, 5.0, 20.0) is None, "pushed on"
    assert stops.next(at_line, 0.0, 60.0) is not None
    assert stops.next(at_line, 0.0, 60.0 + WAIT) is None


def test_stop_sign_applies_on_every_lap() -> None:
    """The wait of the first lap does not count on the second."""
    stops = SignalStops(street(stop_sign("stop", 100.0)), CAR)
    stops.follow(np.concatenate([ROUND, ROUND[1:]]))
    stops.signals.update([SignalReading("stop", "")])
    at_line = 60.0 - CAR.offset[0] - CAR.size[0] / 2.0 - BEFORE_LINE
    for lap, now in ((0.0, 0.0), (320.0, 60.0)):
        assert stops.next(lap + at_line - 20.0, 8.0, now) is not None
        assert stops.next(lap + at_line, 0.0, now + 3.0) is not None
        assert stops.next(lap + at_line, 0.0, now + 3.0 + WAIT) is None
        assert stops.next(lap + at_line + 2.0, 2.0, now + 8.0) is None


SET_STATE = """<GlobalAction><InfrastructureAction><TrafficSignalAction><TrafficSignalStateAction name="7" state="{}"/>
</TrafficSignalAction></InfrastructureAction></GlobalAction>"""


class Track:
    """Observer of the position of the ego's front, by time."""

    def __init__(self) -> None:
        self.fronts: dict[float, float] = {}

    def observe(self, frame: Frame) -> None:
        place = float(frame.view.position[frame.view.row("Ego"), 0])
        self.fronts[round(frame.view.time, 2)] = place + 1.4 + 2.25

    def close(self) -> None:
        pass


@pytest.mark.statistical
@pytest.mark.parametrize("obeys", [True, False])
def test_scenario_with_light_stops_obeying_car_until_green(tmp_path: Path, obeys: bool) -> None:
    """Light of the storyboard at 80 m: red from the start, green from 18 s on."""
    road = road_xml(length=400.0, extra=f"<signals>{light('7', 80.0)}</signals>")
    (tmp_path / "street.xodr").write_text(map_xml(road))
    later = trigger_xml(condition_xml(time_xml(18, "greaterOrEqual")))
    path = tmp_path / "light.xosc"
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("street.xodr"),
            entities=object_xml("Ego", controller=agent_xml(target_speed=10, obey_signals=str(obeys).lower())),
            init=SET_STATE.format("red") + init_xml("Ego", teleport_xml(lane_position_xml(-1, 20))),
            story=acts_xml(act_xml(group_xml(maneuver_xml(event_xml("turns", SET_STATE.format("green"), later)), ""))),
            stop=end_xml(26),
        )
    )
    track = Track()
    assert run_file(path, seed=0, observers=[track]).end_reason == "stop trigger"
    if obeys:
        assert 78.0 < track.fronts[17.95] < 80.0
        assert track.fronts[26.0] > 95.0
    else:
        assert track.fronts[17.95] > 95.0
