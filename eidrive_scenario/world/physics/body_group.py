"""All bodies of a world in their order: how the scripted ones move, and which are near each other."""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from msgspec.structs import astuple

from eidrive_scenario.base.arrays import Array, Bools, Integers, number_in_groups, of_each
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.physics.bodies import Body, ScriptedBody
from eidrive_scenario.world.view import FEW, ActorState

ROUNDING = 1e-6
"""Least distance beyond a gap at which footprints certainly have it [m]."""


class Footprints(NamedTuple):
    """Boxes of bodies in plan view, each array (N,).

    x y          centers [m]
    cos sin      of the headings
    half_length half_width radius  of the boxes and of the circles around them [m]
    moved        whether the last step changed the pose
    """

    x: Array
    y: Array
    cos: Array
    sin: Array
    half_length: Array
    half_width: Array
    radius: Array
    moved: Bools

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> Footprints:
        """Return the footprints of bodies."""
        rows = [
            (b.center_x, b.center_y, math.cos(b.yaw), math.sin(b.yaw), b.spec.size[0] / 2, b.spec.size[1] / 2, b.radius)
            for b in bodies
        ]
        x, y, cos, sin, half_length, half_width, radius = np.array(rows, dtype=float).reshape(-1, 7).T
        moved = np.array([body.moved for body in bodies], dtype=bool)
        return cls(x, y, cos, sin, half_length, half_width, radius, moved)

    def near_pairs(self, gap: float) -> list[tuple[int, int]]:
        """Return the pairs of rows with a moved body that may be at most `gap` [m] apart, in the order of the rows.

        Candidates are found by a sweep along x, as only consecutive footprints in x can be near.
        """
        x, y, radius, moved = self.x, self.y, self.radius, self.moved
        order = np.argsort(x, kind="stable")
        sorted_x = x[order]
        # A footprint is paired with its followers in x up to the last one that the largest circle can reach.
        last = sorted_x.searchsorted(sorted_x + radius[order] + radius.max() + gap, side="right")
        counts = last - np.arange(len(x)) - 1
        left, number = number_in_groups(counts)
        first, second = order[left], order[left + number + 1]
        near = np.hypot(x[first] - x[second], y[first] - y[second]) <= radius[first] + radius[second] + gap
        near &= moved[first] | moved[second]
        near[near] = ~self._are_apart(first[near], second[near], gap)
        pairs = np.sort(np.stack([first[near], second[near]], axis=1), axis=1)
        return [(row, other) for row, other in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist()]

    def _are_apart(self, first: Integers, second: Integers, gap: float) -> Bools:
        """Return whether an axis of one of two boxes separates them by more than the gap, for pairs of rows."""
        rows = np.stack([first, second])
        x, y, cos, sin, half_length, half_width = (column[rows] for column in self[:6])
        dx, dy = x[1] - x[0], y[1] - y[0]
        # Separating axes: the distance of the centers along each axis exceeds both half extents projected on it.
        turn_cos, turn_sin = abs(cos[0] * cos[1] + sin[0] * sin[1]), abs(cos[0] * sin[1] - sin[0] * cos[1])
        along = abs(dx * cos + dy * sin) - half_length - turn_cos * half_length[::-1] - turn_sin * half_width[::-1]
        across = abs(dy * cos - dx * sin) - half_width - turn_sin * half_length[::-1] - turn_cos * half_width[::-1]
        apart: Bools = (np.maximum(along, across) > gap + ROUNDING).any(axis=0)
        return apart


