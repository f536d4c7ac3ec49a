"""Traffic lights and stop signs in pictures, told apart by the map."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.learned.classes import STOP_SIGN, light_state
from eidrive_scenario.perception.learned.image_network import ImageDetections
from eidrive_scenario.perception.projection import pixels
from eidrive_scenario.roads import RoadNetwork, Signal
from eidrive_scenario.sensing.readings import CameraReading, SignalReading

Array = NDArray[np.float64]

NEAR_BOX = 0.75
"""A signal of the map is one that was found if it lies within this many sizes of the box from the box's middle."""
STOP_TYPES = ("206",)
STOP = "stop"
"""The state of a stop sign that was found."""


class LightsOnMap:
    """Which signal of the map a box in a picture shows."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        signals = [] if roads is None else [signal for signal in roads.signals.items() if _wanted(signal[1])]
        self._ids = [name for name, _ in signals]
        self._dynamic = np.array([signal.dynamic for _, signal in signals], dtype=bool)
        self._places = np.empty((0, 3))
        if roads is not None and signals:
            poses = [(roads.signal_pose(signal), signal.height / 2.0) for _, signal in signals]
            self._places = np.array([(pose.x, pose.y, pose.z + rise) for pose, rise in poses])

    def read(
        self, found: Mapping[str, ImageDetections], cameras: Mapping[str, CameraReading]
    ) -> tuple[SignalReading, ...]:
        """The signals of the map that were found, each once, by the surest box; in the order of the map."""
        best: dict[int, tuple[float, str]] = {}
        for name, detections in found.items():
            for row, score, state in self._matched(detections, cameras[name]):
                if row not in best or score > best[row][0]:
                    best[row] = (score, state)
        return tuple(SignalReading(self._ids[row], best[row][1]) for row in sorted(best))

    def _matched(self, found: ImageDetections, camera: CameraReading) -> list[tuple[int, float, str]]:
        if not len(self._places):
            return []
        places, _ = pixels(self._places, camera)
        matched = []
        for box, score, name in zip(found.boxes, found.scores.tolist(), found.classes, strict=True):
            state = STOP if name == STOP_SIGN else light_state(name)
            if state is None:
                continue
            size = np.maximum(box[2:] - box[:2], 2.0)
            away = np.abs(places - (box[:2] + box[2:]) / 2.0) / size
            reach = np.where(np.isnan(away).any(axis=1), np.inf, away.max(axis=1))
            reach[self._dynamic == (name == STOP_SIGN)] = np.inf
            nearest = int(np.argmin(reach))
            if reach[nearest] <= NEAR_BOX:
                matched.append((nearest, score, state))
        return matched


def _wanted(signal: Signal) -> bool:
    return signal.dynamic or signal.type in STOP_TYPES
