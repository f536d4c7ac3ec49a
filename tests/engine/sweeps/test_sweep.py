"""Sweeps: plans, rows of all outcomes, continuation, killed workers and killed sweeps."""

from __future__ import annotations

import importlib
import re
import signal
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from sweep_workers import InProcess

from eidrive_scenario.base.content_digest import package_versions
from eidrive_scenario.errors import ConstraintError, InputError, SettingError
from eidrive_scenario.experiments.sweeps.axes import Point, parse_axes, points_of
from eidrive_scenario.experiments.sweeps.jobs import Shard, SweepPlan, plan_of
from eidrive_scenario.experiments.sweeps.results import summaries
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun
from eidrive_scenario.experiments.sweeps.sweep import SweepProgress, run_sweep
from eidrive_scenario.experiments.sweeps.workers import LocalWorkers
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.simulation import RunSettings, Simulation

SPEEDS: list[Point] = points_of(parse_axes(["Speed=10,30,50"]), "grid", None, 1)


def swept(plan: SweepPlan, store: Path, **options: Any) -> tuple[SweepProgress, list[StoredRun]]:
    with ResultStore.open(store, package_versions()) as opened:
        progress = run_sweep(Shard(plan), opened, InProcess(), **options)
        return progress, list(opened.runs())


def test_plan_orders_runs_by_seed_and_limits_them(scenario: Path) -> None:
    plan = plan_of(scenario, SPEEDS, RunSettings(), runs=7)
    assert [(job.number, job.seed, job.point["Speed"]) for job in plan] == [
        (0, 1, 10),
        (1, 1, 30),
        (2, 1, 50),
        (3, 2, 10),
        (4, 2, 30),
        (5, 2, 50),
        (6, 3, 10),
    ]
    assert len({job.key for job in plan}) == 7


def test_keys_depend_on_inputs_only(scenario: Path, tmp_path: Path) -> None:
    """Order and number of the runs do not change a key; content of the scenario, settings and seed do."""
    one = {(job.seed, job.point["Speed"]): job.key for job in plan_of(scenario, SPEEDS, RunSettings(), seeds=[1, 2])}
    reverse = plan_of(scenario, SPEEDS[::-1], RunSettings(), seeds=[2, 1])
    assert {(job.seed, job.point["Speed"]): job.key for job in reverse} == one
    for changed in (RunSettings(dt=0.1), RunSettings(criteria="{collision: {of: Ego}}")):
        assert not {job.key for job in plan_of(scenario, SPEEDS, changed, seeds=[1, 2])} & set(one.values())
    scenario.write_text(scenario.read_text().replace('value="0.5"', 'value="0.6"'))
    assert not {job.key for job in plan_of(scenario, SPEEDS, RunSettings(), seeds=[1, 2])} & set(one.values())


@pytest.mark.parametrize("setting", ["channel", "weather", "criteria", "drive", "axis"])
def test_keys_depend_on_the_content_of_setting_files(scenario: Path, setting: str) -> None:
    texts = {
        "channel": ("delay: {kind: constant, seconds: 0.1}", "delay: {kind: constant, seconds: 0.2}"),
        "weather": ("friction: 0.7", "friction: 0.6"),
        "criteria": ("max_speed: {of: Ego, at_most: 6}", "max_speed: {of: Ego, at_most: 7}"),
        "drive": ("target_speed: 5", "target_speed: 6"),
    }
    file = scenario.with_name("setting.yaml")
    points = [{"channel": str(file)}, {"channel": "none"}] if setting == "axis" else SPEEDS
    given: dict[str, Any] = (
        {} if setting == "axis" else {setting: {"Ego": str(file)} if setting == "drive" else str(file)}
    )
    keys = []
    for text in texts["channel" if setting == "axis" else setting]:
        file.write_text(text)
        first, second = ([job.key for job in plan_of(scenario, points, RunSettings(**given))] for _ in range(2))
        assert first == second
        keys.append(set(first))
    assert len(keys[0] & keys[1]) == (1 if setting == "axis" else 0)


