"""Traffic lights and stop signs in images, identified by the map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools, Floats
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.learned.image_network import STOP_SIGN, UNKNOWN, light_state, resized
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import (
    FLASHES_PER_SECOND,
    GREEN,
    RED,
    YELLOW,
    lamp_colors,
    must_stop,
)
from eidrive_scenario.sensing.readings import CameraReading, SignalReading
from eidrive_scenario.sensing.signals import RANGE, SIGNAL_KINDS, signal_kind
from eidrive_scenario.world.road_objects import signal_heads

WEIGHTS = Path(__file__).parents[1] / "weights" / "lamps.npz"
NONE = "none"
"""Output for a region without a visible light."""
SHOWN = ("red", "redYellow", "yellow", "green", "off", NONE)
"""States that the network distinguishes, in the order of its outputs."""
CROP = (16, 32)
"""Width and height of the network input [px]."""
REGION_HEIGHT = 2.0
"""Height of the region in heights of the light; its width is half of its height."""
DARKEST = 0.05
"""Minimum brightness, as a share of white, for the normalization of a region."""


def crops(image: NDArray[np.uint8], centers: Array, heights: Array) -> Floats:
    """Return regions (N, 3, 32, 16) of an image (H, W, 3) around the centers (N, 2) of lights of these heights (N,)
    [px].

    The maximum value of each region is 1. Pixels outside the image repeat its border.
    """
    regions = np.empty((len(centers), 3, CROP[1], CROP[0]), dtype=np.float32)
    for row, ((x, y), height) in enumerate(zip(centers.tolist(), heights.tolist(), strict=True)):
        high = max(REGION_HEIGHT * height, 4.0)
        region = _region(image, x - high / 4.0, y - high / 2.0, x + high / 4.0, y + high / 2.0)
        regions[row] = resized(region, CROP).transpose(2, 0, 1) / np.float32(255.0)
    brightest = regions.max(axis=(1, 2, 3), keepdims=True, initial=DARKEST)
    return np.asarray(regions / brightest, dtype=np.float32)


def _region(image: NDArray[np.uint8], left: float, top: float, right: float, bottom: float) -> NDArray[np.uint8]:
    """Return the pixels between these edges."""
    x0, y0 = int(np.floor(left + 0.5)), int(np.floor(top + 0.5))
    columns = np.arange(x0, max(int(np.floor(right + 0.5)), x0 + 1)).clip(0, image.shape[1] - 1)
    lines = np.arange(y0, max(int(np.floor(bottom + 0.5)), y0 + 1)).clip(0, image.shape[0] - 1)
    return np.asarray(image[lines[:, None], columns[None]])


class LampNetwork:
    """Network of three convolutions and one linear layer in numpy that classifies the state of lights.

    weights   `w0 b0 w1 b1 w2 b2`, kernels (O, I, 3, 3), and `w3` (6, 1024), `b3`, of training/train_lamps.py
    """

    def __init__(self, weights: dict[str, Floats]) -> None:
        self._weights = weights

    def probabilities(self, regions: Floats) -> Floats:
        """Return the probability (N, 6) of each state in SHOWN for regions (N, 3, 32, 16)."""
        if not len(regions):
            return np.empty((0, len(SHOWN)), dtype=np.float32)
        w = self._weights
        features = _max_pool(_convolve(regions, w["w0"], w["b0"]))
        features = _max_pool(_convolve(features, w["w1"], w["b1"]))
        features = _convolve(features, w["w2"], w["b2"])
        logits = features.reshape(len(features), -1) @ w["w3"].T + w["b3"]
        shares = np.exp(logits - logits.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True), dtype=np.float32)


@cache
def lamp_network() -> LampNetwork:
    """Return the network with the shipped weights."""
    with np.load(WEIGHTS) as stored:
        return LampNetwork({name: stored[name].astype(np.float32) for name in stored.files})


def _convolve(features: Floats, kernel: Floats, bias: Floats) -> Floats:
    """Return the 3 x 3 convolution of (N, I, H, W) with zero padding, followed by a ReLU."""
    padded = np.pad(features, ((0, 0), (0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(2, 3))
    convolved = np.tensordot(windows, kernel, axes=((1, 4, 5), (1, 2, 3))) + bias
    return np.ascontiguousarray(np.maximum(convolved, 0.0).transpose(0, 3, 1, 2), dtype=np.float32)


def _max_pool(features: Floats) -> Floats:
    """Return the maximum of each 2 x 2 block."""
    count, channels, height, width = features.shape
    return np.asarray(features.reshape(count, channels, height // 2, 2, width // 2, 2).max(axis=(3, 5)))


NEAR_BOX = 0.75
"""Maximum distance of a signal of the map from the center of its box, in box sizes."""
LEAST_FACING = 0.25
"""Minimum cosine of the angle between the direction of a light and that to the camera for visible lamps."""
LEAST_HEIGHT = 6.0
"""Minimum height of a light in the image [px]."""
SURE, SURE_IN_BOX = 0.9, 0.6
"""Minimum probability of a lamp state: for lights that only the map locates, and for detected lights."""
STOP = "stop"
"""State of a detected stop sign."""
_REQUIRED_LAMPS = {"red": {RED}, "redYellow": {RED, YELLOW}, "yellow": {YELLOW}, "green": {GREEN}}
"""Lamps that a light requires for each state."""


class LightView(NamedTuple):
    """Traffic light of the map that may be in an image: its row in the heads of the map, id, center and height [px]."""

    row: int
    id: str
    center: tuple[float, float]
    height: float


class LightsOnMap:
    """Association of image boxes with signals of the map, and lamp states of traffic lights.

    A light is detected by the network, or located by the map. Its state is read from the lamps in the image by a
    separate small network. If that is not certain, the class of the detector is used.
    """

    def __init__(self, roads: RoadNetwork | None) -> None:
        heads = [] if roads is None else signal_heads(roads)
        heads = [head for head in heads if signal_kind(head.signal) in SIGNAL_KINDS]
        self.ids = [head.signal.id for head in heads]
        """Ids of the signals, in the order of the map."""
        self._dynamic: Bools = np.array([head.signal.dynamic for head in heads], dtype=bool)
        self._feet = np.array([head.pose[:3] for head in heads], dtype=float).reshape(-1, 3)
        self._heights = np.array([head.height for head in heads], dtype=float)
        self._facing = np.array([(math.cos(head.pose.h), math.sin(head.pose.h)) for head in heads]).reshape(-1, 2)
        colors = [set(lamp_colors(head.signal)) for head in heads]
        self._possible: Bools = np.array(
            [[_REQUIRED_LAMPS.get(state, set()) <= own for state in SHOWN] for own in colors], dtype=bool
        ).reshape(-1, len(SHOWN))

    def read(
        self, detected: Mapping[str, ImageDetections], cameras: Mapping[str, CameraReading]
    ) -> tuple[SignalReading, ...]:
        """Return the visible signals of the map, each once with its most certain state, in the order of the map."""
        best: dict[int, tuple[float, str]] = {}
        for name, camera in cameras.items() if self.ids else ():
            boxes = self.match(detected[name], camera) if name in detected else {}
            for row, (score, state) in (boxes | self._lamp_states(camera, boxes)).items():
                if state != UNKNOWN and (row not in best or score > best[row][0]):
                    best[row] = (score, state)
        return tuple(SignalReading(self.ids[row], best[row][1]) for row in sorted(best))

    def in_view(self, camera: CameraReading) -> list[LightView]:
        """Return the lights within range and within the image that face the camera."""
        to_camera = camera.pose[:2, 3] - self._feet[:, :2]
        away = np.maximum(np.hypot(to_camera[:, 0], to_camera[:, 1]), 1e-6)
        towards = np.einsum("ni,ni->n", to_camera, self._facing) >= LEAST_FACING * away
        rows = np.flatnonzero(self._dynamic & towards & (away <= RANGE))
        if not rows.size:
            return []
        tops = self._feet[rows] + self._heights[rows, None] * (0.0, 0.0, 1.0)
        low, high = pixels(self._feet[rows], camera)[0], pixels(tops, camera)[0]
        centers, heights = (low + high) / 2.0, np.abs(low - high)[:, 1]
        inside = ((centers >= 0.0) & (centers < camera.size)).all(axis=1) & (heights >= LEAST_HEIGHT)
        return [
            LightView(int(rows[k]), self.ids[rows[k]], (float(centers[k, 0]), float(centers[k, 1])), float(heights[k]))
            for k in np.flatnonzero(inside).tolist()
        ]

    def _lamp_states(
        self, camera: CameraReading, boxes: Mapping[int, tuple[float, str]]
    ) -> dict[int, tuple[float, str]]:
        """Return the states of the lamps and their probabilities, by rows of lights."""
        views = self.in_view(camera)
        if not views:
            return {}
        centers, heights = np.array([view.center for view in views]), np.array([view.height for view in views])
        shares = lamp_network().probabilities(crops(camera.rgb, centers, heights))
        states = {}
        for view, share in zip(views, shares, strict=True):
            likely = np.where(self._possible[view.row], share, 0.0)
            in_box = view.row in boxes
            if in_box:
                likely[SHOWN.index(NONE)] = 0.0
                likely /= max(float(likely.sum()), 1e-9)
            index = int(np.argmax(likely))
            if SHOWN[index] != NONE and likely[index] >= (SURE_IN_BOX if in_box else SURE):
                states[view.row] = (float(likely[index]), SHOWN[index])
        return states

    def match(self, detections: ImageDetections, camera: CameraReading) -> dict[int, tuple[float, str]]:
        """Return score and state of the box with the highest score for each signal, by its row."""
        positions, _ = pixels(self._feet + self._heights[:, None] * (0.0, 0.0, 0.5), camera)
        matches: dict[int, tuple[float, str]] = {}
        for box, score, name in zip(detections.boxes, detections.scores.tolist(), detections.classes, strict=True):
            state = STOP if name == STOP_SIGN else light_state(name)
            if state is None:
                continue
            size = np.maximum(box[2:] - box[:2], 2.0)
            away = np.abs(positions - (box[:2] + box[2:]) / 2.0) / size
            reach = np.where(np.isnan(away).any(axis=1), np.inf, away.max(axis=1))
            reach[self._dynamic == (name == STOP_SIGN)] = np.inf
            nearest = int(np.argmin(reach))
            if reach[nearest] <= NEAR_BOX and (nearest not in matches or score > matches[nearest][0]):
                matches[nearest] = (score, state)
        return matches


DARK = "off"
FLASHING_YELLOW = "yellow flashing"
IMAGES, SPAN = 3, 3.0 / FLASHES_PER_SECOND
"""Minimum number and usual time [s] of the readings in which a light is dark or flashes."""
KEPT = 10
"""Number of readings that are kept beyond this time, which is too short for lights that are rarely read."""
FLASH_SHARE = 0.25
"""Minimum share of yellow, and of dark, readings of a flashing light, half of which are expected."""


class LightStates:
    """States of lights over several images, as some are misread.

    Red and yellow count from the first reading on, other lamps from the second one in succession. A light is dark if it
    is in all of the last ten readings, in those of three periods of flashing lamps, and in three at least; until then
    its last state is kept. If some of them are yellow and all others dark, it flashes.
    """

    def __init__(self) -> None:
        self._readings: dict[str, list[tuple[float, str]]] = {}
        """Times and states of the last readings, by the id of the signal, the newest last."""
        self._states: dict[str, str] = {}

    def confirm(self, readings: Sequence[SignalReading], time: float) -> tuple[SignalReading, ...]:
        """Return the states of the signals that are read in the images of `time` [s], without those not confirmed."""
        start = time - SPAN - TIME_TOLERANCE
        for reading in readings:
            kept = [*self._readings.get(reading.id, ()), (time, reading.state)]
            kept = [*(old for old in kept[:-KEPT] if old[0] >= start), *kept[-KEPT:]]
            self._readings[reading.id] = kept
            confirmed = _confirmed([state for _, state in kept])
            if confirmed is not None:
                self._states[reading.id] = confirmed
        names = (reading.id for reading in readings)
        return tuple(SignalReading(name, self._states[name]) for name in names if name in self._states)


def _confirmed(states: Sequence[str]) -> str | None:
    """Return the state that these readings of one light confirm, the newest last; None if they confirm no other one."""
    newest, yellow, dark = states[-1], states.count("yellow"), states.count(DARK)
    if len(states) >= IMAGES and yellow + dark == len(states):
        if min(yellow, dark) >= FLASH_SHARE * len(states):
            return FLASHING_YELLOW
        if not yellow:
            return DARK
    return newest if newest != DARK and (must_stop(newest) or states[-2:-1] == [newest]) else None


def signal_kinds(classes: Sequence[str]) -> frozenset[str]:
    """Return the kinds of signals that a network of these classes reads.

    Lights need no class, as the map locates their lamps.
    """
    return SIGNAL_KINDS if STOP_SIGN in classes else SIGNAL_KINDS - {"stop sign"}
