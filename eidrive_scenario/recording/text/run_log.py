"""What happened in a run, for human eyes: one line per change of the storyboard, with what fired and why."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import TextIO

from eidrive_scenario.files.atomic import create
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.link_text import OFF_THE_AIR, describe_link
from eidrive_scenario.storyboard.state.states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.elements import EMPTY

STANDARD_OUTPUT = "-"
_KINDS = {"maneuverGroup": "maneuver group"}
_VERBS = {
    ElementTransition.START: "starts",
    ElementTransition.END: "ends",
    ElementTransition.STOP: "is stopped",
    ElementTransition.SKIP: "is skipped",
    None: "stands by",
}


class RunLog:
    """Writes a line for each change: time [s], element, what became of it, and why.

    Those above an element are named when it is first spoken of, and always where another has the same name. Raises
    SettingError if the file cannot be written; `-` is standard output.
    """

    def __init__(self, path: str | Path) -> None:
        self._own = str(path) != STANDARD_OUTPUT
        self._stream: TextIO = io.TextIOWrapper(create(path), encoding="utf-8") if self._own else sys.stdout
        self._named: dict[tuple[str, str], str] = {}
        self._twice: set[tuple[str, str]] = set()
        self._told: set[tuple[str, str]] = set()

    def observe(self, frame: Frame) -> None:
        """A line for each change of this frame; who starts at once need not be said to stand by.

        And one for each message that a radio carried: when it was said, its fate, and what the radio did.
        """
        started = {change.path for change in frame.changes if change.transition is ElementTransition.START}
        for change in frame.changes:
            if change.transition is not None or change.path not in started:
                self._stream.write(f"{change.time:9.3f} s  {self._title(change)} {describe_change(change)}\n")
        for link in frame.links:
            if link.path_loss_db is not None or link.reason in OFF_THE_AIR:
                self._stream.write(f"{link.sent:9.3f} s  {describe_link(link)}\n")

    def close(self) -> None:
        """Finish the file."""
        if self._own:
            self._stream.close()
        else:
            self._stream.flush()

    def _title(self, change: StateChange) -> str:
        kind = _KINDS.get(change.kind, change.kind)
        if change.path == change.kind:
            return kind
        key = (change.kind, change.element)
        known = self._named.setdefault(key, change.path)
        if known != change.path:
            self._twice.add(key)
        above = change.path.rpartition("/")[0]
        told = f" (in {above})" if above and (key not in self._told or key in self._twice) else ""
        self._told.add(key)
        return f"{kind} {change.element}{told}"


def describe_change(change: StateChange) -> str:
    """What became of an element, and why."""
    verb = _VERBS[change.transition]
    if change.transition is ElementTransition.END and change.after is ElementState.STANDBY:
        verb = "ends, and stands by again"
    return f"{verb}: {change.why}" if change.why and change.why != EMPTY else verb
