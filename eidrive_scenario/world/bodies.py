"""The bodies of the actors in pybullet: scripted ones are placed, driven ones move by the forces of their tyres.

Each is one rigid box. pybullet's gravity and damping are off; it integrates the velocities and resolves collisions.
"""

from __future__ import annotations

import math

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.world.actor import ActorSpec, Control, Placement, Vector3
from eidrive_scenario.world.bullet import bullet
from eidrive_scenario.world.dynamics import SingleTrack, VehicleParameters
from eidrive_scenario.world.ground import GroundUnder

RAYS, SCRIPTED, DRIVEN, STATIC, TERRAIN = 1, 2, 4, 8, 16
"""Groups of pybullet's collision filter; a ray belongs to the first by pybullet's default."""

UNMOVED = 1e9
"""Mass of what no collision moves [kg], and moment of inertia about the axes that no collision turns [kg m²]."""
RESTITUTION = 0.3
"""Of one body; two rebound with its square, about 0.1, as cars do above some 5 m/s."""
BODY_FRICTION = 0.7


class Body:
    """One actor: its state, plain numbers as they stand in the view's rows, and its rigid body in pybullet."""

    def __init__(self, client: int, spec: ActorSpec, placement: Placement, dt: float) -> None:
        self.client = client
        self.spec = spec
        self.name = spec.name
        self.radius = math.hypot(spec.size[0], spec.size[1]) / 2
        self.handle = -1
        self.moved = True
        """Whether the last step changed its pose."""
        self.yaw_rate = 0.0
        self.acceleration: Vector3 = (0.0, 0.0, 0.0)
        self._dt = dt
        self._stand(placement)
        self.velocity = self._along_heading(placement.speed)
        self.velocity_before = self.velocity
        """At the beginning of the last step [m/s]."""

    @property
    def box(self) -> tuple[float, ...]:
        """(7,) x y z l w h yaw of the bounding box."""
        return (self.centre_x, self.centre_y, self.centre_z, *self.spec.size, self.yaw)

    def row(self) -> tuple[float, ...]:
        """x y z yaw pitch roll, velocity, acceleration, yaw rate, speed."""
        velocity, acceleration = self.velocity, self.acceleration
        return (self.x, self.y, self.z, self.yaw, self.pitch, self.roll, velocity[0], velocity[1], velocity[2],
                acceleration[0], acceleration[1], acceleration[2], self.yaw_rate, self.speed)  # fmt: skip

    def remove(self) -> None:
        """Take the body out of pybullet."""
        bullet.removeBody(self.handle, physicsClientId=self.client)

    def _stand(self, placement: Placement) -> None:
        self._pose(placement.x, placement.y, placement.z, placement.yaw, placement.pitch, placement.roll)
        self.speed = placement.speed

    def _pose(self, x: float, y: float, z: float, yaw: float, pitch: float, roll: float) -> None:
        self.x, self.y, self.z, self.yaw, self.pitch, self.roll = x, y, z, yaw, pitch, roll
        ox, oy, oz = self.spec.offset
        cos, sin = math.cos(yaw), math.sin(yaw)
        self.centre_x, self.centre_y, self.centre_z = x + cos * ox - sin * oy, y + sin * ox + cos * oy, z + oz

    def _along_heading(self, speed: float) -> Vector3:
        if self.pitch == 0.0:
            return speed * math.cos(self.yaw), speed * math.sin(self.yaw), 0.0
        level = speed * math.cos(self.pitch)
        return level * math.cos(self.yaw), level * math.sin(self.yaw), -speed * math.sin(self.pitch)

    def _accelerate_to(self, velocity: Vector3) -> None:
        old, dt = self.velocity, self._dt
        self.velocity_before, self.velocity = old, velocity
        self.acceleration = (
            (velocity[0] - old[0]) / dt,
            (velocity[1] - old[1]) / dt,
            (velocity[2] - old[2]) / dt,
        )

    def _create(self, centre: Vector3, at: Vector3, mass: float, inertia: float, group: int, meets: int) -> None:
        """Make the rigid body, whose box has its centre there in the frame of the centre of gravity.

        What must not be moved is added as a static body and gets its huge mass only then: pybullet does not integrate
        it, yet collisions see the velocity that it is given, which that of a static body they do not.
        """
        length, width, height = self.spec.size
        here = {"physicsClientId": self.client}
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX,
            halfExtents=(length / 2, width / 2, height / 2),
            collisionFramePosition=centre,
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
    """An actor that stands exactly where it is placed; nothing pushes it."""

    def __init__(self, client: int, spec: ActorSpec, placement: Placement, dt: float) -> None:
        super().__init__(client, spec, placement, dt)
        self._create(spec.offset, (self.x, self.y, self.z), UNMOVED, UNMOVED, SCRIPTED, DRIVEN)
        self.stale = False
        """Whether the rigid body is not yet where the actor is: pybullet hears of it when somebody asks pybullet."""
        self._from: tuple[float, ...] = (self.x, self.y, self.z, self.yaw, self.pitch, self.roll)

    def rest(self) -> None:
        """Stay for this step: no placement was given."""
        self.place(Placement(self.x, self.y, self.z, self.yaw, self.pitch, self.roll))

    def place(self, placement: Placement) -> None:
        """Be there at the end of the step, with a velocity out of the given speed and the distance covered.

        Along the heading the velocity is the given speed; across, it follows from the distance.
        """
        x, y, z, yaw = self.x, self.y, self.z, self.yaw
        self._from = (x, y, z, yaw, self.pitch, self.roll)
        was_moving = self.yaw_rate != 0.0 or self.velocity != (0.0, 0.0, 0.0)
        self._stand(placement)
        self.moved = (x, y, z, yaw) != (self.x, self.y, self.z, self.yaw) or self.pitch != self._from[4]
        along = self._along_heading(placement.speed)
        if placement.teleport:
            self._from = (self.x, self.y, self.z, self.yaw, self.pitch, self.roll)
            self.velocity = self.velocity_before = along
            self.acceleration, self.yaw_rate = (0.0, 0.0, 0.0), 0.0
        else:
            dt = self._dt
            vx, vy, vz = (self.x - x) / dt, (self.y - y) / dt, (self.z - z) / dt
            fx, fy, fz = self._along_heading(1.0)
            excess = placement.speed - (vx * fx + vy * fy + vz * fz)
            self._accelerate_to((vx + excess * fx, vy + excess * fy, vz + excess * fz))
            self.yaw_rate = wrap_angle(self.yaw - yaw) / dt if self.yaw != yaw else 0.0
        self.stale = self.stale or self.moved or was_moving or self.velocity != (0.0, 0.0, 0.0)

    def settle(self) -> None:
        """Put the rigid body where the actor is."""
        self.stale = False
        here = {"physicsClientId": self.client}
        turn = quaternion(self.yaw, self.pitch, self.roll)
        bullet.resetBasePositionAndOrientation(self.handle, (self.x, self.y, self.z), turn, **here)
        bullet.resetBaseVelocity(self.handle, self.velocity, (0.0, 0.0, self.yaw_rate), **here)

    def pass_through(self, share: float) -> None:
        """Put the rigid body on the way between its last and its next place, for a collision in between."""
        x, y, z, yaw, pitch, roll = self._from
        turn = quaternion(
            yaw + share * wrap_angle(self.yaw - yaw),
            pitch + share * (self.pitch - pitch),
            roll + share * (self.roll - roll),
        )
        at = (x + share * (self.x - x), y + share * (self.y - y), z + share * (self.z - z))
        here = {"physicsClientId": self.client}
        bullet.resetBasePositionAndOrientation(self.handle, at, turn, **here)
        moving = ((self.x - x) / self._dt, (self.y - y) / self._dt, (self.z - z) / self._dt)
        bullet.resetBaseVelocity(self.handle, moving, (0.0, 0.0, self.yaw_rate), **here)


