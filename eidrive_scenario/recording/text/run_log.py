"""Human-readable log of a run: storyboard transitions, decisions of planners, radio messages, and the final state."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator, Sequence
from typing import Protocol, TextIO

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.files.atomic import create
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.elements import NO_TRIGGER
from eidrive_scenario.v2x.messages.message import LinkEvent, Message

_NUMBER = re.compile(r"\d+(\.\d+)?")


class Decisions:
    """Fold over the frames of a run that finds new decisions."""

    def __init__(self) -> None:
        self._last: dict[str, str] = {}

    def new(self, frame: Frame) -> Iterator[tuple[str, Plan]]:
        """Yield stations and plans whose reason differs from that of the former plan in more than its numbers."""
        for name, step in frame.steps.items():
            if step.plan is None:
                continue
            decision = _NUMBER.sub("", step.plan.reason)
            if self._last.get(name) != decision:
                self._last[name] = decision
                yield name, step.plan


NOT_TRANSMITTED = frozenset({"queue", "absent"})
"""Loss reasons of messages that a radio never transmitted."""

_SIGHT = {"los": "no obstacle", "nlosv": "behind", "nlos": "behind a building or the ground"}


def describe_expired(message: Message) -> str:
    """Return the text about a received message that is too old: `message 7 of RSU is not used: it is too old; …`."""
    text = f"message {message.number} of {message.sender} is not used: it is too old on arrival"
    return f"{text}; measured at {message.detections.time:.3f} s by the clock of {message.sender}"


def describe_link(link: LinkEvent) -> str:
    """Return sender, receiver, outcome and radio conditions of a message: `RSU to Ego, message 7: lost: busy; …`.

    Radio conditions are the path loss with shadowing and blockage [dB] and the signal-to-noise ratio [dB].
    """
    arrival = f"arrives at {link.arrives:.4f} s" if link.arrives is not None else ""
    outcome = arrival or f"lost: {link.reason.replace('_', ' ')}"
    text = f"{link.sender} to {link.receiver}, message {link.number}: {outcome}"
    if link.path_loss_db is None or link.snr_db is None or link.los is None:
        return text
    bodies = ", ".join(link.blockers)
    sight = _SIGHT[link.los] + (f" {bodies}" if link.los == "nlosv" else f", and {bodies}" if bodies else "")
    radio = f"path loss {link.path_loss_db:.1f} dB, signal to noise {link.snr_db:.1f} dB"
    return f"{text}; {radio}, {link.los.upper().replace('NLOSV', 'NLOSv')}: {sight}"


STANDARD_OUTPUT = "-"
_VERBS = {
    ElementTransition.START: "starts",
    ElementTransition.END: "ends",
    ElementTransition.STOP: "is stopped",
    ElementTransition.SKIP: "is skipped",
    None: "enters standbyState",
}


class _Result(Protocol):
    """Result of a run, which a higher layer defines."""

    @property
    def final_links(self) -> Sequence[LinkEvent]:
        """Message outcomes that became known in the last tick."""


class RunLog:
    """Observer that writes a line for each change: time [s], element, transition and reason.

    The path of the parent is added at the first mention of an element, and always if another element has the same name.
    The path `-` is standard output. Raise SettingError if the file cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._own = str(path) != STANDARD_OUTPUT
        self._stream: TextIO = io.TextIOWrapper(create(path), encoding="utf-8") if self._own else sys.stdout
        self._paths: dict[tuple[str, str], str] = {}
        self._ambiguous: set[tuple[str, str]] = set()
        self._mentioned: set[tuple[str, str]] = set()
        self._decisions = Decisions()

    def observe(self, frame: Frame) -> None:
        """Write one line for each change, new decision of a planner, message of a radio channel, and received message
        that is too old, in this frame.

        The standbyState of an element that starts in the same tick is omitted. The line of a message begins with its
        sending time.
        """
        started = {change.path for change in frame.changes if change.transition is ElementTransition.START}
        for change in frame.changes:
            if change.transition is not None or change.path not in started:
                self._stream.write(f"{change.time:9.3f} s  {self._title(change)} {describe_change(change)}\n")
        for name, step in frame.steps.items():
            for row in step.expired:
                self._stream.write(f"{frame.view.time:9.3f} s  {name}: {describe_expired(step.inbox[row].message)}\n")
        for name, plan in self._decisions.new(frame):
            self._stream.write(f"{frame.view.time:9.3f} s  {name}: {plan.reason}\n")
        self.write_links(frame.links)

    def write_links(self, links: Sequence[LinkEvent]) -> None:
        """Write a line for each message of a radio channel."""
        for link in links:
            if link.path_loss_db is not None or link.reason in NOT_TRANSMITTED:
                self._stream.write(f"{link.sent:9.3f} s  {describe_link(link)}\n")

    def conclude(self, result: _Result) -> None:
        """Write the messages whose outcome became known in the last tick."""
        self.write_links(result.final_links)

    def close(self) -> None:
        """Close the file."""
        if self._own:
            self._stream.close()
        else:
            self._stream.flush()

    def _title(self, change: StateChange) -> str:
        kind = describe_kind(change.kind)
        if change.path == change.kind:
            return kind
        key = (change.kind, change.element)
        if self._paths.setdefault(key, change.path) != change.path:
            self._ambiguous.add(key)
        parent = change.path.removesuffix(change.element).removesuffix("/")
        suffix = f" (in {parent})" if parent and (key not in self._mentioned or key in self._ambiguous) else ""
        self._mentioned.add(key)
        return f"{kind} {change.element}{suffix}"


