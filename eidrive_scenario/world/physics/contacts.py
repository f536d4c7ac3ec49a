"""Start of contacts between boxes, with impact speeds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from eidrive_scenario.geometry import box_corners, box_distance, overlap, points_in_box
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bodies import Body
from eidrive_scenario.world.physics.body_group import BodyGroup, SingleBodies
from eidrive_scenario.world.physics.couplings import PARTED, Couplings
from eidrive_scenario.world.view import Contact


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

    def update(self, bodies: BodyGroup, touches: dict[tuple[str, str], Touch]) -> tuple[Contact, ...]:
        """Return the contacts that started since the last call; `touches` are those of pybullet by pair of names."""
        if not self._touching and not touches and not bodies.any_moved():
            return ()
        begun: list[Contact] = []
        near = {(first.name, second.name): (first, second) for first, second in bodies.near_pairs(PARTED)}
        moved = bodies.moved_names() if self._touching else set()
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
        found = self._tracker.update(SingleBodies(tuple(bodies.values())), {})
        in_order = tuple(sorted(found, key=lambda one: (rows[one.second], rows[one.first])))
        if self._is_viewed:
            self._late += in_order
        else:
            self._started += in_order

    def forget(self, name: str) -> None:
        """Delete the contacts of a removed actor that no view has had yet."""
        self._tracker.forget(name)
        self._late = tuple(one for one in self._late if name not in (one.first, one.second))

    def step(self, bodies: BodyGroup, touches: dict[tuple[str, str], Touch]) -> None:
        """Find the contacts that started in a step; `touches` are those of pybullet."""
        self._started = self._late + self._tracker.update(bodies, touches)
        self._late, self._is_viewed = (), False

    def viewed(self) -> tuple[Contact, ...]:
        """Return the contacts for the view of the tick, which is taken now."""
        self._is_viewed = True
        return self._started


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
