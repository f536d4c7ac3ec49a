"""Figures of the benchmarks: their measurement, the history of commits, and the comparison of two."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from eidrive_scenario.world.physics.bullet import connect, disconnect

ROOT = Path(__file__).parents[1]
BENCHMARKS = ROOT / "benchmarks"


@pytest.fixture(autouse=True)
def benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def is_repository() -> bool:
    return (ROOT / ".git").exists()


def test_bare_loop_and_run_have_the_same_ticks_and_rays() -> None:
    """Another world is open, so that the clients of run and loop are not the first one."""
    from bench_scenario_1 import measure

    other = connect()
    try:
        measured = measure(runs=1, seed=1, channel="ideal")
    finally:
        disconnect(other)
    trace = measured.trace
    assert min(measured.run_time, measured.bare_time, measured.calls_time) > 0.0
    assert measured.simulated == pytest.approx((len(trace.states) - 1) * measured.dt)
    assert len(trace.ticks) == len(trace.states) + 1
    assert sum(len(calls) for calls in trace.calls("rayTestBatch")) > 100


def test_better_figure_depends_on_its_unit() -> None:
    from figures import better

    assert better("planner", [0.8, 1.2]) == 0.8
    assert better("yolov5", [0.8, 1.2]) == 1.2


def test_unknown_figure_is_an_error() -> None:
    from figures import available

    with pytest.raises(SystemExit, match="unknown figure: speed"):
        available(["speed"])


def test_figures_of_maps_are_omitted_without_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    from figures import available

    monkeypatch.delenv("EIDRIVE_MAPS", raising=False)
    assert "cars_200" not in available()
    assert "scenario_1" in available()


def test_gain_is_above_one_where_head_is_better() -> None:
    from compare import comparison, gain

    assert gain("planner", 2.0, 1.0) == gain("yolov5", 1.0, 2.0) == 2.0
    assert "1.50   (1.33 to 1.50)" in comparison("yolov5", [(1.0, 1.5), (0.9, 1.2)])


def test_history_has_one_line_per_measurement(tmp_path: Path) -> None:
    from history import add_row, columns

    file = tmp_path / "history.csv"
    for commit in ("a", "b"):
        add_row(file, [commit, *["1"] * (len(columns()) - 1)])
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["commit"] for row in rows] == ["a", "b"]
    assert {len(row) for row in rows} == {len(columns())}


def test_history_of_other_figures_is_refused(tmp_path: Path) -> None:
    from history import add_row

    file = tmp_path / "history.csv"
    file.write_text("commit,speed\n", encoding="utf-8")
    with pytest.raises(SystemExit, match="other columns"):
        add_row(file, ["a", "1"])
    assert file.read_text(encoding="utf-8") == "commit,speed\n"


def test_committed_history_has_the_columns_of_the_figures() -> None:
    from history import FILE, columns

    with FILE.open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    assert header == columns()
    assert rows
    assert all(len(row) == len(header) for row in rows)


def test_comparison_with_esmini_counts_files_of_the_same_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The geometric mean of the ratios 1 and 4 is 2."""
    import bench_corpora

    monkeypatch.setattr(bench_corpora, "start_seconds", lambda command: 0.5)
    runs = [bench_corpora.ScenarioRun("cut_in", 10.0, 0.5, running, "stop trigger") for running in (0.5, 3.5)]
    bench_corpora.compare("esmini", [(run, 2.0, 1.0) for run in runs])
    assert "geometric mean 2.00" in (text := capsys.readouterr().out)
    assert "largest: cut_in 4.0, cut_in 1.0" in text


def worktrees() -> str:
    command = ("git", "worktree", "list", "--porcelain")
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


@pytest.mark.process
@pytest.mark.skipif(not is_repository(), reason="not a checkout of git")
def test_comparison_measures_commits_and_removes_checkouts() -> None:
    before = worktrees()
    command = (sys.executable, str(BENCHMARKS / "compare.py"), "HEAD", "--figures", "version", "--repeats", "1")
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    header, row = done.stdout.splitlines()
    assert header.split()[0] == "figure"
    name, base, head, *_ = row.split()
    assert name == "version"
    assert float(base) > 0.0
    assert float(head) > 0.0
    assert worktrees() == before


@pytest.mark.skipif(not is_repository(), reason="not a checkout of git")
def test_comparison_with_unknown_commit_is_an_error() -> None:
    command = (sys.executable, str(BENCHMARKS / "compare.py"), "no-such-commit")
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "git rev-parse" in done.stderr


def test_ratios_of_suites_are_those_of_sums_and_their_geometric_mean() -> None:
    from compare_corpora import summary

    line = summary("one process", [(4.0, 2.0), (1.0, 2.0)])
    assert "ratio of the sums 0.800, geometric mean of the ratios 1.000 (0.50 to 2.00)" in line


@pytest.mark.process
@pytest.mark.skipif(not is_repository(), reason="not a checkout of git")
def test_comparison_of_suites_counts_scenarios_that_end_by_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One scenario ends after 3 s, one only after the limit of 10 s, and one is invalid."""
    text = (ROOT / "tests/data/passing_by.xosc").read_text(encoding="utf-8")
    (tmp_path / "ends.xosc").write_text(text, encoding="utf-8")
    (tmp_path / "lasts.xosc").write_text(text.replace('name="End" parameterType="double" value="3.0"',
                                                      'name="End" parameterType="double" value="30.0"'))  # fmt: skip
    (tmp_path / "invalid.xosc").write_text("<OpenSCENARIO/>", encoding="utf-8")
    monkeypatch.setenv("EIDRIVE_CORPORA", str(tmp_path))
    command = (sys.executable, str(BENCHMARKS / "compare_corpora.py"), "HEAD", "--limit", "10", "--repeats", "1")
    done = subprocess.run((*command, "--csv", str(tmp_path / "times.csv")), check=True, capture_output=True, text=True)
    assert done.stdout.startswith("1 scenarios that end by themselves")
    with (tmp_path / "times.csv").open(newline="", encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert row["scenario"] == "ends"
    assert float(row["base_s"]) > 0.0
    assert float(row["head_s"]) > 0.0
    assert row["head_process_s"] == ""
