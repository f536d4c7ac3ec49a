"""Log messages, and numbers of actors and stations for plots as JSON messages."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.export.foxglove.schemas import Foxglove, stamp
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.run_log import (
    Decisions,
    describe_change,
    describe_expired,
    describe_kind,
    describe_link,
)
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.world.view import WorldView


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
        due = [verdict for verdict in self._violations if (verdict.first_violation or 0.0) <= time + TIME_TOLERANCE]
        for verdict in due:
            level = "INFO" if verdict.passed else "ERROR"
            lines = (f"{verdict.name}: violated; {verdict.reason}", *verdict.violation_state)
            yield self._message(time, level, "criterion", "\n".join(lines))
        self._violations = [verdict for verdict in self._violations if verdict not in due]

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
        number = self._foxglove.log.Level.Value(level)
        return self._foxglove.log(timestamp=stamp(time), level=number, name=name, message=text)


_NUMBER = {"type": "number"}
ACTOR: Mapping[str, str] = {
    "x": "x of the reference point [m]",
    "y": "y of the reference point [m]",
    "z": "z of the reference point [m]",
    "yaw": "heading [rad]",
    "speed": "speed along the heading [m/s]",
    "acceleration": "acceleration along the heading [m/s²]",
    "yaw_rate": "yaw rate [rad/s]",
}
STATION: Mapping[str, str] = {
    "detections": "own detections",
    "fused": "objects after fusion",
    "received": "messages that arrived in this step",
    "sent": "messages that were sent in this step",
    "planned_speed": "speed at the start of the plan [m/s]",
    "braking": "deceleration that the planner demands [m/s²], 0 without a demand",
    "throttle": "throttle in [0, 1]",
    "brake": "brake in [0, 1]",
    "steering": "steering angle [rad]",
}


def json_schema(title: str, fields: Mapping[str, str]) -> bytes:
    """Return the JSON schema of a message with these numbers; those that are unknown are missing."""
    properties = {name: {**_NUMBER, "description": text} for name, text in fields.items()}
    return json.dumps({"title": title, "type": "object", "properties": properties}, ensure_ascii=False).encode()


def actor_numbers(view: WorldView, row: int) -> bytes:
    """Return the numbers of an actor."""
    state = view.states[row]
    ahead = state.acceleration_x * math.cos(state.yaw) + state.acceleration_y * math.sin(state.yaw)
    values = (state.x, state.y, state.z, state.yaw, state.speed, ahead, state.yaw_rate)
    return _text(dict(zip(ACTOR, values, strict=True)))


def station_numbers(step: AgentStep) -> bytes:
    """Return the numbers of a station."""
    values: dict[str, float] = {
        "detections": len(step.detections),
        "fused": len(step.fused),
        "received": len(step.inbox),
        "sent": len(step.outbox),
    }
    if step.plan is not None and len(step.plan.speeds):
        values["planned_speed"] = float(step.plan.speeds[0])
        values["braking"] = step.plan.braking or 0.0
    if step.control is not None:
        for name in ("throttle", "brake", "steering"):
            values[name] = getattr(step.control, name)
    return _text(values)


def _text(values: Mapping[str, float]) -> bytes:
    finite = {name: value for name, value in values.items() if math.isfinite(value)}
    return json.dumps(finite, separators=(",", ":")).encode()
