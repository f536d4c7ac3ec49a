"""The physics steps of one tick: driven vehicles move, and what collides with them is resolved and noted."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.errors import Problem, SettingError
from eidrive_scenario.world.actor import Control, Vector3
from eidrive_scenario.world.bodies import Body, DrivenBody, ScriptedBody
from eidrive_scenario.world.bullet import bullet
from eidrive_scenario.world.contacts import Touch, relative_speed
from eidrive_scenario.world.scenery import Scenery

Touches = dict[tuple[str, str], Touch]
"""By the names of the pair: in the order of the view's rows, a building last."""

_ROLL = Control()
_BLOW = 20.0
"""Speed that a collision may add within a tick, as far as the search for neighbours goes [m/s]."""


def substeps_per_tick(dt: float, physics_rate: float) -> int:
    """Physics steps in one tick. Raises SettingError unless the tick is a whole number of them."""
    exact = dt * physics_rate
    count = round(exact)
    if count < 1 or abs(exact - count) > 1e-9 * max(exact, 1.0):
        what = f"a tick of {dt:g} s is {exact:g} physics steps at {physics_rate:g} Hz"
        raise SettingError(Problem(what, "choose dt and the rate so that this is a whole number, at least 1"))
    return count


class Physics:
    """Steps one pybullet client. Bodies that nothing can reach within a tick cost nothing in its steps."""

    def __init__(self, client: int, scenery: Scenery, dt: float, substeps: int) -> None:
        self.step = dt / substeps
        """Length of a physics step [s]."""
        self._client = client
        self._scenery = scenery
        self._dt = dt
        self._substeps = substeps
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self.step, deterministicOverlappingPairs=1, physicsClientId=client
        )

    def tick(
        self,
        bodies: Mapping[str, Body],
        driven: Mapping[str, DrivenBody],
        controls: Mapping[str, Control],
        friction: float,
    ) -> Touches:
        """All steps of one tick, the scripted bodies being at their new places; returns what pybullet resolved."""
        pedals = [(body, controls.get(name, _ROLL)) for name, body in driven.items()]
        passing, watched = self._within_reach(bodies, driven)
        owners = {body.handle: (row, body) for row, body in enumerate(bodies.values())} if watched else {}
        touches: Touches = {}
        for number in range(self._substeps):
            for scripted in passing:
                scripted.pass_through(number / self._substeps)
            for body, control in pedals:
                body.drive(control, friction)
            before = {body.handle: body.present_velocity() for body in watched}
            bullet.stepSimulation(physicsClientId=self._client)
            for body in watched:
                self._note_touches(body, owners, before, touches)
        for scripted in passing:
            scripted.settle()
        for body, _ in pedals:
            body.read_back()
        bullet.performCollisionDetection(physicsClientId=self._client)
        return touches

    def _within_reach(
        self, bodies: Mapping[str, Body], driven: Mapping[str, DrivenBody]
    ) -> tuple[list[ScriptedBody], list[DrivenBody]]:
        """Scripted bodies that move near a driven one, and the driven ones near any other body or a building."""
        passing: dict[str, ScriptedBody] = {}
        watched: list[DrivenBody] = []
        reaches = {name: self._reach(body) for name, body in bodies.items()}
        for name, body in driven.items():
            x, y, own = body.centre_x, body.centre_y, reaches[name]
            near = self._scenery.near(x, y, own)
            for other_name, other in bodies.items():
                dx, dy, reach = other.centre_x - x, other.centre_y - y, own + reaches[other_name]
                if dx * dx + dy * dy <= reach * reach and other is not body:
                    near = True
                    if isinstance(other, ScriptedBody) and other.moved:
                        passing[other_name] = other
            if near:
                watched.append(body)
        return list(passing.values()), watched

    def _reach(self, body: Body) -> float:
        """How far any part of a body can be from its centre during a tick [m]."""
        vx, vy, _ = body.velocity
        return body.radius + (abs(vx) + abs(vy) + _BLOW) * self._dt + 1.0

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
