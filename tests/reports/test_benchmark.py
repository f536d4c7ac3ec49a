"""Benchmark of fusion methods: methods, channels and scenarios by their texts, ranks, cells, page, own methods."""

from __future__ import annotations

import hashlib
import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive
from eidrive_reports.reproduction import benchmark
from eidrive_reports.reproduction.benchmark import CELLS, RANKS, Plan, arm_of
from eidrive_reports.reproduction.benchmark_arms import (
    CHANNELS,
    SCENARIOS,
    SILENT,
    Method,
    channel_of,
    methods_of,
    scenarios_of,
    settings_of,
    shared_channel,
)
from eidrive_reports.reproduction.episodes import BUSY, BYTES, Episode, air_metrics
from eidrive_reports.reproduction.page import write_benchmark_page
from lxml import html

from eidrive_scenario.api.experiments import resolve_scenario
from eidrive_scenario.api.run import load_scenario
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent_factory import station_sensors
from eidrive_scenario.driving.station_declarations import declared_settings
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.registry import register, registry
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.v2x.analytic.ieee80211p import offered_load
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

OWN_METHOD = """
from eidrive_scenario.api.fusion import AverageFusion


class Own(AverageFusion):
    pass
"""
SCENARIO = "ncap/crossing_car"


def episode(scenario: str, arm: str, seed: int, passed: bool | None, **metrics: float) -> Episode:
    named = {"near": "min_distance.Ego.Other.box", "sent": BYTES, "busy": BUSY}
    values = {named[name]: value for name, value in metrics.items()}
    return Episode(scenario, arm, seed, "", f"hash {scenario} {arm} {seed}", 10.0, 0.5, values, passed=passed)


@pytest.fixture
def plan() -> Plan:
    """Return one scenario on two channels without cooperation, with `average` and with `early`."""
    methods = methods_of(["none", "average", "early"], ["lidar"])
    return methods, (channel_of("1mbit_2"), channel_of("ideal")), (SCENARIO,)


@pytest.fixture
def episodes(plan: Plan) -> list[Episode]:
    """Return ten runs a cell. Passed ones: none 0; average 8 and 10; early 8 and 5."""
    passed = {("average", "1mbit_2"): 8, ("average", "ideal"): 10, ("early", "1mbit_2"): 8, ("early", "ideal"): 5}
    sent = {"none": 0.0, "average": 80_000.0, "early": 800_000.0}
    return [
        episode(
            scenario,
            arm_of(method, channel),
            seed,
            seed <= passed.get((method.fusion, channel.name), 0),
            near=0.1 * seed,
            sent=sent[method.fusion],
        )
        for scenario, method, channel in benchmark.cells_of(plan)
        for seed in range(1, 11)
    ]


def rows_of(episodes: list[Episode], plan: Plan, table: str) -> list[dict[str, Any]]:
    """Return the rows of a table of the report as its JSON file has them."""
    report = benchmark.report(episodes, ("lidar",), plan=plan)
    return json.loads(json.dumps(report.as_json()))["tables"][table]  # type: ignore[no-any-return]


@pytest.mark.parametrize("stations", [3, 40, 80, 350])
def test_background_of_a_shared_channel_offers_the_load_of_its_stations(stations: int) -> None:
    """300 and 30 bytes at 6 Mbit/s after a preamble of 40 us take 480 us: each of the others offers 0.0048."""
    density = shared_channel(6, stations)["background"]["density"]
    load = offered_load(density, 10.0, 300, 23.0, 6e6, 1.0)
    assert load == pytest.approx((stations - 2) * 0.0048, rel=1e-2 if stations == 3 else 1e-3)


@pytest.mark.parametrize(("rate", "expected"), [(1, 15.2), (3, 45.7)])
def test_station_sends_at_most_at_the_rate_of_a_shared_channel(rate: float, expected: float) -> None:
    """A message of 8000 bytes is five frames of 1912 us and one of 1384 us: 10.94 ms, of which it may use one sixth."""
    channel = RadioChannel(RadioProfile.model_validate(shared_channel(rate, 2)), 1)
    antennas = {"Ego": (0.0, 0.0, 1.5), "RSU": (20.0, 0.0, 1.5)}
    channel.update_environment(RadioEnvironment(antennas))
    state, ticks, delivered = StationState(0.0, 20.0, 0.0, 0.0, 0.0, 0.0), 1000, 0
    for tick in range(ticks):
        now = 0.01 * tick
        channel.transmit([(Message("RSU", tick, now, state, Detections(now), 8000), ["Ego"])], now)
        delivered += len(channel.deliver("Ego", now + 0.01))
    assert delivered / (0.01 * ticks) == pytest.approx(expected, rel=0.05)


