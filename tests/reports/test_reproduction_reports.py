"""Reports of the reproduction of the paper, from episodes with known values."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from eidrive_reports.paper import ARMS, COUNTS, RATIOS, TABLE_2, TABLE_3
from eidrive_reports.reproduction import detection, sensitivity, table_2, table_3
from eidrive_reports.reproduction.drives import EI, PIPELINE
from eidrive_reports.reproduction.encounters import CENTER, COLLISIONS, GAP, TIME_TO_COLLISION
from eidrive_reports.reproduction.episodes import Episode, EpisodeJob, run_episode
from eidrive_reports.reproduction.part import Part
from eidrive_reports.reproduction.parts import PARTS
from known_episodes import episode

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.extensions.library import scenarios

# Table II


def published_episodes() -> list[Episode]:
    """Return the paper's five episodes of each cell, under each planner and rule for the channel."""
    found = []
    for case in table_2.cases(table_2.DETECTORS):
        detector, _, channel = case.arm.split()
        arm = next(arm for arm in ARMS if channel in (arm.links, arm.own))
        for seed, center in enumerate(TABLE_2[case.scenario, detector, arm.name].episodes, 1):
            hit = float(center < 3.4)
            more = {"collision.count": hit, **({"collision.impact_speed": 10.0} if hit else {})}
            found.append(episode(case.scenario, case.arm, seed, center=center, box=max(0.0, center - 3.4), **more))
    return found


def test_table_2_of_the_papers_episodes_agrees_with_the_paper() -> None:
    """The orders that the facts list: cooperation > none and > latency 4 of 4, latency < none 3, error < none 1."""
    report = table_2.report(published_episodes(), table_2.DETECTORS)
    data = report.data()
    counts = {
        str(row["statement"]): (row["holds"], row["paper"])
        for row in data["table2_summary"]
        if (row["planner"], row["channel"]) == ("conflict_area", "links")
    }
    assert counts == {
        "cooperation > none": (4, 4),
        "cooperation > latency": (4, 4),
        "sd of error > cooperation": (4, 4),
        "none > latency": (3, 3),
        "none > error": (1, 1),
    }
    assert all(abs(float(row["difference"] or 0.0)) < 0.01 for row in data["table2"]), "truncated means differ by 0.009"
    text = report.markdown()
    assert "40 of 40 comparisons have the sign of the paper" in text
    assert text.count("Likely reason") == 1
    assert "Here the least distance of a run with a crash is 1.82 m." in text


def test_table_2_of_equal_arms_departs_from_the_paper() -> None:
    """Episodes of 4 m in all arms: no order holds, and the mean absolute difference follows from the paper's means."""
    cases = table_2.cases(("oracle",))
    same = [episode(case.scenario, case.arm, seed, center=4.0, box=0.6) for case in cases for seed in (1, 2)]
    report = table_2.report(same, ("oracle",))
    assert {row["holds"] for row in report.data()["table2_summary"]} == {0}
    oracle = [published.mean for (_, detector, _), published in TABLE_2.items() if detector == "oracle"]
    expected = sum(abs(4.0 - mean) for mean in oracle) / len(oracle)
    text = report.markdown()
    assert f"`conflict_area`, `links`: {expected:.2f} m from the 8 means of the paper" in text
    assert "Likely reason (none > latency)" in text
    assert "none 0 of 4, cooperation 0 of 4" in text


def test_episode_without_metric_is_an_error() -> None:
    runs = [episode(case.scenario, case.arm) for case in table_2.cases(("oracle",))]
    with pytest.raises(SimulationError, match=r"metric min_distance\.Ego\.Incoming\.center is missing"):
        table_2.report(runs, ("oracle",))


