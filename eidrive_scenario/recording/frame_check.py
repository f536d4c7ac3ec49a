"""Whether a frame that was read fits together, as a frame of a run does."""

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
"""Columns of the arrays of a view; 0 for one number per actor."""


def check_frame(frame: Frame) -> None:
    """Raise ValueError if the time is not a number or the arrays of the view do not have a row for each actor."""
    view = frame.view
    if not math.isfinite(view.time):
        raise ValueError(f"the time is {view.time}")
    count = len(view.names)
    if len(view.categories) != count or len(set(view.names)) != count:
        raise ValueError("the names of the actors do not fit")
    for name, columns in _COLUMNS.items():
        shape = getattr(view, name).shape
        if shape != ((count, columns) if columns else (count,)):
            raise ValueError(f"{name} has shape {shape} for {count} actors")
