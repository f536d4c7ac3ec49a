"""The limit of the wall time of a run: it interrupts Python code in any thread, and names what was running."""

from __future__ import annotations

import re
import signal
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from faulty_extensions import line_of, write_scenario
from threads import run_in_thread

from eidrive_scenario.base import wall_limit
from eidrive_scenario.base.wall_limit import LastResort, current_limit, limit_wall_time, set_last_resort, signal_name
from eidrive_scenario.errors import InputError, WallLimitError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

pytestmark = pytest.mark.timeout(600)
LONG = 3600.0
"""A limit that no run here reaches [s]."""


def watchdogs() -> list[threading.Thread]:
    """Return the running threads of limits."""
    return [thread for thread in threading.enumerate() if thread.name == "eidrive wall limit" and thread.is_alive()]


def hung(tmp_path: Path, detector: str) -> WallLimitError:
    """Return the error of a run that is interrupted; its time begins when all is loaded."""
    simulation = Simulation(write_scenario(tmp_path / "s.xosc", detector=detector))
    with pytest.raises(WallLimitError) as caught:
        simulation.run(wall_limit=1.0)
    return caught.value


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("detector", "name", "time", "lines"),
    [
        ("hangs", "Hangs", 0.5, ("while readings.time >= AFTER:", "time.sleep(0.001)")),
        ("swallows", "Swallows", 0.5, ("while readings.time >= AFTER:", "time.sleep(0.001)")),
        ("sleeps", "Sleeps", 0.0, ("time.sleep(3600.0)",)),
    ],
)
def test_hung_detector_is_interrupted_and_named(
    package: Path, tmp_path: Path, detector: str, name: str, time: float, lines: tuple[str, ...]
) -> None:
    error = hung(tmp_path, detector)
    assert error.place is not None
    assert (error.place.kind, error.place.value, error.place.subject) == ("detector", f"faulty:{name}", "station 'Ego'")
    assert error.place.file == str(package / "faulty.py")
    assert error.place.time == pytest.approx(time)
    assert error.place.line is not None
    assert (package / "faulty.py").read_text().splitlines()[error.place.line - 1].strip() in lines


@pytest.mark.exhaustive
def test_hung_detector_in_another_thread_is_interrupted(package: Path, tmp_path: Path) -> None:
    errors: list[WallLimitError] = []
    thread = threading.Thread(target=lambda: errors.append(hung(tmp_path, "hangs")))
    thread.start()
    thread.join()
    assert errors[0].place is not None
    assert errors[0].place.name == "hangs"


@pytest.mark.process
@pytest.mark.parametrize("is_main", [True, False])
def test_interruption_in_a_finalizer_aborts_the_run_at_its_next_step(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_main: bool
) -> None:
    """The interpreter ignores exceptions in finalizers, and pytest would report it. No second interruption follows."""
    monkeypatch.setattr(wall_limit, "REPEAT", LONG)

    class Interrupted:
        def __del__(self) -> None:
            while True:
                pass

    class Deletes:
        def observe(self, frame: Frame) -> None:
            times.append(frame.view.time)
            if frame.view.time > 0.0:
                Interrupted()

        def close(self) -> None:
            pass

    times: list[float] = []
    errors: list[WallLimitError] = []

    def run() -> None:
        simulation = Simulation(write_scenario(tmp_path / "s.xosc", end=3600.0), observers=[Deletes()])
        with pytest.raises(WallLimitError) as caught:
            simulation.run(wall_limit=1.0)
        errors.append(caught.value)

    run_in_thread(run, is_main=is_main)
    assert times == [0.0, 0.05]
    assert re.search(r"not finished at t = \d+\.\d{3} s after 1 s of wall time", str(errors[0]))


