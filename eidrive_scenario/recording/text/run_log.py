"""Human-readable log of a run: one line per storyboard transition, decision of a planner and radio message."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, TextIO

from eidrive_scenario.files.atomic import create
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.decisions import Decisions
from eidrive_scenario.recording.text.link_text import NOT_TRANSMITTED, describe_expired, describe_link
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.elements import NO_TRIGGER
from eidrive_scenario.v2x.messages.message import LinkEvent

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

    def __init__(self, path: str | Path) -> None:
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
        parent = change.path.rpartition("/")[0]
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
