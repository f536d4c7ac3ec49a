"""`eidrive run`: verdicts, exit codes, files."""

import csv
import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_fixtures import Eidrive
from openscenario_xml import agent_xml, object_xml, parameters_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, teleport_xml, world_position_xml

from eidrive_scenario.cli.console import show
from eidrive_scenario.cli.run import run
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import DEFAULT_SEED, RunResult, RunSettings, load_for_seed


def test_run_of_passing_scenario_prints_verdicts(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by)
    assert result.exit_code == 0, result.output
    assert "Ego and Parked came within 5.00 m (center to center) at 2.00 s" in result.stdout
    assert "end: stop trigger at 3.00 s" in result.stdout
    assert re.search(r"trace [0-9a-f]{64}", result.stdout)


def test_run_with_collision_prints_actors_and_time(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--param", "OtherY=0")
    assert result.exit_code == 1, result.output
    # 4 m long, reference points 20 m apart: a gap of 16 m closes at 10 m/s.
    assert re.search(r"collision +failed .*Ego and Parked hit each other at 1\.6[05] s", result.stdout)


def test_run_options_have_the_defaults_of_run_settings() -> None:
    """The command defines them again, as it imports the simulation only when it is executed."""
    defaults = {name: option.default for name, option in inspect.signature(run).parameters.items()}
    settings = RunSettings()
    expected = {"dt": settings.dt, "time_limit": settings.time_limit, "seed": DEFAULT_SEED}
    assert {name: defaults[name] for name in expected} == expected


def test_json_option_prints_one_object_per_run(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--json", "--repeat", "2", "--seed", "5")
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["seed"] for line in lines] == [5, 6]
    first = lines[0]
    expected = {
        "scenario",
        "seed",
        "passed",
        "end_reason",
        "criteria",
        "metrics",
        "trace_hash",
        "simulated_s",
        "wall_s",
    }
    assert expected <= set(first)
    verdict = {"name", "passed", "value", "limit", "unit", "reason", "first_violation", "violation_state"}
    assert set(first["criteria"][0]) == verdict
    assert first["passed"] is True
    assert first["end_reason"] == "stop trigger"
    assert first["metrics"]["min_distance.Ego.Parked.center"] == pytest.approx(5.0)
    assert first["metrics"]["min_distance.Ego.Parked.box"] == pytest.approx(3.0)


def test_out_option_writes_recording_and_result(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    printed = json.loads(eidrive("run", passing_by, "--json", "--out", tmp_path / "run").stdout)
    (result,) = (tmp_path / "run").rglob("result.json")
    kept = json.loads(result.read_text(encoding="utf-8"))
    assert kept == printed
    recording = read_recording(result.with_name("recording.mcap"))
    assert recording.seed == 1
    assert recording.attachments["scenario.xosc"] == passing_by.read_bytes()
    frames = list(recording.frames())
    assert frames[-1].view.time == pytest.approx(3.0)
    assert frames[-1].view.position[0, 0] == pytest.approx(30.0, abs=0.6)


def test_no_record_option_writes_result_folder_per_seed(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path, "--no-record", "--repeat", "2", "--csv", tmp_path / "motion.csv")
    files = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file())
    assert files[:2] == ["motion-seed-1.csv", "motion-seed-2.csv"]
    for seed, file in enumerate(files[2:], 1):
        assert re.fullmatch(rf"passing_by-none-seed{seed}-[0-9a-f]{{10}}/result\.json", file)
    assert len(files) == 4


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        (("--record", "on-failure"), {"near"}),
        (("--record", "always"), {"far", "near"}),
        (("--record", "never"), set()),
        (("--no-record",), set()),
    ],
)
def test_record_option_selects_runs_whose_recording_is_kept(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, options: tuple[str, ...], kept: set[str]
) -> None:
    for name, other_y in (("far", "5"), ("near", "0")):
        eidrive("run", passing_by, "--out", tmp_path / name, "--param", f"OtherY={other_y}", *options)
    assert {path.relative_to(tmp_path).parts[0] for path in tmp_path.rglob("*.mcap")} == kept
    assert len(list(tmp_path.rglob("result.json"))) == 2


