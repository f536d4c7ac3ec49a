"""Traffic of SUMO in simulation runs, compared with SUMO alone.

The networks are of netconvert 1.28.0: `netconvert --opendrive-files xosc/roads/ROADS.xodr --no-turnarounds
--opendrive.internal-shapes true --opendrive.curve-resolution 0.5`, without comments.
"""

from __future__ import annotations

import gc
import importlib.util
import math
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
from opendrive_xml import map_xml, road_xml
from storyboard_xml import global_xml
from street_scene import after
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import InputError, SimulationError
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings, Simulation

DATA = Path(__file__).parents[1] / "data"
OFFSET = 80.0, 120.25
"""Offset of the network four_way_signals [m]."""
CAR = '<vType id="car" length="4.5" width="1.8" height="1.5" minGap="2.5" sigma="0"/>'
EAST = '<trip id="east" type="car" depart="0" from="-1" to="-2" departLane="0" departPos="10" departSpeed="10"/>'
MIXED = (
    '<vType id="heavy" vClass="truck"/><vType id="bike" vClass="bicycle"/>'
    f'{EAST}<trip id="north" type="heavy" depart="1" from="-4" to="-3"/>'
    '<trip id="left" type="car" depart="2" from="2" to="4"/><trip id="right" type="bike" depart="2.5" from="3" to="1"/>'
)
PLAIN = """
import sys, libsumo
options = {"--net-file": sys.argv[1], "--route-files": sys.argv[2], "--step-length": "0.05", "--seed": "0",
           "--lanechange.duration": "3", "--collision.action": "warn", "--time-to-teleport": "-1",
           "--fcd-output": sys.argv[3], "--precision": "6"}
libsumo.start(["sumo", *(part for option in options.items() for part in option)])
for _ in range(int(sys.argv[4])):
    libsumo.simulationStep()
libsumo.close()
"""
needs_sumo = pytest.mark.skipif(importlib.util.find_spec("libsumo") is None, reason="libsumo is not installed")


def command(network: object = DATA / "four_way_signals.net.xml", routes: str = "routes.rou.xml") -> str:
    content = f"{{network: {network}, routes: [{routes}]}}"
    action = f'<CustomCommandAction type="eidrive.sumo">{content}</CustomCommandAction>'
    return f"<UserDefinedAction>{action}</UserDefinedAction>"


@pytest.fixture
def crossing(run: Run) -> Callable[..., RecordedRun]:
    """Run with routes of SUMO at a crossing with traffic lights; Ego stands in the lane that leads south."""

    def played(
        routes: str, end: float = 12.0, *steps: tuple[str, ...], init: str = command(), **parts: object
    ) -> RecordedRun:
        (run.folder / "routes.rou.xml").write_text(f"<routes>{CAR}{routes}</routes>")
        roads = (library_path() / "roads/four_way_signals.xodr").read_text()
        stated = {"ego": (-1, 90.0, 0.0), "driven": False, "globally": init, "street": roads, **parts}
        return run(end, *steps, **stated)  # type: ignore[arg-type]

    return played


def front(played: RecordedRun, name: str, tick: int) -> tuple[float, float] | None:
    """Return the place of the front bumper of a car."""
    view = played.frames[tick].view
    if name not in view:
        return None
    row = view.rows[name]
    (x, y, _, length, _, _, yaw) = view.boxes[row]
    return x + 0.5 * length * math.cos(yaw), y + 0.5 * length * math.sin(yaw)


@needs_sumo
def test_positions_are_those_of_sumo_alone(run: Run, crossing: Callable[..., RecordedRun]) -> None:
    """Ego stands where none of the routes leads."""
    played = crossing(MIXED, 16.0, ego=(1, 60.0, 0.0))
    output = run.folder / "fcd.xml"
    network, routes = str(DATA / "four_way_signals.net.xml"), str(run.folder / "routes.rou.xml")
    subprocess.run([sys.executable, "-c", PLAIN, network, routes, str(output), "330"], check=True)
    compared = set()
    for step in ElementTree.parse(output).getroot().iter("timestep"):
        tick = round(float(step.attrib["time"]) / 0.05) + 1
        expected = {f"sumo.{one.attrib['id']}": one.attrib for one in step.iter("vehicle")}
        if tick >= len(played.frames):
            break
        assert {name for name in played.frames[tick].view.names if name != "Ego"} == set(expected)
        for name, values in expected.items():
            place = front(played, name, tick)
            assert place is not None
            stated = float(values["x"]) - OFFSET[0], float(values["y"]) - OFFSET[1]
            assert place == pytest.approx(stated, abs=1e-3)
            row = played.frames[tick].view.rows[name]
            assert played.frames[tick].view.speed[row] == pytest.approx(float(values["speed"]), abs=0.6)
            compared.add(name)
    assert compared == {f"sumo.{name}" for name in ("east", "north", "left", "right")}
    categories = {name: frame.view.categories[row] for frame in played.frames for name, row in frame.view.rows.items()}
    assert categories["sumo.north"] == "truck"
    assert categories["sumo.right"] == "bicycle"


