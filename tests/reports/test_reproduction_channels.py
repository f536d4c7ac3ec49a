"""Part `channels` of the reproduction: its report from known episodes, and scenarios with added stations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from eidrive_reports.reproduction import channels
from eidrive_reports.reproduction.channel_load import CLEAR, INNER, OUTER, places, with_load
from eidrive_reports.reproduction.episodes import Episode, EpisodeJob, run_episode
from eidrive_reports.reproduction.figures import channels_figure
from eidrive_reports.reproduction.part import Case
from eidrive_reports.reproduction.provenance import job_digest
from eidrive_reports.reproduction.reproduce import Record
from known_episodes import episode

from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.v2x.standards import ieee80211p_airtime

LINKS = {"age_of_information.mean": 0.1, "age_of_information.p95": 0.2, "packet_reception_ratio": 0.5}


def known_episodes(count: int = 2) -> list[Episode]:
    """Episodes of all arms: a collision without messages, from a latency of 0.4 s, and with bursty losses."""
    found = []
    for case in channels.cases(channels.DETECTORS):
        latency = case.arm.split("latency ")[1].split()[0] if "latency" in case.arm else "0"
        fault = "none" if "none" in case.arm else ""
        hit = bool(fault) or "bursty" in case.arm or float(latency) >= 0.4
        links = {} if fault == "none" else {**LINKS, "channel_busy_ratio.Ego": 0.3}
        values = {"collision.count": float(hit), **links}
        found += [episode(case.scenario, case.arm, seed, center=4.0, box=1.0, **values) for seed in range(count)]
    return found


def test_report_states_the_effects_of_latency_bursts_and_radio() -> None:
    report = channels.report(known_episodes(), channels.DETECTORS)
    rows = {(row["scenario"], row["planner"], row["fault"], row["value"]): row for row in report.data()["channels"]}
    assert rows["coop/scenario_5", "conflict_area", "none", None]["free"] == 0
    assert rows["coop/scenario_5", "conflict_area", "none", None]["reception"] is None
    assert rows["coop/scenario_1", "behavior", "latency", 0.3]["free"] == 4
    assert rows["coop/scenario_1", "behavior", "latency", 0.4]["free"] == 0
    text = report.markdown()
    assert text.count("the largest step is from 100% at 0.3 s to 0% at 0.4 s") == 3
    assert text.count("90% lost: 100% and 0%") == 3
    assert "100% with 50% received (100% with independent losses and 50%)" in text
    assert "from 2 to 200 stations the channel busy ratio rises from 30% to 30%" in text


def test_infinite_ages_have_no_value() -> None:
    """A run in which no message arrives has no finite age; the median of most such runs is infinite."""
    lost: dict[str, Any] = {"collision.count": 0.0, "packet_reception_ratio": 0.0}
    runs = [episode(seed=seed, center=4.0, box=1.0, **lost) for seed in (1, 2)]
    aged: dict[str, Any] = {**lost, "center": 4.0, "box": 1.0, "age_of_information.mean": 0.2}
    some = [*runs, *(episode(seed=seed, **aged) for seed in (3, 4, 5))]
    assert channels.outcome(runs)["age"] is None
    assert channels.outcome(some)["age"] == 0.2
    assert channels.outcome(some)["reception"] == 0.0


def test_infinite_ages_of_a_loaded_channel_are_a_gap_of_the_curve() -> None:
    lost = {"collision.count": 0.0, "packet_reception_ratio": 0.0, "channel_busy_ratio.Ego": 0.9}
    episodes = [
        episode(one.scenario, one.arm, one.seed, **lost) if one.arm.endswith(" 200") else one
        for one in known_episodes()
    ]
    report = channels.report(episodes, channels.DETECTORS)
    assert "the mean age of information from 0.100 s to infinity" in report.markdown()
    ages = channels_figure(report.data()).axes[-2].lines[0].get_ydata()
    assert np.asarray(ages) == pytest.approx([0.1, 0.1, 0.1, 0.1, np.nan], nan_ok=True)


def test_runs_of_one_arm_have_different_seeds() -> None:
    jobs = channels.PART.jobs(2, channels.DETECTORS)
    latency = [job for job in jobs if job.arm.startswith("oracle behavior latency 0.3 ")]
    assert sorted(job.seed for job in latency) == [1, 2, 1001, 1002]
    assert len(set(map(Record.key, jobs))) == len(jobs)


def test_added_stations_are_beside_the_roads_and_nested() -> None:
    many = places(198)
    assert places(23) == many[:23]
    for x, y in many:
        assert INNER <= math.hypot(x - 40.0, y) <= OUTER
        assert min(abs(x - 40.0), abs(y)) > CLEAR
    assert len(set(many)) == 198


def test_added_stations_occupy_the_channel_by_their_airtime() -> None:
    """30 stations send CAM of 300 bytes twice per second and of 190 bytes eight times, some of them at the same time.

    The roadside unit and the ego send CPMs of 121 + 35 (1 + objects) bytes at 20 Hz (Thandavarayan et al., 2019), with
    three and two objects.
    """
    path = resolve_scenario("coop/scenario_1")
    settings = RunSettings(
        channel=channels.loaded("802.11p"), criteria={"channel_busy_ratio": {"of": "Ego"}}, time_limit=3.0
    )
    result = run_file(with_load(path, 30), seed=1, settings=settings)
    small, large, first, second = (ieee80211p_airtime(size, 6.0, 1400) for size in (190, 300, 261, 226))
    expected = 30 * (8.0 * small + 2.0 * large) + 20.0 * (first + second)
    assert 0.95 * expected <= result.metrics["channel_busy_ratio.Ego"] <= expected


def test_load_is_part_of_job_and_digest() -> None:
    case = Case("coop/scenario_1", "some", RunSettings(channel=channels.loaded("802.11p"), time_limit=0.5), load=2)
    job = case.job(1)
    assert (job.load, job.digest) == (2, job_digest(case.scenario, case.settings, load=2))
    assert job.digest != job_digest(case.scenario, case.settings)
    alone = run_episode(EpisodeJob(case.scenario, "some", 1, case.settings))
    assert run_episode(job).trace_hash != alone.trace_hash


@pytest.mark.parametrize("name", ["pipeline/scenario_1", "ncap/crossing_car"])
def test_stations_can_be_added_to_other_scenarios(name: str) -> None:
    result = run_file(with_load(resolve_scenario(name), 3), settings=RunSettings(time_limit=0.3))
    assert result.simulated_s == pytest.approx(0.3, abs=0.06)
