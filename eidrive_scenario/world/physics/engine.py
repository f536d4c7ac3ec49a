"""Physics steps of one tick: motion of driven vehicles and resolution of their collisions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, repeat

import numpy as np

from eidrive_scenario.base.geometry import box_distance
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.world.actor import Control, Vector3
from eidrive_scenario.world.physics.bodies import Body, DrivenBody, ScriptedBody
from eidrive_scenario.world.physics.body_group import BodyGroup
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.physics.contacts import Touches
from eidrive_scenario.world.physics.dynamics import Demand
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.view import FEW

_ROLL = Control()
_MAX_IMPACT = 20.0
"""Speed that a collision may add within a tick in the search for neighbors [m/s]."""
_MAX_ACCELERATION = 20.0
"""Maximum acceleration of any part of a vehicle without a collision [m/s²]."""
_MARGIN = 0.1
"""Maximum distance of bodies that pybullet processes [m]: more than twice its collision margin of 4 cm."""
_AHEAD = 5.0
"""Additional radius of the search for obstacles around a body, so that it is not repeated in each tick [m]."""
MAX_TICK = 100.0
"""Maximum length of a tick [s], as all its physics steps are computed in one call."""


def substeps_per_tick(dt: float, physics_rate: float) -> int:
    """Return the physics steps of a tick.

    Raise SettingError unless the tick is at most MAX_TICK and a multiple of a physics step.
    """
    exact = dt * physics_rate
    if not abs(dt) <= MAX_TICK or not math.isfinite(exact):
        raise SettingError(Diagnostic(f"a tick is {dt:g} s long", f"give a dt of at most {MAX_TICK:g} s"))
    count = round(exact)
    if count < 1 or abs(exact - count) > 1e-9 * max(exact, 1.0):
        message = f"a tick of {dt:.10g} s is {exact:.10g} physics steps at {physics_rate:g} Hz"
        raise SettingError(Diagnostic(message, f"give a dt that is a multiple of {1.0 / physics_rate:g} s"))
    return count


class Physics:
    """Steps of one pybullet client.

    Only driven bodies with a possible contact within the tick move in pybullet, together with the bodies that may be
    involved.
    """

    def __init__(self, client: int, scenery: Scenery, dt: float, substeps: int) -> None:
        self.step = dt / substeps
        """Length of a physics step [s]."""
        self._client = client
        self._scenery = scenery
        self._dt = dt
        self._substeps = substeps
        self._slack = _MARGIN + 0.5 * _MAX_ACCELERATION * dt * dt
        self._searchable = False
        self._free: dict[str, tuple[tuple[float, float], float]] = {}
        """Position of each body at the last search for obstacles, and the free radius around it [m]."""
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self.step, deterministicOverlappingPairs=1, physicsClientId=client
        )

    def changed(self) -> None:
        """Reset caches after bodies were added, removed or moved."""
        self._searchable = False

    def scenery_changed(self) -> None:
        """Reset caches after scenery was added."""
        self._free.clear()

    def refresh(self, bodies: BodyGroup) -> None:
        """Update the search structure of pybullet, which setting poses does not update."""
        if not self._searchable:
            bodies.sync_poses()
            bullet.performCollisionDetection(self._client)
            self._searchable = True

    def tick(
        self,
        bodies: BodyGroup,
        driven: Mapping[str, DrivenBody],
        controls: Mapping[str, Control],
        friction: float,
    ) -> Touches:
        """Compute all steps of one tick after the scripted bodies have moved. Return the contacts that pybullet
        resolved.
        """
        self.changed()
        if not driven:
            return {}
        demands = {
            name: body.track.demand(controls.get(name, _ROLL), friction, body.pitch) for name, body in driven.items()
        }
        passing, watched = self._within_reach(bodies, driven)
        touches: Touches = {}
        if watched:
            bodies.sync_poses()
            self._step_through(bodies.members, passing, watched, demands, touches)
        for name, body in driven.items():
            if name not in watched:
                body.coast(demands[name], self._substeps)
        if watched:
            self.refresh(bodies)
        return touches

    def is_near_object(self, bodies: BodyGroup, body: Body, name: str, margin: float) -> bool:
        """Return whether a static object of this name is within a margin of a body [m]."""
        self.refresh(bodies)
        low, high = np.array(bullet.getAABB(body.handle, physicsClientId=self._client))
        around = (low - margin).tolist(), (high + margin).tolist()
        handles = {handle for handle, _ in bullet.getOverlappingObjects(*around, physicsClientId=self._client) or ()}
        return any(
            self._scenery.name_of(handle, point[5]) == name
            for handle in handles & self._scenery.handles
            for point in bullet.getClosestPoints(body.handle, handle, margin, physicsClientId=self._client)
        )

    def _step_through(
        self,
        bodies: Sequence[Body],
        passing: Sequence[ScriptedBody],
        watched: Mapping[str, DrivenBody],
        demands: Mapping[str, Demand],
        touches: Touches,
    ) -> None:
        """Compute the steps in pybullet."""
        owners = {body.handle: (row, body) for row, body in enumerate(bodies)}
        for number in range(self._substeps):
            for scripted in passing:
                scripted.pass_through(number / self._substeps)
            for name, body in watched.items():
                body.drive(demands[name])
            before = {body.handle: bullet.getBaseVelocity(body.handle, self._client)[0] for body in watched.values()}
            bullet.stepSimulation(self._client)
            for body in watched.values():
                self._note_touches(body, owners, before, touches)
        for scripted in passing:
            scripted.sync_pose()
        for body in watched.values():
            body.read_back()

    def _within_reach(
        self, bodies: BodyGroup, driven: Mapping[str, DrivenBody]
    ) -> tuple[list[ScriptedBody], dict[str, DrivenBody]]:
        """Return scripted bodies near a driven one, and driven ones near any other body or a building.

        Both are empty unless any two may meet. If two may meet, a collision can push them towards others.
        """
        passing: dict[str, ScriptedBody] = {}
        watched: dict[str, DrivenBody] = {}
        impact = _MAX_IMPACT * self._dt
        movers = list(driven.values())
        if len(movers) * len(bodies.members) <= FEW:  # to select near ones takes longer than to compare all below
            neighbors = [bodies.current()] * len(movers)
        else:
            neighbors = bodies.neighbors(movers, 2.0 * (self._slack + impact))
        nearby = dict.fromkeys(chain.from_iterable(neighbors))
        travels = {other.name: other.travel + self._slack for other in nearby}
        if not any(map(self._may_meet, movers, neighbors, repeat(travels))):
            return [], watched
        for body, others in zip(movers, neighbors, strict=True):
            x, y, own = body.center_x, body.center_y, body.radius + travels[body.name] + impact
            near = self._is_near_static(body.name, x, y, own)
            for other in others:
                reach = own + (other.radius + travels[other.name] + impact)
                dx, dy = other.center_x - x, other.center_y - y
                if dx * dx + dy * dy <= reach * reach and other is not body:
                    near = True
                    if isinstance(other, ScriptedBody) and other.moved:
                        passing[other.name] = other
            if near:
                watched[body.name] = body
        return list(passing.values()), watched

    def _may_meet(self, body: DrivenBody, others: Iterable[Body], travels: Mapping[str, float]) -> bool:
        """Return whether a driven body may have a contact in this tick."""
        x, y, radius, own = body.center_x, body.center_y, body.radius, travels[body.name]
        if self._is_near_static(body.name, x, y, radius + own):
            return True
        for other in others:
            way = own + travels[other.name]
            dx, dy, reach = other.center_x - x, other.center_y - y, radius + other.radius + way
            if dx * dx + dy * dy <= reach * reach and other is not body and box_distance(body.box, other.box) <= way:
                return True
        return False

    def _is_near_static(self, name: str, x: float, y: float, reach: float) -> bool:
        """Return whether any static object may be within reach of the center of a body [m]."""
        there, free = self._free.get(name, ((x, y), -math.inf))
        if reach + math.dist(there, (x, y)) < free:
            return False
        free = self._scenery.clearance(x, y, reach + _AHEAD)
        self._free[name] = (x, y), free
        return free <= reach

    def _note_touches(
        self,
        body: DrivenBody,
        owners: Mapping[int, tuple[int, Body]],
        before: Mapping[int, Vector3],
        touches: Touches,
    ) -> None:
        """Add the contacts of this body that pybullet resolved in the last step."""
        for _, first, second, _, _, position, _, _, gap, force, *_ in bullet.getContactPoints(
            body.handle, physicsClientId=self._client
        ):
            if gap > 0.0 and force <= 0.0:
                continue
            handle = second if first == body.handle else first
            if handle not in owners:
                speed = math.dist(before[body.handle], (0.0, 0.0, 0.0))
                touches.setdefault((body.name, self._scenery.name_of(handle, position)), (position, speed))
                continue
            row, other = owners[handle]
            pair = (body.name, other.name) if owners[body.handle][0] < row else (other.name, body.name)
            if pair not in touches:
                speed = math.dist(before[body.handle], before.get(handle, other.velocity))
                touches[pair] = position, speed
