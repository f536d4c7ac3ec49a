"""The last resort of the wall limit: the end of a process whose run cannot be interrupted."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest
from faulty_extensions import write_scenario
from threads import run_in_thread

import eidrive_scenario
from eidrive_scenario.base import wall_limit
from eidrive_scenario.base.wall_limit import LastResort, Limit, limit_wall_time, set_last_resort
from eidrive_scenario.errors import WallLimitError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.simulation.attribution import describe_dump, describe_hung_run

pytestmark = pytest.mark.timeout(600)


def test_interruption_waits_until_notes_are_saved() -> None:
    """Otherwise a file remains open, which is a warning at a later time."""
    saved: list[str] = []

    def save(limit: Limit) -> None:
        if limit.notes:
            time.sleep(0.5)
            saved.extend(limit.notes)

    def add_note_and_hang() -> None:
        with limit_wall_time(0.1) as limit:
            assert limit is not None
            limit.add_note("a note")
            while True:
                pass

    before = set_last_resort(LastResort(end=lambda limit, frame: None, publish=save))
    try:
        with pytest.raises(WallLimitError):
            add_note_and_hang()
    finally:
        set_last_resort(before)
    assert saved == ["a note"]


@pytest.mark.process
@pytest.mark.parametrize("is_main", [True, False])
@pytest.mark.parametrize(("closing", "ends"), [(0.2, 1), (3600.0, 0)])
def test_interrupted_run_has_more_time_to_close_its_files(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_main: bool, closing: float, ends: int
) -> None:
    """An observer takes longer to close than uninterruptible code has before the last resort."""
    monkeypatch.setattr(wall_limit, "GRACE", 0.5)
    monkeypatch.setattr(wall_limit, "CLOSING", closing)

    class ClosesSlowly:
        def observe(self, frame: Frame) -> None:
            pass

        def close(self) -> None:
            until = time.monotonic() + 1.5
            while time.monotonic() < until and not resorts:
                time.sleep(0.01)
            closed.append(True)

    resorts: list[Limit] = []
    closed: list[bool] = []
    errors: list[WallLimitError] = []

    def run() -> None:
        scenario = write_scenario(tmp_path / "s.xosc", detector="hangs")
        simulation = Simulation(scenario, observers=[ClosesSlowly()])
        with pytest.raises(WallLimitError) as caught:
            simulation.run(wall_limit=1.0)
        errors.append(caught.value)

    before = set_last_resort(LastResort(end=lambda limit, frame: resorts.append(limit)))
    try:
        run_in_thread(run, is_main=is_main)
    finally:
        set_last_resort(before)
    assert (len(resorts), closed) == (ends, [True])
    assert errors[0].place is not None


def test_report_of_a_run_that_cannot_be_described_names_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise RuntimeError("changed during iteration")

    monkeypatch.setattr("eidrive_scenario.simulation.attribution.wall_limit_error", fail)
    assert "after 5 s of wall time" in str(describe_hung_run(Limit(5.0), sys._getframe()))


@pytest.mark.parametrize("module", ["simulation/simulation.py", "checks/scenario_checks.py"])
def test_dump_of_hung_run_or_check_names_line_of_its_thread(module: str) -> None:
    """The thread of the watchdog comes first, as faulthandler lists the newest thread first."""
    engine = Path(eidrive_scenario.__file__).parent
    reading = engine / "files" / "bounded.py"
    dump = f"""Timeout (0:00:12)!
Thread 0x00007f0000000002 (most recent call first):
  File "/usr/lib/python3.11/threading.py", line 331 in wait
  File "{engine / "base" / "wall_limit.py"}", line 161 in _watch

Thread 0x00007f0000000001 (most recent call first):
  File "{reading}", line 66 in read_regular_file
  File "{engine / module}", line 30 in collect
"""
    assert describe_dump(6.0, dump).where == f"{reading}:66 in read_regular_file"
