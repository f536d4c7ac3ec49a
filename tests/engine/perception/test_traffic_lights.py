"""Stop lines on the path, states of visible signals, and vehicles that stop for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.control.pid_controller import PidController
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.planning.signal_stops import BEFORE_LINE, WAIT, SignalStops
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.perception.traffic_lights import SignalsAhead, stop_lines
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.requests import Goal
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.signals import SIGNAL_KINDS, SignalSensor
from eidrive_scenario.simulation import run_file
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

LANES = """<lanes><laneSection s="0">
<left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection>
</lanes>"""
SIGNAL = (
    '<signal s="{s}" t="{t}" id="{id}" name="" dynamic="{dynamic}" orientation="{orientation}" zOffset="{z}"'
    ' country="DE" type="{type}" subtype="-1" value="-1" height="0.9" width="0.34" hOffset="0"/>'
)


def light(name: str, s: float, *, orientation: str = "+", t: float = -4.5) -> str:
    return SIGNAL.format(s=s, t=t, id=name, dynamic="yes", orientation=orientation, z=2.5, type="1000001")


def stop_sign(name: str, s: float) -> str:
    return SIGNAL.format(s=s, t=-4.5, id=name, dynamic="no", orientation="+", z=2.0, type="206")


def street(*signals: str) -> RoadNetwork:
    """Return a straight road of 200 m along x with a lane in each direction."""
    return RoadNetwork.parse(
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road name="" length="200" id="1" junction="-1"><planView>'
        f'<geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView>{LANES}'
        f"<signals>{''.join(signals)}</signals></road></OpenDRIVE>"
    )


EAST = np.column_stack([np.arange(0.0, 200.0), np.full(200, -1.75)])
WEST = np.column_stack([np.arange(199.0, -1.0, -1.0), np.full(200, 1.75)])


def names(roads: RoadNetwork, path: np.ndarray, progress: float = 0.0) -> list[tuple[str, float]]:
    signals = SignalsAhead(roads)
    signals.follow(path)
    return [(one.signal, round(one.distance, 3)) for one in signals.ahead(progress)]


def test_stop_lines_apply_to_lanes_of_signal_direction() -> None:
    roads = street(light("east", 120.0), light("west", 60.0, orientation="-"), light("both", 150.0, orientation="none"))
    assert names(roads, EAST) == [("east", 120.0), ("both", 150.0)]
    assert names(roads, WEST) == [("both", 49.0), ("west", 139.0)]
    assert names(roads, EAST, 130.0) == [("both", 20.0)]
    assert names(roads, EAST + np.array([0.0, 8.0])) == []


def test_stop_lines_exclude_other_signs() -> None:
    roads = street(stop_sign("stop", 80.0), SIGNAL.format(
        s=50, t=-4.5, id="limit", dynamic="no", orientation="+", z=2.0, type="274"
    ))  # fmt: skip
    assert [(line.signal, line.kind) for line in stop_lines(roads)] == [("stop", "stop sign")]


JUNCTION = """<OpenDRIVE><header revMajor="1" revMinor="6"/>
<road name="" length="50" id="1" junction="-1"><link><successor elementType="junction" elementId="9"/></link><planView>
<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry></planView>{lanes}</road>
<road name="" length="20" id="2" junction="9"><link><predecessor elementType="road" elementId="1" contactPoint="end"/>
<successor elementType="road" elementId="4" contactPoint="start"/></link><planView>
<geometry s="0" x="50" y="0" hdg="0" length="20"><line/></geometry></planView>{one}<signals>{straight}</signals></road>
<road name="" length="15.708" id="3" junction="9"><link>
<predecessor elementType="road" elementId="1" contactPoint="end"/>
</link><planView><geometry s="0" x="50" y="0" hdg="0" length="15.708"><arc curvature="0.1"/></geometry></planView>{one}
<signals>{left}</signals></road>
<road name="" length="50" id="4" junction="-1"><link><predecessor elementType="junction" elementId="9"/></link>
<planView>
<geometry s="0" x="70" y="0" hdg="0" length="50"><line/></geometry></planView>{lanes}</road>
<junction id="9" name=""><connection id="0" incomingRoad="1" connectingRoad="2" contactPoint="start">
<laneLink from="-1" to="-1"/></connection><connection id="1" incomingRoad="1" connectingRoad="3" contactPoint="start">
<laneLink from="-1" to="-1"/></connection></junction></OpenDRIVE>"""


def test_stop_lines_of_connecting_roads_apply_before_junction() -> None:
    """Straight on and left begin at the same point, each with a separate light."""
    one = LANES[: LANES.index("<left>")] + LANES[LANES.index("<center>") :]
    roads = RoadNetwork.parse(
        JUNCTION.format(lanes=LANES, one=one, straight=light("straight", 10.0), left=light("left", 8.0))
    )
    arc = np.linspace(0, math.pi / 2, 20)
    turn = np.column_stack([50 + 11.75 * np.sin(arc), 10 - 11.75 * np.cos(arc)])
    before = np.column_stack([np.arange(0.0, 50.0), np.full(50, -1.75)])
    on = np.column_stack([np.arange(50.0, 110.0), np.full(60, -1.75)])
    assert names(roads, np.concatenate([before, on])) == [("straight", 50.0)]
    assert [name for name, _ in names(roads, np.concatenate([before, turn]))] == ["left"]


def test_signals_ahead_require_stop_only_after_sight() -> None:
    signals = SignalsAhead(street(light("east", 120.0), stop_sign("stop", 150.0)))
    signals.follow(EAST)
    assert [one.must_stop for one in signals.ahead(0.0)] == [False, False]
    for state, stops in (("red", True), ("green", False), ("on;off;off", True), ("", False)):
        signals.see([SignalReading("east", state), SignalReading("stop", "")])
        assert [one.must_stop for one in signals.ahead(0.0)] == [stops, True]


CAR = ActorSpec("Ego", "car", "car", (4.892, 1.837, 1.49), (1.4, 0.0, 0.745), wheelbase=2.85, max_steering=0.6)
TRUCK = ActorSpec("Truck", "firetruck", "truck", (8.5, 2.9, 3.8), (0.0, 0.0, 1.9), wheelbase=5.0)


def visible_signals(
    roads: RoadNetwork,
    states: Mapping[str, str],
    x: float,
    yaw: float = 0.0,
    *,
    truck: bool = False,
    kinds: frozenset[str] = SIGNAL_KINDS,
) -> set[str]:
    with World(roads, dt=0.05) as world:
        world.add(CAR, Placement(x, -1.75, yaw=yaw))
        if truck:
            world.add(TRUCK, Placement(x + 14, -2.5))
        readings = SignalSensor(CAR, roads, kinds).read(world, world.view(), 0, states)
    return {f"{reading.id} {reading.state}".strip() for reading in readings}


def test_signal_sensor_requires_front_range_and_line_of_sight() -> None:
    roads = street(light("east", 120.0), light("west", 100.0, orientation="-"), stop_sign("stop", 130.0))
    states = {"east": "red", "west": "green"}
    assert visible_signals(roads, states, 60.0) == {"east red", "stop"}
    assert visible_signals(roads, states, 60.0, kinds=frozenset({"light"})) == {"east red"}
    assert visible_signals(roads, states, 60.0, kinds=frozenset({"stop sign"})) == {"stop"}
    assert visible_signals(roads, states, 10.0) == set()
    assert visible_signals(roads, states, 125.0) == {"stop"}
    assert "east red" not in visible_signals(roads, states, 90.0, truck=True)
    assert visible_signals(roads, {}, 60.0) == {"east", "stop"}


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

    def run(self, seconds: float, states: Mapping[str, str]) -> tuple[float, float]:
        """Run for a duration [s]; return the position of its front [m] and its speed [m/s]."""
        for _ in range(round(seconds / 0.05)):
            view = self.world.view()
            ego = self.rig.read(self.world, view).ego
            self.planner.observe_signals(self.sensor.read(self.world, view, 0, states))
            plan = self.planner.plan(ego, Detections(view.time), Goal(), view.time)
            self.reasons.append(plan.reason)
            self.world.step({}, {"Ego": self.controller.control(ego, plan)})
        view = self.world.view()
        return float(view.position[0, 0]) + 1.4 + 2.446, float(view.speed[0])


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


def test_interrupted_wait_at_stop_sign_restarts() -> None:
    stops = SignalStops(street(stop_sign("stop", 100.0)), CAR)
    stops.follow(EAST)
    stops.signals.see([SignalReading("stop", "")])
    at_line = 100.0 - CAR.offset[0] - CAR.size[0] / 2.0 - BEFORE_LINE
    assert stops.next(at_line, 0.0, 0.0) is not None
    assert stops.next(at_line, 0.0, WAIT - 0.1) is not None
    assert stops.next(150.0, 5.0, 20.0) is None, "pushed on"
    assert stops.next(at_line, 0.0, 60.0) is not None
    assert stops.next(at_line, 0.0, 60.0 + WAIT) is None


ROUND = np.concatenate(
    [
        np.column_stack([np.arange(40.0, 160.0), np.full(120, -1.75)]),
        np.column_stack([np.full(40, 160.0), np.arange(-1.75, -41.75, -1.0)]),
        np.column_stack([np.arange(160.0, 40.0, -1.0), np.full(120, -41.75)]),
        np.column_stack([np.full(41, 40.0), np.arange(-41.75, -0.75)]),
    ]
)
"""Lap of 320 m that uses the street from x = 40 m to 160 m."""


@pytest.mark.parametrize("offset", [0.0, 0.37, 0.77])
def test_signal_is_ahead_on_every_lap(offset: float) -> None:
    path = np.concatenate([[[40.0 - offset, -1.75]], ROUND[1:], ROUND[1:]])
    assert [place for _, place in names(street(light("east", 120.0)), path)] == pytest.approx(
        [80.0 + offset, 400.0 + offset], abs=0.01
    )


def test_stop_sign_applies_on_every_lap() -> None:
    """The wait of the first lap does not count on the second."""
    stops = SignalStops(street(stop_sign("stop", 100.0)), CAR)
    stops.follow(np.concatenate([ROUND, ROUND[1:]]))
    stops.signals.see([SignalReading("stop", "")])
    at_line = 60.0 - CAR.offset[0] - CAR.size[0] / 2.0 - BEFORE_LINE
    for lap, now in ((0.0, 0.0), (320.0, 60.0)):
        assert stops.next(lap + at_line - 20.0, 8.0, now) is not None
        assert stops.next(lap + at_line, 0.0, now + 3.0) is not None
        assert stops.next(lap + at_line, 0.0, now + 3.0 + WAIT) is None
        assert stops.next(lap + at_line + 2.0, 2.0, now + 8.0) is None


SCENARIO = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="" author=""/><CatalogLocations/>
<RoadNetwork><LogicFile filepath="street.xodr"/></RoadNetwork>
<Entities><ScenarioObject name="Ego"><Vehicle name="car" vehicleCategory="car">
<BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
<Performance maxSpeed="50" maxAcceleration="5" maxDeceleration="9"/>
<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles></Vehicle>
<ObjectController><Controller name="stack"><Properties><Property name="module" value="eidrive"/>
<Property name="target_speed" value="10"/><Property name="obey_signals" value="{obeys}"/></Properties></Controller>
</ObjectController></ScenarioObject></Entities>
<Storyboard><Init><Actions>
<GlobalAction><InfrastructureAction><TrafficSignalAction><TrafficSignalStateAction name="7" state="red"/>
</TrafficSignalAction></InfrastructureAction></GlobalAction>
<Private entityRef="Ego"><PrivateAction><TeleportAction><Position>
<LanePosition roadId="1" laneId="-1" s="20"/></Position></TeleportAction></PrivateAction></Private></Actions></Init>
<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"/><Maneuver name="maneuver"><Event name="turns" priority="parallel">
<Action name="green"><GlobalAction><InfrastructureAction><TrafficSignalAction><TrafficSignalStateAction name="7"
 state="green"/></TrafficSignalAction></InfrastructureAction></GlobalAction></Action>
<StartTrigger><ConditionGroup><Condition name="later" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="18" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
</StartTrigger>
</Event></Maneuver></ManeuverGroup></Act></Story>
<StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="26" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
</StopTrigger>
</Storyboard></OpenSCENARIO>"""


