"""`eidrive run` of runs that an extension aborts: exit code, messages, lines of `--json`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from faulty_extensions import install, line_of, write_scenario
from openscenario_xml import deterministic_xml, distribution_xml, parameters_xml, values_xml

from eidrive_scenario.recording.recording import read_recording

pytestmark = pytest.mark.timeout(600)
"""Hung runs last for the limit and the grace period, and several processes load the engine."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the faulty extensions and a scenario."""
    install(tmp_path)
    write_scenario(tmp_path / "s.xosc")
    return tmp_path


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    command = [sys.executable, "-m", "eidrive_scenario", "run", *arguments]
    return subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def run(folder: Path, *arguments: str) -> tuple[int, str, str]:
    process = start(folder, *arguments)
    out, err = process.communicate()
    return process.returncode, out, err


@pytest.mark.statistical
def test_sys_exit_of_detector_aborts_only_its_run(folder: Path) -> None:
    """Each of two seeds has its own JSON line and message."""
    code, out, err = run(folder, "s.xosc", "--detector", "exits", "--repeat", "2", "--json", "--out", "runs")
    assert code == 3
    entries = [json.loads(line) for line in out.splitlines()]
    assert [(entry["seed"], entry["passed"], entry["end_reason"]) for entry in entries] == [
        (1, False, "error"),
        (2, False, "error"),
    ]
    assert entries[0]["error"] == {
        "kind": "detector",
        "name": "exits",
        "value": "faulty:Exits",
        "subject": "station 'Ego'",
        "time": 0.5,
        "file": str(folder / "faulty.py"),
        "line": line_of("sys.exit(0)"),
        "function": "detect",
        "problem": "SystemExit: 0 (an extension cannot end the process)",
        "message": entries[0]["error"]["message"],
    }
    assert err.count("detector 'exits' (faulty:Exits) of station 'Ego' at t = 0.500 s: SystemExit: 0") == 2
    assert "internal error" not in err
    assert "please report" not in err
    for note in entries[1]["notes"]:
        if note.startswith("recording: "):
            assert (folder / note.removeprefix("recording: ")).is_file()
            break
    else:
        pytest.fail("no note names the recording")


@pytest.mark.exhaustive
def test_aborted_run_of_distribution_does_not_end_other_runs(folder: Path) -> None:
    """The action fails for a parameter of 4, and not for 5."""
    declared = parameters_xml(Speed=("double", "5"))
    write_scenario(folder / "s.xosc", action="fails below 5", declarations=declared, speed="$Speed")
    body = deterministic_xml(values_xml("Speed", "4", "5"))
    (folder / "d.xosc").write_bytes(distribution_xml(body, scenario="s.xosc"))
    code, out, err = run(folder, "d.xosc", "--json")
    assert code == 3
    entries = [json.loads(line) for line in out.splitlines()]
    assert [(entry["run"], entry["end_reason"]) for entry in entries] == [(0, "error"), (1, "stop trigger")]
    assert "2 runs in d.xosc: 1 passed, 1 not passed" in err


@pytest.mark.exhaustive
def test_uninterruptible_run_ends_with_exit_code_3(folder: Path) -> None:
    code, out, err = run(folder, "s.xosc", "--detector", "hangs_in_c", "--wall-limit", "6", "--json")
    assert code == 3
    detector = f"{folder / 'faulty.py'}:{line_of('in detect')}: detector 'hangs_in_c' (faulty:HangsInC)"
    assert f"{detector}: still running in detect after 6 s of wall time" in err
    assert json.loads(out)["error"]["name"] == "hangs_in_c"


@pytest.mark.exhaustive
def test_uninterruptible_run_keeps_recording_except_last_second(folder: Path) -> None:
    """The detector hangs at 2.5 s, and the process ends without closing its files."""
    write_scenario(folder / "s.xosc", detector="hangs_in_c_later", end=5.0)
    code, out, err = run(
        folder, "s.xosc", "--wall-limit", "6", "--out", "runs", "--json", "--seed", "4", "--repeat", "2"
    )
    assert code == 3
    (recording,) = folder.glob("runs/*/recording.partial.mcap")
    notes = [f"reproduce: eidrive run {folder / 's.xosc'} --seed 4", f"recording: {recording.relative_to(folder)}"]
    entry = json.loads(out)
    assert (entry["seed"], entry["notes"]) == (4, notes)
    assert err.splitlines()[-2:] == notes
    times = [frame.view.time for frame in read_recording(recording).frames()]
    assert times == pytest.approx([0.05 * tick for tick in range(len(times))])
    assert times[-1] >= 2.5 - 1.05


@pytest.mark.exhaustive
def test_run_waiting_in_native_code_ends_with_closed_recording(folder: Path) -> None:
    code, _, err = run(folder, "s.xosc", "--detector", "deadlocks", "--wall-limit", "6", "--out", "runs")
    assert code == 3
    line = line_of("library.pthread_mutex_lock(mutex)")
    place = f"{folder / 'faulty.py'}:{line}: detector 'deadlocks' (faulty:Deadlocks) of station 'Ego' at t = 0.500 s"
    assert f"{place}: still running in detect after 6 s of wall time" in err
    (recording,) = folder.glob("runs/*/recording.partial.mcap")
    assert len(list(read_recording(recording).frames())) == 10
    assert "reproduce: eidrive run" in err
    assert f"recording: {recording.relative_to(folder)}" in err


@pytest.mark.exhaustive
def test_os_exit_of_extension_under_wall_limit_is_reported(folder: Path) -> None:
    """Without a limit there is no parent process that could report it."""
    code, _, err = run(folder, "s.xosc", "--detector", "ends_process", "--wall-limit", "600")
    assert (code, err) == (3, "run aborted: an extension ended its process (os._exit)\n")


@pytest.mark.exhaustive
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 3)])
def test_signal_under_wall_limit_ends_run(folder: Path, number: signal.Signals, code: int) -> None:
    process = start(folder, "s.xosc", "--detector", "sleeps", "--wall-limit", "600", "--out", "runs")
    while not list(folder.glob("runs/*/recording.partial.mcap")):
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(number)
    process.communicate()
    assert process.returncode == code


@pytest.mark.exhaustive
@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf"])
def test_wall_limit_of_run_not_positive_is_invalid_input(folder: Path, limit: str) -> None:
    code, _, err = run(folder, "s.xosc", "--wall-limit", limit)
    assert code == 2
    assert "--wall-limit" in err
