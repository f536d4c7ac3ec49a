"""One run and what it leaves behind."""

from pathlib import Path

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.evaluation import evaluate_criteria
from eidrive_scenario.evaluation.criteria_parser import build_criteria, parse_criteria
from eidrive_scenario.experiments.single_run import read_results, run_and_save
from eidrive_scenario.recording import TraceHash, read_recording
from eidrive_scenario.simulation import RunSettings

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
CRITERIA = """
    collision: {of: Ego, with: Parked}
    min_distance: {of: Ego, to: Parked, at_least: 3.0, measure: center}
"""


@pytest.mark.parametrize("other_y", ["5", "0", "2.5"])
def test_a_recording_is_judged_as_the_run_was(tmp_path: Path, other_y: str) -> None:
    result = run_and_save(PASSING_BY, seed=4, settings=RunSettings(parameters={"OtherY": other_y}), out=tmp_path)
    recording = read_recording(tmp_path / "recording.mcap")
    assert evaluate_criteria(recording.frames(), build_criteria(parse_criteria(CRITERIA))) == result.criteria
    trace = TraceHash()
    for frame in recording.frames():
        trace.observe(frame)
    assert trace.hexdigest() == result.trace_hash
    assert recording.frame_count == round(result.simulated_s / 0.05) + 1


def test_the_recording_says_what_the_run_was_told(tmp_path: Path) -> None:
    settings = RunSettings(parameters={"OtherY": "7"}, cooperate=(), channel="none")
    run_and_save(PASSING_BY, seed=4, settings=settings, out=tmp_path)
    told = read_recording(tmp_path / "recording.mcap").metadata
    assert (told["scenario"], told["seed"], told["channel"], told["cooperate"]) == ("passing_by", "4", "none", "none")
    assert '"OtherY": "7"' in told["parameters"]
    assert "weather" not in told


def test_two_recordings_of_one_run_are_equal(tmp_path: Path) -> None:
    for name in ("first", "second"):
        run_and_save(PASSING_BY, seed=4, out=tmp_path / name)
    first, second = ((tmp_path / name / "recording.mcap").read_bytes() for name in ("first", "second"))
    assert first == second


def test_results_are_found_below_folders(tmp_path: Path) -> None:
    for seed in (2, 1):
        run_and_save(PASSING_BY, seed=seed, out=tmp_path / f"seed-{seed}", record=False)
    assert [result["seed"] for result in read_results([tmp_path])] == [1, 2]
    twice = [tmp_path, tmp_path / "seed-1", tmp_path / "seed-2" / ".." / "seed-2" / "result.json"]
    assert [result["seed"] for result in read_results(twice)] == [1, 2]
    assert [result["seed"] for result in read_results([tmp_path / "seed-2" / "result.json"])] == [2]


@pytest.mark.parametrize("text", ["{", "[]", '{"seed": 1}'])
def test_what_is_no_result(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)
    with pytest.raises(InputError, match=r"result\.json: not "):
        read_results([tmp_path])
