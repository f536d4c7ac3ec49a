"""`eidrive run --live`: exit codes, output, options, interruption."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from command_fixtures import Eidrive
from openscenario_xml import deterministic_xml, distribution_xml, values_xml

from eidrive_scenario.recording.recording import read_recording

PATIENCE = 30.0
"""Maximum time for which a test waits for another process [s]."""
ADDRESS = re.compile(r"live view: (http://127\.0\.0\.1:\d+/[\w-]{20,}/)")


@pytest.fixture(autouse=True)
def no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open no page, and do not wait for one."""
    monkeypatch.setenv("BROWSER", "true")
    monkeypatch.setattr("eidrive_scenario.reporting.live.live_view.WAIT", 0.0)


@pytest.mark.parametrize(("y", "code"), [("5", 0), ("0", 1)])
def test_live_run_without_browser_ends_with_usual_exit_code(
    eidrive: Eidrive, passing_by: Path, y: str, code: int
) -> None:
    result = eidrive("run", passing_by, "--param", f"OtherY={y}", "--live", "--live-speed", "max")
    assert result.exit_code == code, result.output
    assert ADDRESS.search(result.stdout)
    assert "criterion" in result.stdout
    assert "Close the page" not in result.output


def test_live_run_with_json_prints_address_to_standard_error(eidrive: Eidrive, passing_by: Path) -> None:
    watched = eidrive("run", passing_by, "--json", "--live", "--live-speed", "0")
    alone = eidrive("run", passing_by, "--json")
    assert ADDRESS.search(watched.stderr)
    results = [json.loads(each.stdout) for each in (watched, alone)]
    for result in results:
        del result["wall_s"]
    assert results[0] == results[1]


def test_live_run_writes_recording(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("run", passing_by, "--out", tmp_path, "--live", "--live-speed", "max")
    assert result.exit_code == 0, result.output
    recording = read_recording(tmp_path)
    assert not recording.damage
    assert recording.frame_count == 61


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--live", "--repeat", "2"], "--live shows a single run (got --repeat 2)"),
        (["--live", "--success-rate", "0.9"], "--live shows a single run (got --success-rate)"),
        (["--live-speed", "2"], "--live-speed without --live has no effect"),
        (["--live-port", "8000"], "--live-port without --live has no effect"),
        (["--live", "--live-speed", "-1"], "--live-speed is '-1'"),
        (["--live", "--live-speed", "nan"], "--live-speed is 'nan'"),
        (["--live", "--live-speed", "fast"], "--live-speed is 'fast'"),
    ],
)
def test_invalid_live_options_are_reported(
    eidrive: Eidrive, passing_by: Path, arguments: list[str], message: str
) -> None:
    result = eidrive("run", passing_by, *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert not result.stdout


def test_live_port_in_use_is_reported(eidrive: Eidrive, passing_by: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = eidrive("run", passing_by, "--live", "--live-port", port)
    assert result.exit_code == 2
    assert f"port {port} of 127.0.0.1 cannot be used" in result.stderr


def test_live_port_is_used(eidrive: Eidrive, passing_by: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    result = eidrive("run", passing_by, "--live", "--live-port", port, "--live-speed", "max")
    assert result.exit_code == 0, result.output
    assert f"http://127.0.0.1:{port}/" in result.stdout


def test_live_distribution_shows_single_run_only(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    (tmp_path / "passing_by.xosc").write_bytes(passing_by.read_bytes())
    path = tmp_path / "distribution.xosc"
    path.write_bytes(distribution_xml(deterministic_xml(values_xml("OtherY", "5", "0")), scenario="passing_by.xosc"))
    every = eidrive("run", path, "--live")
    assert every.exit_code == 2
    assert "a distribution; --max-runs 1 runs one of it" in every.stderr
    one = eidrive("run", path, "--live", "--live-speed", "max", "--max-runs", "1", "--json")
    assert one.exit_code == 0, one.output
    assert json.loads(one.stdout)["run"] == 0


def test_invalid_scenario_opens_no_page(eidrive: Eidrive, tmp_path: Path) -> None:
    (tmp_path / "s.xosc").write_text("<OpenSCENARIO/>", encoding="utf-8")
    result = eidrive("run", tmp_path / "s.xosc", "--live")
    assert result.exit_code == 2
    assert "live view" not in result.output


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Return a function that starts `eidrive run` in another process.

    A job in the background ignores SIGINT, and so would its processes.
    """
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)

    def run(*arguments: str, browser: str = "true") -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "eidrive_scenario", "run", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "BROWSER": browser},
        )

    yield run
    signal.signal(signal.SIGINT, inherited)


class Reader(threading.Thread):
    """Page that reads the events of a run to their end."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        super().__init__(daemon=True)
        assert process.stdout is not None
        found = ADDRESS.match(process.stdout.readline())
        assert found is not None
        parts = urlsplit(found[1])
        self._connection = http.client.HTTPConnection("127.0.0.1", parts.port or 0, timeout=PATIENCE)
        self._connection.request("GET", f"{parts.path}events")
        self.text = ""
        self.has_frames, self.has_ended = threading.Event(), threading.Event()
        self.start()

    def run(self) -> None:
        for line in self._connection.getresponse():
            self.text += line.decode()
            if line.startswith(b"event: part"):
                self.has_frames.set()
            if b'"ended":true' in line:
                self.has_ended.set()


@pytest.mark.process
def test_interruption_of_live_run_ends_the_page(start: Callable[..., subprocess.Popen[str]]) -> None:
    """The run would take three hours."""
    process = start("coop/scenario_1", "--live", "--live-speed", "0.001")
    page = Reader(process)
    assert page.has_frames.wait(PATIENCE)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "interrupted" in errors
    assert "Traceback" not in errors
    page.join(PATIENCE)
    assert "The run was aborted" in page.text


@pytest.mark.process
@pytest.mark.parametrize("more", [[], ["--wall-limit", "60"]])
def test_interruption_after_the_end_keeps_the_exit_code(
    start: Callable[..., subprocess.Popen[str]], passing_by: Path, more: list[str]
) -> None:
    process = start(str(passing_by), "--param", "OtherY=0", "--live", "--live-speed", "max", *more)
    page = Reader(process)
    assert page.has_ended.wait(PATIENCE)
    assert process.stderr is not None
    while "Close the page" not in process.stderr.readline():
        pass
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    page.join(PATIENCE)


@pytest.mark.process
def test_live_run_opens_its_address_in_the_browser(
    start: Callable[..., subprocess.Popen[str]], passing_by: Path, tmp_path: Path
) -> None:
    """The browser reads the page as one does, prints a line, and ends; then the run ends by itself."""
    browser = tmp_path / "browser"
    script = "import sys, urllib.request as u; a = sys.argv[1]; print('noise'); u.urlopen(a).read(); "
    script += "f = u.urlopen(a + 'events'); open('address', 'w').write(a); "
    script += "any(b'ended\":true' in line for line in f)"
    browser.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{_quoted(script)}" "$1"\n', encoding="utf-8")
    browser.chmod(0o755)
    process = start(str(passing_by), "--live", "--live-speed", "max", browser=str(browser))
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    found = ADDRESS.match(output)
    assert found is not None
    assert (tmp_path / "address").read_text(encoding="utf-8") == found[1]
    assert "noise" not in output


def _quoted(script: str) -> str:
    return script.replace("\\", "\\\\").replace('"', '\\"')
