"""Bodies of actors: scripted ones, and vehicles that move by pedals, steering and collisions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from eidrive_scenario.base.geometry import quaternion, wrap_angle
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.world.actor import ActorSpec, Placement, Vector3
from eidrive_scenario.world.physics.bullet import (
    BODY_FRICTION,
    DRIVEN,
    RAYS,
    RESTITUTION,
    SCRIPTED,
    STATIC,
    bullet,
)
from eidrive_scenario.world.physics.dynamics import Demand, track_of
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters
from eidrive_scenario.world.view import ActorState

UNMOVED = 1e9
"""Mass of bodies that collisions do not move [kg], and their moment of inertia [kg m²]."""
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
        self._pose(placement.x, placement.y, placement.z, placement.yaw, placement.pitch, placement.roll)
        self.speed = placement.speed
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
        self._state: ActorState | None = None

    @property
    def state(self) -> ActorState:
        if self._state is None:
            self._state = super().state
        return self._state

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
        p, dt, speed = placement, self._dt, placement.speed
        after = px, py, pz, pyaw, pitch, roll = p.x, p.y, p.z, p.yaw, p.pitch, p.roll
        if self.is_resting and speed == 0.0 and self.from_pose == after:
            return
        before = x, y, z, yaw, _, _ = self.x, self.y, self.z, self.yaw, self.pitch, self.roll
        self.moved, old = before != after, self.velocity
        was_moving = self.yaw_rate != 0.0 or old != STILL
        self._pose(px, py, pz, pyaw, pitch, roll)
        cos, sin = self._cos, self._sin
        along = (speed * cos, speed * sin, 0.0) if pitch == 0.0 else self._along_heading(speed)
        if p.teleport:
            before, old, acceleration, yaw_rate = after, along, STILL, 0.0
        else:
            if p.across:
                vx, vy, vz = (px - x) / dt, (py - y) / dt, (pz - z) / dt
                fx, fy, fz = (cos, sin, 0.0) if pitch == 0.0 else self._along_heading(1.0)
                excess = speed - (vx * fx + vy * fy + vz * fz)
                along = vx + excess * fx, vy + excess * fy, vz + excess * fz
            acceleration = (along[0] - old[0]) / dt, (along[1] - old[1]) / dt, (along[2] - old[2]) / dt
            yaw_rate = wrap_angle(pyaw - yaw) / dt if pyaw != yaw else 0.0
        self.from_pose, self.velocity_before, self.velocity = before, old, along
        self.acceleration, self.yaw_rate, self.speed = acceleration, yaw_rate, speed
        is_moving = self.moved or along != STILL
        self.stale = self.stale or was_moving or is_moving
        self.is_resting = not is_moving and acceleration == STILL
        self._state = tuple.__new__(ActorState, (*after, *along, *acceleration, yaw_rate, speed))

    def end_step(self, state: ActorState, start: Sequence[float], footprint: Sequence[float], *flags: bool) -> None:
        """Set all values after a step that was computed elsewhere.

        start      pose x y z yaw pitch roll and velocity at its start
        footprint  center of the box, cosine and sine of the heading
        flags      moved, stale, is_resting
        """
        self.x, self.y, self.z, self.yaw, self.pitch, self.roll = state[:6]
        self.velocity, self.acceleration, self.yaw_rate, self.speed = state[6:9], state[9:12], state[12], state[13]
        self.from_pose, (vx, vy, vz) = tuple(start[:6]), start[6:]
        self.velocity_before = vx, vy, vz
        self.center_x, self.center_y, self.center_z, self._cos, self._sin = footprint
        (self.moved, self.stale, self.is_resting), self._state = flags, state

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


class GroundUnder:
    """Height and slope of the ground below one vehicle, with the lane of its last position."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        self._roads = roads
        self._last: LaneLocation | None = None
        self._height = 0.0

    def at(self, x: float, y: float, yaw: float, z: float | None = None) -> tuple[float, float, float]:
        """Return height z [m], pitch and roll [rad] of a body at x, y with that heading.

        Outside the road the ground is level at the height at which the vehicle left the road.

        z  height near which the vehicle is after a teleport [m]
        """
        if z is not None:
            self._height = z
        if self._roads is None:
            return self._height, 0.0, 0.0
        if z is not None:
            self._last = self._roads.locate_pose(x, y, yaw, z)
        else:
            self._last = self._roads.locate_at(x, y, self._last, self._height)
        if self._last is None:
            return self._height, 0.0, 0.0
        pose = self._roads.road_pose_at(self._last.road, self._last.s, self._last.t)
        pose = pose.turned(yaw - pose.h)
        self._height = pose.z
        return pose.z, pose.p, pose.r


