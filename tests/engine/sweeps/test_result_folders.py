"""Folders of results of `eidrive run` and pytest in place of stores."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive
from report_table import listed_runs

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.sweeps.comparison import compare, compare_values
from eidrive_scenario.experiments.sweeps.results import stored_runs, stored_sides, summaries
from eidrive_scenario.reporting.report_files import report_files
from eidrive_scenario.reporting.run_report.reported_runs import read_sweeps

__all__ = ["eidrive"]


@pytest.fixture
def runs(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> Path:
    """Return a folder with the runs of the speeds 5 and 30, of which the second fails, and of two seeds."""
    for speed in ("5", "30.0"):
        eidrive("run", scenario, "--param", f"Speed={speed}", "--repeat", "2", "--out", tmp_path / "runs" / speed)
    return tmp_path / "runs"


def test_settings_that_vary_are_the_axes(runs: Path) -> None:
    rows = list(stored_runs([runs]))
    assert {(one.point["Speed"], one.seed, one.status) for one in rows} == {
        (5, 1, "passed"), (5, 2, "passed"), (30.0, 1, "failed"), (30.0, 2, "failed"),
    }  # fmt: skip
    assert all(set(one.point) == {"Speed"} for one in rows)
    assert [dict(row.counts) for row in summaries(rows)] == [{"passed": 2}, {"failed": 2}]
    result = json.loads(next(runs.rglob("result.json")).read_text(encoding="utf-8"))
    row = next(one for one in rows if one.key == result["settings_sha256"])
    assert (row.result["max_speed.value"], row.result["trace_hash"]) == (
        result["criteria"][0]["value"],
        result["trace_hash"],
    )


def test_runs_are_in_the_order_of_their_paths(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    """The first text is the reference of a comparison."""
    channels = ["80211p_urban", "congested", "ideal", "latency_300ms", "none"]
    for channel in reversed(channels):
        eidrive("run", scenario, "--channel", channel, "--no-record", "--out", tmp_path / "runs" / channel)
    rows = list(stored_runs([tmp_path / "runs"]))
    assert [(row.number, row.point["channel"]) for row in rows] == list(enumerate(channels))
    assert compare_values([tmp_path / "runs"], "channel")[0].first == "80211p_urban"


def test_scenarios_of_a_folder_are_compared_by_seed(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    """Ego drives up to 5 m/s in both scenarios, which are equal but for their file: 2 pairs, both passed."""
    other = scenario.with_stem("other")
    other.write_bytes(scenario.read_bytes())
    for path in (scenario, other):
        eidrive("run", path, "--param", "Speed=5", "--repeat", "2", "--no-record", "--out", tmp_path / "runs")
    (between,) = compare_values([tmp_path / "runs"], "scenario")
    assert between.comparison is not None
    assert (between.comparison.verdicts.both, between.comparison.unpaired) == (2, 0)


def test_scenarios_of_equal_names_are_a_cause_of_repeated_runs(
    eidrive: Eidrive, scenario: Path, tmp_path: Path
) -> None:
    """The results state the name of the file only; each of the two folders has one run and can be compared."""
    runs = tmp_path / "runs"
    for name, limit in (("x", "20"), ("y", "2")):
        copy = tmp_path / name / scenario.name
        copy.parent.mkdir()
        copy.write_text(scenario.read_text().replace("at_most: 20", f"at_most: {limit}"))
        eidrive("run", copy, "--no-record", "--out", runs / name)
    assert "1 run repeats another one" in (text := eidrive("results", runs).stderr)
    assert "another scenario whose file has this name; a new store or folder keeps them apart" in text
    assert "give a folder of one session, or of one scenario in it" in eidrive("compare", runs, runs).stderr
    assert compare([runs / "x"], [runs / "y"]).verdicts.only_first == 1


def test_folders_are_compared_as_stores(eidrive: Eidrive, runs: Path) -> None:
    (between,) = compare_values([runs], "Speed")
    assert between.comparison is not None
    assert (between.first, between.second, between.comparison.verdicts.only_first) == (5, 30.0, 2)
    separate = compare([runs / "5"], [runs / "30.0"])
    assert separate == between.comparison
    assert eidrive("results", runs, "--by", "Speed").exit_code == 0


def test_values_that_vary_on_one_side_distinguish_runs_of_both(runs: Path) -> None:
    """The second side has one speed, whose runs are the partners of the equal speed of the first side."""
    sides = stored_sides([runs], [runs / "5"])
    assert [one.point for one in sides[1]] == [{"Speed": 5}, {"Speed": 5}]
    comparison = compare([runs], [runs / "5"])
    assert (comparison.verdicts.both, comparison.unpaired, comparison.identical) == (2, 2, 2)


def test_swept_distribution_is_compared_with_the_folder_of_its_runs(
    eidrive: Eidrive, distribution: Path, tmp_path: Path
) -> None:
    """Both commands simulate the same runs, so that each has a partner with an equal trace hash."""
    store, folder = tmp_path / "s.db", tmp_path / "runs"
    eidrive("sweep", distribution, "--store", store, "--workers", "1")
    eidrive("run", distribution, "--out", folder)
    for sides in ((store, folder), (folder, store)):
        comparison = compare(*([side] for side in sides))
        assert (comparison.verdicts.pairs, comparison.identical, comparison.unpaired) == (2, 2, 0)


@pytest.mark.parametrize("axis", ["Speed", "param.Speed"])
def test_axis_of_a_store_distinguishes_runs_of_a_folder(
    eidrive: Eidrive, scenario: Path, runs: Path, tmp_path: Path, axis: str
) -> None:
    store = tmp_path / "s.db"
    eidrive("sweep", scenario, "--vary", f"{axis}=5,30", "--seeds", "1-2", "--store", store, "--workers", "1")
    comparison = compare([store], [runs / "5"])
    assert (comparison.verdicts.both, comparison.identical, comparison.unpaired) == (2, 2, 2)
    assert {run.point[axis] for run in stored_runs([store, runs])} == {5, 30}


def test_channel_settings_of_a_store_distinguish_runs_of_a_folder(
    eidrive: Eidrive, scenario: Path, tmp_path: Path
) -> None:
    """Profiles of one name have no other difference; those of different names are told apart by their names."""
    store, folder = tmp_path / "s.db", tmp_path / "runs"
    axis = "channel.delay.seconds"
    eidrive("sweep", scenario, "--channel", "ideal", "--vary", f"{axis}=0,0.3", "--store", store, "--workers", "1")
    for delay in ("0", "0.3"):
        profile = f"{{delay: {{kind: constant, seconds: {delay}}}}}"
        eidrive("run", scenario, "--channel", profile, "--no-record", "--out", folder / delay)
    comparison = compare([store], [folder])
    assert (comparison.verdicts.pairs, comparison.identical, comparison.unpaired) == (2, 2, 0)
    (between,) = compare_values([folder], axis)
    assert (between.first, between.second) == (0, 0.3)
    eidrive("run", scenario, "--channel", "latency_300ms", "--no-record", "--out", tmp_path / "named" / "slow")
    eidrive("run", scenario, "--channel", "ideal", "--no-record", "--out", tmp_path / "named" / "ideal")
    assert {tuple(run.point) for run in stored_runs([tmp_path / "named"])} == {("channel",)}


def test_settings_of_a_store_have_the_values_of_axes_of_others(
    eidrive: Eidrive, scenario: Path, tmp_path: Path
) -> None:
    """The second store varies the speed only; all its runs have the default channel and time step."""
    stores = [tmp_path / "a.db", tmp_path / "b.db"]
    axes = [("channel=none,ideal", "dt=0.05,0.1"), ("Speed=5,30",)]
    for store, texts in zip(stores, axes, strict=True):
        varied = [argument for text in texts for argument in ("--vary", text)]
        eidrive("sweep", scenario, *varied, "--seeds", "1", "--store", store, "--workers", "1")
    points = {tuple(sorted(run.point.items())) for run in stored_runs(stores)}
    assert (("Speed", 30), ("channel", "none"), ("dt", 0.05)) in points
    assert {tuple(name for name, _ in point) for point in points} == {("Speed", "channel", "dt")}
    reported, _ = read_sweeps(stores)
    assert {run.value_of("dt") for run in reported if run.sweep == str(stores[1])} == {0.05}


@pytest.mark.parametrize(
    ("axis", "profile"),
    [("channel", "{name: slow, delay: {kind: constant, seconds: 0.3}}"), ("weather", "{wetness: 1}")],
)
def test_profile_of_a_file_is_one_value_of_an_axis(
    eidrive: Eidrive, scenario: Path, tmp_path: Path, axis: str, profile: str
) -> None:
    """The runs of the folder are those of the second value of the axis, whose files have another name and path."""
    file = tmp_path / "own.yaml"
    file.write_text(profile)
    store, folder = tmp_path / "s.db", tmp_path / "runs"
    first = {"channel": "none", "weather": "sunny"}[axis]
    eidrive("sweep", scenario, "--vary", f"{axis}={first},{file}", "--store", store, "--workers", "1")
    eidrive("run", scenario, f"--{axis}", file, "--no-record", "--out", folder)
    for sides in ((store, folder), (folder, store)):
        comparison = compare(*([side] for side in sides))
        assert (comparison.verdicts.pairs, comparison.identical, comparison.unpaired) == (1, 1, 1)
    assert {run.point[axis] for run in stored_runs([folder, store])} == {first, str(file)}


def test_interrupted_run_is_aborted(runs: Path) -> None:
    """A recording without a result has the settings of its run; one that has only begun is left out."""
    folders = sorted(path.parent for path in runs.rglob("result.json") if "30.0" in str(path))
    for folder in folders:
        (folder / "result.json").unlink()
        (folder / "recording.mcap").rename(folder / "recording.partial.mcap")
    (folders[1] / "recording.partial.mcap").write_bytes(b"")
    rows = list(stored_runs([runs]))
    assert [(one.point["Speed"], one.status) for one in rows].count((30, "aborted")) == 1
    assert len(rows) == 3
    assert compare([runs / "5"], [runs / "5", folders[0]]).lost == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ('{"trace_hash": ""}', "result: 'scenario': field required"),
        ('{"trace_hash": "", "scenario": "s", "seed": "x", "passed": true, "end_reason": "", "settings": {}}', "seed"),
    ],
)
def test_damaged_result_is_an_error_that_names_the_file(runs: Path, text: str, message: str) -> None:
    damaged = next(runs.rglob("result.json"))
    damaged.write_text(text, encoding="utf-8")
    for location in (damaged, damaged.parent):
        with pytest.raises(InputError) as caught:
            stored_runs([runs, location], lambda _: None)
        assert message in str(caught.value)
        assert str(damaged) in str(caught.value)


def test_damaged_result_below_a_folder_is_omitted_with_a_warning(eidrive: Eidrive, runs: Path) -> None:
    damaged = next(runs.rglob("result.json"))
    damaged.write_text("{", encoding="utf-8")
    with pytest.warns(UserWarning, match=r"not JSON: .*, it is omitted"):
        assert len(list(stored_runs([runs]))) == 3
    separate = runs / "5", runs / "30.0"
    for shown in (
        eidrive("results", runs),
        eidrive("compare", *separate),
        eidrive("compare", runs, "--between", "Speed"),
    ):
        (warning,) = [line for line in shown.stderr.splitlines() if "omitted" in line]
        assert warning.startswith(f"warning: {damaged}: not JSON")


def test_folder_without_results_is_an_error(tmp_path: Path, runs: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no result\.json in this folder"):
        stored_runs([runs, tmp_path / "empty"])


def test_copies_of_a_run_count_once(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs, tmp_path / "copy")
    assert len(list(stored_runs([runs, tmp_path / "copy"]))) == 4


def test_runs_of_the_store_and_the_folder_of_a_sweep_count_once(
    eidrive: Eidrive, scenario: Path, tmp_path: Path
) -> None:
    store, out = tmp_path / "s.db", tmp_path / "out"
    eidrive("sweep", scenario, "--vary", "Speed=5,30", "--workers", "1", "--store", store, "--out", out)
    assert [(run.point, run.status) for run in stored_runs([out, store])] == [
        ({"Speed": 5}, "passed"),
        ({"Speed": 30}, "failed"),
    ]
    page = report_files([out, store], tmp_path / "report")
    assert [run["seed"] for run in listed_runs(page)] == [1, 1]