class BodyGroup:
    """Bodies of a world while no actor is added or removed. They move one by one."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        self.members = tuple(bodies)
        """All bodies, whose attributes may be outdated; see `current`."""
        self._by_name = {body.name: body for body in bodies if isinstance(body, ScriptedBody)}
        self._widest = max((body.radius for body in bodies), default=0.0)
        self._rows_format = struct.Struct(f"{14 * len(self.members)}d")
        self._moving = [*self._by_name.values()]
        """Scripted bodies that do not rest."""

    def place(self, placements: Mapping[str, Placement]) -> None:
        """Move the scripted bodies to placements by name; a body without one stands."""
        by_name = self._by_name
        for body in self._moving:
            if body.name not in placements:
                body.rest()
        for name, placement in placements.items():
            if name in by_name:
                by_name[name].place(placement)
        self._moving = [body for body in by_name.values() if not body.is_resting]

    def current(self) -> Sequence[Body]:
        """Return all bodies with their current attributes."""
        return self.members

    def sync_poses(self) -> None:
        """Move the rigid bodies whose poses are outdated to the poses of the actors."""
        for body in self.members:
            if body.stale:
                body.sync_pose()

    def states(self) -> tuple[list[ActorState], Array]:
        """Return the states of all bodies, as scalars and as read-only rows (N, 14)."""
        states = [body.state for body in self.members]
        table = np.frombuffer(self._rows_format.pack(*chain.from_iterable(states))).reshape(-1, 14)
        return states, table

    def moved_names(self) -> set[str]:
        """Return the names of the bodies whose pose the last step changed."""
        return {body.name for body in self.members if body.moved}

    def neighbors(self, of: Sequence[Body], margin: float) -> list[Sequence[Body]]:
        """Return, for each of some bodies, those that can be within `margin` [m] of it in this step, in their order.

        The circles around the boxes are compared. A body is among its own neighbors. More bodies may be returned.
        """
        x, y, reach = self._circles()
        near = []
        for body in of:
            dx, dy = x - body.center_x, y - body.center_y
            limit = reach + (body.radius + body.travel + margin + ROUNDING)
            near.append(np.flatnonzero(dx * dx + dy * dy <= limit * limit).tolist())
        self._update(set(chain.from_iterable(near)))
        return [[self.members[row] for row in rows] for rows in near]

    def near_pairs(self, gap: float) -> list[tuple[Body, Body]]:
        """Return the pairs with a moved body that may be at most `gap` [m] apart, in the order of the bodies."""
        if len(self.members) > FEW:
            pairs = self._footprints().near_pairs(gap)
            self._update(set(chain.from_iterable(pairs)))
            return [(self.members[row], self.members[other]) for row, other in pairs]
        # Without this comparison one by one, runs with few actors take 1.2 to 1.3 times longer.
        bodies, near = self.current(), []
        by_x = sorted([(body.center_x, row, body.moved) for row, body in enumerate(bodies)])
        for index, (x, row, moved) in enumerate(by_x, 1):
            body = bodies[row]
            y, radius = body.center_y, body.radius + gap
            limit = x + radius + self._widest
            for other_x, other_row, other_moved in by_x[index:]:
                if other_x > limit:
                    break
                if moved or other_moved:
                    other = bodies[other_row]
                    dx, dy, reach = other_x - x, other.center_y - y, radius + other.radius
                    if dx * dx + dy * dy <= reach * reach:
                        near.append((row, other_row) if row < other_row else (other_row, row))
        return [(bodies[row], bodies[other]) for row, other in sorted(near)]

    def _update(self, rows: Collection[int]) -> None:
        """Set the attributes of the bodies of some rows to the current values."""

    def _circles(self) -> Array:
        """Return x, y and radius (3, N) of circles around the bodies, with the displacement of this step [m]."""
        return np.array([(body.center_x, body.center_y, body.radius + body.travel) for body in self.members]).T

    def _footprints(self) -> Footprints:
        return Footprints.of(self.members)


MANY = 100
"""Number of scripted bodies from which they move together. In runs of 100 to 1,000 scripted cars on Town04 this takes
1.02 to 1.13 times less time than to move them one by one.
"""

_FIELDS = len(Placement.__struct_fields__)


def group_bodies(bodies: Sequence[Body], dt: float) -> BodyGroup:
    """Return the group of all bodies of a world with ticks of `dt` seconds."""
    if sum(isinstance(body, ScriptedBody) for body in bodies) >= MANY:
        return BodyBatch(bodies, dt)
    return BodyGroup(bodies)


class BodyBatch(BodyGroup):
    """Bodies of which the scripted ones move together.

    `place` computes the same bits as `ScriptedBody.place`: arithmetic in arrays, but sine and cosine by `math`, as
    those of arrays round differently. Attributes of scripted bodies are then outdated until `current` is called.
    """

    def __init__(self, bodies: Sequence[Body], dt: float) -> None:
        super().__init__(bodies)
        self._dt = dt
        scripted = {row: body for row, body in enumerate(bodies) if isinstance(body, ScriptedBody)}
        self._scripted = list(scripted.values())
        self._names = [body.name for body in self._scripted]
        self._rows = np.array(list(scripted), dtype=np.intp)
        self._others = {row: body for row, body in enumerate(bodies) if row not in scripted}
        self._offset = np.array([body.spec.offset for body in self._scripted]).T
        self._half_size = np.array([(body.spec.size[0] / 2, body.spec.size[1] / 2) for body in bodies]).T
        self._radius = np.array([body.radius for body in bodies])
        self._state: Array = np.array([body.state for body in self._scripted])
        self._from = np.array([body.from_pose for body in self._scripted])
        self._resting: Bools = np.array([body.is_resting for body in self._scripted])
        self._stale: Bools = np.array([body.stale for body in self._scripted])
        self._before: Array = np.array([body.velocity_before for body in self._scripted])
        self._center = self._state[:, 0:3]
        self._cos = self._sin = self._state[:, 3]
        self._moved = self._resting
        self._is_outdated = False

    # Overflow and invalid values give inf and nan, as single floats do.
    @np.errstate(over="ignore", invalid="ignore")
    def place(self, placements: Mapping[str, Placement]) -> None:
        old, dt = self._state, self._dt
        wanted = self._placements(placements)
        pose, after, speed, old_velocity = old[:, :6], wanted[:, :6], wanted[:, 6], old[:, 6:9]
        teleports, across = wanted[:, 7] != 0.0, wanted[:, 8] != 0.0
        yaw, pitch = after[:, 3], after[:, 4]
        cos, sin = of_each(math.cos, yaw), of_each(math.sin, yaw)
        pitched: Integers = np.flatnonzero(pitch)
        velocity = _along_heading(speed, cos, sin, pitch, pitched)
        sideways = np.flatnonzero(across & ~teleports)
        if len(sideways):
            # Velocity by the covered distance, with its part along the heading replaced by the given speed
            covered = (after[sideways, :3] - pose[sideways, :3]) / dt
            ahead = _along_heading(np.ones(len(cos)), cos, sin, pitch, pitched)[sideways]
            vx, vy, vz = (covered * ahead).T
            excess = speed[sideways] - (vx + vy + vz)
            velocity[sideways] = covered + excess[:, None] * ahead
        # Teleports start at rest from their new pose; bodies that stay keep all values of the step before.
        moved = (pose != after).any(axis=1)
        acceleration = (velocity - old_velocity) / dt
        yaw_rate = np.where(yaw != pose[:, 3], wrap_angle(yaw - pose[:, 3]) / dt, 0.0)
        acceleration[teleports], yaw_rate[teleports] = 0.0, 0.0
        before = np.where(teleports[:, None], velocity, old_velocity)
        start = np.where(teleports[:, None], after, pose)
        moving = moved | velocity.any(axis=1)
        stays = self._resting & (speed == 0.0) & (self._from == after).all(axis=1)
        state = np.concatenate([after, velocity, acceleration, yaw_rate[:, None], speed[:, None]], axis=1)
        if stays.any():
            state[stays], before[stays], start[stays] = old[stays], self._before[stays], self._from[stays]
        x, y, z = after[:, :3].T
        ahead_x, left_y, up_z = self._offset
        self._center = np.stack([x + cos * ahead_x - sin * left_y, y + sin * ahead_x + cos * left_y, z + up_z], axis=1)
        self._cos, self._sin, self._moved = cos, sin, moved
        self._stale |= (old[:, 12] != 0.0) | old_velocity.any(axis=1) | moving
        self._resting = stays | ~(moving | acceleration.any(axis=1))
        self._state, self._before, self._from = state, before, start
        self._is_outdated = True

    def current(self) -> Sequence[Body]:
        if self._is_outdated:
            self._is_outdated = False
            self._write_back(np.arange(len(self._scripted)))
        return self.members

    def _update(self, rows: Collection[int]) -> None:
        if self._is_outdated and rows:
            self._write_back(np.flatnonzero(np.isin(self._rows, list(rows))))

    def _write_back(self, members: Integers) -> None:
        """Set the attributes of some scripted bodies."""
        starts, footprints, flags = (
            np.column_stack([column[members] for column in columns]).tolist()
            for columns in (
                (self._from, self._before),
                (self._center, self._cos, self._sin),
                (self._moved, self._stale, self._resting),
            )
        )
        rows = zip(members.tolist(), self._state[members].tolist(), starts, footprints, flags, strict=True)
        for member, state, start, footprint, flag in rows:
            self._scripted[member].end_step(tuple.__new__(ActorState, state), start, footprint, *flag)

    def sync_poses(self) -> None:
        members = np.flatnonzero(self._stale)
        states = dict(zip(self._rows[members].tolist(), self._state[members].tolist(), strict=True))
        # In the order of the bodies, on which the order of contacts in pybullet depends.
        for row in sorted([*states, *self._others]):
            body = self.members[row]
            if isinstance(body, ScriptedBody):
                state = states[row]
                body.move_rigid_body(state[:6], state[6:9], state[12])
            elif body.stale:
                body.sync_pose()
        self._stale[:] = False

    def states(self) -> tuple[list[ActorState], Array]:
        table = self._state
        if self._others:
            table = np.empty((len(self.members), table.shape[1]))
            table[self._rows] = self._state
            for row, body in self._others.items():
                table[row] = body.state
        table.flags.writeable = False
        return [tuple.__new__(ActorState, row) for row in table.tolist()], table

    def moved_names(self) -> set[str]:
        names = {self._names[row] for row in np.flatnonzero(self._moved).tolist()}
        return names.union(body.name for body in self._others.values() if body.moved)

    def _circles(self) -> Array:
        # `ScriptedBody.travel`, but for rounding
        covered = self._state[:, :5] - self._from[:, :5]
        turn = np.abs(wrap_angle(covered[:, 3])) + np.abs(covered[:, 4])
        reach = self._radius.copy()
        reach[self._rows] += np.sqrt(np.sum(covered[:, :3] ** 2, axis=1)) + turn * 2.0 * self._radius[self._rows]
        for row, body in self._others.items():
            reach[row] += body.travel
        return np.stack([*self._centers(), reach])

    def _footprints(self) -> Footprints:
        x, y = self._centers()
        cos, sin = np.empty((2, len(self.members)))
        moved = np.empty(len(self.members), dtype=bool)
        cos[self._rows], sin[self._rows], moved[self._rows] = self._cos, self._sin, self._moved
        for row, body in self._others.items():
            cos[row], sin[row], moved[row] = math.cos(body.yaw), math.sin(body.yaw), body.moved
        half_length, half_width = self._half_size
        return Footprints(x, y, cos, sin, half_length, half_width, self._radius, moved)

    def _centers(self) -> Array:
        """Return x and y of the centers of all boxes (2, N)."""
        centers = np.empty((2, len(self.members)))
        centers[:, self._rows] = self._center[:, :2].T
        for row, body in self._others.items():
            centers[:, row] = body.center_x, body.center_y
        return centers

    def _placements(self, placements: Mapping[str, Placement]) -> Array:
        """Return the placements of the scripted bodies as rows; that of a body without one is its pose, at rest."""
        given = [row for row, name in enumerate(self._names) if name in placements]
        rows = [astuple(placements[self._names[row]]) for row in given]
        wanted = np.empty((len(self._names), _FIELDS))
        wanted[:, :6], wanted[:, 6:] = self._state[:, :6], astuple(Placement(0.0, 0.0))[6:]
        wanted[given] = np.fromiter(chain.from_iterable(rows), float, _FIELDS * len(rows)).reshape(-1, _FIELDS)
        return wanted


def _along_heading(speed: Array, cos: Array, sin: Array, pitch: Array, pitched: Integers) -> Array:
    """Return velocities (N, 3) of speeds along headings; `pitched` are the rows with a pitch."""
    level, rise = speed, np.zeros(len(speed))
    if len(pitched):
        level = speed.copy()
        level[pitched] = speed[pitched] * of_each(math.cos, pitch[pitched])
        rise[pitched] = -speed[pitched] * of_each(math.sin, pitch[pitched])
    return np.stack([level * cos, level * sin, rise], axis=1)
