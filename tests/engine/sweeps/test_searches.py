"""Searches with runs of a function instead of a simulation: boundary and failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.cli.sweep_search import Search
from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, Point, parse_axes
from eidrive_scenario.experiments.sweeps.jobs import SweepJob, SweepPlan, plan_of
from eidrive_scenario.experiments.sweeps.searches import Execute, falsify, find_boundary, most_different
from eidrive_scenario.experiments.sweeps.store import StoredRun
from eidrive_scenario.simulation import RunSettings

needs_optuna = pytest.mark.skipif(find_spec("optuna") is None, reason="optuna is not installed")
SPACE = (Axis("Speed", low=0.0, high=40.0), Axis("kind", ("a", "b")))


def executed(result_of: Callable[[SweepJob], dict[str, Any]], called: list[SweepJob] | None = None) -> Execute:
    """Return a function that evaluates jobs; a result with `error` is an aborted run."""

    def execute(jobs: Sequence[SweepJob]) -> list[StoredRun]:
        if called is not None:
            called.extend(jobs)
        return [_row(job, result_of(job)) for job in jobs]

    return execute


def _row(job: SweepJob, result: dict[str, Any]) -> StoredRun:
    status = "aborted" if "error" in result else "passed" if result["passed"] else "failed"
    point = dict(job.point)
    return StoredRun(job.key, job.number, "s", None, job.seed, status, point, result, result.get("error", ""), "c", 0.1)


@pytest.fixture
def plan(scenario: Path) -> SweepPlan:
    return plan_of(scenario, [{}], RunSettings())


def test_find_boundary_ends_at_tolerance_and_varies_seeds(plan: SweepPlan) -> None:
    called: list[SweepJob] = []
    execute = executed(lambda job: {"passed": float(job.point["Speed"]) < 23.0}, called)
    found = find_boundary(plan, SPACE[0], execute, bound=0.5, tolerance=1.0, runs=400)
    assert found.value == pytest.approx(23.0, abs=1.0)
    assert found.high - found.low <= 2.0
    assert found.runs == len(called) < 100
    assert [job.seed for job in called] == list(range(1, len(called) + 1))
    assert len({job.key for job in called}) == len(called)


def test_find_boundary_is_independent_of_interruptions(plan: SweepPlan) -> None:
    """The proposals follow from the outcomes alone, so that a repeated search finds all its runs in the store."""
    calls: list[list[SweepJob]] = [[], []]
    for called in calls:
        execute = executed(lambda job: {"passed": float(job.point["Speed"]) < 23.0}, called)
        find_boundary(plan, SPACE[0], execute, bound=0.5, tolerance=1.0, runs=80)
    assert [job.key for job in calls[0]] == [job.key for job in calls[1]]


def test_find_boundary_ignores_aborted_runs(plan: SweepPlan) -> None:
    """Every third run is aborted."""
    execute = executed(
        lambda job: {"error": "broken"} if job.number % 3 == 0 else {"passed": float(job.point["Speed"]) > 12.0}
    )
    found = find_boundary(plan, SPACE[0], execute, bound=0.5, tolerance=1.0, runs=200)
    assert found.value == pytest.approx(12.0, abs=1.0)
    assert found.rising > 0.9


def test_find_boundary_without_any_verdict_raises(plan: SweepPlan) -> None:
    execute = executed(lambda job: {"error": "no detector"})
    with pytest.raises(SettingError, match="no detector"):
        find_boundary(plan, SPACE[0], execute, bound=0.5, tolerance=1.0, runs=80)


@needs_optuna
def test_falsify_without_any_verdict_raises(plan: SweepPlan) -> None:
    with pytest.raises(SettingError, match="no detector"):
        falsify(plan, SPACE, executed(lambda job: {"error": "no detector"}), runs=20)


@needs_optuna
def test_falsify_finds_rare_failures(plan: SweepPlan) -> None:
    """Failures fill 2 % of the space; the margin of a criterion leads to them, random runs find one or two in 80."""

    def result(job: SweepJob) -> dict[str, Any]:
        gap = abs(float(job.point["Speed"]) - 31.0) + (0.0 if job.point["kind"] == "b" else 3.0)
        return {"passed": gap >= 0.8, "gap.passed": gap >= 0.8, "gap.value": gap, "gap.limit": 0.8}

    found = falsify(plan, SPACE, executed(result), runs=80)
    assert found.runs == 80
    assert found.failed >= 5
    assert all(run.point["kind"] == "b" and abs(run.point["Speed"] - 31.0) < 0.8 for run in found.failures)


@needs_optuna
def test_falsify_with_objective_minimizes_metric(plan: SweepPlan) -> None:
    """No run fails; the run with the least value of the metric is near the minimum."""
    execute = executed(lambda job: {"passed": True, "distance": abs(float(job.point["Speed"]) - 7.0)})
    found = falsify(plan, SPACE[:1], execute, runs=64, objective="distance")
    assert found.failed == 0
    assert found.least is not None
    assert found.least.result["distance"] < 1.0


@needs_optuna
def test_falsify_with_unknown_objective_names_known_ones(plan: SweepPlan) -> None:
    execute = executed(lambda job: {"passed": True, "distance": 1.0})
    with pytest.raises(SettingError, match="known: distance"):
        falsify(plan, SPACE, execute, runs=20, objective="distanz")


@needs_optuna
def test_falsify_counts_equal_runs_once(plan: SweepPlan) -> None:
    """The space has four combinations, two of which fail."""
    space = (Axis("Speed", (5, 30)), Axis("kind", ("a", "b")))
    found = falsify(plan, space, executed(lambda job: {"passed": float(job.point["Speed"]) < 20.0}), runs=40)
    assert (found.runs, found.failed) == (4, 2)
    assert len({run.key for run in found.failures}) == len(found.failures) == 2


def test_falsify_without_axes_raises(plan: SweepPlan) -> None:
    search = Search.of((), None, None, None, True, None, None)
    assert search is not None
    with pytest.raises(SettingError, match="without --vary"):
        search.check(plan)


def test_most_different_are_far_apart(plan: SweepPlan) -> None:
    """Of ten runs at one place and two elsewhere, three are chosen: one of each place."""
    points: list[Point] = [{"Speed": 1.0 + 0.01 * k, "kind": "a"} for k in range(10)]
    points += [{"Speed": 39.0, "kind": "a"}, {"Speed": 1.0, "kind": "b"}]
    runs = [_row(plan.job(k, point, 1), {"passed": False}) for k, point in enumerate(points)]
    chosen = most_different(runs, SPACE, 3)
    assert {(round(run.point["Speed"]), run.point["kind"]) for run in chosen} == {(1, "a"), (39, "a"), (1, "b")}
    assert most_different(runs[:2], SPACE, 3) == runs[:2]


def test_lists_of_one_value_are_no_space() -> None:
    axes = parse_axes(["kind=a", "Speed=1:2"])
    search = Search.of(axes, None, None, None, True, None, None)
    assert search is not None
    assert [axis.name for axis in search.space] == ["Speed"]
    assert [axis.name for axis in search.fixed] == ["kind"]


@needs_optuna
@pytest.mark.parametrize(
    ("other", "size"),
    [
        ({"goal.passed": True, "goal.value": 1.99, "goal.limit": 2.0, "goal.margin": 1.0}, 0.02),
        ({"collision.passed": True, "collision.value": 0.0, "collision.limit": 0.0}, 2.0),
        ({"speed.passed": True, "speed.value": 5.0, "speed.limit": math.inf}, 2.0),
        ({"goal.passed": True, "goal.value": 1.99, "goal.limit": 2.0, "goal.margin": 1.0}, 2.0),
        ({"seen.passed": True, "seen.value": 1.0, "seen.limit": 1.0, "seen.margin": 1.0}, 2.0),
        ({"off.passed": True, "off.value": 0.0, "off.limit": 0.5}, 2.0),
        ({"monitor.door.passed": 0.0}, 2.0),
    ],
    ids=[
        "reached",
        "without limit",
        "infinite limit",
        "reached without deadline",
        "monitor",
        "nothing of the allowed",
        "metric",
    ],
)
def test_falsify_follows_the_margin_that_varies(plan: SweepPlan, other: dict[str, Any], size: float) -> None:
    """The gap is least at the speed 31, without a failure. A run that ends on arrival is near the tolerance."""

    def result_of(job: SweepJob) -> dict[str, Any]:
        gap = 1.01 + size * abs(float(job.point["Speed"]) - 31.0)
        return {"passed": True, **other, "gap.passed": True, "gap.value": gap, "gap.limit": 1.0}

    found = falsify(plan, SPACE[:1], executed(result_of), runs=40)
    assert found.least is not None
    assert float(found.least.point["Speed"]) == pytest.approx(31.0, abs=2.0)