def test_run_that_ends_after_its_limit_is_aborted(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the watchdog thread, which may not run before a short run ends."""
    monkeypatch.setattr(wall_limit._Watchdog, "_watch", lambda watchdog: None)
    simulation = Simulation(write_scenario(tmp_path / "s.xosc", end=0.0))
    with pytest.raises(WallLimitError, match=r"after 1e-06 s of wall time"):
        simulation.run(wall_limit=1e-6)


@pytest.mark.exhaustive
def test_hung_constructor_is_interrupted_while_loading(package: Path, tmp_path: Path) -> None:
    with pytest.raises(WallLimitError, match=r"detector 'hangs_when_built'.*still running in __init__"):
        run_file(write_scenario(tmp_path / "s.xosc", detector="hangs_when_built"), wall_limit=3.0)


@pytest.mark.exhaustive
def test_hung_run_leaves_a_readable_partial_recording(package: Path, tmp_path: Path) -> None:
    """0.5 s of frames at 0.05 s, and the hung tick is not among them."""
    scenario = write_scenario(tmp_path / "s.xosc", detector="hangs")
    with pytest.raises(WallLimitError) as caught:
        run_and_save(scenario, out=tmp_path / "run", wall_limit=5.0)
    (note,) = [note for note in caught.value.__notes__ if note.startswith("recording: ")]
    recording = read_recording(Path(note.removeprefix("recording: ")))
    assert [round(frame.view.time, 3) for frame in recording.frames()] == [round(0.05 * tick, 3) for tick in range(10)]


def test_limit_that_is_not_reached_changes_nothing(package: Path, tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path / "s.xosc")
    before = signal.getsignal(signal.SIGUSR2)
    free, limited = run_file(scenario), run_file(scenario, wall_limit=LONG)
    assert limited.trace_hash == free.trace_hash
    assert limited.settings == free.settings
    assert signal.getsignal(signal.SIGUSR2) is before
    assert current_limit() is None
    assert not watchdogs()


def test_limit_of_block_without_run_names_the_line(tmp_path: Path) -> None:
    with pytest.raises(WallLimitError, match=rf"{__file__}:\d+ in test_limit_of_block"), limit_wall_time(0.2):
        time.sleep(LONG)


def test_outer_limit_stays_within_an_inner_one(tmp_path: Path) -> None:
    with limit_wall_time(LONG) as outer, limit_wall_time(0.001) as inner:
        assert inner is outer
        time.sleep(0.05)


def test_interruption_while_a_block_ends_leaves_no_limit() -> None:
    """The handler is called at each call and line of the code that ends the block, in one repetition each.

    A signal within a trace function would stop the interpreter: its check for signals is repeated forever.
    """
    before = signal.getsignal(signal.SIGUSR2)
    seen = event = 0

    def trace(frame: FrameType, kind: str, argument: object) -> Any:
        nonlocal seen
        if frame.f_code.co_filename == wall_limit.__file__ and frame.f_code.co_name in ("__exit__", "stop"):
            handler = signal.getsignal(signal.SIGUSR2)
            if seen == event and handler is not before:
                assert callable(handler)
                handler(signal.SIGUSR2, frame)
            seen += 1
        return trace

    usual = sys.gettrace()
    for event in range(100):
        seen = 0
        try:
            with suppress(WallLimitError), limit_wall_time(LONG):
                sys.settrace(trace)
        finally:
            sys.settrace(usual)
        assert current_limit() is None, f"event {event}"
        assert signal.getsignal(signal.SIGUSR2) is before, f"event {event}"
        assert not watchdogs(), f"event {event}"
        if seen <= event:
            break
    assert 8 < event < 99


@pytest.mark.exhaustive
def test_limits_that_end_with_their_blocks_leave_none() -> None:
    """The limit is reached about when the block ends, in the main thread and in another one."""

    def blocks(count: int) -> None:
        for number in range(count):
            with suppress(WallLimitError), limit_wall_time(0.01):
                end = time.perf_counter() + 0.009 + 0.00002 * number
                while time.perf_counter() < end:
                    pass
            assert current_limit() is None

    blocks(100)
    thread = threading.Thread(target=blocks, args=(100,))
    thread.start()
    thread.join()
    assert not watchdogs()


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf"), "60", True])
def test_limit_that_is_not_a_positive_number_is_refused(package: Path, tmp_path: Path, seconds: float) -> None:
    with pytest.raises(InputError, match="give a positive number of seconds"):
        run_file(write_scenario(tmp_path / "s.xosc"), settings=RunSettings(), wall_limit=seconds)


def test_limit_beyond_the_timers_of_the_system_is_not_reached(tmp_path: Path) -> None:
    """Timers of faulthandler and of threads have 64 bits of nanoseconds."""
    with (tmp_path / "dump").open("w") as dump:
        before = set_last_resort(LastResort(lambda limit, frame: None, dump))
        try:
            with limit_wall_time(1e308) as limit:
                assert limit is not None
                assert limit.armed
        finally:
            set_last_resort(before)


def test_line_of_finds_the_package_line(package: Path) -> None:
    text = (package / "faulty.py").read_text().splitlines()
    assert "sys.exit(0)" in text[line_of("sys.exit(0)") - 1]


def test_signal_name_of_a_real_time_signal_is_its_number() -> None:
    """Python names the first and the last real-time signal only."""
    assert signal_name(signal.SIGKILL) == "SIGKILL"
    assert signal_name(signal.SIGRTMIN + 3) == f"signal {signal.SIGRTMIN + 3}"
