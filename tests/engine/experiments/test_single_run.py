"""Single runs and their output files."""

from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.evaluation import evaluate_criteria
from eidrive_scenario.evaluation.criteria_parser import build_criteria, parse_criteria
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.run_files import read_result, result_paths
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.simulation import RunSettings

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
CRITERIA = """
    collision: {of: Ego, with: Parked}
    min_distance: {of: Ego, to: Parked, at_least: 3.0, measure: center}
"""


@pytest.mark.parametrize("other_y", ["5", "0", "2.5"])
def test_evaluate_criteria_of_recording_equals_verdicts_of_run(tmp_path: Path, other_y: str) -> None:
    result = run_and_save(PASSING_BY, seed=4, settings=RunSettings(parameters={"OtherY": other_y}), out=tmp_path)
    recording = read_recording(tmp_path / "recording.mcap")
    assert evaluate_criteria(recording.frames(), build_criteria(parse_criteria(CRITERIA))) == result.criteria
    trace = TraceHash()
    for frame in recording.frames():
        trace.observe(frame)
    assert trace.hexdigest() == result.trace_hash
    assert recording.frame_count == round(result.simulated_s / 0.05) + 1


def test_unknown_record_mode_raises_setting_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="record is 'failed'; give one of always, on-failure, never"):
        run_and_save(PASSING_BY, out=tmp_path, record="failed")


def test_recording_metadata_contain_given_settings(tmp_path: Path) -> None:
    settings = RunSettings(parameters={"OtherY": "7"}, cooperate=(), channel="none")
    run_and_save(PASSING_BY, seed=4, settings=settings, out=tmp_path)
    metadata = read_recording(tmp_path / "recording.mcap").metadata
    given = [metadata[name] for name in ("scenario", "seed", "channel", "cooperate")]
    assert given == ["passing_by", "4", "none", "none"]
    assert '"OtherY": "7"' in metadata["parameters"]
    assert "weather" not in metadata


def test_recording_has_what_a_planner_returned_at_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The planner overwrites the points of its last plan; those of the route planner are other arrays."""
    point = EntryPoint("buffered", "buffered_planner:BufferedPlanner", "eidrive_scenario.planners")
    monkeypatch.setitem(registry("planners")._points, "buffered", point)
    points = []
    for planner in ("route", "buffered"):
        settings = RunSettings(planner=planner, detector="oracle", time_limit=4.0)
        result = run_and_save("coop/scenario_1", settings=settings, out=tmp_path / planner)
        assert result.recording is not None
        plans = [frame.steps["Ego"].plan for frame in read_recording(result.recording).frames()]
        points.append([plan.points for plan in plans if plan is not None])
    assert len(points[0]) > 50
    assert all(map(np.array_equal, *points))
    assert not np.array_equal(points[0][0], points[0][50])


def test_recordings_of_equal_runs_are_equal_files(tmp_path: Path) -> None:
    for name in ("first", "second"):
        run_and_save(PASSING_BY, seed=4, out=tmp_path / name)
    first, second = ((tmp_path / name / "recording.mcap").read_bytes() for name in ("first", "second"))
    assert first == second


def test_result_paths_finds_each_result_below_folders_once(tmp_path: Path) -> None:
    for seed in (2, 1):
        run_and_save(PASSING_BY, seed=seed, out=tmp_path / f"seed-{seed}", record=False)
    files = [tmp_path / f"seed-{seed}" / "result.json" for seed in (1, 2)]
    assert list(result_paths([tmp_path])) == files
    assert [read_result(file)["seed"] for file in files] == [1, 2]
    twice = [tmp_path, tmp_path / "seed-1", tmp_path / "seed-2" / ".." / "seed-2" / "result.json"]
    assert list(result_paths(twice)) == files
    assert list(result_paths(files[1:])) == files[1:]


@pytest.mark.parametrize("text", ["{", "[]", '{"seed": 1}'])
def test_read_result_of_other_file_raises_input_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)
    with pytest.raises(InputError, match=r"result\.json: not "):
        read_result(tmp_path / "result.json")
