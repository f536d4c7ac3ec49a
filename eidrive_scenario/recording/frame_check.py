"""Consistency check of a decoded frame."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.errors import quoted
from eidrive_scenario.recording.frame import Frame

MAX_TIME = 1e9
"""Maximum time of a frame [s]. In nanoseconds it fits into the 64 bits of MCAP."""
MAX_TICK = 2**32 - 1
"""Maximum tick of a frame: the sequence number of its message has 32 bits."""
MAX_NUMBER = 1e12
"""Maximum absolute value of the numbers of a view. Scenarios have positions and speeds of at most 1e9."""
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
    """Raise ValueError if time or tick are out of range, an array of the view does not have one row per actor, or a
    station names a message that it did not receive."""
    view = frame.view
    if not 0.0 <= view.time <= MAX_TIME:
        raise ValueError(f"time is out of range (got {view.time}; expected 0 to {MAX_TIME:g})")
    if not 0 <= view.tick <= MAX_TICK:
        raise ValueError(f"tick is out of range (got {quoted(view.tick)}; expected 0 to {MAX_TICK})")
    count = len(view.names)
    if len(view.categories) != count or len(set(view.names)) != count:
        raise ValueError("names and categories of the actors are inconsistent")
    for name, columns in _COLUMNS.items():
        array = getattr(view, name)
        if array.shape != ((count, columns) if columns else (count,)):
            raise ValueError(f"{name} has an invalid shape (got {array.shape} for {count} actors)")
        if not (np.abs(array) <= MAX_NUMBER).all():
            raise ValueError(f"{name} is out of range (expected -{MAX_NUMBER:g} to {MAX_NUMBER:g})")
    for name, step in frame.steps.items():
        if not all(0 <= row < len(step.inbox) for row in step.expired):
            raise ValueError(f"expired messages of {name} were not received (got rows {list(step.expired)[:5]})")
