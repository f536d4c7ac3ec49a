"""Table of the paper from given results: cells, checks of the order, sentence, terminal output."""

from __future__ import annotations

import dataclasses
import io

import pytest
from eidrive_reports.demo_page import render
from eidrive_reports.paper import (
    ARMS,
    LINKS,
    OWN,
    SCENARIOS,
    TABLE_2,
    Table,
    difference,
    evaluate_claims,
    run_settings,
    tabulate,
)
from rich.console import Console

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.repetitions import Job, jobs_of
from eidrive_scenario.experiments.statistics.intervals import summarize
from eidrive_scenario.simulation import RunResult, RunSettings

DETECTORS = ("oracle", "yolov5")


def result(scenario: str, seed: int, center: float, box: float) -> RunResult:
    return RunResult(
        scenario=scenario,
        seed=seed,
        channel="ideal",
        passed=box > 0,
        end_reason="stop trigger",
        exit_code=0 if box > 0 else 1,
        criteria=(),
        metrics={
            "min_distance.Ego.Incoming.center": center,
            "min_distance.Ego.Incoming.box": box,
            "collision.count": float(box == 0),
        },
        trace_hash="",
        simulated_s=15.0,
        wall_s=0.5,
    )


def episodes(shift_of_own: float = 0.0) -> list[tuple[Job, RunResult]]:
    """Return the published episodes as results of runs, with a body distance of center - 3.4 m."""
    runs = []
    for (scenario, detector, name), published in TABLE_2.items():
        if detector != "oracle":
            continue
        arm = next(arm for arm in ARMS if arm.name == name)
        for channel, shift in {arm.own: shift_of_own, arm.links: 0.0}.items():
            for seed, episode in enumerate(published.episodes):
                center = episode + shift
                job = Job(scenario, channel, seed, RunSettings(channel=channel))
                runs.append((job, result(scenario, seed, center, max(0.0, center - 3.4))))
    return runs


@pytest.fixture(scope="module")
def table() -> Table:
    return tabulate(episodes(), LINKS)


@pytest.mark.parametrize("key", TABLE_2)
def test_published_episodes_have_published_mean_and_sd(key: tuple[str, str, str]) -> None:
    """Two published means are truncated instead of rounded: 4.3258 m is printed as 4.32, and 3.9188 m as 3.91."""
    published = TABLE_2[key]
    summary = summarize(published.episodes)
    assert round(summary.population_sd, 2) == published.sd
    truncated = {("coop/scenario_2", "oracle", "error"): 4.33, ("coop/scenario_2", "yolov5", "none"): 3.92}
    printed = truncated.get(key, published.mean)
    assert round(summary.mean, 2) == printed


def test_published_cells_cover_all_scenarios_and_arms() -> None:
    cells = {(scenario, detector, arm.name) for scenario in SCENARIOS for detector in DETECTORS for arm in ARMS}
    assert set(TABLE_2) == cells


def test_run_settings_share_no_cooperation_between_variants() -> None:
    settings = run_settings()
    assert len(settings) == 7
    assert len({id(arm) for arm in ARMS if arm.links == arm.own}) == 1
    assert all(setting.channel == name for name, setting in settings.items())


def test_jobs_of_arms_are_ordered_by_seed() -> None:
    jobs = jobs_of("coop/scenario_1", {"a": RunSettings(), "b": RunSettings()}, [3, 4])
    assert [(job.seed, job.arm) for job in jobs] == [(3, "a"), (3, "b"), (4, "a"), (4, "b")]


def test_cell_counts_collision_free_runs(table: Table) -> None:
    cell = table.cell("coop/scenario_1", "error")
    assert (cell.collision_free.successes, cell.collision_free.trials) == (3, 5)
    assert cell.center.smallest == 1.8226
    assert cell.box.smallest == 0.0


def test_tabulate_does_not_depend_on_order_of_runs(table: Table) -> None:
    assert tabulate(episodes()[::-1], LINKS).cell("coop/scenario_2", "error") == table.cell("coop/scenario_2", "error")


def test_tabulate_of_run_without_metric_raises_error() -> None:
    (job, run), *rest = episodes()
    bare = dataclasses.replace(run, metrics={"collision.count": 0.0})
    with pytest.raises(
        SimulationError, match=r"scenario_1, seed 0: metric min_distance\.Ego\.Incoming\.center is missing"
    ):
        tabulate([(job, bare), *rest], LINKS)


def test_evaluate_claims_of_published_episodes_confirms_order(table: Table) -> None:
    found = evaluate_claims(table)
    assert len(found) == 6
    assert all(check.holds for check in found)
    assert "cooperation 3.98 m, none 3.26 m; difference per seed +0.72 m" in found[0].evidence


def test_evaluate_claims_of_reversed_order_rejects_claims() -> None:
    runs = [(job, result(job.scenario, job.seed, 2.0, 0.0) if job.arm == "ideal" else run) for job, run in episodes()]
    verdicts = {
        check.statement: check.holds for check in evaluate_claims(tabulate(runs, LINKS)) if check.scenario[-1] == "1"
    }
    assert verdicts["cooperation > none"] is False
    assert verdicts["latency < cooperation"] is False


def test_difference_of_variants_states_changed_arms() -> None:
    """Latency minus none in scenario 1: -0.756 m with a standard deviation of 0.812 m, so ±1.008 m by t (scipy.stats).

    Scenario 2: -0.404 ± 0.024 m. A shift by -1 m leaves both intervals below zero.
    """
    runs = episodes(shift_of_own=-1.0)
    text = difference(tabulate(runs, LINKS), tabulate(runs, OWN))
    assert "scenario 1 latency 0.3 s 2.50 → 1.50 m, collision-free 0 → 0 of 5" in text
    assert "scenario 2 error 30 % 4.33 → 3.33 m, collision-free 5 → 4 of 5" in text
    assert "worse than no cooperation in 2 of 2 scenarios with this variant, and in 1 of 2 with" in text


def test_difference_of_equal_variants_states_no_change() -> None:
    runs = episodes()
    text = difference(tabulate(runs, LINKS), tabulate(runs, OWN))
    assert "changes nothing (means by 0.00 m at most)" in text


def test_render_fits_80_columns_with_published_values(table: Table) -> None:
    out = io.StringIO()
    Console(file=out, width=80).print(render(table, evaluate_claims(table)))
    text = out.getvalue()
    assert "…" not in text
    assert max(len(line) for line in text.splitlines()) <= 80
    row = next(line for line in text.splitlines() if line.startswith("error 30 %"))
    assert row.split() == [
        *("error", "30", "%", "3.15", "±", "1.07", "1.82", "0.38", "0.00", "3/5", "0.23-0.88", "3.15", "±", "1.07")
    ]
    assert text.count("holds: ") == 6