def test_texts_select_methods_channels_and_scenarios_once() -> None:
    methods = methods_of(["none", "average:oracle", "early", "average"], ["oracle", "lidar"])
    names = ["none:oracle", "none:lidar", "average:oracle", "early:lidar", "average:lidar"]
    assert [method.name for method in methods] == names
    assert scenarios_of(["coop/scenario_5", "pipeline", "coop/scenario_5"]) == (
        "coop/scenario_5",
        *(f"pipeline/scenario_{number}" for number in range(1, 5)),
    )
    assert channel_of("3mbit_40").title == "3 Mbit/s, 40 stations"
    assert channel_of("1.5mbit_2").profile["congestion"]["share_max"] == 0.25  # type: ignore[index]
    assert "congestion" not in channel_of("6mbit_2").profile
    assert channel_of("bursty").profile == "bursty"


def test_settings_of_all_cells_without_options_are_valid() -> None:
    part = benchmark.benchmark_part(())
    cases = part.cases(())
    assert len(cases) == len(SCENARIOS) * (1 + 4 * len(CHANNELS))
    for name in CHANNELS:
        RadioProfile.model_validate(channel_of(name).profile)
    assert settings_of(SCENARIO, Method("none", "lidar"), SILENT).channel == "none"


@pytest.mark.parametrize("detector", ["pillars", "lidar"])
def test_lidars_have_the_field_of_view_that_stations_declare(detector: str) -> None:
    for name in SCENARIOS:
        settings = settings_of(name, Method("none", detector), SILENT)
        scenario = load_scenario(resolve_scenario(name), parameters=settings.parameters)
        for station in declared_settings(scenario, {"detector": detector}).values():
            (lidar,) = station_sensors(station).values()
            default = LidarSettings(rate=10.0, rotation=10.0) if detector == "pillars" else LidarSettings()
            assert lidar == default.model_copy(update={"field_of_view": station.field_of_view or 360.0})


