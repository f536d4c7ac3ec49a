"""How a driven vehicle moves: a single-track model with tyre and drivetrain limits.

Single-track model: R. Rajamani, Vehicle Dynamics and Control, 2nd ed., Springer 2012, section 2.3, with the axle
loads at standstill. Tyre: the brush model of E. Fiala in the form of R. Hindiyeh and J. C. Gerdes, "A controller
framework for autonomous drifting", ASME J. Dyn. Syst. Meas. Control 136 (2014), whose largest side force is what the
friction circle leaves beside the longitudinal force. Drive, brakes, rolling resistance and air drag: Rajamani, ch. 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from eidrive_scenario.errors import Problem, SettingError
from eidrive_scenario.world.actor import ActorSpec, Control

GRAVITY = 9.81
AIR_DENSITY = 1.2041
"""At 20 °C and 101.325 kPa [kg/m³]."""
LONGITUDINAL_SHARE = 0.95
"""Share of the grip that drive and brakes may use: anti-lock and traction control leave the rest to the steering."""

PROPERTIES = (
    "power",
    "drag_area",
    "rolling_resistance",
    "tyre_friction",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
    "weight_front",
    "drive_front",
    "yaw_inertia",
    "steering_rate",
    "steering_ratio",
)
"""The Properties of a Vehicle which `VehicleParameters.of` reads; each is a number, each may be missing."""


@dataclass(frozen=True)
class VehicleParameters:
    """What the single-track model knows of a vehicle. The defaults in brackets hold where the catalog is silent."""

    mass: float
    """[kg]"""
    wheelbase: float
    """[m]"""
    weight_front: float
    """Share of the weight on the front axle at standstill [0.55]."""
    yaw_inertia: float
    """About the centre of gravity [kg m²; mass times the product of its distances from the axles]."""
    max_steering: float
    """[rad]"""
    steering_rate: float
    """Of the front wheels [rad/s; 0.8]."""
    steering_ratio: float
    """Turn of the steering wheel over that of the front wheels [16]."""
    max_speed: float
    max_acceleration: float
    """That the drive gives at low speed [m/s²]."""
    max_deceleration: float
    """That the brakes give at full pedal [m/s²]."""
    power: float
    """At the wheels [W; 60 W per kg]."""
    drive_front: float
    """Share of the drive force on the front axle [1]."""
    drag_area: float
    """Drag coefficient times frontal area [m²; 0.3 times width times height]."""
    rolling_resistance: float
    """Force over weight [0.012]."""
    tyre_friction: float
    """Largest tyre force over load, on a dry road [1.0]."""
    cornering_stiffness_front: float
    """Of the whole axle [N/rad; 14 per rad times its load]."""
    cornering_stiffness_rear: float
    """Of the whole axle [N/rad; 18 per rad times its load]."""

    @classmethod
    def of(cls, spec: ActorSpec) -> VehicleParameters:
        """The parameters in a vehicle's specification. Raises SettingError for a Property that makes no sense."""
        if spec.wheelbase <= 0.0:
            what = f"{spec.name!r} cannot be driven: its axles are not apart"
            raise SettingError(Problem(what, "give its Vehicle a FrontAxle whose positionX is above the RearAxle's"))
        weight_front = _number(spec, "weight_front", 0.55, below=1.0)
        weight = spec.mass * GRAVITY
        lever = weight_front * (1.0 - weight_front) * spec.wheelbase**2
        return cls(
            mass=spec.mass,
            wheelbase=spec.wheelbase,
            weight_front=weight_front,
            yaw_inertia=_number(spec, "yaw_inertia", spec.mass * lever),
            max_steering=spec.max_steering,
            steering_rate=_number(spec, "steering_rate", 0.8),
            steering_ratio=_number(spec, "steering_ratio", 16.0),
            max_speed=spec.max_speed,
            max_acceleration=spec.max_acceleration,
            max_deceleration=spec.max_deceleration,
            power=_number(spec, "power", 60.0 * spec.mass),
            drive_front=_number(spec, "drive_front", 1.0, zero=True, below=1.0 + 1e-9),
            drag_area=_number(spec, "drag_area", 0.3 * spec.size[1] * spec.size[2], zero=True),
            rolling_resistance=_number(spec, "rolling_resistance", 0.012, zero=True),
            tyre_friction=_number(spec, "tyre_friction", 1.0),
            cornering_stiffness_front=_number(spec, "cornering_stiffness_front", 14.0 * weight * weight_front),
            cornering_stiffness_rear=_number(spec, "cornering_stiffness_rear", 18.0 * weight * (1.0 - weight_front)),
        )


def _number(spec: ActorSpec, name: str, default: float, *, zero: bool = False, below: float = math.inf) -> float:
    text = spec.properties.get(name)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and (value > 0.0 or (zero and value == 0.0)) and value < below):
        bound = "at least 0" if zero else "above 0"
        remedy = f"give a number {bound}" + (f" and at most {below:g}" if below < math.inf else "")
        raise SettingError(Problem(f"{spec.name!r}: Property {name!r} is {text!r}", remedy))
    return value


