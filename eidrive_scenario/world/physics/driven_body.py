"""Bodies of driven vehicles, which move by tire forces and collisions.

Gravity and damping of pybullet are off; it integrates the velocities and resolves collisions.
"""

from __future__ import annotations

import math

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.world.actor import ActorSpec, Control, Placement, Vector3
from eidrive_scenario.world.physics.bodies import DRIVEN, SCRIPTED, STATIC, STILL, Body, quaternion
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.physics.dynamics import Demand
from eidrive_scenario.world.physics.ground import GroundUnder
from eidrive_scenario.world.physics.multi_axle import track_of
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters


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
        z, pitch, roll = self._ground.at(placement.x, placement.y, placement.yaw)
        self._pose(placement.x, placement.y, z, placement.yaw, pitch, roll)
        self.speed, self.yaw_rate, self.acceleration = placement.speed, 0.0, (0.0, 0.0, 0.0)
        self.velocity = self.velocity_before = self._along_heading(placement.speed)
        self._motion = (self.velocity[0], self.velocity[1], 0.0)
        self.moved = self.stale = True

    def demand(self, control: Control, friction: float) -> Demand:
        """Return the forces and the steering that a control requests for the steps of this tick."""
        return self.track.demand(control, friction, self.pitch)

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

    def present_velocity(self) -> Vector3:
        """Return the current velocity of the rigid body within a step [m/s]."""
        velocity: Vector3 = bullet.getBaseVelocity(self.handle, self.client)[0]
        return velocity

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
        self._accelerate_to((vx + arm_y * rate, vy - arm_x * rate, -math.tan(pitch) * level))

    def _arm(self, yaw: float) -> Vector3:
        """Return the vector from the reference point to the center of gravity, at half the height of the box [m]."""
        lever, height = self._lever, self.spec.offset[2]
        cy, sy = math.cos(yaw), math.sin(yaw)
        if self.pitch == 0.0 and self.roll == 0.0:
            return lever * cy, lever * sy, height
        cp, sp, cr, sr = math.cos(self.pitch), math.sin(self.pitch), math.cos(self.roll), math.sin(self.roll)
        ahead, aside = lever * cp + height * sp * cr, -height * sr
        return cy * ahead - sy * aside, sy * ahead + cy * aside, height * cp * cr - lever * sp
