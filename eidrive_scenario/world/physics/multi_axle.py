"""Single-track model of a vehicle with more than two axles, each with a separate slip.

Unsteered axles at different positions cannot all roll without slip in a turn. They resist it, and the vehicle turns as
with a longer wheelbase (C. B. Winkler, Simplified analysis of the steady-state turning of complex vehicles, Vehicle
System Dynamics 29 (1998), 141-180). Here this results from the forces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from eidrive_scenario.openscenario.model import Vehicle
from eidrive_scenario.world.physics.dynamics import Demand, SingleTrack, fiala, remaining_side_force
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters
from eidrive_scenario.world.specs import actor_spec


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
