"""State of a run at its end: the storyboard, its running events, and the last decision of each driven station."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.run_log import describe_change, describe_kind
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange

_STORYBOARD = "storyboard"
_SHOWN = 5
"""Maximum number of running events that are listed."""


class FinalState:
    """Observer that keeps the last state of the storyboard and the last plans."""

    def __init__(self) -> None:
        self._frame: Frame | None = None
        self._running: dict[str, StateChange] = {}
        self._interrupted: dict[str, StateChange] = {}
        """Starts of the elements that were stopped with the storyboard, by path."""
        self._last: StateChange | None = None
        """Last change before the end of the storyboard."""
        self._end: StateChange | None = None

    def observe(self, frame: Frame) -> None:
        """Process one frame."""
        self._frame = frame
        if frame.changes:
            self._observe_changes(frame.changes)

    def close(self) -> None:
        """Do nothing: no file is open."""

    def _observe_changes(self, changes: tuple[StateChange, ...]) -> None:
        end = next((one for one in changes if one.kind == _STORYBOARD and one.after is ElementState.COMPLETE), None)
        for change in changes:
            start = self._running.pop(change.path, None)
            if change.after is ElementState.RUNNING:
                self._running[change.path] = change
            if end is None:
                self._last = change
            elif start is not None and change.transition is ElementTransition.STOP:
                self._interrupted[change.path] = start
        self._end = end or self._end

    def lines(self) -> tuple[str, ...]:
        """Return the state as lines of text; empty before the first frame."""
        return () if self._frame is None else tuple(self._lines(self._frame))

    def _lines(self, frame: Frame) -> Iterator[str]:
        now = frame.view.time
        yield f"storyboard: {self._storyboard(now)}"
        events = [one for one in (self._running | self._interrupted).values() if one.kind == "event"]
        shown = ", ".join(f"{one.path} since {one.time:.2f} s" for one in events[:_SHOWN])
        more = f" and {len(events) - _SHOWN} more" if len(events) > _SHOWN else ""
        yield f"running events: {shown or 'none'}{more}"
        if self._last is not None:
            last = self._last
            element = describe_kind(last.kind) + (f" {last.path}" if last.path != last.kind else "")
            yield f"last change: {last.time:.2f} s {element} {describe_change(last)}"
        for name, step in frame.steps.items():
            if step.plan is not None:
                yield f"decision of {name}: {_decision(step.plan)}: {step.plan.reason}"

    def _storyboard(self, now: float) -> str:
        if self._end is None:
            return f"running at {now:.2f} s"
        how = "stopped" if self._end.transition is ElementTransition.STOP else "complete"
        return f"{how} at {self._end.time:.2f} s" + (f": {self._end.why}" if self._end.why else "")


def _decision(plan: Plan) -> str:
    if plan.braking is not None:
        return f"brake with {plan.braking:.1f} m/s²"
    if len(plan.speeds) == 0:
        return "no trajectory"
    return f"drive at {float(plan.speeds[0]):.1f} m/s, acceleration {plan.acceleration:.1f} m/s²"
