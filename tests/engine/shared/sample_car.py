"""The car of the tests, of a Lincoln MKZ's size, and types of the fixture `car` of the world tests."""

from __future__ import annotations

from typing import Protocol, TypedDict

from eidrive_scenario.world.actor import ActorSpec


class CarFactory(Protocol):
    """A function that makes a car with a name, a shape and properties."""

    def __call__(self, name: str = "Ego", *, shape: str = "car", **properties: object) -> ActorSpec: ...


class Resistances(TypedDict):
    """Properties of a car that determine its driving resistances."""

    drag_area: float
    rolling_resistance: float


CAR = ActorSpec(
    "Ego",
    "car",
    "car",
    (4.892, 1.837, 1.49),
    (1.4, 0.0, 0.745),
    wheelbase=2.85,
    max_steering=0.6,
    mass=1900.0,
    max_acceleration=5.0,
    max_deceleration=9.0,
)