@needs_sumo
def test_pedestrians_of_sumo_are_those_of_sumo_alone(run: Run, crossing: Callable[..., RecordedRun]) -> None:
    """Random speeds and lateral motion, also with Ego in the world. Walking is allowed on all lanes."""
    network, routes, output = (run.folder / name for name in ("walk.net.xml", "routes.rou.xml", "fcd.xml"))
    network.write_text(re.sub(r' (dis)?allow="[^"]*"', "", (DATA / "four_way_signals.net.xml").read_text()))
    walkers = '<personFlow id="p" begin="0" end="20" period="1"><walk edges="-1"/></personFlow>'
    last = crossing(walkers, 12.0, init=command("walk.net.xml")).frames[-1].view
    subprocess.run([sys.executable, "-c", PLAIN, str(network), str(routes), str(output), "330"], check=True)
    step = next(
        step
        for step in ElementTree.parse(output).getroot().iter("timestep")
        if round(float(step.attrib["time"]) / 0.05) + 1 == round(last.time / 0.05)
    )
    expected = {f"sumo.{person.attrib['id']}": person.attrib for person in step.iter("person")}
    assert len(expected) >= 10
    for name, values in expected.items():
        x, y, _, length, _, _, yaw = last.boxes[last.rows[name]].tolist()
        front = x + 0.5 * length * math.cos(yaw) + OFFSET[0], y + 0.5 * length * math.sin(yaw) + OFFSET[1]
        assert front == pytest.approx((float(values["x"]), float(values["y"])), abs=1e-3)


LEAVES = global_xml('<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>')
RETURNS = global_xml(
    '<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="1" laneId="-2" s="70"/>'
    "</Position></AddEntityAction></EntityAction>"
)


@needs_sumo
@pytest.mark.parametrize(
    ("standing", "steps"), [("Ego", ()), ("Other", (("Ego", LEAVES, after(0.5)), ("Ego", RETURNS, after(1.0))))]
)
def test_vehicle_of_sumo_stops_behind_a_standing_car(
    crossing: Callable[..., RecordedRun], standing: str, steps: tuple[tuple[str, ...], ...]
) -> None:
    """With lane changes forbidden, it stops 2.5 m behind (minGap); the car has 4 m, and its center is its place.

    So it does if the car has left and returned.
    """
    forbidden = CAR.replace('"car"', '"careful"').replace("/>", ' lcKeepRight="0" lcSpeedGain="0" lcStrategic="-1"/>')
    trip = EAST.replace('type="car"', 'type="careful"')
    places = {"Ego": (1, 60.0, 0.0), "Other": (1, 90.0, 0.0), standing: (-2, 70.0, 0.0)}
    ego, other = places.pop("Ego"), places
    played = crossing(forbidden + trip, 20.0, *steps, ego=ego, others=other)
    last = played.frames[-1].view
    place = front(played, "sumo.east", -1)
    assert place is not None
    car = last.boxes[last.rows[standing]]
    assert car[0] - 0.5 * car[3] - place[0] == pytest.approx(2.5, abs=0.3)
    assert last.speed[last.rows["sumo.east"]] == pytest.approx(0.0, abs=0.05)


LIGHTS = """<TrafficSignals><TrafficSignalController name="lights">
<Phase name="{0}" duration="100">{1}</Phase></TrafficSignalController></TrafficSignals>"""


@needs_sumo
@pytest.mark.parametrize(("state", "passes"), [("green", True), ("red", False)])
def test_lights_of_the_scenario_apply_to_sumo(crossing: Callable[..., RecordedRun], state: str, passes: bool) -> None:
    """The stop line of the lane that leads east is 16 m before the center of the crossing, at x = 26 m."""
    states = "".join(f'<TrafficSignalState trafficSignalId="{n}0" state="{state}"/>' for n in range(1, 5))
    played = crossing(EAST, 20.0, signals=LIGHTS.format(state, states))
    ends = [place[0] for tick in range(len(played.frames)) if (place := front(played, "sumo.east", tick)) is not None]
    assert (max(ends) > 60.0) == passes
    if not passes:
        assert 20.0 < max(ends) <= 26.0


