"""Stations of background traffic in simulation runs: their share, messages, perception and errors."""

from __future__ import annotations

import math
from collections import Counter

import pytest
from opendrive_xml import lane_xml, section_xml
from openscenario_xml import parameters_xml
from street_scene import after, street
from traffic_scene import PEDESTRIAN, VEHICLE, area, crowd, distribution, road_range, source, swarm, traffic
from whole_run import RecordedRun, Run

from eidrive_scenario.driving.stack import EmptyStack
from eidrive_scenario.driving.traffic_stations import parse_traffic_stations
from eidrive_scenario.errors import InputError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation

MANY = 4000


def command(content: str) -> str:
    action = f'<CustomCommandAction type="eidrive.traffic_stations">{content}</CustomCommandAction>'
    return f"<UserDefinedAction>{action}</UserDefinedAction>"


def stations(played: RecordedRun, time: float) -> set[str]:
    """Return the stations of traffic that act at a time."""
    return {name for name in played.frames[round(time / 0.05)].steps if name.startswith("crowd.")}


def names_in_share(share: float, seed: int = 0) -> set[str]:
    declared = parse_traffic_stations(f"{{share: {share}}}", source="", line=None, scope=None)
    return {name for name in (f"crowd.{number:04}" for number in range(MANY)) if declared.includes(name, seed)}


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_number_of_stations_is_binomial(share: float) -> None:
    """Within four standard deviations."""
    deviation = math.sqrt(MANY * share * (1.0 - share))
    assert len(names_in_share(share)) == pytest.approx(MANY * share, abs=4.0 * deviation)


def test_larger_share_keeps_all_stations_and_seeds_differ() -> None:
    assert names_in_share(0.2) < names_in_share(0.5)
    assert names_in_share(0.5) != names_in_share(0.5, seed=1)


def test_every_vehicle_of_traffic_is_a_station_and_sends_to_ego(run: Run) -> None:
    """At 10 Hz each station sends 9 to 11 messages in a second, and the channel without loss delivers all."""
    given = traffic(swarm()) + command("{share: 1.0, message_rate: 10, detector: oracle}")
    played = run(4.0, globally=given, settings=RunSettings(channel="ideal"))
    assert stations(played, 0.05) == set(crowd(played, 0.05))
    assert len(stations(played, 0.05)) == 12
    received = Counter(
        message.message.sender
        for frame in played.frames
        if 2.0 <= frame.view.time < 3.0
        for message in frame.steps["Ego"].inbox
    )
    assert set(received) == set(crowd(played, 2.0))
    assert all(9 <= count <= 11 for count in received.values())
    assert played.result.metrics["messages.lost"] == 0.0


def test_ego_perceives_what_a_station_of_traffic_sees(run: Run) -> None:
    """Ego sees 20 m far; the station in the range of the car ahead reports the car 40 m ahead of Ego."""
    car = distribution((1.0, VEHICLE.format(20)))
    ahead = traffic(area(1, "false", road_range(130.0, 134.0, '<Lane id="-1"/>'), car))

    def perceived(share: float) -> set[float]:
        played = run(
            1.0,
            ego=(-1, 100.0, 0.0),
            others={"Hidden": (-2, 140.0, 0.0)},
            globally=ahead + command(f"{{share: {share}, range: 30}}"),
            settings=RunSettings(channel="ideal", drive={"Ego": "{range: 20, target_speed: 0}"}),
            driven=False,
        )
        boxes = played.frames[10].steps["Ego"].fused.boxes
        return {round(float(x)) for x, y in boxes[:, :2].tolist() if y < -4.0}

    assert perceived(0.0) == set()
    assert len(perceived(1.0)) == 1


def test_pedestrians_of_traffic_are_no_stations(run: Run) -> None:
    mix = distribution((1.0, VEHICLE.format(20)), (1.0, PEDESTRIAN))
    lanes = "".join(lane_xml(-number, 4) for number in (1, 2)) + lane_xml(-3, 3, kind="sidewalk")
    given = traffic(area(10, "false", road_range(150.0, 400.0), mix)) + command("{share: 1}")
    played = run(0.5, globally=given, street=street(section_xml("", lanes)))
    view = played.frames[-1].view
    categories = {name: view.categories[view.rows[name]] for name in crowd(played, 0.4)}
    assert stations(played, 0.4) == {name for name, category in categories.items() if category != "pedestrian"}


def test_command_in_an_event_applies_to_vehicles_that_enter_later(run: Run) -> None:
    """A vehicle enters every 2 s; none becomes a station after 3 s."""
    given = traffic(source(0.5, 300)) + command("{share: 1}")
    stop = command("{share: 0}")
    played = run(8.0, ("Ego", stop, after(3.0)), ego=(1, 900.0, 0.0), globally=given, driven=False)
    entered = {name: frame.view.time for frame in reversed(played.frames) for name in frame.view.names}
    assert stations(played, 7.9) == {name for name, time in entered.items() if name != "Ego" and time < 3.0}
    assert any(time > 4.0 for time in entered.values())


def test_share_is_a_parameter_and_settings_are_part_of_the_result(run: Run) -> None:
    run(0.2, globally=traffic(swarm()) + command("{share: 0.5, messages: cam, detector_latency: 0.1}"))
    path = run.folder / "scene.xosc"
    text = path.read_text().replace("share: 0.5", "share: $Share")
    declared = parameters_xml(Share=("double", "0.2")) + "<MonitorDeclarations>"
    path.write_text(text.replace("<MonitorDeclarations>", declared))
    settings = RunSettings(parameters={"Share": "0.25"}, detector="oracle", fusion="average")
    with Simulation(load_scenario(path), settings=settings) as simulation:
        (resolved,) = simulation.resolved.as_json()["traffic_stations"]
    expected = {"share": 0.25, "messages": ["cam"], "detector_latency": 0.1, "planner": "none", "fusion": "average"}
    assert resolved.items() >= expected.items()


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("{messages: cam}", r"share.*(missing|required)"),
        ("{share: 1.5}", r"share.*1\.5"),
        ("{share: .nan}", r"share.*nan"),
        ("{share: 0.5, detecter: oracle}", r"detecter.*did you mean 'detector'"),
        ("{share: 0.5, detector: oracel}", r"oracel.*did you mean 'oracle'"),
        ("{share: 0.5, detector: [oracle]}", r"detector"),
        ("{share: 0.5, sensors: camera}", r"'oracle' needs a sensor of kind truth"),
        ("{share: 0.5, planner: behavior}", r"planner 'behavior' for vehicles that the traffic drives"),
        ("{share: 0.5, cooperates_with: Ege}", r"cooperates with 'Ege', which is no station; did you mean 'Ego'"),
        ("{share: 0.5, asn1_files: cam.asn}", r"cam\.asn"),
        ("0.5", r"eidrive.traffic_stations is 0.5; write {share: 0.3}"),
        ("{share: 0.5, 1: 2}", r"1"),
        ("{share: 0.2, share: 0.3}", r"duplicate key 'share'"),
    ],
)
def test_invalid_settings_are_errors_with_their_line(run: Run, content: str, error: str) -> None:
    with pytest.raises(InputError, match=rf"scene\.xosc:\d+: .*{error}"):
        run(1.0, globally=traffic(swarm()) + command(content))


def test_stack_without_stations_of_traffic_warns(run: Run) -> None:
    run(0.2, globally=traffic(swarm()) + command("{share: 0.5}"), driven=False)
    result = Simulation(load_scenario(run.folder / "scene.xosc"), stack=EmptyStack).run()
    assert any("the driving stack has no stations of traffic" in warning for warning in result.warnings)
