"""State at the first violation of criteria: its frame, criteria of third parties, and violations found too late."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.evaluation import Criterion, CriterionSettings, Verdict, evaluate_criteria
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState

DT = 0.05


class Doubtful(Criterion):
    """Criterion of a third party that fails from a time on, and states the violation from another time on.

    Its verdict is an error before `readable`.
    """

    name = "doubtful"
    subjects = ("Ego", "Other")

    def __init__(self, fails: float | None, stated: float = 0.0, readable: float = 0.0) -> None:
        super().__init__(CriterionSettings())
        self.fails, self.stated, self.readable = fails, stated, readable
        self.now = 0.0
        self.asked = 0

    def observe(self, frame: Frame) -> None:
        self.now = frame.view.time

    def verdict(self) -> Verdict:
        self.asked += 1
        if self.now < self.readable:
            raise ZeroDivisionError
        failed = self.fails is not None and self.now >= max(self.fails, self.stated)
        return self.conclude(not failed, "", first_violation=self.fails if failed else None)


def detections(time: float, *places: float) -> Detections:
    """Return objects on the x axis."""
    boxes = np.array([[x, 0.0, 0.75, 4.0, 2.0, 1.5, 0.0] for x in places]).reshape(-1, 7)
    count = len(places)
    nothing = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
    return Detections(time, boxes, np.ones(count), ("car",) * count, *nothing)


def run(frame: Any, car: Any, seconds: float, delay: float | None, speed: float = 10.0) -> list[Frame]:
    """Return frames in which Other drives away from Ego along x, 20 m ahead at first, and is known by messages of RSU.

    The messages have this delay [s], and none arrives without one; the fused objects are those of the newest message.
    """
    frames: list[Frame] = []
    for tick in range(round(seconds / DT) + 1):
        time = tick * DT
        actors = {"Ego": car(0), "Other": car(20.0 + speed * time, 0.0, 0.0, speed)}
        inbox: tuple[ReceivedMessage, ...] = ()
        fused = detections(time)
        if delay is not None and time >= delay - 1e-9:
            known = detections(time - delay, 20.0 + speed * (time - delay))
            state = StationState(time - delay, 0.0, 0.0, 0.0, 0.0, 0.0)
            inbox = (ReceivedMessage(Message("RSU", tick, time - delay, state, known, 100), time),)
            fused = known
        plan = Plan(np.zeros((1, 2)), np.array([8.0]), f"decision {tick}", acceleration=-1.0)
        step = AgentStep(detections(time), inbox, fused, plan, None, ())
        frames.append(Frame(frame(time, actors).view, {"Ego": step}))
    return frames


def state(frames: Sequence[Frame], criterion: Criterion) -> list[str]:
    (verdict,) = evaluate_criteria(frames, [criterion])
    return list(verdict.violation_state)


@pytest.mark.parametrize("fails", [0.6, 1.0, 3.65, 7.95])
def test_state_is_that_of_the_frame_of_the_violation(frame: Any, car: Any, fails: float) -> None:
    """A message of 0.5 s ago has the place of a car at 10 m/s 5 m behind its true one."""
    assert state(run(frame, car, 8.0, delay=0.5), Doubtful(fails)) == [
        f"first violation at {fails:.2f} s",
        f"decision of Ego: drive at 8.0 m/s, acceleration -1.0 m/s²: decision {round(fails / DT)}",
        "Ego perceived Other 5.00 m from the truth, age 0.50 s (message of RSU)",
        "age of the newest messages at Ego: RSU 0.50 s",
    ]


def test_unperceived_actor_and_missing_messages_are_stated(frame: Any, car: Any) -> None:
    assert state(run(frame, car, 4.0, delay=None), Doubtful(3.0))[2:] == [
        "Ego perceived nothing of Other",
        "Ego received no message in the last 2.00 s",
    ]
    assert state(run(frame, car, 4.0, delay=None), Doubtful(1.0))[-1] == "Ego received no message so far"


def test_lost_object_has_the_age_of_its_last_measurement(frame: Any, car: Any) -> None:
    frames = run(frame, car, 3.0, delay=0.5)
    silent = run(frame, car, 3.0, delay=None)
    mixed = [early if early.view.time < 2.0 - 1e-9 else late for early, late in zip(frames, silent, strict=True)]
    # The last message arrived at 1.95 s and was generated at 1.45 s
    assert state(mixed, Doubtful(2.5))[2:] == [
        "Ego perceived nothing of Other, age of its last measurement 1.05 s (message of RSU)",
        "age of the newest messages at Ego: RSU 1.05 s",
    ]


def test_absent_actor_is_stated(frame: Any, car: Any) -> None:
    frames = [frame(0.0, {"Other": car(0)})]
    assert state(frames, Doubtful(0.0)) == ["first violation at 0.00 s", "Ego is absent"]


def test_failure_without_violation_has_the_state_of_the_last_frame(frame: Any, car: Any) -> None:
    class AtEnd(Doubtful):
        def verdict(self) -> Verdict:
            return self.conclude(False, "")

    assert state(run(frame, car, 2.0, delay=0.5), AtEnd(None))[:2] == [
        "state at the last tick, 2.00 s",
        "decision of Ego: drive at 8.0 m/s, acceleration -1.0 m/s²: decision 40",
    ]


def test_violation_stated_much_later_has_the_state_of_the_last_frame(frame: Any, car: Any) -> None:
    """No frame of 1 s is held at 6 s: the text says which state it has instead."""
    title = state(run(frame, car, 7.0, delay=0.5), Doubtful(1.0, stated=6.0))[0]
    assert title == "first violation at 1.00 s; state at the last tick, 7.00 s"


def test_passed_criterion_has_no_state_and_is_asked_once_per_second(frame: Any, car: Any) -> None:
    criterion = Doubtful(None)
    assert state(run(frame, car, 5.0, delay=0.5), criterion) == []
    assert criterion.asked <= 7  # at 0, 1, … 5 s, and at the end


def test_error_of_a_verdict_counts_at_the_end_only(frame: Any, car: Any) -> None:
    """A third party may compute its verdict from what it knows after a while."""
    title = state(run(frame, car, 4.0, delay=0.5), Doubtful(3.5, readable=2.0))[0]
    assert title == "first violation at 3.50 s"
    with pytest.raises(ZeroDivisionError):
        state(run(frame, car, 1.0, delay=0.5), Doubtful(0.5, readable=2.0))


def test_state_of_other_frames_is_no_difference_of_verdicts() -> None:
    """Recordings of older versions have no states."""
    verdict = Verdict("a", False, None, None, "", 1.0, "")
    assert verdict == Verdict("a", False, None, None, "", 1.0, "", violation_state=("first violation at 1.00 s",))
