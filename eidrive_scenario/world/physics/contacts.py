"""Start of contacts between boxes, with impact speeds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Bools, Integers
from eidrive_scenario.geometry import box_corners, box_distance, overlap, points_in_box
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bodies import Body
from eidrive_scenario.world.physics.couplings import PARTED, Couplings
from eidrive_scenario.world.view import FEW, Contact

ROUNDING = 1e-6
"""Least distance beyond the hysteresis at which boxes certainly have parted [m]."""


class Touch(NamedTuple):
    """Contact that pybullet reported within the step."""

    position: Vector3
    impact_speed: float


class ContactTracker:
    """Tracker of starting contacts: overlaps of boxes at the ends of steps, and contacts in pybullet.

    A contact that began while a trailer was connected to its vehicle is none until they have parted.
    """

    def __init__(self, couplings: Couplings) -> None:
        self._couplings = couplings
        self._touching: dict[tuple[str, str], None] = {}

    def forget(self, name: str) -> None:
        """Delete the contacts of a removed actor."""
        self._touching = {pair: None for pair in self._touching if name not in pair}

    def update(self, bodies: Sequence[Body], touches: dict[tuple[str, str], Touch]) -> tuple[Contact, ...]:
        """Return the contacts that started since the last call; `touches` are those of pybullet by pair of names."""
        if not self._touching and not touches and not any(body.moved for body in bodies):
            return ()
        begun: list[Contact] = []
        near = {(first.name, second.name): (first, second) for first, second in _near_pairs(bodies)}
        moved = {body.name for body in bodies if body.moved} if self._touching else set()
        for pair in [pair for pair in self._touching if pair not in touches]:
            if pair in near:
                first, second = near[pair]
                if box_distance(first.box, second.box) <= PARTED:
                    continue
            elif moved.isdisjoint(pair):
                continue
            del self._touching[pair]
        for pair, (first, second) in near.items():
            if pair in self._touching or pair in touches or not overlap(first.box, second.box):
                continue
            self._touching[pair] = None
            if frozenset(pair) in self._couplings.pairs:
                continue
            begun.append(
                Contact(
                    *pair, _shared_point(first, second), relative_speed(first.velocity_before, second.velocity_before)
                )
            )
        for pair, touch in touches.items():
            if pair not in self._touching:
                self._touching[pair] = None
                begun.append(Contact(*pair, touch.position, touch.impact_speed))
        return tuple(begun)


class ContactsOfTick:
    """Contacts that the view of a tick has: those that started in the last step, and those of actors added before it.

    Contacts of actors that are added after the view was taken are those of the next view. The contacts of several added
    actors are found at once, in the order of addition.
    """

    def __init__(self, couplings: Couplings) -> None:
        self._tracker = ContactTracker(couplings)
        self._started: tuple[Contact, ...] = ()
        self._late: tuple[Contact, ...] = ()
        """Contacts of actors that were added after the view was taken."""
        self._is_viewed = False
        self._has_added = False

    def note_addition(self) -> None:
        """Note that an actor was added. `find_added` has to be called before another change."""
        self._has_added = True

    def find_added(self, bodies: Mapping[str, Body]) -> None:
        """Find the contacts of actors that were added since the last call."""
        if not self._has_added:
            return
        self._has_added = False
        rows = {name: row for row, name in enumerate(bodies)}
        found = self._tracker.update(tuple(bodies.values()), {})
        in_order = tuple(sorted(found, key=lambda one: (rows[one.second], rows[one.first])))
        if self._is_viewed:
            self._late += in_order
        else:
            self._started += in_order

    def forget(self, name: str) -> None:
        """Delete the contacts of a removed actor that no view has had yet."""
        self._tracker.forget(name)
        self._late = tuple(one for one in self._late if name not in (one.first, one.second))

    def step(self, bodies: Sequence[Body], touches: dict[tuple[str, str], Touch]) -> None:
        """Find the contacts that started in a step; `touches` are those of pybullet."""
        self._started = self._late + self._tracker.update(bodies, touches)
        self._late, self._is_viewed = (), False

    def viewed(self) -> tuple[Contact, ...]:
        """Return the contacts for the view of the tick, which is taken now."""
        self._is_viewed = True
        return self._started


def _near_pairs(bodies: Sequence[Body]) -> Iterator[tuple[Body, Body]]:
    """Yield pairs with a moved body that may be within the hysteresis, in the order of the bodies.

    Few bodies are compared by their circles only.
    """
    if len(bodies) > FEW:
        yield from _near_pairs_of_many(bodies)
        return
    for index, first in enumerate(bodies):
        x, y, radius, moved = first.center_x, first.center_y, first.radius + PARTED, first.moved
        for other in range(index + 1, len(bodies)):
            second = bodies[other]
            if moved or second.moved:
                dx, dy, reach = second.center_x - x, second.center_y - y, radius + second.radius
                if dx * dx + dy * dy <= reach * reach:
                    yield first, second


def _near_pairs_of_many(bodies: Sequence[Body]) -> Iterable[tuple[Body, Body]]:
    """Yield pairs by a sweep along x, as only consecutive bodies in x can be near, and by axes that separate them."""
    x, y, radius, moved = np.array([(b.center_x, b.center_y, b.radius, b.moved) for b in bodies]).T
    order = np.argsort(x, kind="stable")
    sorted_x = x[order]
    last = sorted_x.searchsorted(sorted_x + radius[order] + radius.max() + PARTED, side="right")
    counts = last - np.arange(len(bodies)) - 1
    left = np.arange(len(bodies)).repeat(counts)
    within = np.arange(len(left)) - (counts.cumsum() - counts).repeat(counts)
    first, second = order[left], order[left + within + 1]
    near = np.hypot(x[first] - x[second], y[first] - y[second]) <= radius[first] + radius[second] + PARTED
    near &= (moved[first] + moved[second]) > 0
    near[near] = ~_are_apart(bodies, first[near], second[near])
    pairs = np.sort(np.stack([first[near], second[near]], axis=1), axis=1)
    for row, other in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist():
        yield bodies[row], bodies[other]


def _are_apart(bodies: Sequence[Body], first: Integers, second: Integers) -> Bools:
    """Return whether an axis of one of two boxes separates them by more than the hysteresis, for pairs of rows."""
    rows = np.unique(np.concatenate([first, second]))
    values = [
        (b.center_x, b.center_y, math.cos(b.yaw), math.sin(b.yaw), b.spec.size[0] / 2, b.spec.size[1] / 2)
        for b in map(bodies.__getitem__, rows.tolist())
    ]
    table = np.array(values).reshape(-1, 6)[rows.searchsorted([first, second])]
    x, y, cos, sin, half_length, half_width = table.transpose(2, 0, 1)
    dx, dy = x[1] - x[0], y[1] - y[0]
    turn_cos, turn_sin = abs(cos[0] * cos[1] + sin[0] * sin[1]), abs(cos[0] * sin[1] - sin[0] * cos[1])
    along = abs(dx * cos + dy * sin) - half_length - turn_cos * half_length[::-1] - turn_sin * half_width[::-1]
    across = abs(dy * cos - dx * sin) - half_width - turn_sin * half_length[::-1] - turn_cos * half_width[::-1]
    apart: Bools = (np.maximum(along, across) > PARTED + ROUNDING).any(axis=0)
    return apart


def _shared_point(first: Body, second: Body) -> Vector3:
    """Return the mean of the corners of each box inside the other, or of the centers if there are none."""
    boxes = np.array([first.box, second.box])
    corners = box_corners(boxes)
    inside = [corners[0][points_in_box(corners[0], boxes[1])], corners[1][points_in_box(corners[1], boxes[0])]]
    points = np.concatenate(inside)
    bottom = max(boxes[0, 2] - boxes[0, 5] / 2, boxes[1, 2] - boxes[1, 5] / 2)
    top = min(boxes[0, 2] + boxes[0, 5] / 2, boxes[1, 2] + boxes[1, 5] / 2)
    middle = points.mean(axis=0) if len(points) else boxes[:, :3].mean(axis=0)
    return float(middle[0]), float(middle[1]), float((bottom + top) / 2)


def relative_speed(first: Vector3, second: Vector3) -> float:
    """Return the magnitude of the difference of two velocities [m/s]."""
    return math.dist(first, second)
