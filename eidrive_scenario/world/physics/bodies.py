"""Bodies of actors in pybullet: one rigid box per actor, and the bodies of scripted actors."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.world.actor import ActorSpec, Placement, Vector3
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.view import ActorState

RAYS, SCRIPTED, DRIVEN, STATIC, TERRAIN = 1, 2, 4, 8, 16
"""Groups of the collision filter of pybullet; rays belong to the first by default."""

UNMOVED = 1e9
"""Mass of bodies that collisions do not move [kg], and their moment of inertia [kg m²]."""
RESTITUTION = 0.3
"""Restitution of one body. Two rebound with its square, about 0.1, as cars above some 5 m/s."""
BODY_FRICTION = 0.7
STILL: Vector3 = (0.0, 0.0, 0.0)


class Body(ABC):
    """Actor with its state as scalars, in the units of the view, and its rigid body in pybullet."""

    def __init__(self, client: int, spec: ActorSpec, placement: Placement, dt: float) -> None:
        self.client = client
        self.spec = spec
        self.name = spec.name
        self.radius = math.hypot(spec.size[0], spec.size[1]) / 2
        self.handle = -1
        self.moved = True
        """Whether the last step changed its pose."""
        self.stale = False
        """Whether the pose of the rigid body is outdated. It is updated before pybullet is used."""
        self.yaw_rate = 0.0
        self.acceleration: Vector3 = (0.0, 0.0, 0.0)
        self._dt, self._offset = dt, spec.offset
        self._stand(placement)
        self.velocity = self._along_heading(placement.speed)
        self.velocity_before = self.velocity
        """Velocity at the start of the last step [m/s]."""

    @property
    def box(self) -> tuple[float, ...]:
        """Bounding box x y z l w h yaw (7,)."""
        return (self.center_x, self.center_y, self.center_z, *self.spec.size, self.yaw)

    @property
    def state(self) -> ActorState:
        """Pose and motion."""
        pose = self.x, self.y, self.z, self.yaw, self.pitch, self.roll
        # half the time of the constructor of the named tuple
        return tuple.__new__(ActorState, (*pose, *self.velocity, *self.acceleration, self.yaw_rate, self.speed))

    @property
    @abstractmethod
    def travel(self) -> float:
        """Maximum displacement of any part within a tick at constant velocity without a collision [m]."""

    @abstractmethod
    def sync_pose(self) -> None:
        """Move the rigid body to the pose of the actor."""

    def remove(self) -> None:
        """Remove the body from pybullet."""
        bullet.removeBody(self.handle, physicsClientId=self.client)

    def _stand(self, placement: Placement) -> None:
        self._pose(placement.x, placement.y, placement.z, placement.yaw, placement.pitch, placement.roll)
        self.speed = placement.speed

    def _pose(self, x: float, y: float, z: float, yaw: float, pitch: float, roll: float) -> None:
        self.x, self.y, self.z, self.yaw, self.pitch, self.roll = x, y, z, yaw, pitch, roll
        ox, oy, oz = self._offset
        self._cos, self._sin = cos, sin = math.cos(yaw), math.sin(yaw)
        self.center_x, self.center_y, self.center_z = x + cos * ox - sin * oy, y + sin * ox + cos * oy, z + oz

    def _along_heading(self, speed: float) -> Vector3:
        if self.pitch == 0.0:
            return speed * self._cos, speed * self._sin, 0.0
        level = speed * math.cos(self.pitch)
        return level * self._cos, level * self._sin, -speed * math.sin(self.pitch)

    def _accelerate_to(self, velocity: Vector3) -> None:
        old, dt = self.velocity, self._dt
        self.velocity_before, self.velocity = old, velocity
        self.acceleration = (
            (velocity[0] - old[0]) / dt,
            (velocity[1] - old[1]) / dt,
            (velocity[2] - old[2]) / dt,
        )

    def _create(self, center: Vector3, at: Vector3, mass: float, inertia: float, group: int, meets: int) -> None:
        """Create the rigid body with the center of its box in the frame of the center of gravity.

        An immovable body is created as static and gets its huge mass afterwards. pybullet then does not integrate it,
        but collisions consider its velocity, which they ignore for a static body.
        """
        length, width, height = self.spec.size
        here = {"physicsClientId": self.client}
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX,
            halfExtents=(length / 2, width / 2, height / 2),
            collisionFramePosition=center,
            **here,
        )
        self.handle = bullet.createMultiBody(
            0.0 if mass == UNMOVED else mass,
            shape,
            basePosition=at,
            baseOrientation=quaternion(self.yaw, self.pitch, self.roll),
            useMaximalCoordinates=1,
            **here,
        )
        bullet.changeDynamics(
            self.handle,
            -1,
            mass=mass,
            localInertiaDiagonal=(UNMOVED, UNMOVED, inertia),
            linearDamping=0.0,
            angularDamping=0.0,
            lateralFriction=BODY_FRICTION,
            restitution=RESTITUTION,
            **here,
        )
        bullet.setCollisionFilterGroupMask(self.handle, -1, group, meets | RAYS, **here)


class ScriptedBody(Body):
    """Actor at exact placements; collisions do not move it."""

    def __init__(self, client: int, spec: ActorSpec, placement: Placement, dt: float) -> None:
        super().__init__(client, spec, placement, dt)
        self._create(spec.offset, (self.x, self.y, self.z), UNMOVED, UNMOVED, SCRIPTED, DRIVEN)
        self.from_pose: tuple[float, ...] = (self.x, self.y, self.z, self.yaw, self.pitch, self.roll)
        """Pose x y z yaw pitch roll at the start of the last step."""
        self.is_resting = False
        """Whether it did not move in the last step, and had stopped before."""
        self._resting_state: ActorState | None = None

    @property
    def state(self) -> ActorState:
        if not self.is_resting:
            return super().state
        if self._resting_state is None:
            self._resting_state = super().state
        return self._resting_state

    @property
    def travel(self) -> float:
        """Maximum displacement of any part in the current step [m]."""
        if not self.moved:
            return 0.0
        x, y, z, yaw, pitch, _ = self.from_pose
        turn = abs(wrap_angle(self.yaw - yaw)) + abs(self.pitch - pitch)
        return math.dist((x, y, z), (self.x, self.y, self.z)) + turn * 2.0 * self.radius

    def rest(self) -> None:
        """Stay for this step without a placement."""
        self.place(Placement(self.x, self.y, self.z, self.yaw, self.pitch, self.roll))

    def place(self, placement: Placement) -> None:
        """Move to the placement at the end of the step, with a velocity from the given speed and the covered distance.

        The velocity along the heading is the given speed. The lateral one follows from the distance if there is any.
        """
        p, dt = placement, self._dt
        speed = p.speed
        after = px, py, pz, pyaw, _, _ = p.x, p.y, p.z, p.yaw, p.pitch, p.roll
        if self.is_resting and speed == 0.0 and self.from_pose == after:
            return
        x, y, z, yaw = self.x, self.y, self.z, self.yaw
        self.from_pose = before = (x, y, z, yaw, self.pitch, self.roll)
        was_moving = self.yaw_rate != 0.0 or self.velocity != STILL
        self._pose(*after)
        self.speed = speed
        self.moved = before != after
        along = self._along_heading(speed)
        if p.teleport:
            self.from_pose = after
            self.velocity = self.velocity_before = along
            self.acceleration, self.yaw_rate = STILL, 0.0
        else:
            if p.across:
                vx, vy, vz = (px - x) / dt, (py - y) / dt, (pz - z) / dt
                fx, fy, fz = self._along_heading(1.0)
                excess = speed - (vx * fx + vy * fy + vz * fz)
                along = vx + excess * fx, vy + excess * fy, vz + excess * fz
            self._accelerate_to(along)
            self.yaw_rate = wrap_angle(pyaw - yaw) / dt if pyaw != yaw else 0.0
        is_moving = self.moved or self.velocity != STILL
        self.stale = self.stale or was_moving or is_moving
        self.is_resting, self._resting_state = not is_moving and self.acceleration == STILL, None

    def end_step(
        self,
        state: ActorState,
        center: Vector3,
        heading: tuple[float, float],
        from_pose: tuple[float, ...],
        velocity_before: Vector3,
        moved: bool,
        stale: bool,
        is_resting: bool,
    ) -> None:
        """Set all values after a step that was computed elsewhere; `heading` is its cosine and sine."""
        self.x, self.y, self.z, self.yaw, self.pitch, self.roll = state[:6]
        self.velocity, self.acceleration, self.yaw_rate, self.speed = state[6:9], state[9:12], state[12], state[13]
        self.center_x, self.center_y, self.center_z = center
        self._cos, self._sin = heading
        self.from_pose, self.velocity_before, self.moved = from_pose, velocity_before, moved
        self.stale, self.is_resting, self._resting_state = stale, is_resting, None

    def sync_pose(self) -> None:
        """Move the rigid body to the pose of the actor."""
        pose = self.x, self.y, self.z, self.yaw, self.pitch, self.roll
        self.move_rigid_body(pose, self.velocity, self.yaw_rate)

    def move_rigid_body(self, pose: Sequence[float], velocity: Sequence[float], yaw_rate: float) -> None:
        """Move the rigid body to a pose x y z yaw pitch roll, which may be more recent than that of the actor."""
        self.stale = False
        x, y, z, yaw, pitch, roll = pose
        bullet.resetBasePositionAndOrientation(self.handle, (x, y, z), quaternion(yaw, pitch, roll), self.client)
        bullet.resetBaseVelocity(self.handle, velocity, (0.0, 0.0, yaw_rate), self.client)

    def pass_through(self, share: float) -> None:
        """Move the rigid body to a point between its last and next pose, for a collision in between."""
        x, y, z, yaw, pitch, roll = self.from_pose
        turn = quaternion(
            yaw + share * wrap_angle(self.yaw - yaw),
            pitch + share * (self.pitch - pitch),
            roll + share * (self.roll - roll),
        )
        at = (x + share * (self.x - x), y + share * (self.y - y), z + share * (self.z - z))
        bullet.resetBasePositionAndOrientation(self.handle, at, turn, self.client)
        moving = ((self.x - x) / self._dt, (self.y - y) / self._dt, (self.z - z) / self._dt)
        bullet.resetBaseVelocity(self.handle, moving, (0.0, 0.0, self.yaw_rate), self.client)


def quaternion(yaw: float, pitch: float, roll: float) -> tuple[float, float, float, float]:
    """Return x y z w of the rotation yaw, pitch, roll (z-y'-x'')."""
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    if pitch == 0.0 and roll == 0.0:
        return 0.0, 0.0, sy, cy
    cp, sp, cr, sr = math.cos(pitch / 2), math.sin(pitch / 2), math.cos(roll / 2), math.sin(roll / 2)
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )
