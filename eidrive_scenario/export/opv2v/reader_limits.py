"""Limits of programs that read OPV2V datasets. They omit what exceeds them without a message.

The values are those of OpenCOOD 31ba160 (`opencood/data_utils/datasets/basedataset.py`, `opencood/utils/box_utils.py`
and the files in `opencood/hypes_yaml`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from eidrive_scenario.base.arrays import Array

MAX_STATIONS = 7
"""Maximum number of stations."""
COMMUNICATION_RANGE = 70.0
"""Maximum distance of a station from the ego [m]."""
TRUTH_RANGE: Array = np.array([[-140.0, -40.0, -3.0], [140.0, 40.0, 1.0]])
"""Box around the lidar of the ego that contains all corners of true objects [m]."""
MAX_OBJECTS = 100
"""Maximum number of true objects in a frame."""


class ReaderLimits:
    """Record of what exceeds the limits in the frames of a run."""

    def __init__(self) -> None:
        self._ego = ""
        self._nearest: dict[str, float] = {}
        self._too_high: dict[str, dict[str, None]] = {}
        self._most_objects = 0

    def observe(
        self, lidars: Mapping[str, Array], listed: Mapping[str, Iterable[str]], corners: Mapping[str, Array]
    ) -> None:
        """Record a frame.

        lidars   pose (4, 4) of the lidar of each station, that of the ego first
        listed   true objects of each station
        corners  corners (8, 3) of each true object, world frame [m]
        """
        self._ego, ego = next(iter(lidars.items()))
        for name, pose in lidars.items():
            distance = float(np.linalg.norm(pose[:2, 3] - ego[:2, 3]))
            self._nearest[name] = min(distance, self._nearest.get(name, distance))
        self._most_objects = max(self._most_objects, len(corners))
        for name, pose in lidars.items():
            for other in corners if name == self._ego else listed[name]:
                if _is_too_high(pose, corners[other]):
                    self._too_high.setdefault(name, {})[other] = None

    def warnings(self) -> list[str]:
        """Return the limits that are exceeded."""
        messages = []
        if len(self._nearest) > MAX_STATIONS:
            messages.append(f"OpenCOOD uses {MAX_STATIONS} of {len(self._nearest)} stations (train_params.max_cav)")
        for name, distance in self._nearest.items():
            if distance > COMMUNICATION_RANGE:
                messages.append(
                    f"OpenCOOD never uses station {name!r}: its lidar is at least {distance:.0f} m from that of "
                    f"{self._ego!r} (COM_RANGE {COMMUNICATION_RANGE:g} m)"
                )
        low, high = TRUTH_RANGE[:, 2]
        for name, objects in self._too_high.items():
            kind = "the truth" if name == self._ego else "the truth of late fusion"
            messages.append(
                f"OpenCOOD omits {', '.join(map(repr, objects))} from {kind} of some frames: the box leaves "
                f"z = {low:g} to {high:g} m of the lidar of {name!r}"
            )
        if self._most_objects > MAX_OBJECTS:
            messages.append(f"OpenCOOD fails: a frame has {self._most_objects} true objects (postprocess.max_num)")
        return messages


def _is_too_high(pose: Array, corners: Array) -> bool:
    """Return whether corners (8, 3) are in range of a lidar with this pose in plan view, and not by their heights."""
    low, high = TRUTH_RANGE
    local = (corners - pose[:3, 3]) @ pose[:3, :3]
    inside = (low <= local) & (local <= high)
    return bool(inside[:, :2].all() and not inside[:, 2].all())