def describe_kind(kind: str) -> str:
    """Return the words for the kind of a storyboard element, such as `maneuver group` for `maneuverGroup`."""
    return "maneuver group" if kind == "maneuverGroup" else kind


def describe_change(change: StateChange) -> str:
    """Return the transition of an element and its reason."""
    verb = _VERBS[change.transition]
    if change.transition is ElementTransition.END and change.after is ElementState.STANDBY:
        verb = "ends and returns to standbyState"
    return f"{verb}: {change.why}" if change.why and change.why != NO_TRIGGER else verb


_STORYBOARD = "storyboard"
LAST_DECISION = "last decision of "
"""Start of the lines about decisions in a final state."""
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

    def _observe_changes(self, changes: tuple[StateChange, ...]) -> None:
        end = next(
            (change for change in changes if change.kind == _STORYBOARD and change.after is ElementState.COMPLETE), None
        )
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
        events = [event for event in (self._running | self._interrupted).values() if event.kind == "event"]
        shown = ", ".join(f"{event.path} since {event.time:.2f} s" for event in events[:_SHOWN])
        more = f" and {len(events) - _SHOWN} more" if len(events) > _SHOWN else ""
        yield f"running events: {shown or 'none'}{more}"
        if self._last is not None:
            last = self._last
            element = describe_kind(last.kind) + (f" {last.path}" if last.path != last.kind else "")
            yield f"last change: {last.time:.2f} s {element} {describe_change(last)}"
        for name, step in frame.steps.items():
            if step.plan is not None:
                yield f"{LAST_DECISION}{name}: {describe_decision(step.plan)}: {step.plan.reason}"

    def _storyboard(self, now: float) -> str:
        if self._end is None:
            return f"running at {now:.2f} s"
        how = "stopped" if self._end.transition is ElementTransition.STOP else "complete"
        return f"{how} at {self._end.time:.2f} s" + (f": {self._end.why}" if self._end.why else "")


def describe_decision(plan: Plan) -> str:
    """Return what a plan does at its start, without its reason."""
    if plan.braking is not None:
        return f"brake with {plan.braking:.1f} m/s²"
    if len(plan.speeds) == 0:
        return "no trajectory"
    return f"drive at {float(plan.speeds[0]):.1f} m/s, acceleration {plan.acceleration:.1f} m/s²"
