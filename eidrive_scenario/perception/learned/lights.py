"""Traffic lights and stop signs in pictures, told apart by the map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Bools
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned.classes import STOP_SIGN, light_state
from eidrive_scenario.perception.learned.lamps import NONE, SHOWN, crops, lamp_network
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import GREEN, RED, YELLOW, lamp_colors
from eidrive_scenario.sensing.readings import CameraReading, SignalReading
from eidrive_scenario.sensing.signals import RANGE, SIGNAL_KINDS, signal_kind
from eidrive_scenario.world.road_objects import signal_heads

NEAR_BOX = 0.75
"""A signal of the map is one that was found if it lies within this many sizes of the box from the box's middle."""
LEAST_FACING = 0.25
"""Cosine of the angle between where a light looks and where the camera is, below which its lamps are not seen."""
LEAST_HEIGHT = 6.0
"""Lights lower in the picture are not read [px]."""
SURE, SURE_IN_BOX = 0.9, 0.6
"""From which probability on lamps are believed: where nothing but the map says that there is a light, and where the
network has found one."""
STOP = "stop"
"""The state of a stop sign that was found."""
_NEEDS = {"red": {RED}, "redYellow": {RED, YELLOW}, "yellow": {YELLOW}, "green": {GREEN}}
"""The lamps that a light must have for each state."""


class LightView(NamedTuple):
    """A traffic light of the map that may be in a picture: its row in the map's heads, id, middle and height [px]."""

    row: int
    id: str
    middle: tuple[float, float]
    height: float


class LightsOnMap:
    """Which signals of the map the boxes in a picture show, and what the lamps of lights show.

    A light is found by the detector's network, or looked up where the map has it. Its state is read from the lamps in
    the picture, by a small network of its own; where that is not sure, the class that the detector gave counts.
    """

    def __init__(self, roads: RoadNetwork | None) -> None:
        heads = [] if roads is None else signal_heads(roads)
        heads = [head for head in heads if signal_kind(head.signal) in SIGNAL_KINDS]
        self._ids = [head.signal.id for head in heads]
        self._dynamic: Bools = np.array([head.signal.dynamic for head in heads], dtype=bool)
        self._feet = np.array([head.pose[:3] for head in heads], dtype=float).reshape(-1, 3)
        self._heights = np.array([head.height for head in heads], dtype=float)
        self._facing = np.array([(math.cos(head.pose.h), math.sin(head.pose.h)) for head in heads]).reshape(-1, 2)
        colors = [set(lamp_colors(head.signal)) for head in heads]
        self._possible: Bools = np.array(
            [[_NEEDS.get(state, set()) <= own for state in SHOWN] for own in colors], dtype=bool
        ).reshape(-1, len(SHOWN))

    def read(
        self, found: Mapping[str, ImageDetections], cameras: Mapping[str, CameraReading]
    ) -> tuple[SignalReading, ...]:
        """The signals of the map that were seen, each once, as the surest look has it; in the order of the map."""
        best: dict[int, tuple[float, str]] = {}
        for name, camera in cameras.items() if self._ids else ():
            boxes = self._matched(found[name], camera) if name in found else {}
            for row, (score, state) in (boxes | self._shown(camera, boxes)).items():
                if row not in best or score > best[row][0]:
                    best[row] = (score, state)
        return tuple(SignalReading(self._ids[row], best[row][1]) for row in sorted(best))

    def by_class(
        self, found: Mapping[str, ImageDetections], cameras: Mapping[str, CameraReading]
    ) -> tuple[SignalReading, ...]:
        """The same by the classes of the boxes alone."""
        best: dict[int, tuple[float, str]] = {}
        for name, detections in found.items() if self._ids else ():
            for row, look in self._matched(detections, cameras[name]).items():
                best[row] = max(best.get(row, look), look)
        return tuple(SignalReading(self._ids[row], best[row][1]) for row in sorted(best))

    def in_view(self, camera: CameraReading) -> list[LightView]:
        """The lights that are near enough, within the picture, and look towards the camera."""
        to_eye = camera.pose[:2, 3] - self._feet[:, :2]
        away = np.maximum(np.hypot(to_eye[:, 0], to_eye[:, 1]), 1e-6)
        towards = np.einsum("ni,ni->n", to_eye, self._facing) >= LEAST_FACING * away
        rows = np.flatnonzero(self._dynamic & towards & (away <= RANGE))
        if not rows.size:
            return []
        tops = self._feet[rows] + self._heights[rows, None] * (0.0, 0.0, 1.0)
        low, high = pixels(self._feet[rows], camera)[0], pixels(tops, camera)[0]
        middles, heights = (low + high) / 2.0, np.abs(low - high)[:, 1]
        size = camera.rgb.shape[1], camera.rgb.shape[0]
        inside = ((middles >= 0.0) & (middles < size)).all(axis=1) & (heights >= LEAST_HEIGHT)
        return [
            LightView(int(rows[k]), self._ids[rows[k]], (float(middles[k, 0]), float(middles[k, 1])), float(heights[k]))
            for k in np.flatnonzero(inside).tolist()
        ]

    def _shown(self, camera: CameraReading, boxes: Mapping[int, tuple[float, str]]) -> dict[int, tuple[float, str]]:
        """What the lamps show, and how sure that is, by the rows of lights."""
        views = self.in_view(camera)
        if not views:
            return {}
        middles, heights = np.array([view.middle for view in views]), np.array([view.height for view in views])
        shares = lamp_network().probabilities(crops(camera.rgb, middles, heights))
        found = {}
        for view, share in zip(views, shares, strict=True):
            likely = np.where(self._possible[view.row], share, 0.0)
            in_box = view.row in boxes
            if in_box:
                likely[SHOWN.index(NONE)] = 0.0
                likely /= max(float(likely.sum()), 1e-9)
            which = int(np.argmax(likely))
            if SHOWN[which] != NONE and likely[which] >= (SURE_IN_BOX if in_box else SURE):
                found[view.row] = (float(likely[which]), SHOWN[which])
        return found

    def _matched(self, found: ImageDetections, camera: CameraReading) -> dict[int, tuple[float, str]]:
        """Score and state of the surest box on each signal, by its row."""
        places, _ = pixels(self._feet + self._heights[:, None] * (0.0, 0.0, 0.5), camera)
        matched: dict[int, tuple[float, str]] = {}
        for box, score, name in zip(found.boxes, found.scores.tolist(), found.classes, strict=True):
            state = STOP if name == STOP_SIGN else light_state(name)
            if state is None:
                continue
            size = np.maximum(box[2:] - box[:2], 2.0)
            away = np.abs(places - (box[:2] + box[2:]) / 2.0) / size
            reach = np.where(np.isnan(away).any(axis=1), np.inf, away.max(axis=1))
            reach[self._dynamic == (name == STOP_SIGN)] = np.inf
            nearest = int(np.argmin(reach))
            if reach[nearest] <= NEAR_BOX and (nearest not in matched or score > matched[nearest][0]):
                matched[nearest] = (score, state)
        return matched


def signal_kinds(classes: Sequence[str]) -> frozenset[str]:
    """What can be read with a network of these classes: lights without it, as the map says where their lamps are."""
    return SIGNAL_KINDS if STOP_SIGN in classes else SIGNAL_KINDS - {"stop sign"}
