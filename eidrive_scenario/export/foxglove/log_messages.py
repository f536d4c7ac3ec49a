"""Log messages: storyboard transitions, decisions of planners, contacts, commands, verdicts, and message outcomes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.export.foxglove.schemas import Foxglove, set_stamp
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.decisions import Decisions
from eidrive_scenario.recording.text.link_text import describe_expired, describe_link
from eidrive_scenario.recording.text.run_log import describe_change, describe_kind
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import LinkEvent


class RunMessages:
    """Log messages of a run.

    verdicts  of the run; a violation is logged at its time, and all verdicts at the end
    """

    def __init__(self, foxglove: Foxglove, verdicts: Sequence[Verdict]) -> None:
        self._foxglove = foxglove
        self._verdicts = verdicts
        self._violations = [verdict for verdict in verdicts if verdict.first_violation is not None]
        self._decisions = Decisions()

    def of_frame(self, frame: Frame) -> Iterator[Any]:
        """Yield the messages of the next frame."""
        time = frame.view.time
        for contact in frame.view.contacts:
            text = f"contact of {contact.first} and {contact.second} at {contact.impact_speed:.2f} m/s"
            yield self._message(time, "ERROR", "contact", text)
        for command in frame.commands:
            yield self._message(time, "INFO", "command", f"{command.type}: {command.content.strip()}")
        for change in frame.changes:
            if change.transition is not None:
                text = f"{describe_kind(change.kind)} {change.path} {describe_change(change)}"
                yield self._message(time, "INFO", "storyboard", text)
        for name, step in frame.steps.items():
            for row in step.expired:
                yield self._message(time, "WARNING", name, describe_expired(step.inbox[row].message))
        for name, plan in self._decisions.new(frame):
            yield self._message(time, "INFO" if plan.braking is None else "WARNING", name, plan.reason)
        due = [one for one in self._violations if (one.first_violation or 0.0) <= time + TIME_TOLERANCE]
        for verdict in due:
            level = "INFO" if verdict.passed else "ERROR"
            yield self._message(time, level, "criterion", f"{verdict.name}: violated; {verdict.reason}")
        self._violations = [one for one in self._violations if one not in due]

    def of_links(self, events: Sequence[LinkEvent], time: float) -> Iterator[Any]:
        """Yield the outcomes of messages between stations."""
        for event in events:
            level = "DEBUG" if event.outcome == "delivered" else "WARNING"
            yield self._message(time, level, event.receiver, describe_link(event))

    def at_end(self, time: float) -> Iterator[Any]:
        """Yield the verdicts."""
        for verdict in self._verdicts:
            level = "INFO" if verdict.passed else "ERROR"
            outcome = "passed" if verdict.passed else "failed"
            yield self._message(time, level, "criterion", f"{verdict.name}: {outcome}; {verdict.reason}")

    def _message(self, time: float, level: str, name: str, text: str) -> Any:
        message = self._foxglove.log(level=self._foxglove.log.Level.Value(level), name=name, message=text)
        set_stamp(message.timestamp, time)
        return message