class Track:
    """Observer of the position of the ego's front, by time."""

    def __init__(self) -> None:
        self.fronts: dict[float, float] = {}

    def observe(self, frame: Frame) -> None:
        place = float(frame.view.position[frame.view.row("Ego"), 0])
        self.fronts[round(frame.view.time, 2)] = place + 1.4 + 2.25

    def close(self) -> None:
        pass


@pytest.mark.parametrize("obeys", [True, False])
def test_scenario_with_light_stops_obeying_car_until_green(tmp_path: Path, obeys: bool) -> None:
    """Light of the storyboard at 80 m: red from the start, green from 18 s on."""
    road = (
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road name="" length="400" id="1" junction="-1"><planView>'
        f'<geometry s="0" x="0" y="0" hdg="0" length="400"><line/></geometry></planView>{LANES}'
        f"<signals>{light('7', 80.0)}</signals></road></OpenDRIVE>"
    )
    (tmp_path / "street.xodr").write_text(road)
    path = tmp_path / "light.xosc"
    path.write_text(SCENARIO.replace("{obeys}", str(obeys).lower()))
    track = Track()
    assert run_file(path, seed=0, observers=[track]).end_reason == "stop trigger"
    if obeys:
        assert 78.0 < track.fronts[17.95] < 80.0
        assert track.fronts[26.0] > 95.0
    else:
        assert track.fronts[17.95] > 95.0