def test_keys_depend_on_the_modules_of_extensions(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A criterion that the scenario declares; its module is part of the key, its resolved settings name it."""
    module = tmp_path / "gap_of_sweep.py"
    code = "from eidrive_criteria.max_speed import MaxSpeed\n\nclass Gap(MaxSpeed):\n    pass\n"
    module.write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    point = EntryPoint("gap_of_sweep", "gap_of_sweep:Gap", "eidrive_scenario.criteria")
    monkeypatch.setitem(registry("criteria")._points, point.name, point)
    scenario.write_text(scenario.read_text().replace("{max_speed:", "{gap_of_sweep:"))
    first = {job.key for job in plan_of(scenario, SPEEDS, RunSettings())}
    module.write_text(f"{code}# changed\n")
    assert not first & {job.key for job in plan_of(scenario, SPEEDS, RunSettings())}
    with Simulation(scenario) as simulation:
        assert "gap_of_sweep:Gap" in simulation.resolved.extensions["criteria.gap_of_sweep"]


def test_keys_depend_on_the_values_of_a_distribution(distribution: Path) -> None:
    plans = []
    for value in ("10", "11"):
        distribution.write_text(distribution.read_text().replace('value="10"', f'value="{value}"'))
        plans.append(plan_of(distribution, points_of((), "grid", None, 1), RunSettings(), is_distribution=True))
    assert not {job.key for job in plans[0]} & {job.key for job in plans[1]}


def test_shards_are_disjoint_and_complete(scenario: Path) -> None:
    plan = plan_of(scenario, SPEEDS, RunSettings(), runs=10)
    shards = [Shard(plan, number, 4) for number in (1, 2, 3, 4)]
    assert [len(shard) for shard in shards] == [len(list(shard)) for shard in shards] == [3, 3, 2, 2]
    assert sorted(job.number for shard in shards for job in shard) == list(range(10))


def test_sweep_stores_every_outcome_as_row(scenario: Path, tmp_path: Path) -> None:
    """Passed, failed by its criterion, and excluded by the constraint of the parameter."""
    progress, runs = swept(plan_of(scenario, SPEEDS, RunSettings()), tmp_path / "s.db")
    assert [(run.point["Speed"], run.status) for run in runs] == [(10, "passed"), (30, "failed"), (50, "excluded")]
    assert runs[0].result["max_speed.value"] == pytest.approx(10.0, abs=0.5)
    assert runs[0].result["parameter.Speed"] == 10
    assert '"versions"' in runs[0].settings
    assert "constraint" in runs[2].error
    assert runs[1].command == f"eidrive run {scenario} --param Speed=30 --seed 1"
    assert progress.is_complete
    assert progress.left == 0


def test_sweep_of_distribution_runs_all_its_values(distribution: Path, tmp_path: Path) -> None:
    plan = plan_of(distribution, points_of((), "grid", None, 1), RunSettings(), is_distribution=True, seeds=[1, 2])
    _, runs = swept(plan, tmp_path / "s.db")
    assert [(run.seed, run.run, run.status) for run in runs] == [
        (seed, run, status) for seed in (1, 2) for run, status in enumerate(("passed", "failed", "excluded"))
    ]


def test_run_of_distribution_without_verdict_has_scenario_parameters_and_command(
    distribution: Path, scenario: Path, tmp_path: Path
) -> None:
    """Constraints exclude the speed 50 of the last run."""
    _, runs = swept(plan_of(distribution, [{}], RunSettings(), is_distribution=True), tmp_path / "s.db")
    assert (runs[2].status, runs[2].scenario, runs[2].result) == ("excluded", runs[0].scenario, {"parameter.Speed": 50})
    assert runs[2].command == f"eidrive run {scenario} --param Speed=50 --seed 1"
    assert [row.point["Speed"] for row in summaries(runs)] == [10, 30, 50]


def test_sweep_continues_without_repetition(scenario: Path, tmp_path: Path) -> None:
    store = tmp_path / "s.db"
    first = plan_of(scenario, SPEEDS[:2], RunSettings())
    swept(first, store)
    longer = plan_of(scenario, SPEEDS, RunSettings(), seeds=[1, 2])
    progress, runs = swept(longer, store)
    assert (progress.kept, progress.done, len(runs)) == (2, 4, 6)
    _, alone = swept(longer, tmp_path / "other.db")
    strip = [(run.key, run.status, run.result.get("trace_hash")) for run in alone]
    assert sorted(strip) == sorted((run.key, run.status, run.result.get("trace_hash")) for run in runs)


def test_retry_repeats_aborted_runs_only(scenario: Path, tmp_path: Path) -> None:
    """A wall limit that no run meets aborts all; with `retry` they are repeated."""
    # Half a second could end before the thread of the limit starts.
    scenario.write_text(scenario.read_text().replace('value="0.5"', 'value="20"'))
    store = tmp_path / "s.db"
    plan = plan_of(scenario, SPEEDS, RunSettings())
    progress, runs = swept(plan, store, wall_limit=1e-4)
    assert [run.status for run in runs][:2] == ["aborted", "aborted"]
    assert not progress.is_complete
    assert all("wall" in run.error for run in runs if run.status == "aborted")
    assert swept(plan, store)[0].done == 0
    _, runs = swept(plan, store, retry=True)
    assert [run.status for run in runs] == ["passed", "failed", "excluded"]


def test_invalid_value_of_one_point_is_a_row(scenario: Path, tmp_path: Path) -> None:
    points = points_of(parse_axes(["Speed=10,fast"]), "grid", None, 1)
    progress, runs = swept(plan_of(scenario, points, RunSettings()), tmp_path / "s.db")
    assert [run.status for run in runs] == ["passed", "invalid"]
    assert "fast" in runs[1].error
    assert not progress.is_complete


def test_plan_of_which_the_first_runs_are_excluded_is_valid(scenario: Path, tmp_path: Path) -> None:
    """The constraint of the scenario excludes its default speed and the first one."""
    scenario.write_text(scenario.read_text().replace('value="5">', 'value="45">'))
    points = points_of(parse_axes(["Speed=50,10"]), "grid", None, 1)
    _, runs = swept(plan_of(scenario, points, RunSettings()), tmp_path / "s.db")
    assert [run.status for run in runs] == ["excluded", "passed"]
    with pytest.raises(ConstraintError):
        plan_of(scenario, points[:1], RunSettings())


def test_plan_with_an_impossible_later_point_raises(scenario: Path) -> None:
    points = points_of(parse_axes(["channel=ideal,none", "channel.delay.seconds=0.1"]), "grid", None, 1)
    with pytest.raises(SettingError, match="no channel"):
        plan_of(scenario, points, RunSettings())


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        ("detector=oracle,nope", "unknown detector 'nope'"),
        ("planner=route,behavior", "planner 'route' has no effect"),
        ("weather=nope", "no weather preset 'nope'"),
        ("channel=none,nope", "no channel profile 'nope'"),
        ("dt=0.05,0", "a tick of 0 s"),
        ("time_limit=-1,20", "time_limit is -1"),
    ],
)
def test_invalid_setting_of_a_later_point_raises(scenario: Path, axis: str, expected: str) -> None:
    points = points_of(parse_axes([axis, "Speed=10,30"]), "grid", None, 1)
    with pytest.raises(InputError, match=expected):
        plan_of(scenario, points, RunSettings())


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"runs": 9, "seeds": [1]}, "--runs is 9"),
        ({"seeds": [1, 1]}, "twice"),
        ({"seeds": [1, 2**63]}, "at most 2^63 - 1"),
        ({"seeds": []}, "0 runs"),
        ({"settings": RunSettings(channel="no such")}, "no such"),
        ({"settings": RunSettings(parameters={"Sped": "1"})}, "Sped"),
    ],
)
def test_invalid_plans_raise(scenario: Path, options: dict[str, Any], expected: str) -> None:
    settings = options.pop("settings", RunSettings())
    with pytest.raises(InputError, match=re.escape(expected)):
        plan_of(scenario, SPEEDS, settings, **options)


def test_killed_worker_is_a_row_and_others_are_unharmed(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker of one run is killed in each try; it is replaced, and all other runs have results."""
    monkeypatch.syspath_prepend(Path(__file__).parent)
    task = importlib.import_module("sweep_tasks").killed_at_30
    monkeypatch.setattr("eidrive_scenario.experiments.sweeps.sweep.execute", task)
    plan = plan_of(scenario, points_of(parse_axes(["Speed=8,10,12,30,14,16"]), "grid", None, 1), RunSettings())
    workers = LocalWorkers(2)
    try:
        with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
            progress = run_sweep(Shard(plan), store, workers)
            statuses = {run.point["Speed"]: run.status for run in store.runs()}
    finally:
        workers.close()
    assert statuses == {8: "passed", 10: "passed", 12: "passed", 30: "crashed", 14: "passed", 16: "passed"}
    assert not progress.is_complete


@pytest.mark.process
def test_killed_sweep_continues_to_the_same_results(scenario: Path, tmp_path: Path) -> None:
    """SIGKILL of the command at 4 and at 20 rows; then all rows are those of an uninterrupted sweep."""
    store = tmp_path / "s.db"
    arguments = ["sweep", str(scenario), "--store", str(store)]
    arguments += ["--vary", "Speed=1:20:1", "--seeds", "1-8", "--workers", "2"]
    for rows in (4, 20):
        killed = [sys.executable, str(Path(__file__).with_name("sweep_tasks.py")), str(rows), *arguments]
        code = subprocess.call(killed, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        assert code == -signal.SIGKILL
        assert _count(store) == rows
    command = [sys.executable, "-m", "eidrive_scenario", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    plan = plan_of(scenario, points_of(parse_axes(["Speed=1:20:1"]), "grid", None, 1), RunSettings(), seeds=range(1, 9))
    _, alone = swept(plan, tmp_path / "other.db")
    with ResultStore.read(store) as opened:
        runs = list(opened.runs())
    assert [(run.key, run.number, run.status, run.result["trace_hash"]) for run in runs] == [
        (run.key, run.number, run.status, run.result["trace_hash"]) for run in alone
    ]


def _count(store: Path) -> int:
    if not store.exists() or not store.stat().st_size:
        return 0
    with ResultStore.read(store) as opened:
        return len(opened.statuses())
