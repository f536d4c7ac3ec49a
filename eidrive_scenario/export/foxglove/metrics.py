"""Numbers of actors and stations for plots, as JSON messages."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.world.view import WorldView

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
