"""Results of sweeps: summaries, exports, and the commands of the command line."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive
from msgspec.structs import replace

from eidrive_scenario.api.run import read_results
from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.statistics.intervals import anytime_interval, wilson
from eidrive_scenario.experiments.sweeps.results import stored_runs, summaries, write_parquet
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun

__all__ = ["eidrive"]


def run(number: int, status: str, **point: str | float) -> StoredRun:
    ended = status in ("passed", "failed")
    result = {"passed": status == "passed", "distance": 1.5 * number, "note": "=1+1"} if ended else {}
    return StoredRun(f"{number:064}", number, "s", None, number, status, dict(point), result, "", f"run {number}", 0.1)


RUNS = [
    run(0, "passed", Speed=5, detector="oracle"),
    run(1, "failed", Speed=5, detector="ssd"),
    run(2, "passed", Speed=5, detector="oracle"),
    run(3, "crashed", Speed=8, detector="oracle"),
]


@pytest.fixture
def store(tmp_path: Path) -> Path:
    path = tmp_path / "s.db"
    with ResultStore.open(path, {"numpy": "2"}) as opened:
        for one in RUNS:
            opened.add(one)
    return path


def test_summaries_group_by_all_or_some_axes() -> None:
    rows = summaries(RUNS)
    assert [(row.point["Speed"], row.point["detector"], row.counts) for row in rows] == [
        (5, "oracle", {"passed": 2}),
        (5, "ssd", {"failed": 1}),
        (8, "oracle", {"crashed": 1}),
    ]
    assert rows[2].rate is None
    first, second = summaries(RUNS, by=["Speed"], interval="wilson")
    assert first.counts == {"passed": 2, "failed": 1}
    assert first.rate == wilson(2, 3)
    assert second.counts == {"crashed": 1}
    assert summaries(RUNS, by=[])[0].rate == anytime_interval(2, 3)


def test_summaries_distinguish_scenarios_of_several_stores() -> None:
    other = replace(run(4, "failed", Speed=5, detector="ssd"), scenario="other")
    rows = summaries([*RUNS, other], by=["scenario", "detector"])
    assert [(row.point["scenario"], row.point["detector"], row.counts) for row in rows] == [
        ("s", "oracle", {"passed": 2, "crashed": 1}),
        ("s", "ssd", {"failed": 1}),
        ("other", "ssd", {"failed": 1}),
    ]
    assert len(summaries([*RUNS, other])) == 4


def test_summaries_are_sorted_by_value_whatever_the_order_of_the_runs() -> None:
    runs = [
        run(0, "passed", Speed=10, detector="ssd"),
        run(1, "passed", detector="oracle", Speed=10),
        run(2, "passed", Speed=9.5, detector="oracle"),
        run(3, "failed", detector="ssd", Speed=10),
    ]
    found = [(row.point["Speed"], row.point["detector"], row.counts) for row in summaries(runs)]
    assert found == [
        (9.5, "oracle", {"passed": 1}),
        (10, "ssd", {"passed": 1, "failed": 1}),
        (10, "oracle", {"passed": 1}),
    ]


@pytest.mark.parametrize(("options", "expected"), [({"by": ["Sped"]}, "Sped"), ({"interval": "normal"}, "normal")])
def test_summaries_with_unknown_names_raise(options: dict[str, object], expected: str) -> None:
    with pytest.raises(SettingError, match=expected):
        summaries(RUNS, **options)  # type: ignore[arg-type]


def test_read_results_has_one_row_per_run(store: Path) -> None:
    pytest.importorskip("pandas")
    table = read_results(store)
    assert len(table) == 4
    assert table["vary.Speed"].tolist() == [5, 5, 5, 8]
    assert table.loc[table["status"] == "passed", "distance"].tolist() == [0.0, 3.0]
    assert table.groupby("vary.detector")["passed"].sum().to_dict() == {"oracle": 2, "ssd": 0}


def test_parquet_keeps_numbers_and_missing_values(store: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    with ResultStore.read(store) as opened:
        write_parquet(opened.runs(), tmp_path / "r.parquet")
    columns = parquet.read_table(tmp_path / "r.parquet").to_pydict()
    assert columns["distance"] == [0.0, 1.5, 3.0, None]
    assert columns["vary.Speed"] == [5, 5, 5, 8]


def test_results_prints_table_and_exports(eidrive: Eidrive, store: Path, tmp_path: Path) -> None:
    done = eidrive("results", store, "--by", "detector", "--csv", tmp_path / "r.csv")
    assert done.exit_code == 0
    lines = [line.split() for line in done.stdout.splitlines()]
    assert lines[0][:5] == ["detector", "runs", "passed", "crashed", "failed"]
    assert lines[1][:6] == ["oracle", "3", "2", "1", "0", "100.0%"]
    with (tmp_path / "r.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["distance"] for row in rows] == ["0.0", "1.5", "3.0", ""]
    assert rows[0]["note"] == "'=1+1"


def test_results_as_json_and_failures(eidrive: Eidrive, store: Path) -> None:
    rows = [json.loads(line) for line in eidrive("results", store, "--json").stdout.splitlines()]
    assert rows[0]["point"] == {"Speed": 5, "detector": "oracle"}
    assert (rows[0]["success_rate"], rows[0]["runs"]) == (1.0, {"passed": 2})
    failures = eidrive("results", store, "--failures").stdout.splitlines()
    assert failures == ["failed: run 1", "crashed: run 3"]


def test_results_combine_stores(eidrive: Eidrive, store: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.db"
    with ResultStore.open(other, {"numpy": "2"}) as opened:
        opened.add(RUNS[0])
        opened.add(run(9, "passed", Speed=5, detector="ssd"))
    done = eidrive("results", store, other, "--by", "detector", "--json")
    counts = {row["point"]["detector"]: row["runs"] for row in map(json.loads, done.stdout.splitlines())}
    assert counts == {"oracle": {"passed": 2, "crashed": 1}, "ssd": {"failed": 1, "passed": 1}}


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("results", "no.db"), "no such store"),
        (("sweep", "{scenario}", "--store", "s.db", "--vary", "Speed"), "--vary"),
        (("sweep", "{scenario}", "--store", "s.db", "--vary", "Speed=1:2"), "interval in a grid"),
        (("sweep", "{scenario}", "--store", "s.db", "--seeds", "3-1"), "--seeds"),
        (("sweep", "{scenario}", "--store", "s.db", "--shard", "3/2"), "--shard"),
        (("sweep", "{scenario}", "--store", "s.db", "--find-boundary", "Speed=1,2"), "not an interval"),
        (("sweep", "{scenario}", "--store", "s.db", "--find-boundary", "Speed=2:1"), "--find-boundary: 'Speed=2:1'"),
        (("sweep", "{scenario}", "--store", "s.db", "--falsify"), "without --vary"),
        (("sweep", "{scenario}", "--store", "s.db", "--find-boundary", "Speed=1:2", "--seeds", "5"), "--seeds"),
        (
            ("sweep", "{scenario}", "--store", "s.db", "--find-boundary", "Speed=1:2", "--vary", "Speed=1"),
            "given twice",
        ),
        (("sweep", "{distribution}", "--store", "s.db", "--find-boundary", "time_limit=1:2"), "3 runs"),
        (("sweep", "{scenario}", "--store", "s.db", "--vary", "channel.delay.seconds=0,1"), "no channel"),
        (("sweep", "{scenario}", "--store", "s.db", "--vary", "Sped=1,2"), "did you mean 'Speed'"),
        (
            ("sweep", "{scenario}", "--store", "s.db", "--channel", "ideal", "--vary", "channel.delay.secs=1"),
            "did you mean 'seconds'",
        ),
        (("sweep", "no_such_scenario", "--store", "s.db"), "no_such_scenario"),
        (("sweep", "{scenario}", "--store", "{folder}"), "not a regular file"),
        (("sweep", "{scenario}"), "--store is missing"),
        (("sweep", "{scenario}", "--vary", "seed=1,2", "--dry-run"), "did you mean '--seeds'?"),
    ],
)
def test_invalid_commands_are_clear_errors(
    eidrive: Eidrive, distribution: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], expected: str
) -> None:
    folder = distribution.parent
    monkeypatch.chdir(folder)
    names = {"scenario": folder / "car.xosc", "distribution": distribution, "folder": folder}
    given = [one.format(**names) for one in arguments]
    done = eidrive(*given)
    assert done.exit_code == 2
    assert expected in done.stderr
    assert not Path("s.db").exists()


def test_sweep_command_runs_and_continues(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    runs = ("sweep", scenario, "--vary", "Speed=10,30")
    arguments = (*runs, "--store", tmp_path / "s.db", "--workers", "1")
    assert eidrive(*runs, "--dry-run").stdout.splitlines() == [
        f"2 runs of {scenario}: 2 combinations, 1 seed each",
        "  Speed=10",
        "  Speed=30",
    ]
    first = eidrive(*arguments)
    assert first.exit_code == 0
    assert "1 failed, 1 passed" in first.stdout
    assert "2 already in the store (1 failed, 1 passed)" in eidrive(*arguments).stdout


def test_results_of_a_distribution_by_its_parameters(eidrive: Eidrive, distribution: Path, tmp_path: Path) -> None:
    """Speeds 10, 30 and 50: below the limit of 20, above it, and excluded."""
    store = tmp_path / "s.db"
    assert eidrive("sweep", distribution, "--seeds", "1-2", "--store", store, "--workers", "1").exit_code == 0
    rows = [json.loads(line) for line in eidrive("results", store, "--by", "Speed", "--json").stdout.splitlines()]
    points = [{"Speed": 10}, {"Speed": 30}, {"Speed": 50}]
    assert [(row["point"], row["runs"]) for row in rows] == [
        (point, {status: 2}) for point, status in zip(points, ("passed", "failed", "excluded"), strict=True)
    ]
    assert eidrive("results", store).stdout.splitlines()[1].split()[:3] == ["0", "10", "2"]


def test_results_of_changed_inputs_are_a_warning(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    sweep = ("sweep", scenario, "--vary", "Speed=10,12", "--store", tmp_path / "s.db", "--workers", "1")
    assert eidrive(*sweep).exit_code == 0
    assert not eidrive("results", tmp_path / "s.db").stderr
    assert eidrive(*sweep, "--time-limit", "0.3").exit_code == 0
    assert "2 runs repeat other ones with other options" in eidrive("results", tmp_path / "s.db").stderr
    compared = eidrive("compare", tmp_path / "s.db", tmp_path / "s.db")
    assert compared.exit_code == 2
    assert "2 runs repeat other ones" in compared.stderr


def test_sweep_command_drives_entities_of_other_tools(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    """The key of a run depends on the content of the file of the stack."""
    stack = tmp_path / "stack.yaml"
    common = ("sweep", scenario, "--store", tmp_path / "s.db", "--workers", "1", "--user-value", "Mood=calm")
    assert eidrive(*common).exit_code == 0
    for speed in (5, 6):
        stack.write_text(f"target_speed: {speed}")
        assert eidrive(*common, "--drive", f"Ego={stack}").exit_code == 0
    with ResultStore.read(tmp_path / "s.db") as store:
        runs = list(store.runs())
    assert len(runs) == 3
    assert sorted(f"--drive Ego={stack}" in run.command for run in runs) == [False, True, True]
    assert all("--user-value Mood=calm" in run.command for run in runs)


def test_sweep_command_prints_why_runs_have_no_verdict(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    store = tmp_path / "s.db"
    arguments = ("sweep", scenario, "--vary", "Speed=10,fast", "--store", store, "--workers", "1")
    first = eidrive(*arguments)
    assert first.exit_code == 3
    assert "1 invalid: " in first.stderr
    assert "parameter 'Speed' is 'fast', which is not a number" in first.stderr
    assert f"eidrive results {store} --failures" in first.stderr
    again = eidrive(*arguments)
    assert again.exit_code == 3, "the store still has a run without a verdict"
    assert "2 already in the store (1 invalid, 1 passed)" in again.stdout


def test_dry_run_of_a_search_prints_axes_and_maximum(eidrive: Eidrive, scenario: Path) -> None:
    """The default maximum is 200 runs."""
    text = f"runs of {scenario}: search over"
    falsified = eidrive("sweep", scenario, "--vary", "Speed=5:15", "--vary", "dt=0.05,0.1", "--falsify", "--dry-run")
    assert falsified.stdout == f"at most 200 {text} Speed=5:15, dt=0.05,0.1\n"
    fixed = ("--find-boundary", "Speed=10:30", "--vary", "dt=0.1", "--runs", "24")
    assert eidrive("sweep", scenario, *fixed, "--dry-run").stdout == f"at most 24 {text} Speed=10:30, dt=0.1\n"


def test_find_boundary_command_prints_value(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    """The limit of the criterion is 20 m/s."""
    options = ("--find-boundary", "Speed=10:30", "--tolerance", "0.5", "--store", tmp_path / "s.db", "--workers", "1")
    done = eidrive("sweep", scenario, *options)
    assert done.exit_code == 0
    value = float(done.stdout.split(" at ")[1].split()[0])
    assert value == pytest.approx(20.0, abs=0.5)
    assert "falls through 0.5" in done.stdout


def test_search_states_the_number_of_runs_without_a_verdict(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    """Speeds from 40 m/s on are excluded; the search ends with runs at or near 60 m/s among its first eight."""
    options = ("--find-boundary", "Speed=10:60", "--runs", "8", "--store", tmp_path / "s.db", "--workers", "1")
    done = eidrive("sweep", scenario, *options)
    assert done.exit_code == 0
    assert "runs have no verdict and do not count: excluded: " in done.stderr


def test_results_of_different_versions_are_named(eidrive: Eidrive, store: Path, tmp_path: Path) -> None:
    """Shards of two releases, and one package of an extension with two versions in one store."""
    with ResultStore.open(store, {"numpy": "2"}) as opened:
        opened.add(replace(RUNS[0], settings='{"versions": {"engine": "1.0", "radar": "3"}}'))
        opened.add(replace(RUNS[1], settings='{"versions": {"engine": "1.0", "radar": "4"}}'))
    other = tmp_path / "other.db"
    with ResultStore.open(other, {"numpy": "3"}) as opened:
        opened.add(replace(run(9, "passed", Speed=5), settings='{"versions": {"engine": "1.1", "radar": "4"}}'))
    text = "the success rates mix runs of different versions: "
    assert f"{text}radar 3 (1), 4 (1); a new store" in eidrive("results", store).stderr
    assert f"{text}engine 1.0 (2), 1.1 (1); radar 3 (1), 4 (2); a new" in eidrive("results", store, other).stderr
    assert text not in eidrive("results", other).stderr


def test_combined_stores_keep_the_verdict_of_a_run_that_was_aborted_elsewhere(tmp_path: Path) -> None:
    """Overlapping shards: the order of the stores decides only between rows with a verdict."""
    stores = [tmp_path / "a.db", tmp_path / "b.db"]
    rows = ([run(1, "passed"), run(2, "aborted")], [run(1, "aborted"), run(2, "crashed")])
    for path, held in zip(stores, rows, strict=True):
        with ResultStore.open(path, {"numpy": "2"}) as opened:
            opened.add(*held)
    assert [one.status for one in stored_runs(stores)] == ["passed", "crashed"]
    assert [one.status for one in stored_runs(stores[::-1])] == ["passed", "aborted"]


@pytest.mark.parametrize("option", ["--csv", "--parquet"])
def test_export_over_a_store_is_refused(eidrive: Eidrive, store: Path, option: str) -> None:
    before = store.read_bytes()
    result = eidrive("results", store, option, store.parent / "." / store.name)
    assert result.exit_code == 2
    assert f"{option} would overwrite an input file" in result.stderr
    assert store.read_bytes() == before


def test_sweep_and_results_name_runs_with_warnings(eidrive: Eidrive, tmp_path: Path) -> None:
    """A time step above 0.1 s is a warning of each run."""
    one_after_another = ("--workers", "1")
    options = ("--vary", "dt=0.05,0.5", "--seeds", "1,2", "--vary", "time_limit=0.5", *one_after_another)
    swept = eidrive("sweep", "coop/scenario_1", *options, "--store", tmp_path / "s.db")
    command = "eidrive run coop/scenario_1 --seed 1 --dt 0.5 --time-limit 0.5"
    expected = f"warning: 2 of 4 runs have warnings; to print those of the first: {command}"
    assert expected in swept.stderr
    assert expected in eidrive("results", tmp_path / "s.db").stderr
    assert "warning: the time step is 0.5 s" in eidrive(*command.split()[1:], "--no-record").stderr
    again = eidrive("sweep", "coop/scenario_1", *options, "--store", tmp_path / "s.db")
    assert "warnings" not in again.stderr, "no run of this call"


def test_results_of_runs_without_a_command_count_warnings(eidrive: Eidrive, tmp_path: Path) -> None:
    with ResultStore.open(tmp_path / "s.db", {"numpy": "2"}) as opened:
        opened.add(replace(RUNS[0], result={**RUNS[0].result, "warnings": 2}, command=""))
        opened.add(replace(RUNS[1], result={**RUNS[1].result, "warnings": 0}))
        opened.add(RUNS[3])
    assert eidrive("results", tmp_path / "s.db").stderr == "warning: 1 of 3 runs has warnings\n"