@needs_sumo
def test_signals_follow_sumo_where_the_scenario_sets_none(crossing: Callable[..., RecordedRun]) -> None:
    """The program of netconvert: 42 s green, 3 s yellow, then red, with signals 30 and 10 in turn."""
    played = crossing(EAST, 50.0)
    states = [(frame.signals.get("30"), frame.signals.get("10")) for frame in played.frames[1:]]
    changes = [(0.05 * number, after) for number, (before, after) in enumerate(pairwise(states)) if before != after]
    assert states[0] == ("green", "red")
    assert [after for _, after in changes] == [("yellow", "red"), ("red", "green")]
    assert [time for time, _ in changes] == pytest.approx([42.0, 45.0], abs=0.11)


@needs_sumo
def test_signal_of_several_links_has_the_most_restrictive_state(run: Run, crossing: Callable[..., RecordedRun]) -> None:
    """Signal 30 is that of the links 0 to 3, of which the first one differs: red for 1 s, then yellow for 1 s."""
    network = (DATA / "four_way_signals.net.xml").read_text()
    phase = '<phase duration="42" state="GGGgrrrrGGGgrrrr"/>'
    split = "".join(phase.replace("42", "1").replace("GGGg", f"{letter}GGg", 1) for letter in "ryG")
    (run.folder / "split.net.xml").write_text(network.replace(phase, split))
    played = crossing(EAST, 2.9, init=command("split.net.xml"))
    assert [played.frames[tick].signals["30"] for tick in (10, 30, 50)] == ["red", "yellow", "green"]


@needs_sumo
def test_runs_repeat_and_end_sumo(crossing: Callable[..., RecordedRun]) -> None:
    random = '<flow id="f" type="DEFAULT_VEHTYPE" begin="0" end="20" probability="0.4" from="-1" to="-2"/>'
    first, second, other = (crossing(random, seed=seed).result.trace_hash for seed in (3, 3, 4))
    assert first == second
    assert first != other


@needs_sumo
def test_vehicles_of_sumo_can_be_stations(crossing: Callable[..., RecordedRun]) -> None:
    """From 2.5 s on there are four vehicles, each of which sends 10 messages per second."""
    equipped = '<CustomCommandAction type="eidrive.traffic_stations">{share: 1, message_rate: 10}</CustomCommandAction>'
    stated = f"{command()}<UserDefinedAction>{equipped}</UserDefinedAction>"
    drive = {"Ego": "{target_speed: 0, planner: route}"}
    played = crossing(MIXED, 5.0, init=stated, settings=RunSettings(channel="ideal", drive=drive))
    received = Counter(
        message.message.sender
        for frame in played.frames
        if frame.view.time >= 3.0
        for message in frame.steps["Ego"].inbox
    )
    assert set(received) == {f"sumo.{name}" for name in ("east", "north", "left", "right")}
    assert all(19 <= count <= 21 for count in received.values())


@needs_sumo
def test_vehicles_of_sumo_are_on_the_surface_of_hills(run: Run) -> None:
    path = library_path() / "roads/crest_road.xodr"
    trip = '<trip id="over" type="car" depart="0" from="-1" to="-1" departPos="10" departSpeed="13"/>'
    (run.folder / "routes.rou.xml").write_text(f"<routes>{CAR}{trip}</routes>")
    init = command(DATA / "crest_road.net.xml")
    played = run(40.0, ego=(1, 20.0, 0.0), driven=False, globally=init, street=path.read_text())
    roads = RoadNetwork.load(path)
    views = [frame.view for frame in played.frames if "sumo.over" in frame.view]
    rows = [view.rows["sumo.over"] for view in views]
    heights = [float(view.position[row, 2]) for view, row in zip(views, rows, strict=True)]
    assert max(heights) - min(heights) > 2.0
    for view, row, height in zip(views, rows, heights, strict=True):
        x, y, _ = view.position[row]
        location = roads.locate_at(float(x), float(y))
        assert location is not None
        surface = roads.pose(location)
        assert (height, float(view.pitch[row])) == pytest.approx((surface.z, surface.p), abs=0.01)


@needs_sumo
def test_comments_between_routes_have_no_effect(crossing: Callable[..., RecordedRun]) -> None:
    assert "sumo.east" in crossing(f"<!-- by randomTrips --><?editor?>{EAST}", 1.0).frames[-1].view.names