def test_record_on_failure_removes_recording_of_earlier_run(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    assert len(list(tmp_path.rglob("*.mcap"))) == 1
    result = eidrive("run", passing_by, "--out", tmp_path, "--record", "on-failure")
    assert result.exit_code == 0
    assert list(tmp_path.rglob("*.mcap")) == []


def test_contradicting_record_options_are_invalid_input(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--no-record", "--record", "on-failure")
    assert result.exit_code == 2
    assert "--no-record and --record on-failure contradict each other" in result.stderr


def test_csv_option_writes_motion_of_all_actors(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--csv", tmp_path / "motion.csv", "--dt", "0.1")
    with (tmp_path / "motion.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    at_one = {row["name"]: row for row in rows if row["time"] == "1.000000"}
    assert set(at_one) == {"Ego", "Parked"}
    assert float(at_one["Ego"]["x"]) == pytest.approx(10.0)
    assert float(at_one["Ego"]["speed"]) == pytest.approx(10.0)
    assert float(at_one["Parked"]["y"]) == pytest.approx(5.0)
    assert len(rows) == 2 * 31


def test_run_beyond_time_limit_ends_with_exit_code_3(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--time-limit", "1")
    assert result.exit_code == 3
    assert result.stdout.splitlines()[0].endswith("time limit")
    assert "end: time limit at 1.00 s" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no/such"], "no scenario 'no/such'"),
        (["{file}", "--cooperate", " ,"], "--cooperate: no station is listed (got ' ,'; expected A,B or none)"),
        (["{file}", "--param", "OtherY"], "--param: no value is assigned (got 'OtherY'; expected NAME=VALUE)"),
        (["{file}", "--param", "OthreY=1"], "did you mean 'OtherY'?"),
        (["{file}", "--user-value", "mood"], "--user-value: no value is assigned (got 'mood'; expected NAME=VALUE)"),
        (
            ["{file}", "--param", "OtherY=1", "--param", "End=2", "--param", "OtherY=3"],
            "--param: 'OtherY' is given twice, as '1' and '3'; give each name once",
        ),
        (["{file}", "--user-value", "a=1", "--user-value", "a=1"], "--user-value: 'a' is given twice"),
        (["{file}", "--controller", "K=alks", "--controller", "K=external"], "--controller: 'K' is given twice"),
        (["{file}", "--controller", "ALKSController"], "--controller: no value is assigned (got 'ALKSController'"),
        (["{file}", "--controller", "ALKSController=alk"], "unknown controller model 'alk'; did you mean 'alks'?"),
        (["{file}", "--channel", "latencyy"], "no channel profile 'latencyy'"),
        (["{file}", "--dt", "0"], "--dt: not a positive number of seconds (got 0.0)"),
        (["{file}", "--time-limit", "-1"], "--time-limit: not a positive number of seconds (got -1.0)"),
        (["{file}", "--wall-limit", "nan"], "--wall-limit: not a positive number of seconds (got nan)"),
    ],
)
def test_run_with_invalid_argument_ends_with_exit_code_2(
    eidrive: Eidrive, passing_by: Path, arguments: list[str], message: str
) -> None:
    result = eidrive("run", *(argument.format(file=passing_by) for argument in arguments))
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert "Traceback" not in result.output
    assert result.stdout == ""


def test_run_of_invalid_file_reports_line(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.xosc"
    broken.write_text(passing_by.read_text(encoding="utf-8").replace("of: Ego, to", "ofe: Ego, to"), encoding="utf-8")
    result = eidrive("run", broken)
    assert result.exit_code == 2, result.output
    assert f"{broken}:47: criterion 'min_distance': unknown setting 'ofe'; did you mean 'of'?" in result.stderr


@pytest.mark.process
def test_trace_hash_of_equal_seed_is_equal_in_other_process(eidrive: Eidrive, passing_by: Path) -> None:
    here = json.loads(eidrive("run", passing_by, "--json").stdout)
    command = [sys.executable, "-m", "eidrive_scenario", "run", str(passing_by), "--json"]
    there = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert here["trace_hash"] == there["trace_hash"]


def test_log_option_writes_transitions_with_reasons(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("run", passing_by, "--log", tmp_path / "run.log", "--no-record")
    assert result.exit_code == 0, result.output
    lines = (tmp_path / "run.log").read_text(encoding="utf-8").splitlines()
    assert lines == [
        "    0.000 s  storyboard starts",
        "    3.000 s  storyboard is stopped: simulation time 3.00 s ≥ 3 s",
    ]
    printed = eidrive("run", passing_by, "--log", "-")
    assert printed.stdout.splitlines()[:2] == lines


def test_log_option_of_two_runs_writes_two_files(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--log", tmp_path / "run.log", "--repeat", "2")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run-seed-1.log", "run-seed-2.log"]


def test_explain_option_prints_trigger_history(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--explain", "storyboard")
    assert "the run stopped at 3.00 s: simulation time 3.00 s ≥ 3 s\n" in result.stdout
    assert f"['end', {passing_by}:" in result.stdout
    assert "true from 3.00 s on" in result.stdout
    unknown = eidrive("run", passing_by, "--explain", "Cut")
    assert unknown.exit_code == 2
    assert "no event or act is named 'Cut'" in unknown.stderr


def test_json_option_prints_explanations_on_standard_error(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--json", "--explain", "storyboard")
    assert json.loads(result.stdout)["passed"] is True
    assert "the run stopped at 3.00 s" in result.stderr
    assert eidrive("run", passing_by, "--json", "--log", "-").exit_code == 2


@pytest.mark.parametrize("columns", ["50", "70"])
def test_verdicts_on_narrow_terminal_wrap_reasons_only(
    eidrive: Eidrive, passing_by: Path, columns: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    lines = eidrive("run", passing_by, "--no-record").stdout.splitlines()
    assert any(line.startswith("min_distance  passed  5.000 m  3.000 m  Ego ") for line in lines), lines
    assert any(re.fullmatch(r"trace [0-9a-f]{64}", line) for line in lines)


def test_unused_user_value_and_controller_option_are_warnings(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("run", passing_by, "--no-record", "--user-value", "mood=3", "--controller", "ALKS=alks")
    assert result.exit_code == 0, result.output
    assert (
        "warning: --user-value mood: no UserDefinedValueCondition reads the value; none is known here" in result.stderr
    )
    assert "warning: --controller: no controller is named 'ALKS'" in result.stderr


def test_run_with_long_time_step_ends(eidrive: Eidrive) -> None:
    """The ego does not move in a single step, so that the criterion of its progress fails."""
    result = eidrive("run", "coop/scenario_1", "--no-record", "--dt", "100", "--time-limit", "1000")
    assert result.exit_code == 1
    assert "end: stop trigger at 100.00 s" in result.stdout
    assert "warning: the time step is 100 s: stations perceive, plan and send at most once per step" in result.stderr


def test_time_step_up_to_interval_of_messages_has_no_warning(eidrive: Eidrive) -> None:
    """Three steps of 0.1 s, and 0.15 s, are multiples of a physics step."""
    short = ("run", "coop/scenario_1", "--no-record", "--time-limit", "0.3", "--dt")
    assert eidrive(*short, "0.1").stderr == ""
    assert "give a dt of at most 0.1 s" in eidrive(*short, "0.15").stderr


def test_time_step_below_physics_step_is_error_that_names_multiple(eidrive: Eidrive) -> None:
    result = eidrive("run", "coop/scenario_1", "--no-record", "--dt", "0.002")
    assert result.exit_code == 2
    assert "a tick of 0.002 s is 0.4 physics steps at 200 Hz; give a dt that is a multiple of 0.005 s" in result.stderr


def test_show_prints_ratio_to_real_time(capsys: pytest.CaptureFixture[str]) -> None:
    ratios = {320.0: "0.01 times", 12.9: "0.31 times", 2.0: "2.0 times", 0.1: "40 times"}
    for wall, ratio in ratios.items():
        show(RunResult("a", 1, "none", True, "stop trigger", 0, (), {}, "00", 4.0, wall))
        assert f"({wall:.2f} s wall, {ratio} real time)" in capsys.readouterr().out


def test_controller_option_for_station_is_a_warning(eidrive: Eidrive) -> None:
    short = ("run", "coop/scenario_1", "--no-record", "--time-limit", "0.1")
    warned = eidrive(*short, "--controller", "EgoStack=alks").stderr
    assert "warning: --controller: controller 'EgoStack' belongs to a station" in warned
    assert eidrive(*short).stderr == ""


def test_invalid_start_of_one_seed_does_not_end_the_other_runs(eidrive: Eidrive, tmp_path: Path) -> None:
    """The bodies are 4.5 m long; the distance of their places is drawn."""
    distance = "<CustomCommandAction type='eidrive.variation'>Distance: {uniform: [0, 9]}</CustomCommandAction>"
    path = tmp_path / "a.xosc"
    path.write_bytes(
        scenario_xml(
            declarations=parameters_xml(Distance=("double", "9")),
            entities=object_xml("Ego", controller=agent_xml(target_speed=5)) + object_xml("Other"),
            init=f"<UserDefinedAction>{distance}</UserDefinedAction>"
            + init_xml("Ego", teleport_xml(world_position_xml(0)))
            + init_xml("Other", teleport_xml("<WorldPosition x='$Distance' y='0'/>")),
            stop=end_xml(0.1),
        )
    )
    drawn = [float(load_for_seed(path, seed, {}).parameters["Distance"]) for seed in range(1, 9)]
    invalid = [seed for seed, distance in enumerate(drawn, 1) if distance < 4.5]
    assert 1 not in invalid, "an error of the first run ends the command"
    assert 0 < len(invalid) < 7
    result = eidrive("run", path, "--repeat", "8", "--no-record", "--no-criteria")
    assert result.exit_code == 2
    assert result.stdout.count("trace ") == 8 - len(invalid)
    assert re.findall(r"^seed (\d+): .* 'Ego' starts inside of 'Other'", result.stderr, re.MULTILINE) == [
        str(seed) for seed in invalid
    ]
