"""Consistency check of a decoded frame."""

from __future__ import annotations

import math

from eidrive_scenario.recording.frame import Frame

_COLUMNS = {
    "position": 3,
    "yaw": 0,
    "pitch": 0,
    "roll": 0,
    "velocity": 3,
    "acceleration": 3,
    "yaw_rate": 0,
    "speed": 0,
    "size": 3,
    "offset": 3,
}
"""Number of columns of each array of a view; 0 for one number per actor."""


def check_frame(frame: Frame) -> None:
    """Raise ValueError if the time is not finite, an array of the view does not have one row per actor, or a station
    names a message that it did not receive."""
    view = frame.view
    if not math.isfinite(view.time):
        raise ValueError(f"time is not finite (got {view.time})")
    count = len(view.names)
    if len(view.categories) != count or len(set(view.names)) != count:
        raise ValueError("names and categories of the actors are inconsistent")
    for name, columns in _COLUMNS.items():
        shape = getattr(view, name).shape
        if shape != ((count, columns) if columns else (count,)):
            raise ValueError(f"{name} has an invalid shape (got {shape} for {count} actors)")
    for name, step in frame.steps.items():
        if not all(0 <= row < len(step.inbox) for row in step.expired):
            raise ValueError(f"expired messages of {name} were not received (got rows {list(step.expired)[:5]})")
