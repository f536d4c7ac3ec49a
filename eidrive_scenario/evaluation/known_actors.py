"""Actors that a station knows: its objects matched with the ground truth by distance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.recording.frame import Frame

Source = Literal["own", "fused"]
"""Objects of a station: those that it perceives itself, or the result of fusion, which its planner gets."""


def objects_of(step: AgentStep, source: Source) -> Detections:
    """Return the own or the fused objects of a station."""
    return step.detections if source == "own" else step.fused


def nearest_pairs(first: Array, second: Array, within: float) -> list[tuple[int, int, float]]:
    """Return rows and horizontal distance [m] of pairs of boxes (N, 7) and (M, 7), each box in one pair at most.

    Pairs are formed in order of increasing distance of the centers, up to `within` [m].
    """
    if not len(first) or not len(second):
        return []
    offset = first[:, None, :2] - second[None, :, :2]
    distance = np.hypot(offset[..., 0], offset[..., 1])
    near = np.flatnonzero(distance <= within)
    pairs: list[tuple[int, int, float]] = []
    taken: tuple[set[int], set[int]] = set(), set()
    for flat in near[np.argsort(distance.ravel()[near], kind="stable")].tolist():
        row, other = divmod(flat, len(second))
        if row not in taken[0] and other not in taken[1]:
            taken[0].add(row)
            taken[1].add(other)
            pairs.append((row, other, float(distance[row, other])))
    return pairs


def known_actors(
    frame: Frame, station: str, source: Source, *, within: float, min_confidence: float = 0.0
) -> Mapping[str, float]:
    """Return the actors that a station knows, with the horizontal distance of their objects from them [m].

    An actor is known by an object whose center is at most `within` [m] from its own center. Each object stands for one
    actor only, so that duplicates and false objects do not count. The station itself is excluded.

    min_confidence  minimum probability of existence of an object, or its score if it has no such probability
    """
    step, view = frame.steps.get(station), frame.view
    if step is None:
        return {}
    objects = objects_of(step, source)
    boxes = objects.boxes
    if min_confidence > 0.0:
        boxes = boxes[objects.confidence >= min_confidence]
    others = [row for row, name in enumerate(view.names) if name != station]
    pairs = nearest_pairs(boxes, view.boxes[others].reshape(-1, 7), within)
    return {view.names[others[place]]: distance for _, place, distance in pairs}
