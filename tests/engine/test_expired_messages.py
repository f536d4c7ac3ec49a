"""Messages that are too old on arrival: their number on every surface of a run, and the warning about them."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from lxml import html
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.export.tables import write_csv
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.text.run_log import RunLog
from eidrive_scenario.reporting.notebook import write_replay
from eidrive_scenario.reporting.run_report.report import write_run_report
from eidrive_scenario.simulation import RunResult, RunSettings, run_file
from eidrive_scenario.simulation.run_outcome import expired_messages
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

LATE = "{model: composed, delay: {kind: constant, seconds: 3}}"
RECEIVED = 21
"""Messages of the time steps from 0 to 1 s, which arrive from 3 s to the end of the run at 4 s."""
LINK = LinkStatistics(200, 100, 0, 100, 100, 2.5, 2.5, 2.5, 2.5, 2.5)


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    """Return a recorded run of 4 s with a latency of 3 s."""
    folder = tmp_path_factory.mktemp("late")
    return run_and_save("coop/scenario_1", settings=RunSettings(channel=LATE, time_limit=4.0), out=folder)


def texts(links: Mapping[tuple[str, str], LinkStatistics]) -> list[str]:
    return [str(warning) for warning in expired_messages(links)]


def test_expired_messages_are_in_result(late: RunResult) -> None:
    link = late.links["RSU", "Ego"]
    assert (link.received, link.expired) == (RECEIVED, RECEIVED)
    assert link.sent == link.received + link.in_flight, "an expired message is received"
    assert late.metrics["messages.expired"] == late.to_dict()["messages.expired"] == RECEIVED
    assert late.as_json()["links"][0]["expired"] == RECEIVED
    (warning,) = (warning for warning in late.warnings if "does not use" in warning)
    assert warning.startswith(
        "station 'Ego' does not use 21 of 21 received messages of 'RSU': they are too old on arrival (mean delay 3 s); "
    )


def test_expired_messages_are_in_recording_replay_tables_and_log(late: RunResult, tmp_path: Path) -> None:
    assert late.recording is not None
    recording = read_recording(late.recording)
    page = write_replay(late.recording, tmp_path / "replay.html")
    data = json.loads(html.fromstring(page.read_text(encoding="utf-8")).findtext(".//script[@id='data']") or "")
    assert data["series"]["Ego"]["expired"]["RSU"][-1] == RECEIVED
    write_csv(open_run(late.recording), tmp_path / "messages.csv", "messages")
    with (tmp_path / "messages.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["number"] for row in rows if row["expired"] == "true"] == [str(number) for number in range(RECEIVED)]
    log = RunLog(tmp_path / "log.txt")
    for frame in recording.frames():
        log.observe(frame)
    log.close()
    lines = (tmp_path / "log.txt").read_text(encoding="utf-8").splitlines()
    assert sum("Ego: message" in line and "of RSU is not used: it is too old" in line for line in lines) == RECEIVED


def test_expired_messages_are_in_report(late: RunResult, tmp_path: Path) -> None:
    page = html.fromstring(write_run_report([late.as_json()], tmp_path).read_text(encoding="utf-8"))
    (table,) = page.iterfind(".//table[@class='overview']")
    titles = [str(cell.xpath("string()")) for cell in table.iterfind("thead/tr/th")]
    cells = [str(cell.xpath("string()")) for cell in table.iterfind("tbody/tr/td")]
    assert cells[titles.index("messages expiredmean (range)")] == f"{RECEIVED:.2f}"
    timely = {**late.as_json(), "metrics": {**late.metrics, "messages.expired": 0.0}}
    page = html.fromstring(write_run_report([timely], tmp_path).read_text(encoding="utf-8"))
    assert "messages expired" not in str(page.xpath("string(//table[@class='overview'])"))


def test_expired_messages_are_in_store_of_sweep(tmp_path: Path) -> None:
    store, table = tmp_path / "s.db", tmp_path / "t.csv"
    sweep = ["sweep", "coop/scenario_1", "--channel", "{model: composed}", "--vary", "channel.delay.seconds=0,3"]
    done = CliRunner().invoke(app, [*sweep, "--time-limit", "4", "--workers", "1", "--store", str(store)])
    assert done.exit_code == 0
    assert CliRunner().invoke(app, ["results", str(store), "--csv", str(table)]).exit_code == 0
    with table.open(newline="", encoding="utf-8") as stream:
        expired = {row["vary.channel.delay.seconds"]: float(row["messages.expired"]) for row in csv.DictReader(stream)}
    assert expired == {"0": 0.0, "3": RECEIVED}


def test_expired_messages_of_own_perception_count_for_the_own_link() -> None:
    channel = "{model: composed, delay: {kind: constant, seconds: 3}, own_perception: true}"
    links = run_file("coop/scenario_1", settings=RunSettings(channel=channel, time_limit=4.0)).links
    assert links["Ego", "Ego"].expired == links["Ego", "Ego"].received == RECEIVED


@pytest.mark.parametrize(("expired", "count"), [(0, 0), (10, 0), (11, 1), (100, 1)])
def test_expired_messages_above_a_tenth_of_a_link_are_a_warning(expired: int, count: int) -> None:
    assert len(texts({("A", "B"): replace(LINK, expired=expired)})) == count


def test_warning_about_expired_messages_is_one_per_receiver() -> None:
    links = {(sender, receiver): replace(LINK, expired=50) for sender in "ABC" for receiver in "YZ"}
    words = "does not use 50 of 100 received messages of 'A', and messages of 2 more stations: they are too old"
    first, second = texts({**links, ("D", "Z"): LINK})
    assert first.startswith(f"station 'Y' {words}")
    assert second.startswith(f"station 'Z' {words}")


def test_link_without_receptions_has_no_warning() -> None:
    assert texts({("A", "B"): LinkStatistics(3, 0, 3, 0, 100, None, None, None, None, None)}) == []
    assert texts({}) == []


@pytest.mark.statistical
@pytest.mark.parametrize("latency", [1.25, 1.5, 1.65])
def test_success_over_latency_ends_where_the_planner_expects_to_pass_first(latency: float) -> None:
    """At 4 s, the braking distance before the crossing, the planner gives way to a car that it expects before 6.1 s.

    That car needs 33.05 m to the crossing, accelerates with 3.5 m/s² and is known as it was before the latency. The
    estimate of its acceleration follows with 0.7 s, and the predicted one decreases with 1.5 s.
    """
    moving, ahead = 4.0 - latency, 6.1 - 4.0
    acceleration = 3.5 * (1.0 - math.exp(-moving / 0.7))
    gained = 1.5 * acceleration * (ahead - 1.5 * (1.0 - math.exp(-ahead / 1.5)))
    reaches = 0.5 * 3.5 * moving**2 + 3.5 * moving * ahead + gained > 33.05
    channel = f"{{model: composed, delay: {{kind: constant, seconds: {latency}}}}}"
    settings = RunSettings(channel=channel, parameters={"Planner": "behavior"})
    result = run_file("coop/scenario_1", seed=1, settings=settings)
    assert result.passed is reaches
    assert result.metrics["messages.expired"] == 0.0