class SingleTrack:
    """The forces on one vehicle, turned into the change of its velocities over short steps of `step` seconds.

    At low speed the slip of a tyre is no longer defined by its ratio of velocities. There the side force is bounded by
    the one that just ends the side slip of its axle within the step, so that the model passes into the kinematic one
    and comes to a stable rest, and yet a blow from the side finds no more than the tyres' grip.
    """

    def __init__(self, parameters: VehicleParameters, step: float) -> None:
        p = self.parameters = parameters
        self.steering = 0.0
        """Present angle of the front wheels [rad]."""
        self.to_front = (1.0 - p.weight_front) * p.wheelbase
        self.to_rear = p.weight_front * p.wheelbase
        self._step = step
        self._load_front = p.mass * GRAVITY * p.weight_front
        self._load_rear = p.mass * GRAVITY * (1.0 - p.weight_front)
        inertia_front = 1.0 / (1.0 / p.mass + self.to_front**2 / p.yaw_inertia)
        inertia_rear = 1.0 / (1.0 / p.mass + self.to_rear**2 / p.yaw_inertia)
        self._slowest_front = step * p.cornering_stiffness_front / inertia_front
        self._slowest_rear = step * p.cornering_stiffness_rear / inertia_rear

    def advance(
        self, forward: float, left: float, yaw_rate: float, control: Control, friction: float, pitch: float
    ) -> tuple[float, float, float]:
        """Changes of the velocities forward and to the left [m/s] and of the yaw rate [rad/s] over one step.

        The velocities are those of the centre of gravity in the vehicle's axes; `friction` scales the tyres' grip,
        `pitch` (positive nose down) is the road's, whose slope pulls the vehicle.
        """
        p, step = self.parameters, self._step
        turn = p.steering_rate * step
        wanted = min(max(control.steering, -p.max_steering), p.max_steering)
        self.steering += min(max(wanted - self.steering, -turn), turn)
        grip = p.tyre_friction * friction
        grip_front, grip_rear = grip * self._load_front, grip * self._load_rear
        along_front, along_rear, free = self._longitudinal(forward, control, grip_front, grip_rear, pitch)

        cos, sin = math.cos(self.steering), math.sin(self.steering)
        side = left + self.to_front * yaw_rate
        rolling, slipping = forward * cos + side * sin, side * cos - forward * sin
        slip = slipping / max(abs(rolling), self._slowest_front)
        side_front = -_fiala(slip, p.cornering_stiffness_front, _left_by(grip_front, along_front))
        slipping = left - self.to_rear * yaw_rate
        slip = slipping / max(abs(forward), self._slowest_rear)
        side_rear = -_fiala(slip, p.cornering_stiffness_rear, _left_by(grip_rear, along_rear))

        across_front = side_front * cos + along_front * sin
        force = along_front * cos - side_front * sin + along_rear + free
        moment = self.to_front * across_front - self.to_rear * side_rear
        return (
            step * force / p.mass,
            step * (across_front + side_rear) / p.mass,
            step * moment / p.yaw_inertia,
        )

    def _longitudinal(
        self, forward: float, control: Control, grip_front: float, grip_rear: float, pitch: float
    ) -> tuple[float, float, float]:
        """Forces along the wheels at the front and the rear axle, and those that need no tyre [N]."""
        p = self.parameters
        free = p.mass * GRAVITY * math.sin(pitch) - 0.5 * AIR_DENSITY * p.drag_area * forward * abs(forward)
        direction = -1.0 if control.reverse else 1.0
        ahead = direction * forward
        drive = min(max(control.throttle, 0.0), 1.0) * min(p.mass * p.max_acceleration, p.power / max(ahead, 0.1))
        drive = direction * min(drive, max(p.mass * (p.max_speed - ahead) / self._step - direction * free, 0.0))
        drive_front = _limited(drive * p.drive_front, LONGITUDINAL_SHARE * grip_front)
        drive_rear = _limited(drive * (1.0 - p.drive_front), LONGITUDINAL_SHARE * grip_rear)
        # Brakes and rolling resistance stop the vehicle and hold it; they never push it.
        to_rest = p.mass * forward / self._step + free + drive_front + drive_rear
        rolling = _limited(to_rest, p.rolling_resistance * p.mass * GRAVITY)
        brake = min(max(control.brake, 0.0), 1.0) * p.mass * p.max_deceleration
        brake = _limited(to_rest - rolling, min(brake, LONGITUDINAL_SHARE * (grip_front + grip_rear)))
        return (
            _limited(drive_front - brake * p.weight_front, LONGITUDINAL_SHARE * grip_front),
            _limited(drive_rear - brake * (1.0 - p.weight_front), LONGITUDINAL_SHARE * grip_rear),
            free - rolling,
        )


def _fiala(slip: float, stiffness: float, largest: float) -> float:
    """Side force of an axle [N] at a tangent of its slip angle, saturating at `largest`."""
    used = stiffness * abs(slip) / (3.0 * largest)
    return math.copysign(largest if used >= 1.0 else largest * (1.0 - (1.0 - used) ** 3), slip)


def _left_by(grip: float, along: float) -> float:
    return math.sqrt(grip * grip - along * along)


def _limited(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
