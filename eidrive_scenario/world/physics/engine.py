"""The physics steps of one tick: driven vehicles move, and what collides with them is resolved and noted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.geometry import box_distance
from eidrive_scenario.world.actor import Control, Vector3
from eidrive_scenario.world.physics.bodies import Body, ScriptedBody
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.physics.contacts import Touch, relative_speed
from eidrive_scenario.world.physics.driven_body import DrivenBody
from eidrive_scenario.world.physics.dynamics import Demand
from eidrive_scenario.world.physics.scenery import Scenery

Touches = dict[tuple[str, str], Touch]
"""By the names of the pair: in the order of the view's rows, a building last."""

_ROLL = Control()
_BLOW = 20.0
"""Speed that a collision may add within a tick, as far as the search for neighbors goes [m/s]."""
_HARDEST = 20.0
"""Acceleration of any part of a vehicle that nothing hits, at most [m/s²]."""
_MARGIN = 0.1
"""pybullet deals with bodies that are nearer than twice its collision margin of 4 cm [m]."""


_AHEAD = 5.0
"""So much farther than needed it is looked what stands around a body, so that it need not be looked each time [m]."""


MAX_TICK = 100.0
"""Maximum length of a tick [s]; all its physics steps are taken at once."""


def substeps_per_tick(dt: float, physics_rate: float) -> int:
    """Physics steps in one tick. Raise SettingError unless the tick is a whole number of them, of at most MAX_TICK."""
    exact = dt * physics_rate
    if not abs(dt) <= MAX_TICK or not math.isfinite(exact):
        raise SettingError(Diagnostic(f"a tick is {dt:g} s long", f"give a dt of at most {MAX_TICK:g} s"))
    count = round(exact)
    if count < 1 or abs(exact - count) > 1e-9 * max(exact, 1.0):
        what = f"a tick of {dt:g} s is {exact:g} physics steps at {physics_rate:g} Hz"
        raise SettingError(Diagnostic(what, "choose dt and the rate so that this is a whole number, at least 1"))
    return count