def test_sensors_of_oracles_and_cameras_are_not_replaced() -> None:
    for detector in ("oracle", "yolov5"):
        assert settings_of("coop/scenario_7", Method("none", detector), SILENT).parameters == {}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("table2", "--fusion", "average"), "--fusion: has an effect on the part benchmark only"),
        (("benchmark", "--fusion", "averge"), "--fusion: unknown fusion method 'averge'; did you mean 'average'?"),
        (("benchmark", "--fusion", "average:lidr"), "--fusion: unknown detector 'lidr'; did you mean 'lidar'?"),
        (("benchmark", "--detectors", "lidr"), "--detectors: unknown name 'lidr'"),
        (("benchmark", "--channels", "7mbit_2"), "--channels: invalid shared channel '7mbit_2'"),
        (("benchmark", "--channels", "6mbit_1"), "2 to 350 stations"),
        (("benchmark", "--channels", "idael"), "--channels: "),
        (("benchmark", "--scenarios", "coop/scenario_55"), "no scenario 'coop/scenario_55'"),
        (("benchmark", "--scenarios", ""), "no scenario ''"),
    ],
)
def test_invalid_texts_end_with_exit_code_2(
    eidrive: Eidrive, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    result = eidrive("reproduce", *arguments, "--out", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
    assert not (tmp_path / "out").exists()


def test_ranks_follow_shares_then_bytes(episodes: list[Episode], plan: Plan) -> None:
    """Wilson's interval of 8 of 10 is 0.490 to 0.943; each of ten pairs without cooperation failed."""
    ranks = rows_of(episodes, plan, RANKS)
    assert [(row["channel"], row["rank"], row["method"], row["passed"]) for row in ranks] == [
        ("1mbit_2", 1, "average:lidar", 8),
        ("1mbit_2", 1, "early:lidar", 8),
        ("1mbit_2", 3, "none:lidar", 0),
        ("ideal", 1, "average:lidar", 10),
        ("ideal", 2, "early:lidar", 5),
        ("ideal", 3, "none:lidar", 0),
    ]
    assert [ranks[0][name] for name in ("low", "high")] == pytest.approx([0.490, 0.943], abs=5e-4)
    assert (ranks[0]["gain"], ranks[2]["gain"]) == (0.8, None)
    assert ranks[0]["gain_low"] > 0.0
    assert (ranks[0]["bytes_per_s"], ranks[0]["busy"]) == (8000.0, None)
    assert ranks[0]["distance"] == pytest.approx(0.55)


def test_cells_have_digests_of_traces_and_commands(episodes: list[Episode], plan: Plan) -> None:
    cells = rows_of(episodes, plan, CELLS)
    assert [(cell["method"], cell["channel"]) for cell in cells] == [
        ("none:lidar", "none"),
        ("average:lidar", "1mbit_2"),
        ("average:lidar", "ideal"),
        ("early:lidar", "1mbit_2"),
        ("early:lidar", "ideal"),
    ]
    lines = "\n".join(f"hash {SCENARIO} average:lidar ideal {seed}" for seed in range(1, 11))
    assert cells[2]["traces"] == hashlib.sha256(lines.encode()).hexdigest()[:16]
    words = "--fusion average:lidar --channels ideal --scenarios ncap/crossing_car --episodes 10"
    assert cells[2]["command"] == f"eidrive reproduce benchmark {words} --out reports/cell"
    assert "--channels" not in cells[0]["command"]
    assert [cell["run_seed"] for cell in cells] == ["1", "9", "1", "9", "6"]


def test_scenario_without_criteria_has_no_success(plan: Plan, episodes: list[Episode]) -> None:
    unjudged = [*episodes[:-1], episode(SCENARIO, episodes[-1].arm, 10, None, sent=0.0)]
    with pytest.raises(SettingError, match=r"ncap/crossing_car: no criterion judges the runs"):
        rows_of(unjudged, plan, CELLS)


def test_transmitted_bytes_count_a_broadcast_once() -> None:
    def link(size: int, busy: float | None) -> LinkStatistics:
        return LinkStatistics(1, 1, 0, 0, size, None, None, None, None, None, channel_busy_ratio=busy)

    links = {("A", "B"): link(100, 0.2), ("A", "C"): link(90, 0.3), ("B", "C"): link(7, 0.3)}
    assert air_metrics(links) == {BYTES: 107.0, BUSY: 0.3}
    assert air_metrics({("A", "B"): link(5, None)}) == {BYTES: 5.0}


def test_page_shows_ranks_scenarios_and_commands(tmp_path: Path, episodes: list[Episode], plan: Plan) -> None:
    report = benchmark.report(episodes, ("lidar",), plan=plan).as_json()
    report["sections"].insert(0, {"title": "Question", "paragraphs": ["Which <method>?"], "columns": [], "rows": []})
    (tmp_path / "benchmark.json").write_text(json.dumps(report))
    page: Any = html.parse(write_benchmark_page(tmp_path))
    assert page.xpath("//p[@class='lead']")[0].text_content() == "Which <method>?"
    assert page.xpath("//section/h3/text()") == ["1 Mbit/s, 2 stations", "ideal"]
    first = page.xpath("//section[1]//tbody/tr[1]/td")
    assert [" ".join(cell.text_content().split()) for cell in first[:3]] == ["1", "average:lidar", "80 % 8/10"]
    matrix = page.xpath("//table[@class='matrix']")[1].xpath(".//tbody/tr")
    assert [[cell.text_content().split()[0] for cell in row.xpath("td")] for row in matrix] == [
        ["0", "0"],
        ["80", "100"],
        ["80", "50"],
    ]
    commands = page.xpath("//*[@id='cells']//pre/text()")
    assert len(commands) == 10
    assert commands[3].startswith("eidrive run ncap/crossing_car --channel '{")


@pytest.mark.parametrize("content", ["{", "[]", '{"title": "a"}', "null"])
def test_damaged_file_is_an_error(tmp_path: Path, content: str) -> None:
    (tmp_path / "benchmark.json").write_text(content)
    with pytest.raises(SettingError, match=r"benchmark\.json: the file is damaged: .*eidrive reproduce benchmark"):
        write_benchmark_page(tmp_path)


@pytest.mark.process
@pytest.mark.timeout(120)
def test_own_method_enters_by_its_name(eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A method of the same rule as `average` has its traces; a change of its module runs it again; commands repeat."""
    module = tmp_path / "benchmark_own_method.py"
    module.write_text(OWN_METHOD)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    register("fusion", "own", "benchmark_own_method:Own")
    try:
        options = ("--channels", "6mbit_40", "--scenarios", SCENARIO, "--episodes", 1, "--workers", 1)
        arguments = ("reproduce", "benchmark", "--fusion", "average,own", "--detectors", "oracle", *options)
        done = eidrive(*arguments, "--out", "out")
        assert done.exit_code == 0, done.output
        assert done.stdout.startswith("benchmark: 2 runs in")
        assert done.stdout.rstrip().endswith("out/benchmark.html")
        cells = json.loads(Path("out/benchmark.json").read_bytes())["tables"][CELLS]
        assert [cell["method"] for cell in cells] == ["average:oracle", "own:oracle"]
        assert cells[0]["traces"] == cells[1]["traces"]

        module.write_text(f"{OWN_METHOD}# changed\n")
        assert eidrive(*arguments, "--out", "out").stdout.startswith("benchmark: 1 run in")

        repeated = eidrive(*shlex.split(cells[1]["command"])[1:], "--workers", 1)
        assert repeated.exit_code == 0, repeated.output
        (cell,) = json.loads(Path("reports/cell/benchmark.json").read_bytes())["tables"][CELLS]
        assert cell["traces"] == cells[1]["traces"]
        single = eidrive(*shlex.split(cells[1]["run"])[1:], "--json")
        trace = json.loads(single.stdout)["trace_hash"]
        assert hashlib.sha256(trace.encode()).hexdigest()[:16] == cells[1]["traces"]
    finally:
        del registry("fusion")._points["own"]
