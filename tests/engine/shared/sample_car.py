"""The car of the tests, of a Lincoln MKZ's size, and the fixture `car` of the tests of world and rendering."""

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


def make_car(name: str = "Ego", *, shape: str = "car", **properties: object) -> ActorSpec:
    """Return a car of 1500 kg with a wheelbase of 2.7 m and a box of 4.5 x 1.8 x 1.5 m around x = 1.35."""
    return ActorSpec(
        name=name,
        shape=shape,
        category="car",
        size=(4.5, 1.8, 1.5),
        offset=(1.35, 0.0, 0.75),
        wheelbase=2.7,
        max_steering=0.6,
        wheel_radius=0.32,
        mass=1500.0,
        max_speed=50.0,
        max_acceleration=4.0,
        max_deceleration=8.0,
        properties={key: str(value) for key, value in properties.items()},
    )