@needs_sumo
@pytest.mark.parametrize(
    ("routes", "expected"),
    [
        ('<include href="more.xml"/>', "<include> is not read"),
        ('<vType id="t"><param key="has.ssm.device" value="true"/></vType>', "SUMO writes files by the parameter"),
        ('<vType id="\x9b"/>', r"the id '\\x9b' has control characters"),
        ('<trip id="a" depart="2"/><trip id="b" depart="1"/>', "the departure at 1 s is after one at 2 s"),
        ('<trip depart="0:1:30"/><trip depart="0:00:02.5"/>', "the departure at 2.5 s is after one at 90 s"),
        ('<trip depart="1:0:0:5"/><flow begin="24:00:04"/>', "the departure at 86404 s is after one at 86405 s"),
        ("</routes><routes>", "not well-formed XML"),
    ],
)
def test_routes_with_hidden_or_further_effects_are_errors(
    crossing: Callable[..., RecordedRun], routes: str, expected: str
) -> None:
    with pytest.raises(InputError, match=expected):
        crossing(routes)


@needs_sumo
def test_files_that_do_not_fit_are_errors(run: Run, crossing: Callable[..., RecordedRun]) -> None:
    with pytest.raises(InputError, match=r"cannot read .*gone\.xml"):
        crossing("", init=command(routes="gone.xml"))
    with pytest.raises(InputError, match=r"cannot read .*gone\.net\.xml"):
        crossing("", init=command("gone.net.xml"))
    with pytest.raises(InputError, match="the root element is routes"):
        crossing("", init=command("routes.rou.xml"))
    with pytest.raises(InputError, match="lanes of the network are on the roads of the scenario"):
        crossing("", street=map_xml(road_xml(y=500.0)))
    network = (DATA / "four_way_signals.net.xml").read_text()
    changes = (
        ('netOffset="80.00,120.25"', 'netOffset="nan,1"'),
        ('shape="0.00,116.75', 'shape="?'),
        (' length="106.00"', ""),
        ('speed="13.89"', 'speed="x"'),
    )
    for valid, invalid in changes:
        assert valid in network
        (run.folder / "broken.net.xml").write_text(network.replace(valid, invalid).replace(" 106.00,116.75", ""))
        with pytest.raises(InputError, match="the network has no valid"):
            crossing("", init=command("broken.net.xml"))
    with pytest.raises(InputError, match="unknown setting 'route'"):
        crossing("", init=command().replace("routes:", "route:"))
    with pytest.raises(InputError, match="has started already"):
        crossing("", init=2 * command())
    with pytest.raises(InputError, match="SUMO: "):
        crossing('<trip id="a" depart="0" from="-1" to="nowhere"/>')


@needs_sumo
@pytest.mark.parametrize("length", ["5000", "nan"])
def test_size_without_a_body_is_an_error(crossing: Callable[..., RecordedRun], length: str) -> None:
    long = CAR.replace('"car"', '"long"').replace('length="4.5"', f'length="{length}"')
    with pytest.raises(SimulationError, match="SUMO: 'east' has a size"):
        crossing(long + EAST.replace('type="car"', 'type="long"'), 3.0)


@needs_sumo
def test_error_of_sumo_during_the_run_aborts_it(crossing: Callable[..., RecordedRun]) -> None:
    """The network has no sidewalks. The next run starts SUMO again."""
    with pytest.raises(SimulationError, match="SUMO: Person 'walker' could not find sidewalk"):
        crossing('<person id="walker" depart="1"><walk edges="-1"/></person>', 3.0)
    crossing(EAST, 1.0)


@needs_sumo
def test_only_one_simulation_of_a_process_has_sumo(run: Run, crossing: Callable[..., RecordedRun]) -> None:
    crossing(EAST, 1.0)
    scenario = load_scenario(run.folder / "scene.xosc")
    with Simulation(scenario), pytest.raises(InputError, match="SUMO runs in this process already"):
        Simulation(scenario)
    Simulation(scenario)  # it is not closed
    gc.collect()
    with Simulation(scenario):
        pass


@pytest.mark.parametrize("step", [1 / 30, 0.0125, 0.0004])
def test_time_step_that_sumo_would_round_is_an_error(crossing: Callable[..., RecordedRun], step: float) -> None:
    """The resolution of times in SUMO is 1 ms."""
    with pytest.raises(InputError, match="SUMO cannot simulate the time step of the run"):
        crossing(EAST, settings=RunSettings(dt=step))


def test_sumo_that_is_not_installed_is_an_error(
    crossing: Callable[..., RecordedRun], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"libsumo is not installed.*pip install .*\[sumo\]"):
        crossing(EAST)
