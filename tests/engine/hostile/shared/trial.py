"""Trial of a file: `check` and `run` in a separate process with limits of memory and time."""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from eidrive_scenario.checks.scenario_checks import check_road_file, check_scenario
from eidrive_scenario.errors import EidriveError, InputError
from eidrive_scenario.extensions.library import definition
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation

MEMORY = 2 * 2**30
"""Bytes that a trial may use."""
TIME_LIMIT = 2.0
"""Simulated time of the run of a trial [s]."""
WAIT = 900.0
"""Wall time after which a trial counts as blocked [s]; other processes may take most of the processor."""


@dataclass(frozen=True)
class Outcome:
    """Result of a trial.

    kind       refused (with `errors` diagnostics), played, internal error, out of memory, hang, crash
    detail     the traceback of an internal error
    cpu_s      processor time of the process [s]
    peak_mb    its peak memory [MB]
    """

    kind: str
    detail: str
    cpu_s: float
    peak_mb: float


def attempt(path: Path, cpu_limit: int = 60, run: Callable[[Path], None] | None = None) -> Outcome:
    """Check and run a file in a forked process."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _child(path, writer, cpu_limit, run or check_and_run)
    os.close(writer)
    report = _read(reader, child)
    _, status, usage = os.wait4(child, 0)
    cpu, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        kind = "hang" if number in (signal.SIGXCPU, signal.SIGKILL) else "crash"
        return Outcome(kind, f"signal {number}\n{report.get('stage', '')}", cpu, peak)
    return Outcome(report.get("kind", "crash"), report.get("detail", ""), cpu, peak)


def check_and_run(path: Path) -> None:
    """Execute the operations of `check` and `run` on a file."""
    roads = definition(path) == "roads" or path.suffix == ".xodr"
    (check_road_file if roads else check_scenario)(path)
    if not roads:
        scenario = load_scenario(path)
        Simulation(scenario, seed=1, settings=RunSettings(time_limit=TIME_LIMIT)).run()


def _child(path: Path, writer: int, cpu_limit: int, run: Callable[[Path], None]) -> None:
    """Never returns."""
    kind, detail = "played", ""
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_limit, cpu_limit + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (_mapped() + MEMORY, _mapped() + MEMORY))
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        run(path)
    except InputError as error:
        kind, detail = "refused", "\n".join(str(diagnostic) for diagnostic in error.diagnostics)[:3000]
    except EidriveError as error:
        kind, detail = "refused", str(error)[:3000]
    except MemoryError:
        kind, detail = "out of memory", traceback.format_exc(limit=-6)
    except BaseException:
        kind, detail = "internal error", traceback.format_exc(limit=-8)[-4000:]
    os.write(writer, json.dumps({"kind": kind, "detail": detail}).encode())
    os._exit(0)


def _mapped() -> int:
    """Address space in use before the trial."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _read(reader: int, child: int) -> dict[str, str]:
    parts = []
    until = time.monotonic() + WAIT
    with os.fdopen(reader, "rb") as stream:
        while True:
            ready, _, _ = select.select([stream], [], [], max(until - time.monotonic(), 0.0))
            if not ready:
                os.kill(child, signal.SIGKILL)
                break
            part = os.read(stream.fileno(), 65536)
            if not part:
                break
            parts.append(part)
    text = b"".join(parts)
    return json.loads(text) if text else {}
