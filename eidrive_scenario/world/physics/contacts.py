"""Start of contacts between boxes, with impact speeds; vehicles and trailers, which may overlap."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from eidrive_scenario.base.geometry import box_corners, box_distance, overlap, points_in_box
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bodies import Body
from eidrive_scenario.world.physics.body_group import BodyGroup
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.view import Contact

PARTED = 0.05
"""Minimum gap after a contact before a new one is counted [m], and before a disconnected trailer collides again. It
prevents that a scrape counts as many contacts."""

Pair = frozenset[str]


class Couplings:
    """Pairs of a vehicle and its trailer: no collision between them is resolved, and no contact begins."""

    def __init__(self, client: int) -> None:
        self._client = client
        self.pairs: frozenset[Pair] = frozenset()
        """Names of connected actors."""
        self.is_complete = True
        """Whether all of them, and no others, pass through each other, so that `update` has nothing to do."""
        self._apart: dict[Pair, tuple[int, int]] = {}
        """Handles of the bodies that do not collide with each other."""

    def set_pairs(self, pairs: frozenset[Pair]) -> None:
        """Set which actors are connected."""
        self.pairs = pairs
        self.note_change()

    def note_change(self) -> None:
        """Note that bodies have entered or left."""
        self.is_complete = not self.pairs and not self._apart

    def attached(self, name: str) -> frozenset[str]:
        """Return the actors that are connected to an actor directly or by others, without the actor itself."""
        if not self.pairs:
            return frozenset()
        connected, added = {name}, {name}
        while added:
            added = {other for pair in self.pairs if pair & added for other in pair} - connected
            connected |= added
        return frozenset(connected - {name})

    def update(self, bodies: Mapping[str, Body]) -> None:
        """Set which bodies collide; those of a disconnected trailer and its vehicle only after they have parted."""
        for pair in sorted(self.pairs | self._apart.keys(), key=sorted):
            if not pair <= bodies.keys():
                self._apart.pop(pair, None)
                continue
            first, second = (bodies[name] for name in sorted(pair))
            handles = first.handle, second.handle
            if pair not in self.pairs and box_distance(first.box, second.box) > PARTED:
                self._collide(handles, True)
                del self._apart[pair]
            elif self._apart.get(pair) != handles:
                self._collide(handles, False)
                self._apart[pair] = handles
        self.is_complete = self._apart.keys() <= self.pairs

    def _collide(self, handles: tuple[int, int], enabled: bool) -> None:
        bullet.setCollisionFilterPair(*handles, -1, -1, int(enabled), physicsClientId=self._client)


Touches = dict[tuple[str, str], tuple[Vector3, float]]
"""Points [m] and impact speeds [m/s] of the contacts that pybullet reported within a step.

The key is the pair of names in the order of the rows of the view, a building last.
"""


_NearPairs = dict[tuple[str, str], tuple[Body, Body]]
"""Bodies that may touch, by the names of both."""


class ContactTracker:
    """Tracker of the contacts that start: overlaps of boxes at the ends of steps, and contacts in pybullet.

    A contact that began while a trailer was connected to its vehicle is none until they have parted. The view of a tick
    has the contacts that started in the last step, and those of actors that were added before it is taken. Contacts of
    actors that are added later are those of the next view.
    """

    def __init__(self, couplings: Couplings) -> None:
        self._couplings = couplings
        self._touching: dict[tuple[str, str], None] = {}
        self._started: tuple[Contact, ...] = ()
        self._late: tuple[Contact, ...] = ()
        """Contacts of actors that were added after the view was taken."""
        self._is_viewed = False
        self._has_added = False

    def note_addition(self) -> None:
        """Note that an actor was added. `find_added` has to be called before another change."""
        self._has_added = True

    def find_added(self, bodies: Mapping[str, Body]) -> None:
        """Find the contacts of actors that were added since the last call, in the order of addition."""
        if not self._has_added:
            return
        self._has_added = False
        rows = {name: row for row, name in enumerate(bodies)}
        started = self._start(_near_pairs(BodyGroup(tuple(bodies.values()))), {})
        in_order = tuple(sorted(started, key=lambda contact: (rows[contact.second], rows[contact.first])))
        if self._is_viewed:
            self._late += in_order
        else:
            self._started += in_order

    def forget(self, name: str) -> None:
        """Delete the contacts of a removed actor that no view has had yet."""
        self._touching = {pair: None for pair in self._touching if name not in pair}
        self._late = tuple(contact for contact in self._late if name not in (contact.first, contact.second))

    def step(self, bodies: BodyGroup, touches: Touches, is_near_object: Callable[[Body, str, float], bool]) -> None:
        """Find the contacts that started in a step.

        touches         contacts of pybullet
        is_near_object  whether a static object of a name is within a margin of a body [m]
        """
        near = _near_pairs(bodies)
        self._end_parted(near, bodies, touches, is_near_object)
        self._started = self._late + self._start(near, touches)
        self._late, self._is_viewed = (), False

    def viewed(self) -> tuple[Contact, ...]:
        """Return the contacts for the view of the tick, which is taken now."""
        self._is_viewed = True
        return self._started

    def _end_parted(
        self,
        near: _NearPairs,
        bodies: BodyGroup,
        touches: Touches,
        is_near_object: Callable[[Body, str, float], bool],
    ) -> None:
        """Forget the contacts of pairs that have parted in a step."""
        if not self._touching:
            return
        moved = bodies.moved_names()
        named = {body.name: body for body in bodies.members}
        for pair in [pair for pair in self._touching if pair not in touches]:
            if pair in near:
                first, second = near[pair]
                if frozenset(pair) in self._couplings.pairs or box_distance(first.box, second.box) <= PARTED:
                    continue
            elif moved.isdisjoint(pair) or (pair[1] not in named and is_near_object(named[pair[0]], pair[1], PARTED)):
                continue
            del self._touching[pair]

    def _start(self, near: _NearPairs, touches: Touches) -> tuple[Contact, ...]:
        """Return the contacts that started since the last call."""
        begun: list[Contact] = []
        for pair, (first, second) in near.items():
            if pair in self._touching or pair in touches or not overlap(first.box, second.box):
                continue
            self._touching[pair] = None
            if frozenset(pair) not in self._couplings.pairs:
                speed = math.dist(first.velocity_before, second.velocity_before)
                begun.append(Contact(*pair, _shared_point(first, second), speed))
        for pair, touch in touches.items():
            if pair not in self._touching:
                self._touching[pair] = None
                begun.append(Contact(*pair, *touch))
        return tuple(begun)


def _near_pairs(bodies: BodyGroup) -> _NearPairs:
    return {(first.name, second.name): (first, second) for first, second in bodies.near_pairs(PARTED)}


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
