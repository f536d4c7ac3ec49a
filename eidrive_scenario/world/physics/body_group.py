"""All bodies of a world in their order: how the scripted ones move, and which are near each other."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.physics.bodies import Body, ScriptedBody
from eidrive_scenario.world.physics.footprints import Footprints, near_rows
from eidrive_scenario.world.view import FEW, ActorState

FEW_PAIRS = 1500
"""Maximum number of pairs of bodies of which all are compared faster than arrays select them."""


class BodyGroup(ABC):
    """Bodies of a world while no actor is added or removed."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        self._bodies = tuple(bodies)

    @property
    def members(self) -> Sequence[Body]:
        """All bodies, whose attributes may be outdated; see `current`."""
        return self._bodies

    @abstractmethod
    def place(self, placements: Mapping[str, Placement]) -> None:
        """Move the scripted bodies to placements by name; a body without one stands."""

    @abstractmethod
    def current(self) -> Sequence[Body]:
        """Return all bodies with their current attributes."""

    @abstractmethod
    def sync_poses(self) -> None:
        """Move the rigid bodies whose poses are outdated to the poses of the actors."""

    @abstractmethod
    def states(self) -> tuple[list[ActorState], Array]:
        """Return the states of all bodies, as scalars and as read-only rows (N, 14)."""

    @abstractmethod
    def any_moved(self) -> bool:
        """Return whether the last step changed the pose of any body."""

    @abstractmethod
    def moved_names(self) -> set[str]:
        """Return the names of the bodies whose pose the last step changed."""

    @abstractmethod
    def neighbors(self, of: Sequence[Body], margin: float) -> list[Sequence[Body]]:
        """Return, for each of some bodies, those that can be within `margin` [m] of it in this step, in their order.

        The circles around the boxes are compared. A body is among its own neighbors. More bodies may be returned.
        """

    @abstractmethod
    def near_pairs(self, gap: float) -> Iterator[tuple[Body, Body]]:
        """Yield the pairs with a moved body that may be at most `gap` [m] apart, in the order of the bodies."""


class SingleBodies(BodyGroup):
    """Bodies that move one by one."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        super().__init__(bodies)
        self._scripted = [body for body in bodies if isinstance(body, ScriptedBody)]

    def place(self, placements: Mapping[str, Placement]) -> None:
        for body in self._scripted:
            placement = placements.get(body.name)
            if placement is None:
                body.rest()
            else:
                body.place(placement)

    def current(self) -> Sequence[Body]:
        return self._bodies

    def sync_poses(self) -> None:
        for body in self._bodies:
            if body.stale:
                body.sync_pose()

    def states(self) -> tuple[list[ActorState], Array]:
        states = [body.state for body in self._bodies]
        table = np.fromiter(chain.from_iterable(states), float, 14 * len(states)).reshape(-1, 14)
        table.flags.writeable = False
        return states, table

    def any_moved(self) -> bool:
        return any(body.moved for body in self._bodies)

    def moved_names(self) -> set[str]:
        return {body.name for body in self._bodies if body.moved}

    def neighbors(self, of: Sequence[Body], margin: float) -> list[Sequence[Body]]:
        if len(of) * len(self._bodies) <= FEW_PAIRS:
            return [self._bodies] * len(of)
        x, y, reach = np.array([(b.center_x, b.center_y, b.radius + b.travel) for b in self._bodies]).T
        return [[self._bodies[row] for row in rows] for rows in near_rows(x, y, reach, of, margin)]

    def near_pairs(self, gap: float) -> Iterator[tuple[Body, Body]]:
        bodies = self._bodies
        if len(bodies) > FEW:
            for row, other in Footprints.of(bodies).near_pairs(gap):
                yield bodies[row], bodies[other]
            return
        for index, first in enumerate(bodies):
            x, y, radius, moved = first.center_x, first.center_y, first.radius + gap, first.moved
            for row in range(index + 1, len(bodies)):
                second = bodies[row]
                if moved or second.moved:
                    dx, dy, reach = second.center_x - x, second.center_y - y, radius + second.radius
                    if dx * dx + dy * dy <= reach * reach:
                        yield first, second