@pytest.mark.exhaustive
@pytest.mark.parametrize("arm", ["oracle conflict_area ideal", "oracle behavior latency_300ms"])
def test_table_2_measures_nothing_after_the_end_of_an_episode(arm: str) -> None:
    """The same run without the time limit, to the goal of the ego, has the same distances and collisions."""
    case = next(case for case in table_2.cases(("oracle",)) if (case.scenario, case.arm) == ("coop/scenario_2", arm))
    cut, whole = (
        run_episode(EpisodeJob(case.scenario, case.arm, 1, settings))
        for settings in (case.settings, dataclasses.replace(case.settings, time_limit=60.0))
    )
    assert cut.simulated_s == pytest.approx(5.5)
    assert whole.simulated_s > 10.0
    for name in (CENTER, GAP, COLLISIONS, TIME_TO_COLLISION):
        assert cut.metrics[name] == whole.metrics[name]
    assert whole.metrics[CENTER.replace("center", "time")] < 5.0


# Table III


def episodes_of_rates(rates: dict[tuple[str, str], float], count: int) -> list[Episode]:
    found = []
    for case in table_3.cases(("oracle",)):
        free = round(count * rates[case.scenario, case.arm.split()[1]])
        found += [
            episode(case.scenario, case.arm, seed, center=3.0, box=1.0, **_hit(seed > free))
            for seed in range(1, count + 1)
        ]
    return found


def _hit(hit: bool) -> dict[str, float]:
    return {"collision.count": 1.0, "collision.impact_speed": 3.0} if hit else {"collision.count": 0.0}


def test_table_3_of_the_papers_rates_agrees_with_the_paper() -> None:
    rates = {key: value.rate for key, value in TABLE_3.items()}
    text = table_3.report(episodes_of_rates(rates, 40), ("oracle",)).markdown()
    assert "12 of 12 rates are within 10 points of the paper's, or have it in their interval. both >= rsu in 4" in text
    assert "rsu > vehicle in 4 of 4 scenarios" in text


def test_table_3_states_start_and_variation_of_the_bus() -> None:
    """Values of the scenario files. With rates of 20 % and 50 %, 32 and 20 of 40 runs end in a collision."""
    alone = {("coop/scenario_5", "vehicle"): 0.2, ("coop/scenario_6", "vehicle"): 0.5}
    rates = dict.fromkeys(TABLE_3, 1.0) | alone
    text = table_3.report(episodes_of_rates(rates, 40), ("oracle",)).markdown()
    assert "scenario 5 -36 m, -3 to +3 m; scenario 6 -33.8 m, -5 to +5 m; scenario 7 -24.8 m, -3 to +3 m" in text
    assert "32 of 40 (scenario_5, oracle) and 20 of 40 (scenario_6, oracle) runs end in a collision" in text
    assert "about half" not in text


def test_table_3_of_no_collisions_has_intervals_of_the_differences() -> None:
    """Equal verdicts of 40 pairs: the score interval ends at z² / (n + z²) = 8.8 % on each side, not at 0."""
    report = table_3.report(episodes_of_rates(dict.fromkeys(TABLE_3, 1.0), 40), ("oracle",))
    limits = [(row["low"], row["high"]) for row in report.data()["table3_comparisons"]]
    assert len(limits) == 8
    assert all(pair == pytest.approx((-0.0876, 0.0876), abs=1e-4) for pair in limits)


def test_reports_of_one_episode_have_no_intervals_of_means() -> None:
    """A dash stands in their cells, and figures show the values without bars."""
    single = table_3.report(episodes_of_rates(dict.fromkeys(TABLE_3, 1.0), 1), ("oracle",))
    assert {(row["low"], row["high"]) for row in single.data()["table3"]} == {(None, None)}
    assert "| 3.00 ± 0.00 | - |" in single.markdown()


def test_table_3_of_equal_rates_departs_from_the_paper() -> None:
    """All runs without a collision: 40 of 40 has the Wilson interval 0.91 to 1, which excludes five of the rates."""
    report = table_3.report(episodes_of_rates(dict.fromkeys(TABLE_3, 1.0), 40), ("oracle",))
    apart = {(row["scenario"], row["senders"]) for row in report.data()["table3"] if not row["agrees"]}
    assert apart == {key for key, value in TABLE_3.items() if value.rate < 0.9}
    assert "rsu > vehicle in 0 of 4 scenarios" in report.markdown()


