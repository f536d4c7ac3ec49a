"""Traffic definitions and distributions in simulation runs: mixes of road users, driver models, older versions."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import lanes_xml
from openscenario_xml import agent_xml, road_file_xml, round_car_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    event_xml,
    group_xml,
    init_xml,
    maneuver_xml,
    time_xml,
    trigger_xml,
)
from street_scene import NOTHING, STREET, at, street
from traffic_scene import VEHICLE, crowd, definition, distribution, source, swarm, traffic
from whole_run import Run

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import Simulation


@pytest.mark.element("TrafficDefinition", "TrafficDistribution")
def test_traffic_mix_follows_shares_of_categories_and_entities(run: Run) -> None:
    mixed = definition(("truck", 1), ("car", 1), ("bicycle", 0), a="b")
    played = run(0.1, globally=traffic(swarm(40, reach=400, more=mixed)))
    frame = played.frames[1]
    drawn = [frame.view.categories[frame.view.row(name)] for name in crowd(played, 0.05)]
    assert 10 <= drawn.count("truck") <= 30
    assert set(drawn) == {"car", "truck"}
    played = run(0.1, globally=traffic(swarm(20, reach=400, more=distribution((1.0, VEHICLE.format(5))))))
    frame = played.frames[1]
    rows = [frame.view.row(name) for name in crowd(played, 0.05)]
    assert len(rows) == 20
    assert {tuple(size) for size in frame.view.size[rows].tolist()} == {(3.0, 1.5, 1.5)}
    assert max(frame.view.speed[rows]) <= 5.01


@pytest.mark.exhaustive
def test_traffic_controller_properties_set_the_driver_model(run: Run) -> None:
    def lead_gap(time_gap: float) -> float:
        mix = definition(module="eidrive.traffic", time_gap=time_gap)
        played = run(
            40.0,
            driven=False,
            ego=(-1, 140.0, 8.0),
            globally=traffic(source(0.04, 100.0, more=mix, speed=8.0)),
            street=street(lanes_xml(1, 1, 4)),
        )
        frame = played.frames[-1]
        return float(
            frame.view.position[frame.view.row("Ego"), 0] - frame.view.position[frame.view.row("crowd.0001"), 0]
        )

    assert lead_gap(2.5) - lead_gap(0.8) == pytest.approx(1.7 * 8.0, rel=0.25)


@pytest.mark.parametrize(
    ("version", "inside", "warned"),
    [
        ("0", swarm(9, velocity="9", more=definition(a="b")), False),
        ("1", source(1.0, 300.0, more=definition(a="b"), velocity=9), False),
        (
            "2",
            swarm(
                9,
                more=definition(a="b")
                + '<SpeedRange lowerLimit="8.5" upperLimit="9.4"/>'
                + '<AreaDistribution front="1" rear="0" left="0" right="0"/>',
            ),
            False,
        ),
        ("3", swarm(9, velocity="9", more=definition(a="b")), True),
    ],
)
def test_deprecated_traffic_elements_warn_in_newer_versions(
    tmp_path: Path, version: str, inside: str, warned: bool
) -> None:
    (tmp_path / "street.xodr").write_text(STREET)
    path = tmp_path / "older.xosc"
    trigger = trigger_xml(condition_xml(time_xml(0)))
    group = group_xml(maneuver_xml(event_xml("event", NOTHING, trigger)))
    path.write_bytes(
        scenario_xml(
            minor=int(version),
            road=road_file_xml("street.xodr"),
            entities=round_car_xml("Ego", agent_xml()),
            init=traffic(inside, name="crowd" if version != "0" else "") + init_xml("Ego", at(-1, 100.0, 20.0)),
            story=acts_xml(act_xml(group, trigger)),
        )
    )
    simulation = Simulation(load_scenario(path))
    with simulation:
        simulation.tick()
        frame, _ = simulation.tick()
    rows = [row for name, row in frame.view.rows.items() if name != "Ego"]
    assert len(rows) == (1 if version == "1" else 9)
    assert frame.view.speed[rows] == pytest.approx([9.0] * len(rows), abs=0.6)
    if version == "2":
        assert min(frame.view.position[rows, 0]) > frame.view.position[frame.view.row("Ego"), 0]
    deprecated = [str(warning) for warning in simulation.scenario.warnings if "deprecated" in str(warning)]
    assert any("velocity" in one or "TrafficDefinition" in one for one in deprecated) is warned