class DrivenBody(Body):
    """Vehicle that moves by pedals, steering and collisions.

    If a collision is possible, pybullet integrates the motion step by step by `drive` and `read_back`. Otherwise
    `coast` computes the same without pybullet.
    """

    def __init__(
        self, client: int, spec: ActorSpec, placement: Placement, dt: float, step: float, ground: GroundUnder
    ) -> None:
        super().__init__(client, spec, placement, dt)
        parameters = VehicleParameters.of(spec)
        self.track = track_of(parameters, step)
        self._step = step
        self._ground = ground
        self._lever = self.track.to_reference
        self._motion = (0.0, 0.0, 0.0)
        """Velocity x y of the center of gravity [m/s] and yaw rate [rad/s] of the rigid body."""
        self._create(
            (spec.offset[0] - self._lever, spec.offset[1], 0.0),
            (self.x, self.y, self.z),
            parameters.mass,
            parameters.yaw_inertia,
            DRIVEN,
            SCRIPTED | DRIVEN | STATIC,
        )
        self.teleport(placement)

    @property
    def travel(self) -> float:
        """Maximum displacement of any part within a tick at constant velocity without a collision [m]."""
        vx, vy, rate = self._motion
        return (math.hypot(vx, vy) + abs(rate) * 2.0 * self.radius) * self._dt

    def teleport(self, placement: Placement) -> None:
        """Move to the placement, rolling straight ahead. The ground determines height, pitch and roll."""
        z, pitch, roll = self._ground.at(placement.x, placement.y, placement.yaw, placement.z)
        self._pose(placement.x, placement.y, z, placement.yaw, pitch, roll)
        self.speed, self.yaw_rate, self.acceleration = placement.speed, 0.0, (0.0, 0.0, 0.0)
        self.velocity = self.velocity_before = self._along_heading(placement.speed)
        self._motion = (self.velocity[0], self.velocity[1], 0.0)
        self.moved = self.stale = True

    def drive(self, demand: Demand) -> None:
        """Set the velocity of the rigid body for the next physics step."""
        handle, client = self.handle, self.client
        _, (qx, qy, qz, qw) = bullet.getBasePositionAndOrientation(handle, client)
        (vx, vy, _), (_, _, turning) = bullet.getBaseVelocity(handle, client)
        cos, sin = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz)
        scale = 1.0 / math.sqrt(cos * cos + sin * sin)
        cos, sin = cos * scale, sin * scale
        forward, left, turning = self.track.advance(vx * cos + vy * sin, vy * cos - vx * sin, turning, demand)
        rise = -math.tan(self.pitch) * forward if self.pitch else 0.0
        velocity = (forward * cos - left * sin, forward * sin + left * cos, rise)
        bullet.resetBaseVelocity(handle, velocity, (0.0, 0.0, turning), client)

    def read_back(self) -> None:
        """Read pose and velocity from pybullet after a step, and set the body on the ground."""
        (x, y, z), (qx, qy, qz, qw) = bullet.getBasePositionAndOrientation(self.handle, self.client)
        (vx, vy, _), (_, _, rate) = bullet.getBaseVelocity(self.handle, self.client)
        yaw = math.atan2(2.0 * (qx * qy + qw * qz), 1.0 - 2.0 * (qy * qy + qz * qz))
        lifted = abs(z - self._arm(yaw)[2] - self.z) > 1e-6
        self._arrive(x, y, yaw, (vx, vy, rate))
        self.stale = bool(self.pitch or self.roll or lifted or qx or qy)

    def coast(self, demand: Demand, steps: int) -> None:
        """Move by physics steps without a possible collision.

        As in pybullet, the velocity at the end of a step determines the distance of the step.
        """
        if self._stays(demand):
            steps = 1
        advance, step, before = self.track.advance, self._step, self._motion
        arm_x, arm_y, _ = self._arm(self.yaw)
        x, y, yaw = self.x + arm_x, self.y + arm_y, self.yaw
        vx, vy, rate = before
        for _ in range(steps):
            cos, sin = math.cos(yaw), math.sin(yaw)
            forward, left, rate = advance(vx * cos + vy * sin, vy * cos - vx * sin, rate, demand)
            vx, vy = forward * cos - left * sin, forward * sin + left * cos
            x += step * vx
            y += step * vy
            yaw += step * rate
        self._arrive(x, y, yaw if -math.pi < yaw <= math.pi else wrap_angle(yaw), (vx, vy, rate))
        self.stale = self.stale or self.moved or self._motion != before

    def _stays(self, demand: Demand) -> bool:
        """Return whether the vehicle stands and remains at standstill."""
        track = self.track
        still = self._motion == STILL and track.steering == demand.steering
        return still and track.advance(0.0, 0.0, 0.0, demand) == STILL

    def sync_pose(self) -> None:
        """Move the rigid body to the pose of the actor."""
        self.stale = False
        vx, vy, rate = self._motion
        arm_x, arm_y, arm_z = self._arm(self.yaw)
        at = (self.x + arm_x, self.y + arm_y, self.z + arm_z)
        turn = quaternion(self.yaw, self.pitch, self.roll)
        bullet.resetBasePositionAndOrientation(self.handle, at, turn, self.client)
        rise = -math.tan(self.pitch) * (vx * math.cos(self.yaw) + vy * math.sin(self.yaw)) if self.pitch else 0.0
        bullet.resetBaseVelocity(self.handle, (vx, vy, rise), (0.0, 0.0, rate), self.client)

    def _arrive(self, x: float, y: float, yaw: float, motion: Vector3) -> None:
        """Set position, heading and motion of the center of gravity. The ground determines the rest."""
        vx, vy, rate = self._motion = motion
        arm_x, arm_y, _ = self._arm(yaw)
        x, y = x - arm_x, y - arm_y
        self.moved = (x, y, yaw) != (self.x, self.y, self.yaw)
        height, pitch, roll = self._ground.at(x, y, yaw)
        self._pose(x, y, height, yaw, pitch, roll)
        self.yaw_rate = rate
        level = vx * math.cos(yaw) + vy * math.sin(yaw)
        self.speed = level / math.cos(pitch)
        old_x, old_y, old_z = self.velocity_before = self.velocity
        x, y, z = self.velocity = vx + arm_y * rate, vy - arm_x * rate, -math.tan(pitch) * level
        self.acceleration = (x - old_x) / self._dt, (y - old_y) / self._dt, (z - old_z) / self._dt

    def _arm(self, yaw: float) -> Vector3:
        """Return the vector from the reference point to the center of gravity, at half the height of the box [m]."""
        lever, height = self._lever, self.spec.offset[2]
        cy, sy = math.cos(yaw), math.sin(yaw)
        if self.pitch == 0.0 and self.roll == 0.0:
            return lever * cy, lever * sy, height
        cp, sp, cr, sr = math.cos(self.pitch), math.sin(self.pitch), math.cos(self.roll), math.sin(self.roll)
        ahead, aside = lever * cp + height * sp * cr, -height * sr
        return cy * ahead - sy * aside, sy * ahead + cy * aside, height * cp * cr - lever * sp
