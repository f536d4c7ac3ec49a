"""What an actor is, and the two ways in which it can move: placed exactly, or driven by pedals and steering."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from eidrive_scenario.records import fast_frozen

Vector3 = tuple[float, float, float]


@dataclass(frozen=True)
class ExtraAxle:
    """An axle beside the front and the rear one; of a trailer without a front axle, any of its axles."""

    x: float
    """Ahead of the rear axle [m]; of a trailer, ahead of its reference point."""
    track: float
    """Between the middles of its wheels [m]; 0 for as wide as the body."""
    wheel_radius: float
    max_steering: float = 0.0
    """Largest angle of its wheels [rad]; 0 where they do not steer."""


@dataclass(frozen=True)
class ActorSpec:
    """The body of an actor, as its Vehicle, Pedestrian or MiscObject says.

    shape   which mesh shows it: car, firetruck, ambulance, bus, van, truck, motorbike, bicycle, pedestrian, rsu, box
    category  one of eidrive_scenario.detections.CLASSES
    size    length, width, height [m];  offset  box center in the actor's frame [m]
    """

    name: str
    shape: str
    category: str
    size: Vector3
    offset: Vector3
    wheelbase: float = 0.0
    """Distance between the axles [m]; 0 where there are none."""
    max_steering: float = 0.0
    """Largest angle of the front wheels [rad]."""
    wheel_radius: float = 0.3
    extra_axles: tuple[ExtraAxle, ...] = ()
    """The axles beside those two, in the order of the file."""
    mass: float = 1500.0
    max_speed: float = 70.0
    max_acceleration: float = 10.0
    max_deceleration: float = 10.0
    properties: Mapping[str, str] = field(default_factory=dict)
    color: tuple[float, float, float] | None = None
    """Body paint, red green blue in [0, 1]; by the name where None."""


@fast_frozen
@dataclass(frozen=True)
class Placement:
    """Where a scripted actor stands after the next step: reference point [m], angles [rad], speed [m/s]."""

    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    speed: float = 0.0
    teleport: bool = False
    """True if the actor jumps: velocity and acceleration then follow `speed`, not the distance covered."""
    across: bool = True
    """False where it goes where it points, so that the velocity is the speed along the heading; else the distance
    covered in the step says how fast it moves across."""


@fast_frozen
@dataclass(frozen=True)
class Control:
    """Pedals and steering of a driven vehicle for the next step."""

    throttle: float = 0.0
    """[0, 1]"""
    brake: float = 0.0
    """[0, 1]; 1 is the vehicle's largest deceleration."""
    steering: float = 0.0
    """Angle of the front wheels, left positive [rad]."""
    reverse: bool = False
