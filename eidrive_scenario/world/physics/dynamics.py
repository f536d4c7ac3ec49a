"""Dynamics of a driven vehicle: a single-track model with limits of tires and drivetrain.

Single-track model: R. Rajamani, Vehicle Dynamics and Control, 2nd ed., Springer 2012, section 2.3, with the axle loads
at standstill. Tire: the brush model of E. Fiala in the form of R. Hindiyeh and J. C. Gerdes, "A controller framework
for autonomous drifting", ASME J. Dyn. Syst. Meas. Control 136 (2014). The friction circle limits its side force beside
the longitudinal force. Drive, brakes, rolling resistance and air drag: Rajamani, ch. 4. Vehicles with more than two
axles: `MultiAxleTrack`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from eidrive_scenario.openscenario.model import Vehicle
from eidrive_scenario.world.actor import Control
from eidrive_scenario.world.physics.vehicle_parameters import GRAVITY, VehicleParameters
from eidrive_scenario.world.specs import actor_spec

AIR_DENSITY = 1.2041
"""Density of air at 20 °C and 101.325 kPa [kg/m³]."""
LONGITUDINAL_SHARE = 0.95
"""Share of the grip for drive and brakes. Anti-lock and traction control leave the rest to the steering."""


class Demand(NamedTuple):
    """Requests of driver, road and slope for some steps, computed in advance."""

    steering: float
    """Target angle of the front wheels [rad]."""
    throttle: float
    brake: float
    """Force of the brakes within the grip [N]."""
    direction: float
    """1 forwards, -1 backwards."""
    grip_front: float
    grip_rear: float
    """Maximum tire forces [N]."""
    traction_front: float
    traction_rear: float
    """Maximum forces along the wheels [N]."""
    slope: float
    """Force of the slope along the vehicle [N]."""


class SingleTrack:
    """Forces on one vehicle and the resulting change of its velocities over steps of `step` seconds.

    At low speed the slip of a tire is not defined by its ratio of velocities. There the side force is bounded by the
    force that ends the side slip of its axle within the step. The model thus passes into the kinematic one and comes to
    a stable rest, and a lateral impact is still limited by the grip of the tires.
    """

    def __init__(self, parameters: VehicleParameters, step: float) -> None:
        p = self.parameters = parameters
        self.steering = 0.0
        """Current angle of the front wheels [rad]."""
        self.to_front = (1.0 - p.weight_front) * p.wheelbase
        self.to_rear = p.weight_front * p.wheelbase
        self.to_reference = p.rear + self.to_rear
        """Distance from the reference point on the rear axle to the center of gravity ahead [m]."""
        self._cos, self._sin = 1.0, 0.0
        self._turn = p.steering_rate * step
        self._load_front = p.mass * GRAVITY * p.weight_front
        self._load_rear = p.mass * GRAVITY * (1.0 - p.weight_front)
        self._drag = 0.5 * AIR_DENSITY * p.drag_area
        self._rolling = p.rolling_resistance * p.mass * GRAVITY
        self._full_drive = p.mass * p.max_acceleration
        self._full_brake = p.mass * p.max_deceleration
        self._stop = p.mass / step
        """Force per speed that ends a speed within a step [N s/m]."""
        self._per_mass = step / p.mass
        self._per_inertia = step / p.yaw_inertia
        inertia_front = 1.0 / (1.0 / p.mass + self.to_front**2 / p.yaw_inertia)
        inertia_rear = 1.0 / (1.0 / p.mass + self.to_rear**2 / p.yaw_inertia)
        self._slowest_front = step * p.cornering_stiffness_front / inertia_front
        self._slowest_rear = step * p.cornering_stiffness_rear / inertia_rear

    def demand(self, control: Control, friction: float, pitch: float) -> Demand:
        """Return the forces and the steering that a control requests.

        `friction` scales the grip of the tires. `pitch` of the road (positive nose down) determines the force of the
        slope.
        """
        p = self.parameters
        grip = p.tire_friction * friction
        grip_front, grip_rear = grip * self._load_front, grip * self._load_rear
        brake = min(max(control.brake, 0.0), 1.0) * self._full_brake
        return Demand(
            steering=_limited(control.steering, p.max_steering),
            throttle=min(max(control.throttle, 0.0), 1.0),
            brake=min(brake, LONGITUDINAL_SHARE * (grip_front + grip_rear)),
            direction=-1.0 if control.reverse else 1.0,
            grip_front=grip_front,
            grip_rear=grip_rear,
            traction_front=LONGITUDINAL_SHARE * grip_front,
            traction_rear=LONGITUDINAL_SHARE * grip_rear,
            slope=p.mass * GRAVITY * math.sin(pitch),
        )

    def advance(self, forward: float, left: float, yaw_rate: float, demand: Demand) -> tuple[float, float, float]:
        """Return velocities forward and left [m/s] and yaw rate [rad/s] after one step.

        The arguments are those of the center of gravity in the axes of the vehicle at the start of the step.
        """
        p = self.parameters
        if self.steering != demand.steering:
            self._steer(demand.steering)
        along_front, along_rear, free = self._longitudinal(forward, demand)
        cos, sin, to_front, to_rear = self._cos, self._sin, self.to_front, self.to_rear

        side = left + to_front * yaw_rate
        rolling, slipping = abs(forward * cos + side * sin), side * cos - forward * sin
        side_front = 0.0
        if slipping:
            slip = slipping / (rolling if rolling > self._slowest_front else self._slowest_front)
            side_front = fiala(slip, p.cornering_stiffness_front, remaining_side_force(demand.grip_front, along_front))
        rolling, slipping = abs(forward), left - to_rear * yaw_rate
        side_rear = 0.0
        if slipping:
            slip = slipping / (rolling if rolling > self._slowest_rear else self._slowest_rear)
            side_rear = fiala(slip, p.cornering_stiffness_rear, remaining_side_force(demand.grip_rear, along_rear))

        across_front = along_front * sin - side_front * cos
        force = along_front * cos + side_front * sin + along_rear + free
        return (
            forward + force * self._per_mass,
            left + (across_front - side_rear) * self._per_mass,
            yaw_rate + (to_front * across_front + to_rear * side_rear) * self._per_inertia,
        )

    def _steer(self, wanted: float) -> None:
        missing = wanted - self.steering
        self.steering = wanted if abs(missing) <= self._turn else self.steering + math.copysign(self._turn, missing)
        self._cos, self._sin = math.cos(self.steering), math.sin(self.steering)

    def _longitudinal(self, forward: float, demand: Demand) -> tuple[float, float, float]:
        """Return the forces along the wheels of the front and the rear axle, and those without tires [N]."""
        p = self.parameters
        free = demand.slope - self._drag * forward * abs(forward)
        front = rear = 0.0
        if demand.throttle > 0.0:
            direction = demand.direction
            ahead = direction * forward
            drive = self._full_drive * demand.throttle
            if drive * ahead > p.power:
                drive = p.power / ahead
            to_top = self._stop * (p.max_speed - ahead) - direction * free
            if drive > to_top:
                drive = max(to_top, 0.0)
            drive *= direction
            front = _limited(drive * p.drive_front, demand.traction_front)
            rear = _limited(drive * (1.0 - p.drive_front), demand.traction_rear)
        # Brakes and rolling resistance stop and hold the vehicle; they never accelerate it.
        to_rest = self._stop * forward + free + front + rear
        rolling = _limited(to_rest, self._rolling)
        if demand.brake > 0.0:
            brake = _limited(to_rest - rolling, demand.brake)
            front = _limited(front - brake * p.weight_front, demand.traction_front)
            rear = _limited(rear - brake * (1.0 - p.weight_front), demand.traction_rear)
        return front, rear, free - rolling


def fiala(slip_tangent: float, stiffness: float, largest: float) -> float:
    """Return the side force of an axle [N] at a tangent of its slip angle, limited to `largest`, in slip direction."""
    used = stiffness * slip_tangent / (3.0 * largest)
    size = abs(used)
    if size >= 1.0:
        return math.copysign(largest, used)
    return largest * used * (3.0 - size * (3.0 - size))


def remaining_side_force(grip: float, along: float) -> float:
    """Return the side force that remains of the grip of tires beside a longitudinal force [N]."""
    return math.sqrt(grip * grip - along * along) if along else grip


def _limited(value: float, bound: float) -> float:
    return bound if value > bound else -bound if value < -bound else value


@dataclass
class _Wheels:
    """Axle of the model."""

    lever: float
    """Distance ahead of the center of gravity [m]."""
    front: bool
    gain: float
    """Tangent of its steering angle over that of the front axle."""
    max_steering: float
    slowest: float
    """Speed below which its slip does not follow from the ratio of velocities [m/s]."""
    cos: float = 1.0
    sin: float = 0.0


class MultiAxleTrack(SingleTrack):
    """`SingleTrack` for all axles of `parameters.axles`.

    An additional axle steers, if it can (`max_steering`), by the angle at which its wheels roll about the same point as
    the front wheels. This point is abreast of the mean position of the unsteered axles of the rear group.
    """

    def __init__(self, parameters: VehicleParameters, step: float) -> None:
        super().__init__(parameters, step)
        p = parameters
        steered = p.axles[0]
        fixed = [axle.x for axle in p.axles if not axle.front and axle.max_steering <= 0.0]
        pivot = sum(fixed) / len(fixed)
        in_front = sum(axle.front for axle in p.axles)
        behind = len(p.axles) - in_front
        self._share_front, self._share_rear = 1.0 / in_front, 1.0 / behind
        self._stiffness_front = p.cornering_stiffness_front / in_front
        self._stiffness_rear = p.cornering_stiffness_rear / behind
        self._wheels = []
        for axle in p.axles:
            lever = axle.x - self.to_reference
            stiffness = p.cornering_stiffness_front if axle.front else p.cornering_stiffness_rear
            # The axles of a group share the force that ends the side slip within a step;
            # otherwise they would overshoot together.
            slowest = step * stiffness * (1.0 / p.mass + lever**2 / p.yaw_inertia)
            gain = (axle.x - pivot) / (steered.x - pivot) if axle.max_steering > 0.0 else 0.0
            self._wheels.append(_Wheels(lever, axle.front, gain, axle.max_steering, slowest))
        self._wheels[0].gain = 1.0

    @property
    def turning_wheelbase(self) -> float:
        """Tangent of the angle of the front wheels over the curvature of a slow turn: equivalent wheelbase by Winkler
        [m].

        At this curvature the side forces, cornering stiffness times slip, and their moments are balanced.
        """
        forces = lever = moment = steered = twisted = 0.0
        for wheels in self._wheels:
            stiffness = self._stiffness_front if wheels.front else self._stiffness_rear
            forces += stiffness
            lever += stiffness * wheels.lever
            moment += stiffness * wheels.lever**2
            steered += stiffness * wheels.gain
            twisted += stiffness * wheels.gain * wheels.lever
        return (forces * moment - lever * lever) / (forces * twisted - lever * steered)

    def advance(self, forward: float, left: float, yaw_rate: float, demand: Demand) -> tuple[float, float, float]:
        """Return the velocities after one step, as `SingleTrack.advance` does."""
        if self.steering != demand.steering:
            self._steer(demand.steering)
        along_front, along_rear, force = self._longitudinal(forward, demand)
        share = self._share_front
        front = along_front * share, demand.grip_front * share, self._stiffness_front
        share = self._share_rear
        rear = along_rear * share, demand.grip_rear * share, self._stiffness_rear
        across = moment = 0.0
        for wheels in self._wheels:
            along, grip, stiffness = front if wheels.front else rear
            cos, sin = wheels.cos, wheels.sin
            side = left + wheels.lever * yaw_rate
            rolling, slipping = abs(forward * cos + side * sin), side * cos - forward * sin
            slip = slipping / (rolling if rolling > wheels.slowest else wheels.slowest)
            push = fiala(slip, stiffness, remaining_side_force(grip, along))
            force += along * cos + push * sin
            pull = along * sin - push * cos
            across += pull
            moment += wheels.lever * pull
        return (
            forward + force * self._per_mass,
            left + across * self._per_mass,
            yaw_rate + moment * self._per_inertia,
        )

    def _steer(self, wanted: float) -> None:
        super()._steer(wanted)
        tangent = math.tan(self.steering)
        for wheels in self._wheels:
            if wheels.gain:
                angle = math.atan(wheels.gain * tangent)
                angle = min(max(angle, -wheels.max_steering), wheels.max_steering)
                wheels.cos, wheels.sin = math.cos(angle), math.sin(angle)


def turning_wheelbase(vehicle: Vehicle) -> float:
    """Return the effective wheelbase of a vehicle at low speed [m].

    It is the distance between front and rear axle, more with further axles, and 0 without a front axle. Raise
    InputError if the vehicle is invalid.
    """
    spec = actor_spec(vehicle.name, vehicle)
    if spec.wheelbase <= 0.0 or not spec.extra_axles:
        return max(spec.wheelbase, 0.0)
    return MultiAxleTrack(VehicleParameters.of(spec), 1.0).turning_wheelbase


def track_of(parameters: VehicleParameters, step: float) -> SingleTrack:
    """Return the model of a vehicle with these parameters."""
    return MultiAxleTrack(parameters, step) if parameters.axles else SingleTrack(parameters, step)