class DrivenBody(Body):
    """A vehicle that moves by pedals and steering, and by what hits it."""

    def __init__(
        self, client: int, spec: ActorSpec, placement: Placement, dt: float, step: float, ground: GroundUnder
    ) -> None:
        super().__init__(client, spec, placement, dt)
        parameters = VehicleParameters.of(spec)
        self.track = SingleTrack(parameters, step)
        self._step = step
        self._ground = ground
        self._lever = self.track.to_rear
        self._create(
            (spec.offset[0] - self._lever, spec.offset[1], 0.0),
            (self.x, self.y, self.z),
            parameters.mass,
            parameters.yaw_inertia,
            DRIVEN,
            SCRIPTED | DRIVEN | STATIC,
        )
        self.jump(placement)

    def jump(self, placement: Placement) -> None:
        """Stand there now, rolling straight ahead with the given speed; the ground gives height, pitch and roll."""
        z, pitch, roll = self._ground.at(placement.x, placement.y, placement.yaw)
        self._pose(placement.x, placement.y, z, placement.yaw, pitch, roll)
        self.speed, self.yaw_rate, self.acceleration = placement.speed, 0.0, (0.0, 0.0, 0.0)
        self.velocity = self.velocity_before = self._along_heading(placement.speed)
        self.moved = True
        self._settle(self.velocity, (0.0, 0.0, 0.0))

    def drive(self, control: Control, friction: float) -> None:
        """Give the rigid body the velocity with which it moves over the next physics step."""
        here = {"physicsClientId": self.client}
        _, (qx, qy, qz, qw) = bullet.getBasePositionAndOrientation(self.handle, **here)
        (vx, vy, _), (_, _, turning) = bullet.getBaseVelocity(self.handle, **here)
        cos, sin = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz)
        scale = 1.0 / math.sqrt(cos * cos + sin * sin)
        cos, sin = cos * scale, sin * scale
        forward, left = vx * cos + vy * sin, vy * cos - vx * sin
        ahead, aside, turn = self.track.advance(forward, left, turning, control, friction, self.pitch)
        forward, left = forward + ahead, left + aside
        rise = -math.tan(self.pitch) * forward if self.pitch else 0.0
        velocity = (forward * cos - left * sin, forward * sin + left * cos, rise)
        bullet.resetBaseVelocity(self.handle, velocity, (0.0, 0.0, turning + turn), **here)

    def present_velocity(self) -> Vector3:
        """Of the rigid body now, within a step [m/s]."""
        velocity: Vector3 = bullet.getBaseVelocity(self.handle, physicsClientId=self.client)[0]
        return velocity

    def read_back(self) -> None:
        """Take over pose and velocity from pybullet after a step, and set the body on the ground again."""
        here = {"physicsClientId": self.client}
        (x, y, z), (qx, qy, qz, qw) = bullet.getBasePositionAndOrientation(self.handle, **here)
        (vx, vy, _), turning = bullet.getBaseVelocity(self.handle, **here)
        yaw = math.atan2(2.0 * (qx * qy + qw * qz), 1.0 - 2.0 * (qy * qy + qz * qz))
        cos, sin = math.cos(yaw), math.sin(yaw)
        rate = turning[2]
        arm_x, arm_y, arm_z = self._arm(yaw)
        x, y, z = x - arm_x, y - arm_y, z - arm_z
        self.moved = (x, y, yaw) != (self.x, self.y, self.yaw)
        height, pitch, roll = self._ground.at(x, y, yaw)
        lifted = abs(z - height) > 1e-6
        self._pose(x, y, height, yaw, pitch, roll)
        self.yaw_rate = rate
        level = vx * cos + vy * sin
        self.speed = level / math.cos(pitch)
        rise = -math.tan(pitch) * level
        self._accelerate_to((vx + arm_y * rate, vy - arm_x * rate, rise))
        if pitch or roll or lifted or qx or qy:
            self._settle((vx, vy, rise), (0.0, 0.0, rate))

    def _settle(self, velocity: Vector3, turning: Vector3) -> None:
        """Put the rigid body where the actor is."""
        here = {"physicsClientId": self.client}
        arm_x, arm_y, arm_z = self._arm(self.yaw)
        at = (self.x + arm_x, self.y + arm_y, self.z + arm_z)
        turn = quaternion(self.yaw, self.pitch, self.roll)
        bullet.resetBasePositionAndOrientation(self.handle, at, turn, **here)
        bullet.resetBaseVelocity(self.handle, velocity, turning, **here)

    def _arm(self, yaw: float) -> Vector3:
        """From the reference point to the centre of gravity, at half the height of the box, in the world [m]."""
        lever, height = self._lever, self.spec.offset[2]
        cy, sy = math.cos(yaw), math.sin(yaw)
        if self.pitch == 0.0 and self.roll == 0.0:
            return lever * cy, lever * sy, height
        cp, sp, cr, sr = math.cos(self.pitch), math.sin(self.pitch), math.cos(self.roll), math.sin(self.roll)
        ahead, aside = lever * cp + height * sp * cr, -height * sr
        return cy * ahead - sy * aside, sy * ahead + cy * aside, height * cp * cr - lever * sp


def quaternion(yaw: float, pitch: float, roll: float) -> tuple[float, float, float, float]:
    """x y z w of the rotation yaw, pitch, roll (z-y'-x'')."""
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
