"""Specification of actors, and inputs of scripted and driven actors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import msgspec

Vector3 = tuple[float, float, float]


@dataclass(frozen=True)
class ExtraAxle:
    """Axle in addition to the front and rear axle; any axle of a trailer without a front axle."""

    x: float
    """Distance ahead of the rear axle, or of the reference point of a trailer [m]."""
    track: float
    """Distance between the centers of its wheels [m]; 0 for the width of the body."""
    wheel_radius: float
    max_steering: float = 0.0
    """Maximum angle of its wheels [rad]; 0 if they do not steer."""


@dataclass(frozen=True)
class ActorSpec:
    """Body of an actor by its Vehicle, Pedestrian or MiscObject.

    shape     mesh of the actor: car, firetruck, ambulance, bus, van, truck, motorbike, bicycle, pedestrian, rsu, box
    category  one of eidrive_scenario.base.detections.CLASSES
    size      length, width, height [m]
    offset    box center in the frame of the actor [m]
    """

    name: str
    shape: str
    category: str
    size: Vector3
    offset: Vector3
    wheelbase: float = 0.0
    """Distance between the axles [m]; 0 if there are none."""
    max_steering: float = 0.0
    """Maximum angle of the front wheels [rad]."""
    wheel_radius: float = 0.3
    extra_axles: tuple[ExtraAxle, ...] = ()
    """Additional axles in the order of the file."""
    mass: float = 1500.0
    max_speed: float = 70.0
    max_acceleration: float = 10.0
    max_deceleration: float = 10.0
    properties: Mapping[str, str] = field(default_factory=dict)
    color: tuple[float, float, float] | None = None
    """Body paint, red green blue in [0, 1]; None for a color by the name."""

    @property
    def has_wheels(self) -> bool:
        """Whether the body has axles; masts and pedestrians have none."""
        return self.wheelbase > 0.0


class Placement(msgspec.Struct, frozen=True, gc=False):
    """State of a scripted actor after the next step: reference point [m], angles [rad], speed [m/s]."""

    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    speed: float = 0.0
    teleport: bool = False
    """True for a teleport: velocity and acceleration follow `speed` instead of the covered distance."""
    across: bool = True
    """False if the velocity is the speed along the heading. True if the lateral velocity follows from the covered
    distance.
    """


class Control(msgspec.Struct, frozen=True, gc=False):
    """Pedals and steering of a driven vehicle for the next step."""

    throttle: float = 0.0
    """[0, 1]"""
    brake: float = 0.0
    """[0, 1]; 1 is the maximum deceleration of the vehicle."""
    steering: float = 0.0
    """Angle of the front wheels, left positive [rad]."""
    reverse: bool = False
