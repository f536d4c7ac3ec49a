"""Table of the actors of a world in the order of addition, and their views."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.physics.bodies import Body, ScriptedBody
from eidrive_scenario.world.physics.body_batch import MANY, BodyBatch
from eidrive_scenario.world.physics.body_group import BodyGroup, SingleBodies
from eidrive_scenario.world.physics.rays import GROUND, NOTHING
from eidrive_scenario.world.view import FEW, Contact, WorldView


@dataclass(frozen=True)
class ActorTable:
    """Data of the actors that is constant while no actor is added or removed.

    row_of_handle  row of the actor by the number of its body in pybullet, GROUND for other bodies; the last entry, for
                   handle -1, is NOTHING
    """

    bodies: BodyGroup
    names: tuple[str, ...]
    categories: tuple[str, ...]
    rows: Mapping[str, int]
    size: Array
    offset: Array
    row_of_handle: NDArray[np.int64]
    row_in_list: list[int]
    """`row_of_handle` as a list."""

    @classmethod
    def of(cls, bodies: Mapping[str, Body], highest_handle: int, dt: float) -> ActorTable:
        """Return the table of bodies by name. `highest_handle` is that of other bodies in pybullet."""
        order = tuple(bodies.values())
        size = np.array([body.spec.size for body in order], dtype=float).reshape(-1, 3)
        offset = np.array([body.spec.offset for body in order], dtype=float).reshape(-1, 3)
        size.flags.writeable = offset.flags.writeable = False
        highest = max([highest_handle, *(body.handle for body in order)])
        row_of_handle = np.full(highest + 2, GROUND, dtype=np.int64)
        row_of_handle[-1] = NOTHING
        scripted = sum(isinstance(body, ScriptedBody) for body in order)
        for row, body in enumerate(order):
            row_of_handle[body.handle] = row
        return cls(
            bodies=BodyBatch(order, dt) if scripted >= MANY else SingleBodies(order),
            names=tuple(bodies),
            categories=tuple(body.spec.category for body in order),
            rows={name: row for row, name in enumerate(bodies)},
            size=size,
            offset=offset,
            row_of_handle=row_of_handle,
            row_in_list=row_of_handle.tolist(),
        )

    def view(
        self,
        time: float,
        tick: int,
        contacts: tuple[Contact, ...],
        unseen: tuple[str, ...],
        unseen_by: Mapping[str, tuple[str, ...]],
    ) -> WorldView:
        """Return the view of the current poses and motion."""
        states, table = self.bodies.states()
        view = WorldView(
            time=time,
            tick=tick,
            names=self.names,
            categories=self.categories,
            position=table[:, 0:3],
            yaw=table[:, 3],
            pitch=table[:, 4],
            roll=table[:, 5],
            velocity=table[:, 6:9],
            acceleration=table[:, 9:12],
            yaw_rate=table[:, 12],
            speed=table[:, 13],
            size=self.size,
            offset=self.offset,
            contacts=contacts,
            unseen=unseen,
            unseen_by=unseen_by,
        )
        view.__dict__.update(rows=self.rows, states=states, kinematics=table[:, 0:9])
        if len(states) <= FEW:
            view.__dict__["plain_boxes"] = [body.box for body in self.bodies.current()]
            view.__dict__["is_upright"] = not any([state.pitch or state.roll for state in states])
        return view
