"""Long drives through background traffic on a closed road."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest
from eidrive_reports import long_drives
from eidrive_reports.driven_runs import Stop
from eidrive_reports.long_drives import LongDrive, draw_way, table, waypoints, write_town_drive
from opendrive_xml import (
    BOTH_WAYS,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    ring_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork

LANES = section_xml(right="".join(lane_xml(number, link=lane_links_xml(number, number)) for number in (-1, -2)))
"""Two linked lanes of one direction."""


def ring(folder: Path, radius: float = 80.0) -> Path:
    """Write a ring road of two lanes that are driven counter-clockwise."""
    path = folder / "ring.xodr"
    path.write_text(ring_xml(radius, LANES))
    return path


def test_way_is_random_and_as_long_as_requested(tmp_path: Path) -> None:
    """At 70 % of 50 km/h a way of 100 s is 972 m long; it ends with the half circle in which it reaches that length."""
    roads = RoadNetwork.load(ring(tmp_path))
    ways = [draw_way(roads, seed, 100.0) for seed in range(6)]
    assert ways[0] == draw_way(roads, 0, 100.0)
    assert len({way[0] for way in ways}) > 1
    for way in ways:
        places = waypoints(roads, way)
        length = roads.route(places[0], places[-1], places[1:-1]).length
        assert 972.0 - 2.0 * 3.15 * 80.0 < length < 972.0 + 2.0 * 3.15 * 80.0
        assert all(roads.graph.edges[one, two]["kind"] == "successor" for one, two in pairwise(way))


@pytest.mark.parametrize("lanes", [BOTH_WAYS, LANES])
def test_map_without_a_closed_way_is_an_error(lanes: str) -> None:
    """Lanes between which a vehicle can change, but that end, are no closed way."""
    with pytest.raises(SettingError, match="no closed way"):
        draw_way(RoadNetwork.parse(map_xml(road_xml(lanes=lanes, length=300.0))), 1, 60.0)


def test_written_scenario_is_a_valid_file_for_any_name_of_the_map(tmp_path: Path) -> None:
    folder = tmp_path / "a & b"
    folder.mkdir()
    road_map = ring(folder).rename(folder / 'ring -- "1".xodr')
    path = tmp_path / "drive.xosc"
    write_town_drive(RoadNetwork.load(road_map), path, road_map=road_map, vehicles=7, seed=3, minutes=1.0)
    scenario = load_scenario(path)
    assert scenario.road_file == road_map
    assert 'name="Traffic" parameterType="unsignedInt" value="7"' in path.read_text()


def test_signal_groups_are_green_one_after_the_other() -> None:
    """Two groups of 15 s each: exactly one is green or yellow, and each yellow is followed by red for all."""
    text = long_drives._controller("J", [["1", "2"], ["3"]])
    phases = [line.split('state="')[1:] for line in text.splitlines() if "<Phase" in line]
    states = [[one.split('"')[0] for one in phase] for phase in phases]
    green, yellow, red = "off;off;on", "off;on;off", "on;off;off"
    assert states == [
        [green, green, red],
        [yellow, yellow, red],
        [red, red, red],
        [red, red, green],
        [red, red, yellow],
        [red, red, red],
    ]


def test_table_lists_long_stops_with_their_reason() -> None:
    stops = (Stop(10.0, 5.0, 1.0, 2.0, "follow car"), Stop(60.0, 25.0, 30.0, 40.0, "stop at traffic light 7"))
    drive = LongDrive("ring_1", 1, 600.0, 3000.0, True, False, 0.995, 0, stops, 3)
    alone = LongDrive("ring_1", 1, 400.0, 3000.0, False, False, 1.0, 0, (), 0)
    assert table([drive], [alone]).splitlines()[2:] == [
        "| ring_1 | 600 | 3000 | 5.0 | 7.5 | 3 | 1 | 0 | 0 | 2 | 25 | 99.5 % |",
        "",
        "Stops of at least 20 s:",
        "",
        "- ring_1, 60 s at (30, 40) m: 25 s, stop at traffic light 7",
    ]


@pytest.mark.exhaustive
def test_main_drives_a_ring_with_traffic_to_the_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Half a minute at 70 % of 50 km/h are 292 m, plus the rest of the last half circle."""
    arguments = [str(ring(tmp_path)), "--minutes", "0.5", "--vehicles", "4", "--out", str(tmp_path), "--workers", "1"]
    long_drives.main(arguments)
    (row,) = capsys.readouterr().out.splitlines()[2:3]
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[0] == "ring_1"
    assert cells[5:8] == ["0", "0", "0"]
    assert 180.0 < float(cells[2]) < 600.0
    assert float(cells[11].rstrip(" %")) > 95.0


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--minutes", "0"), "invalid minutes value"),
        (("--minutes", "nan"), "invalid minutes value"),
        (("--seeds", "0"), "argument --seeds: not a positive number (got 0)"),
    ],
)
def test_drive_without_a_duration_or_a_seed_is_an_error(
    option: tuple[str, str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        long_drives.main([str(ring(tmp_path)), *option, "--out", str(tmp_path)])
    assert message in capsys.readouterr().err


def test_map_that_does_not_exist_is_an_error_without_a_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert long_drives.main([str(tmp_path / "no.xodr"), "--out", str(tmp_path)]) == 2
    assert "no.xodr: cannot read" in capsys.readouterr().err


def test_way_around_a_ring_of_one_lane_has_laps() -> None:
    """A ring of one road of 314 m: at 70 % of 50 km/h, 60 s are 583 m, two laps at least."""
    lane = section_xml(right=lane_xml(-1, link=lane_links_xml(-1, -1)))
    link = predecessor_xml("1") + successor_xml("1")
    roads = RoadNetwork.parse(map_xml(road_xml(length=2.0 * math.pi * 50.0, curvature=0.02, link=link, lanes=lane)))
    places = waypoints(roads, draw_way(roads, 1, 60.0))
    assert roads.route(places[0], places[-1], places[1:-1]).length > 583.0
