"""Traffic actions in simulation runs: entry, detection, contact and removal of background traffic."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
from opendrive_xml import lane_xml, section_xml
from storyboard_xml import by_entity_xml, speed_xml
from street_scene import street
from traffic_scene import (
    PEDESTRIAN,
    VEHICLE,
    area,
    at_time,
    crowd,
    definition,
    distribution,
    position,
    road_range,
    sink,
    source,
    swarm,
    traffic,
)
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import InputError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation


@pytest.mark.element("TrafficSwarmAction")
def test_swarm_in_init_is_present_after_the_first_step(run: Run) -> None:
    played = run(8.0, ego=(-1, 400.0, 10.0), driven=False, globally=traffic(swarm()))
    assert crowd(played, 0.0) == []
    assert len(crowd(played, 0.05)) == 12
    for frame in played.frames[1:]:
        rows = [frame.view.rows[name] for name in frame.view.names if name != "Ego"]
        ego = frame.view.position[frame.view.rows["Ego"], 0]
        assert all(abs(frame.view.position[row, 0] - ego) < 151.5 for row in rows)
        assert {frame.view.categories[row] for row in rows} <= {"car"}
    assert not [contact for frame in played.frames for contact in frame.view.contacts]
    moved = {name: played.frames[40].view.row(name) for name in crowd(played, 2.0)}
    assert min(played.frames[40].view.speed[row] for row in moved.values()) > 5.0


def test_source_continues_with_vehicles_where_pedestrians_have_no_sidewalk(run: Run) -> None:
    """A vehicle every 2 s from 0 s on; the pedestrians of the mix are replaced, which is a warning."""
    mix = distribution((1.0, VEHICLE.format(20)), (1.0, PEDESTRIAN))
    played = run(4.5, driven=False, ego=(1, 900.0, 0.0), globally=traffic(source(0.5, 300, more=mix)))
    assert len(crowd(played, 4.4)) == 3
    (warning,) = [text for text in played.result.warnings if "traffic 'crowd'" in text]
    assert "no lane at the source is suitable for: pedestrian" in warning


@pytest.mark.parametrize("continuous", ["true", "false"])
def test_area_without_room_is_a_warning_with_its_line(run: Run, continuous: str) -> None:
    """In 20 m of one lane at most two cars of 4.5 m and 2 m standstill gap fit, as they start at speed."""
    where = road_range(300.0, 320.0, '<Lane id="-1"/>')
    played = run(1.0, driven=False, ego=(1, 900.0, 0.0), globally=traffic(area(6, continuous, where)))
    (warning,) = [text for text in played.result.warnings if "traffic 'crowd'" in text]
    found = re.search(r":(\d+): traffic 'crowd': at most (\d) of 6 road users found a free place", warning)
    assert found is not None
    assert 1 <= int(found[2]) <= 2


@pytest.mark.parametrize(("rate", "reached"), [(0.5, None), (4.0, "[01](.[0-9]+)?")])
def test_source_above_the_capacity_of_its_lane_is_a_warning(run: Run, rate: float, reached: str | None) -> None:
    """At 10 m/s a car of 4.5 m with a time gap of 1 s and a standstill gap of 2 m needs 1.65 s."""
    played = run(10.0, driven=False, ego=(1, 900.0, 0.0), globally=traffic(source(rate, 300.0, speed=10.0)))
    warnings = [text for text in played.result.warnings if "traffic 'crowd'" in text]
    assert len(warnings) == (reached is not None)
    for warning in warnings:
        expected = rf".+:\d+: traffic 'crowd': {reached} road users per second entered \(expected 4\); reduce .+"
        assert re.fullmatch(expected, warning)


def test_swarm_below_its_maximum_number_is_no_warning(run: Run) -> None:
    """A ring of 40 m on each side has no site for 500 cars, and one of no width has none at all."""
    played = run(0.2, ego=(-1, 400.0, 10.0), driven=False, globally=traffic(swarm(500, reach=70)))
    assert 0 < len(crowd(played, 0.1)) < 500
    assert not [text for text in played.result.warnings if "road users" in text]
    played = run(0.2, ego=(-1, 400.0, 10.0), driven=False, globally=traffic(swarm(500, reach=30)))
    assert [text for text in played.result.warnings if "at most 0 of 500 road users" in text]


@pytest.mark.element("TrafficSwarmAction")
@pytest.mark.parametrize(("deleted", "stopped"), [(0.475, 1.0), (1.475, 1.55)])
def test_swarm_around_an_absent_entity_stops(run: Run, deleted: float, stopped: float) -> None:
    """It is stopped at its start at 1 s, or as soon as its entity is gone; its vehicles then continue."""
    delete = '<GlobalAction><EntityAction entityRef="Center"><DeleteEntityAction/></EntityAction></GlobalAction>'
    steps = ("Ego", traffic(swarm(4, center="Center")), at_time(1.0)), ("Ego", delete, at_time(deleted))
    played = run(2.0, *steps, driven=False, others={"Center": (-2, 400.0, 0.0)})
    (stop,) = [
        change for frame in played.frames for change in frame.changes if change.element == "action 0" and change.why
    ]
    assert stop.time == pytest.approx(stopped)
    assert any("TrafficSwarmAction: not executed, as Center is absent" in text for text in played.result.warnings)
    assert len(crowd(played, 2.0)) == (4 if stopped > 1.0 else 0)


def test_swarm_velocity_is_the_initial_speed(run: Run) -> None:
    played = run(0.1, globally=traffic(swarm(more=definition(a="b"), velocity="21")))
    frame = played.frames[1]
    speeds = [float(frame.view.speed[frame.view.row(name)]) for name in crowd(played, 0.05)]
    assert speeds == pytest.approx([21.0] * 12, abs=0.5)


def test_traffic_without_a_name_is_named_after_its_action(run: Run) -> None:
    played = run(0.1, globally=traffic(swarm(2), name=""))
    assert crowd(played, 0.05, "TrafficSwarm") == ["TrafficSwarm.0001", "TrafficSwarm.0002"]


def test_swarm_is_detected_by_the_sensors_of_an_agent(run: Run) -> None:
    seen: set[str] = set()

    def note(simulation: object, frame: object) -> None:
        step = frame.steps["Ego"]  # type: ignore[attr-defined]
        seen.add(str(len(step.detections.boxes)))

    played = run(
        3.0, globally=traffic(swarm(30, inner=8, reach=60)), during=note, settings=RunSettings(detector="oracle")
    )
    assert len(crowd(played, 1.0)) > 5
    assert seen - {"0"}


@pytest.mark.element("TrafficSourceAction")
def test_source_runs_until_its_stop_and_the_vehicles_remain(run: Run) -> None:
    played = run(
        12.0,
        ("Ego", traffic(source(0.5, 500.0, speed=10.0))),
        ("Ego", traffic("<TrafficStopAction/>"), at_time(5.0)),
        driven=False,
    )
    changes = {
        (change.element.rsplit("::", 1)[-1], change.after.value): change.time
        for frame in played.frames
        for change in frame.changes
    }
    assert changes["action 0", "runningState"] == 0.0
    assert changes["action 0", "completeState"] == pytest.approx(5.0, abs=0.06)
    assert changes["action 1", "completeState"] == pytest.approx(5.0, abs=0.06)
    assert [len(crowd(played, time)) for time in (0.05, 2.5, 4.95, 6.5, 11.9)] == [1, 2, 3, 3, 3]


@pytest.mark.element("TrafficStopAction")
def test_traffic_stop_ends_the_named_or_all_traffic(run: Run) -> None:
    def play(name: str) -> RecordedRun:
        return run(
            10.0,
            ("Ego", traffic("<TrafficStopAction/>", name=name), at_time(3.0)),
            driven=False,
            globally=traffic(source(0.5, 500.0, speed=10.0), "one") + traffic(source(0.5, 700.0, speed=10.0), "two"),
        )

    only, every = play("one"), play("")
    assert [len(crowd(only, 9.5, name)) for name in ("one", "two")] == [2, 5]
    assert [len(crowd(every, 9.5, name)) for name in ("one", "two")] == [2, 2]


@pytest.mark.exhaustive
@pytest.mark.element("TrafficSourceAction", "TrafficSinkAction")
def test_sink_removes_vehicles_of_a_source(run: Run) -> None:
    played = run(
        60.0,
        driven=False,
        ego=(1, 900.0, 0.0),
        globally=traffic(source(0.5, 100.0, speed=12.0), "in") + traffic(sink(400.0), "out"),
    )
    made = {name for frame in played.frames for name in frame.view.names if name.startswith("in.")}
    assert len(made) == 30
    assert 8 <= len(crowd(played, 59.0, "in")) <= 16
    xs = [
        x
        for frame in played.frames
        for name, row in frame.view.rows.items()
        if name != "Ego"
        if (x := float(frame.view.position[row, 0]))
    ]
    assert max(xs) < 400.0


def test_sink_does_not_remove_scenario_entities(run: Run) -> None:
    played = run(10.0, driven=False, ego=(-1, 350.0, 20.0), globally=traffic(sink(400.0)))
    assert played.x("Ego")[-1] > 500.0


@pytest.mark.element("TrafficAreaAction")
def test_area_by_road_range_is_filled(run: Run) -> None:
    where = road_range(300.0, 500.0, '<Lane id="-1"/>')
    played = run(5.0, driven=False, ego=(1, 900.0, 0.0), globally=traffic(area(6, "true", where)))
    for frame in played.frames[1:]:
        for name in frame.view.names:
            if name != "Ego":
                assert 299.0 < frame.view.position[frame.view.row(name), 0] < 501.5
    first = played.frames[1]
    assert {round(float(first.view.position[first.view.row(name), 1])) for name in crowd(played, 0.05)} == {-2}
    assert len(crowd(played, 0.05)) == 6


@pytest.mark.element("TrafficAreaAction")
def test_area_by_polygon_is_filled_once_and_completes(run: Run) -> None:
    corners = "".join(
        f'<Position><WorldPosition x="{x}" y="{y}"/></Position>' for x, y in ((300, -9), (500, -9), (500, 5), (300, 5))
    )
    played = run(
        12.0, ("Ego", traffic(area(5, "false", f"<Polygon>{corners}</Polygon>"))), driven=False, ego=(1, 900.0, 0.0)
    )
    assert len(crowd(played, 0.05)) == len(crowd(played, 11.0)) == 5
    done = [
        change.time
        for frame in played.frames
        for change in frame.changes
        if change.after.value == "completeState" and "action 0" in change.element
    ]
    assert done == [pytest.approx(0.0, abs=0.06)]


def test_area_pedestrians_walk_on_sidewalks(run: Run) -> None:
    lanes = "".join(lane_xml(-number, 4) for number in (1, 2)) + lane_xml(-3, 3, kind="sidewalk")
    entities = distribution((1.0, PEDESTRIAN))
    played = run(
        6.0,
        driven=False,
        globally=traffic(area(4, "true", road_range(300.0, 400.0), entities)),
        street=street(section_xml(right=lanes)),
    )
    frame = played.frames[-1]
    rows = [frame.view.row(name) for name in crowd(played, 5.9)]
    assert len(rows) == 4
    assert {frame.view.categories[row] for row in rows} == {"pedestrian"}
    assert frame.view.position[rows, 1] == pytest.approx(-9.5)
    assert all(1.0 < speed < 1.7 for speed in frame.view.speed[rows])


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (
            swarm(semiMinorAxis="60").replace('semiMinorAxis="60" offset', "offset").replace("30", "-3", 1),
            r"innerRadius is out of range \(got -3; expected at least 0\)",
        ),
        (swarm(more='<DirectionOfTravelDistribution same="0" opposite="0"/>'), r"shares are invalid \(got 0, 0;"),
        (swarm(more='<InitialSpeedRange lowerLimit="9" upperLimit="3"/>'), r"speed range is invalid \(got 9 to 3 m/s;"),
        (swarm(center="Egon"), "Egon"),
        (swarm(more=distribution((0.0, PEDESTRIAN))), "are invalid; give weights of at least 0"),
        (area(2, "true", road_range(0.0, 10.0).replace('roadId="1"', 'roadId="9"', 1)), "road '9' does not exist"),
        (swarm(more=definition(module="eidrive.traffic", time_gab=1)), "time_gab"),
    ],
)
def test_invalid_traffic_action_is_rejected_before_the_run(run: Run, inside: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        run(1.0, globally=traffic(inside))
    assert all(diagnostic.line for diagnostic in caught.value.diagnostics)


def test_source_far_from_lanes_is_rejected(run: Run) -> None:
    away = '<Position><WorldPosition x="300" y="200"/></Position>'
    inside = source(1.0, 100.0).replace(position(100.0), away)
    with pytest.raises(InputError, match=r"no lane is near x = 300\.0 m, y = 200\.0 m"):
        run(1.0, globally=traffic(inside))


def test_traffic_without_roads_is_rejected(run: Run, tmp_path: Path) -> None:
    run(0.1, globally=traffic(swarm(2)))
    text = (tmp_path / "scene.xosc").read_text().replace('<LogicFile filepath="street.xodr"/>', "")
    with pytest.raises(InputError, match="the scenario has no road network"):
        Simulation(load_scenario(text.encode()))


def test_collision_condition_by_type_includes_background_traffic(run: Run) -> None:
    """Ego follows a car that has just come from a source at 5 m/s, and accelerates into it."""
    touch = by_entity_xml('<CollisionCondition><ByType type="vehicle"/></CollisionCondition>')
    played = run(
        8.0,
        ("Ego", traffic("<TrafficStopAction/>"), touch),
        ("Ego", speed_xml(30), at_time(1.0)),
        driven=False,
        ego=(-1, 100.0, 5.0),
        globally=traffic(source(0.01, 130.0, speed=5.0)),
    )
    contacts = [frame.view.time for frame in played.frames if frame.view.contacts]
    assert contacts
    assert played.begun("event 0") == [pytest.approx(contacts[0], abs=1e-9)]


@pytest.mark.process
def test_traffic_with_equal_seed_has_equal_trace_in_another_process(run: Run, tmp_path: Path) -> None:
    played = run(4.0, driven=False, globally=traffic(swarm(15)), seed=3)
    other = run(4.0, driven=False, globally=traffic(swarm(15)), seed=4)
    assert played.result.trace_hash != other.result.trace_hash
    code = (
        "import sys; from eidrive_scenario.openscenario import load_scenario as load\n"
        "from eidrive_scenario.simulation import Simulation\n"
        "print(Simulation(load(sys.argv[1]), seed=3).run().trace_hash)"
    )
    scene = str(tmp_path / "scene.xosc")
    printed = subprocess.run([sys.executable, "-c", code, scene], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == played.result.trace_hash
    assert not math.isnan(played.result.simulated_s)
