"""Parameters of the single-track model of a vehicle, from its body and its Properties."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.world.actor import ActorSpec

GRAVITY = 9.81
"""Acceleration of gravity [m/s²]."""


class TrackAxle(NamedTuple):
    """Axle of a vehicle with more than two axles."""

    x: float
    """Distance ahead of the rear axle [m]."""
    front: bool
    """Whether it belongs to the front group: nearer to the front axle than to the rear one."""
    max_steering: float
    """Maximum angle of its wheels [rad]; 0 if they do not steer."""


class VehicleParameters(msgspec.Struct, frozen=True):
    """Parameters of the single-track model, with defaults in brackets.

    With more than two axles, front and rear are groups of axles at their mean positions. The axles of a group carry the
    same load, as with levelling suspensions, and are alike.
    """

    mass: float
    """[kg]"""
    wheelbase: float
    """[m]"""
    weight_front: float
    """Share of the weight on the front axle at standstill [0.55; of n front and m rear axles 0.55 n to 0.45 m]."""
    yaw_inertia: float
    """Yaw inertia about the center of gravity [kg m²; mass times the product of its distances from the axles]."""
    max_steering: float
    """[rad]"""
    steering_rate: float
    """Steering rate of the front wheels [rad/s; 0.8]."""
    steering_ratio: float
    """Angle of the steering wheel over that of the front wheels [16]."""
    max_speed: float
    max_acceleration: float
    """Maximum acceleration of the drive at low speed [m/s²]."""
    max_deceleration: float
    """Maximum deceleration of the brakes [m/s²]."""
    power: float
    """Power at the wheels [W; 60 W per kg]."""
    drive_front: float
    """Share of the drive force on the front axle [1]."""
    drag_area: float
    """Drag coefficient times frontal area [m²; 0.3 times width times height]."""
    rolling_resistance: float
    """Force over weight [0.012]."""
    tire_friction: float
    """Maximum tire force over load on a dry road [1.0]."""
    cornering_stiffness_front: float
    """Cornering stiffness of the front axle [N/rad; 14 per rad times its load]."""
    cornering_stiffness_rear: float
    """Cornering stiffness of the rear axle [N/rad; 18 per rad times its load]."""
    rear: float = 0.0
    """Position of the rear group ahead of the rear axle [m]."""
    axles: tuple[TrackAxle, ...] = ()
    """All axles if there are more than two, the front and the rear one first; else empty."""

    @classmethod
    def of(cls, spec: ActorSpec) -> VehicleParameters:
        """Return the parameters of a vehicle. Raise SettingError if a Property is invalid."""
        if spec.wheelbase <= 0.0:
            message = f"{spec.name!r} cannot be driven: its wheelbase is not positive"
            hint = "give its Vehicle a FrontAxle whose positionX is above the RearAxle's"
            raise SettingError(Diagnostic(message, hint))
        axles = _axles(spec)
        front_group, rear_group = [axle.x for axle in axles if axle.front], [axle.x for axle in axles if not axle.front]
        wheelbase, rear, usual = spec.wheelbase, 0.0, 0.55
        if axles:
            rear = sum(rear_group) / len(rear_group)
            wheelbase = sum(front_group) / len(front_group) - rear
            usual = 0.55 * len(front_group) / (0.55 * len(front_group) + 0.45 * len(rear_group))
        weight_front = _number(spec, "weight_front", usual, below=1.0)
        weight = spec.mass * GRAVITY
        lever = weight_front * (1.0 - weight_front) * wheelbase**2
        return cls(
            mass=spec.mass,
            wheelbase=wheelbase,
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
            tire_friction=_number(spec, "tire_friction", 1.0),
            cornering_stiffness_front=_number(spec, "cornering_stiffness_front", 14.0 * weight * weight_front),
            cornering_stiffness_rear=_number(spec, "cornering_stiffness_rear", 18.0 * weight * (1.0 - weight_front)),
            rear=rear,
            axles=axles,
        )


def _axles(spec: ActorSpec) -> tuple[TrackAxle, ...]:
    if not spec.extra_axles:
        return ()
    middle = spec.wheelbase / 2.0
    extra = (TrackAxle(axle.x, axle.x > middle, axle.max_steering) for axle in spec.extra_axles)
    return TrackAxle(spec.wheelbase, True, spec.max_steering), TrackAxle(0.0, False, 0.0), *extra


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
        hint = f"give a number {bound}" + (f" and at most {below:g}" if below < math.inf else "")
        raise SettingError(Diagnostic(f"{spec.name!r}: Property {name!r} is {text!r}", hint))
    return value
