"""TorchScript weights in a scenario: what check and run do with them, watched by an audit hook in a new process."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hostile_scenario import Write
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation

RED_BOXES = Path(__file__).parents[2] / "data" / "red_boxes.onnx"
WATCHED = """
import json, os, sys
allowed, report = sys.argv[1], sys.argv[2]
events = []

def note(event, arguments):
    if event == "open":
        path, mode, flags = arguments
        writes = isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        writes = writes or (isinstance(mode, str) and set(mode) & set("wax+"))
        if writes and path != os.devnull and not isinstance(path, int):
            events.append(["writes", str(path)])
    elif event.split(".")[0] in ("subprocess", "socket") or event in (
        "os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "pty.spawn",
    ):
        events.append([event, ""])
    elif event in ("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.chmod", "os.truncate",
                   "shutil.rmtree", "shutil.move"):
        events.append(["changes", str(arguments[0])])

sys.addaudithook(note)
sys.argv = ["eidrive", *sys.argv[3:]]
code = 0
try:
    from eidrive_scenario.cli import main
    main()
except SystemExit as end:
    code = end.code
result = {"code": code, "events": list(events), "torch": "torch" in sys.modules}
with open(report, "w") as stream:
    json.dump(result, stream)
"""
"""Runs `eidrive` with the arguments from the third on, and writes what an audit hook noticed to the second."""


HOSTILE_MODULE = """
import sys
from typing import Tuple
import torch