# Counts


def counted_episodes(counts: dict[tuple[str, str, str], tuple[int, ...]]) -> list[Episode]:
    found = []
    for case in detection.cases(detection.DETECTORS):
        detector, arm = case.arm.split()
        metrics, known = {"detection_count.Ego.mean": 1.0}, counts[case.scenario, detector, arm]
        found.append(Episode(case.scenario, case.arm, 1, "", "", 12.0, 0.5, metrics, counts=known))
    return found


def test_detection_of_the_papers_counts_has_its_ratios() -> None:
    """Counts whose means over ten steps are the paper's, such as 9 and 10 for 9.1, for 401 time steps."""
    counts = {}
    for key, published in COUNTS.items():
        tenths = round(10 * published.mean)
        counts[key] = tuple(tenths // 10 + (step % 10 < tenths % 10) for step in range(401))
    report = detection.report(counted_episodes(counts), detection.DETECTORS)
    for row in report.data()["detection_ratios"]:
        assert row["ratio"] == pytest.approx(RATIOS[str(row["scenario"]), str(row["detector"])], abs=0.02)
        assert (row["low"], row["high"]) == (None, None), "a single episode"
    assert {row["mean"] == pytest.approx(row["paper_mean"]) for row in report.data()["detection"]} == {True}
    text = report.markdown()
    assert "Cooperation finds more objects in 4 of 4 panels" in text
    assert "`oracle`: with the roadside units the ego knows +0.3 objects more than with the vehicle" in text
    assert "below" not in text
    assert len(report.data()["detection_series"]) == 8 * 400


def test_detection_without_any_object_has_no_ratio() -> None:
    report = detection.report(counted_episodes(dict.fromkeys(COUNTS, (0,) * 400)), detection.DETECTORS)
    assert {row["ratio"] for row in report.data()["detection_ratios"]} == {None}
    assert "in 0 of 4 panels" in report.markdown()


def test_moving_average_is_mean_of_the_window_and_shorter_at_the_start() -> None:
    counts = np.array([[0.0, 2.0, 4.0, 6.0], [1.0, 1.0, 1.0, 1.0]])
    assert detection.moving_average(counts, 2).tolist() == [[0.0, 1.0, 3.0, 5.0], [1.0, 1.0, 1.0, 1.0]]


def test_counts_of_a_run_have_400_time_steps() -> None:
    """Scenario 3 with the oracle: the criterion counts the same vehicles, as the oracle has no duplicates."""
    job = next(job for job in PARTS["detection"].jobs(1, ("oracle",)) if job.arm == "oracle cooperation")
    one = run_episode(job)
    assert detection.counts_of([one]).shape == (1, 400)
    assert np.mean(one.counts) == pytest.approx(one.metrics["detection_count.Ego.mean"])


# Drives


def drives(part: Part, failing: dict[str, str]) -> list[Episode]:
    """Return two episodes of each case; both fail a criterion in the arms of `failing`."""
    found = []
    for case in part.cases(part.detectors):
        name = failing.get(case.arm.split()[-1], "")
        hit = {"collision.count": float(name == "collision"), "min_distance.Ego.Lead.box": 1.5}
        failed = (name,) if name else ()
        found += [Episode(case.scenario, case.arm, seed, "", "", 20.0 * seed, 0.5, hit, failed) for seed in (1, 2)]
    return found


def test_pipeline_states_completed_runs_and_failed_criteria() -> None:
    """Four scenarios with the oracle, two with each other detector; the mean of 20 and 40 s is 30 s."""
    report = PIPELINE.report(drives(PIPELINE, {"ssd": "reach_position"}), PIPELINE.detectors)
    rows = report.data()["pipeline"]
    assert [(row["detector"], row["passed"], row["failed"]) for row in rows[:3]] == [
        ("oracle", 2, ""),
        ("yolov5", 2, ""),
        ("ssd", 0, "reach_position 2"),
    ]
    assert {(row["duration"], row["gap"]) for row in rows} == {(30.0, 1.5), (None, 1.5)}
    text = report.markdown()
    assert "12 of 16 runs complete the task" in text
    assert "pipeline/scenario_2 ssd (2 runs: reach_position 2)." in text


def test_ei_compares_the_lane_follower_with_the_statement_of_the_paper() -> None:
    text = EI.report(drives(EI, {"route": "collision"}), EI.detectors).markdown()
    assert "The lane follower has a collision in every run of 17 of 17 scenarios (paper: in all)." in text
    assert "`behavior` completes 34 of 34 drives. Scenarios with other runs: none." in text
    other = EI.report(drives(EI, {"behavior": "reach_position"}), EI.detectors).markdown()
    assert "in every run of 0 of 17 scenarios" in other
    assert "`behavior` completes 0 of 34 drives. Scenarios with other runs: ei/scenario_01 (2 runs" in other


@pytest.mark.parametrize("part", [PIPELINE, EI], ids=lambda part: part.name)
def test_scenarios_of_drives_are_those_of_the_library(part: Part) -> None:
    family = part.name
    named = {case.scenario for case in part.cases(part.detectors)}
    assert named == {name for name in scenarios() if name.startswith(f"{family}/")}


# Sensitivity


def sensitivity_episodes() -> list[Episode]:
    """Return two episodes of each case, whose collisions follow a known rule.

    On the maps none collides from 9 m/s on, cooperation never, an arm with latency or error below 8 m/s; on the curve
    all runs from 0.3 s on.
    """
    found = []
    for case in sensitivity.cases(("oracle",)):
        _, _, kind, *place = case.arm.split(maxsplit=5)
        if kind == "map":
            speed, arm = float(place[1]), place[2]
            hit = {"none": speed >= 9.0, "cooperation": False}.get(arm, speed < 8.0)
        else:
            hit = float(place[0]) >= 0.3
        found += [episode(case.scenario, case.arm, seed, **_hit(hit)) for seed in (1, 2)]
    return found


def test_sensitivity_counts_cells_in_which_messages_help_or_harm() -> None:
    """Of 7 speeds, 4 are from 9 m/s on and 2 below 8 m/s; each has 7 starts."""
    report = sensitivity.report(sensitivity_episodes(), ("oracle",))
    effects = {(row["planner"], row["scenario"], row["arm"]): row for row in report.data()["sensitivity_effects"]}
    assert len(effects) == 2 * 2 * 6
    for (_, _, arm), row in effects.items():
        counts = (row["helps"], row["nothing"], row["harms"], row["collisions"])
        expected = {"none": (0, 49, 0, 56), "cooperation": (28, 21, 0, 0)}.get(str(arm), (28, 7, 14, 28))
        assert counts == expected
    text = report.markdown()
    assert "the largest step is from 0% at 0.25 s to 100% at 0.3 s" in text
    assert "scenario 1, start of EI-Drive: none 0, cooperation 0, latency 0.1 s 0" in text
    assert "of 2 at 39 m and 8 m/s" in text
    assert "of 2 at 30 m and 8 m/s" in text


def test_sensitivity_seeds_vary_within_limits_and_equally_in_all_cells() -> None:
    drawn = [sensitivity.offsets(seed) for seed in range(1, 201)]
    for name, bound in sensitivity.OFFSETS.items():
        values = [float(one[name]) for one in drawn]
        assert -bound <= min(values) < -0.9 * bound < 0.9 * bound < max(values) <= bound
    jobs = [job for job in sensitivity.PART.jobs(1, ("oracle",)) if " map " in job.arm]
    assert {tuple(job.settings.parameters[name] for name in sensitivity.OFFSETS) for job in jobs} == {
        tuple(sensitivity.offsets(1).values())
    }
    curve = [job for job in sensitivity.PART.jobs(1, ("oracle",)) if " curve 0.3 " in job.arm]
    drawn_on_curve = {job.settings.parameters["EgoOffset"] for job in curve}
    assert len(drawn_on_curve) == sensitivity.CURVE_SEEDS
