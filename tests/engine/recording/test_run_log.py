"""Log of a run: one line per storyboard transition, with its reason."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.errors import SettingError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.run_log import RunLog
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.elements import NO_TRIGGER

START, STOP, SKIP, END = ElementTransition.START, ElementTransition.STOP, ElementTransition.SKIP, ElementTransition.END
RUNNING, STANDBY, COMPLETE = ElementState.RUNNING, ElementState.STANDBY, ElementState.COMPLETE
Lines = Callable[..., list[str]]


def change(
    time: float, kind: str, path: str, what: ElementTransition | None, after: ElementState, why: str = ""
) -> StateChange:
    return StateChange(time, path.rpartition("/")[2], path, kind, STANDBY, what, after, why)


@pytest.fixture
def lines(make_frame: Callable[..., Frame], tmp_path: Path) -> Lines:
    """Return a function that writes the changes of several frames and returns the lines of the log."""

    def write(*frames: tuple[StateChange, ...]) -> list[str]:
        log = RunLog(tmp_path / "logs" / "run.log")
        for changes in frames:
            log.observe(replace(make_frame(), changes=changes, steps={}))
        log.close()
        return (tmp_path / "logs" / "run.log").read_text(encoding="utf-8").splitlines()

    return write


def test_run_log_writes_each_change_with_its_reason(lines: Lines) -> None:
    assert lines(
        (change(0.0, "storyboard", "storyboard", START, RUNNING), change(0.0, "act", "s/a", None, STANDBY)),
        (change(6.24, "act", "s/a", START, RUNNING, "simulation time 6.24 s > 6 s"),),
        (change(7.5, "act", "s/a", STOP, COMPLETE, "Ego: speed 12.01 m/s > 12 m/s"),),
    ) == [
        "    0.000 s  storyboard starts",
        "    0.000 s  act a (in s) enters standbyState",
        "    6.240 s  act a starts: simulation time 6.24 s > 6 s",
        "    7.500 s  act a is stopped: Ego: speed 12.01 m/s > 12 m/s",
    ]


def test_run_log_of_immediate_start_omits_standby_state(lines: Lines) -> None:
    together = (
        change(0.0, "maneuverGroup", "s/a/g", None, STANDBY),
        change(0.0, "maneuverGroup", "s/a/g", START, RUNNING, NO_TRIGGER),
    )
    assert lines(together) == ["    0.000 s  maneuver group g (in s/a) starts"]


def test_run_log_of_equal_names_adds_parents(lines: Lines) -> None:
    one, other = (change(1.0, "action", f"s/a/g/m/{event}/x", START, RUNNING) for event in ("one", "other"))
    assert lines((one,), (other,), (one,)) == [
        "    1.000 s  action x (in s/a/g/m/one) starts",
        "    1.000 s  action x (in s/a/g/m/other) starts",
        "    1.000 s  action x (in s/a/g/m/one) starts",
    ]


def test_run_log_of_names_with_slashes_keeps_them(lines: Lines) -> None:
    turn = StateChange(1.0, "left/right", "s/a/g/m/left/right", "event", STANDBY, START, RUNNING)
    assert lines((turn,)) == ["    1.000 s  event left/right (in s/a/g/m) starts"]


def test_run_log_of_skip_and_repetition_states_them(lines: Lines) -> None:
    assert lines(
        (change(1.0, "event", "e", SKIP, STANDBY, "other is running"),), (change(2.0, "event", "e", END, STANDBY),)
    ) == ["    1.000 s  event e is skipped: other is running", "    2.000 s  event e ends and returns to standbyState"]


def test_run_log_of_hyphen_writes_to_standard_output(
    make_frame: Callable[..., Frame], capsys: pytest.CaptureFixture[str]
) -> None:
    log = RunLog("-")
    log.observe(replace(make_frame(), steps={}))
    log.close()
    assert capsys.readouterr().out == "    0.000 s  event Stop (in Story/Act) starts: t > 3 s\n"


def test_run_log_of_unwritable_path_raises_setting_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(SettingError, match="cannot write"):
        RunLog(tmp_path / "file" / "run.log")


def test_run_log_writes_a_decision_when_more_than_its_numbers_change(
    make_frame: Callable[..., Frame], tmp_path: Path
) -> None:
    log = RunLog(tmp_path / "run.log")
    empty = Detections(0.0)
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    frame = replace(make_frame(), changes=())
    for reason in ("follow car 12 m ahead at 3.1 m/s", "follow car 9 m ahead at 0.0 m/s", "keep speed", "keep speed"):
        plan = Plan(points, np.ones(2), reason)
        log.observe(replace(frame, steps={"Ego": AgentStep(empty, (), empty, plan, None, ())}))
    log.close()
    written = (tmp_path / "run.log").read_text(encoding="utf-8").splitlines()
    assert [line.partition("s  ")[2] for line in written] == [
        "Ego: follow car 12 m ahead at 3.1 m/s",
        "Ego: keep speed",
    ]