class Hostile(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.target = "{folder}/computed"

    @torch.jit.export
    def __getstate__(self) -> Tuple[str, bool]:
        return self.target, self.training

    @torch.jit.export
    def __setstate__(self, state: Tuple[str, bool]) -> None:
        self.target = state[0]
        self.training = state[1]
        torch.save(torch.ones(1), "{folder}/loaded")

    def forward(self, pixels: torch.Tensor) -> torch.Tensor:
        torch.save(pixels.sum(), self.target)
        return pixels.new_zeros((1, 3, 7))

torch.jit.script(Hostile()).save(sys.argv[1])
"""
"""A program that saves a TorchScript module which writes files."""


@pytest.fixture
def torchscript(tmp_path: Path) -> Path:
    """TorchScript that writes `loaded` beside itself when it is loaded, and `computed` when it is run.

    TorchScript cannot start a process by itself: its compiler refuses imports. Where torch is not installed, the file
    is none, which nothing that refuses it may notice.
    """
    path = tmp_path / "weights.pt"
    path.write_bytes(b"PK\x03\x04 code that nobody shall run")
    if importlib.util.find_spec("torch") is not None:
        module = tmp_path / "hostile_module.py"
        module.write_text(HOSTILE_MODULE.format(folder=tmp_path))
        subprocess.run([sys.executable, "-B", "-W", "ignore", str(module), str(path)], check=True)
        module.unlink()
    return path


def with_weights(write: Write, weights: Path) -> Path:
    """A scenario whose ego looks with these weights."""
    settings = f"{{weights: {weights}, classes: [car, truck], input_size: [96, 64]}}"
    return write({"detector": "yolov5", "detector_settings": settings})


def watched(folder: Path, *arguments: str, **environment: str) -> dict[str, object]:
    """Return the operations of `eidrive` with these arguments that an audit hook records."""
    report = folder / "report.json"
    inherited = {name: value for name, value in os.environ.items() if name != "EIDRIVE_ALLOW_TORCHSCRIPT"}
    command = [sys.executable, "-B", "-c", WATCHED, str(folder), str(report), *arguments]
    done = subprocess.run(command, env=inherited | environment, capture_output=True, text=True, check=False, cwd=folder)
    assert report.exists(), done.stderr
    found: dict[str, object] = json.loads(report.read_text())
    found["output"] = done.stdout + done.stderr
    return found


def written(folder: Path) -> set[str]:
    """Names of the files that the code of the weights has written."""
    return {name for name in ("loaded", "computed") if (folder / name).exists()}


def outside(found: dict[str, object], folder: Path | None) -> list[list[str]]:
    """The events that are no writing below a folder."""
    events: list[list[str]] = found["events"]  # type: ignore[assignment]
    return [
        [kind, path]
        for kind, path in events
        if kind not in ("writes", "changes")
        or folder is None
        or not os.path.abspath(os.path.join(folder.parent, path)).startswith(str(folder))
    ]


@pytest.mark.exhaustive
def test_check_with_torchscript_writes_nothing_starts_nothing_and_imports_no_torch(
    write: Write, torchscript: Path, tmp_path: Path
) -> None:
    """`check` refuses what `run` refuses; with permission it depends on the installation of torch, as for `run`."""
    path = with_weights(write, torchscript)
    installed = importlib.util.find_spec("torch") is not None
    refused, missing = "are TorchScript, which can execute any code", "torch"
    for allowed, code in (("", 2), ("1", 0 if installed else 2)):
        found = watched(tmp_path, "check", str(path), EIDRIVE_ALLOW_TORCHSCRIPT=allowed)
        assert found["code"] == code
        assert outside(found, None) == []
        assert found["torch"] is False
        assert written(tmp_path) == set()
        assert (refused in str(found["output"])) == (allowed == "")
        assert allowed == "" or installed or missing in str(found["output"])


@pytest.mark.exhaustive
def test_run_with_torchscript_is_refused_and_writes_only_to_its_output_folder(
    write: Write, torchscript: Path, tmp_path: Path
) -> None:
    path = with_weights(write, torchscript)
    out = tmp_path / "out"
    found = watched(tmp_path, "run", str(path), "--out", str(out), "--time-limit", "0.2")
    assert found["code"] == 2
    assert f"{path}:" in str(found["output"])
    assert "which can execute any code with your rights" in str(found["output"])
    assert outside(found, out) == []
    assert found["torch"] is False
    assert written(tmp_path) == set()


@pytest.mark.exhaustive
@pytest.mark.parametrize("by", ["option", "environment"])
def test_run_with_permission_executes_torchscript(write: Write, torchscript: Path, tmp_path: Path, by: str) -> None:
    """Torch writes without Python, so that an audit hook cannot see it: the files prove what is refused above."""
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    path = with_weights(write, torchscript)
    option = ["--allow-torchscript"] if by == "option" else []
    allowed = {"EIDRIVE_ALLOW_TORCHSCRIPT": "1"} if by == "environment" else {}
    command = ["run", str(path), "--no-record", "--time-limit", "0.2", *option]
    found = watched(tmp_path, *command, **allowed)
    assert found["code"] == 3  # out of time
    assert written(tmp_path) == {"loaded", "computed"}
    assert "--allow-torchscript" in next(
        line for line in str(found["output"]).splitlines() if line.startswith("reproduce: ")
    )


def test_run_without_weights_writes_only_to_its_output_folder(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    found = watched(tmp_path, "run", str(write()), "--out", str(out), "--time-limit", "0.2")
    assert found["code"] == 3  # out of time
    assert outside(found, out) == []
    assert [event for event in found["events"] if event[0] == "writes"]  # type: ignore[attr-defined]


@pytest.mark.process
def test_run_with_onnx_weights_writes_nothing_into_the_home_directory(write: Write, tmp_path: Path) -> None:
    """ONNX Runtime writes from native code, which an audit hook cannot see, and stops doing so under CI services."""
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    home, out = tmp_path / "home", tmp_path / "out"
    home.mkdir()
    command = ["run", str(with_weights(write, RED_BOXES)), "--out", str(out), "--time-limit", "0.2"]
    environment = {"PATH": os.defpath, "HOME": str(home)}
    program = "from eidrive_scenario.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-B", "-c", program, *command], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 3, done.stderr  # out of time
    assert list(out.rglob("result.json"))
    assert list(home.rglob("*")) == []


@pytest.mark.exhaustive
def test_check_of_shipped_and_onnx_weights_loads_none(write: Write, tmp_path: Path) -> None:
    """A file that is no model at all passes `check`, which does not read it; `run` refuses it."""
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no model")
    found = watched(tmp_path, "check", str(with_weights(write, broken)))
    assert (found["code"], found["torch"], outside(found, None)) == (0, False, [])
    found = watched(tmp_path, "check", str(write({"detector": "ssd"})))
    assert (found["code"], found["torch"], outside(found, None)) == (0, False, [])
    result = CliRunner().invoke(app, ["run", str(with_weights(write, broken)), "--no-record"])
    assert result.exit_code == 2
    assert "are not an ONNX model that can be read" in result.output


def test_run_with_permission_loads_torchscript(write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the option, by the environment variable, and by RunSettings."""
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")

    class Empty(torch.nn.Module):  # type: ignore[name-defined,misc]
        def forward(self, pixels: torch.Tensor) -> torch.Tensor:  # type: ignore[name-defined]
            return pixels.new_zeros((1, 3, 7))

    path = tmp_path / "empty.pt"
    with pytest.warns(DeprecationWarning, match="script"):
        torch.jit.script(Empty()).save(str(path))
    scenario = with_weights(write, path)
    command = ["run", str(scenario), "--no-record", "--time-limit", "0.2"]
    assert CliRunner().invoke(app, command).exit_code == 2
    assert CliRunner().invoke(app, [*command, "--allow-torchscript"]).exit_code == 3
    assert CliRunner().invoke(app, command, env={"EIDRIVE_ALLOW_TORCHSCRIPT": "1"}).exit_code == 3
    settings = RunSettings(time_limit=0.2, allow_torchscript=True)
    assert Simulation(load_scenario(scenario), settings=settings).run().end_reason == "time limit"


@pytest.mark.exhaustive
def test_library_scenarios_are_checked_without_torch(tmp_path: Path) -> None:
    found = watched(tmp_path, "check", str(library_path() / "coop"))
    assert found["torch"] is False
    assert outside(found, None) == []