class Physics:
    """Steps one pybullet client. Only driven bodies that may meet something within the tick move in pybullet; there
    what else can hit them, or be hit, moves with them."""

    def __init__(self, client: int, scenery: Scenery, dt: float, substeps: int) -> None:
        self.step = dt / substeps
        """Length of a physics step [s]."""
        self._client = client
        self._scenery = scenery
        self._dt = dt
        self._substeps = substeps
        self._slack = _MARGIN + 0.5 * _HARDEST * dt * dt
        self._searchable = False
        self._free: dict[str, tuple[tuple[float, float], float]] = {}
        """Where each body was when it was last looked how far around it nothing stands, and how far that is [m]."""
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self.step, deterministicOverlappingPairs=1, physicsClientId=client
        )

    def changed(self) -> None:
        """Bodies were put in or taken out, or moved."""
        self._searchable = False

    def scenery_changed(self) -> None:
        """Something was put up that does not move."""
        self._free.clear()

    def refresh(self, bodies: Iterable[Body]) -> None:
        """Let pybullet's search structure know where the bodies are; placing them does not tell it."""
        if not self._searchable:
            _settle(bodies)
            bullet.performCollisionDetection(self._client)
            self._searchable = True

    def tick(
        self,
        bodies: Mapping[str, Body],
        driven: Mapping[str, DrivenBody],
        controls: Mapping[str, Control],
        friction: float,
    ) -> Touches:
        """All steps of one tick, the scripted bodies being at their new places; returns what pybullet resolved."""
        self.changed()
        if not driven:
            return {}
        demands = {name: body.demand(controls.get(name, _ROLL), friction) for name, body in driven.items()}
        passing, watched = self._within_reach(bodies, driven)
        touches: Touches = {}
        if watched:
            _settle(bodies.values())
            self._step_through(bodies, passing, watched, demands, touches)
        for name, body in driven.items():
            if name not in watched:
                body.coast(demands[name], self._substeps)
        if watched:
            self.refresh(bodies.values())
        return touches

    def _step_through(
        self,
        bodies: Mapping[str, Body],
        passing: Sequence[ScriptedBody],
        watched: Mapping[str, DrivenBody],
        demands: Mapping[str, Demand],
        touches: Touches,
    ) -> None:
        """The steps in pybullet."""
        owners = {body.handle: (row, body) for row, body in enumerate(bodies.values())}
        for number in range(self._substeps):
            for scripted in passing:
                scripted.pass_through(number / self._substeps)
            for name, body in watched.items():
                body.drive(demands[name])
            before = {body.handle: body.present_velocity() for body in watched.values()}
            bullet.stepSimulation(self._client)
            for body in watched.values():
                self._note_touches(body, owners, before, touches)
        for scripted in passing:
            scripted.settle()
        for body in watched.values():
            body.read_back()

    def _within_reach(
        self, bodies: Mapping[str, Body], driven: Mapping[str, DrivenBody]
    ) -> tuple[list[ScriptedBody], dict[str, DrivenBody]]:
        """Scripted bodies that move near a driven one, and the driven ones near any other body or a building.

        Nobody is, unless any two may meet; where they may, a blow can send them on to others.
        """
        passing: dict[str, ScriptedBody] = {}
        watched: dict[str, DrivenBody] = {}
        travels = {name: body.travel + self._slack for name, body in bodies.items()}
        if not any(self._may_meet(body, bodies, travels) for body in driven.values()):
            return [], watched
        reaches = {name: body.radius + travels[name] + _BLOW * self._dt for name, body in bodies.items()}
        for name, body in driven.items():
            x, y, own = body.center_x, body.center_y, reaches[name]
            near = self._stands_near(name, x, y, own)
            for other_name, other in bodies.items():
                dx, dy, reach = other.center_x - x, other.center_y - y, own + reaches[other_name]
                if dx * dx + dy * dy <= reach * reach and other is not body:
                    near = True
                    if isinstance(other, ScriptedBody) and other.moved:
                        passing[other_name] = other
            if near:
                watched[name] = body
        return list(passing.values()), watched

    def _may_meet(self, body: DrivenBody, bodies: Mapping[str, Body], travels: Mapping[str, float]) -> bool:
        """Return whether a driven body may touch anything in this tick."""
        x, y, radius, own = body.center_x, body.center_y, body.radius, travels[body.name]
        if self._stands_near(body.name, x, y, radius + own):
            return True
        for name, other in bodies.items():
            way = own + travels[name]
            dx, dy, reach = other.center_x - x, other.center_y - y, radius + other.radius + way
            if dx * dx + dy * dy <= reach * reach and other is not body and box_distance(body.box, other.box) <= way:
                return True
        return False

    def _stands_near(self, name: str, x: float, y: float, reach: float) -> bool:
        """Return whether anything that does not move may be within reach of a body's middle [m]."""
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
        """Add what pybullet resolved between this body and others in the last step."""
        for _, first, second, _, _, position, _, _, gap, force, *_ in bullet.getContactPoints(
            body.handle, physicsClientId=self._client
        ):
            if gap > 0.0 and force <= 0.0:
                continue
            handle = second if first == body.handle else first
            if handle not in owners:
                speed = relative_speed(before[body.handle], (0.0, 0.0, 0.0))
                touches.setdefault((body.name, self._scenery.name_of(handle, position)), Touch(position, speed))
                continue
            row, other = owners[handle]
            pair = (body.name, other.name) if owners[body.handle][0] < row else (other.name, body.name)
            if pair not in touches:
                speed = relative_speed(before[body.handle], before.get(handle, other.velocity))
                touches[pair] = Touch(position, speed)


def _settle(bodies: Iterable[Body]) -> None:
    for body in bodies:
        if body.stale:
            body.settle()
