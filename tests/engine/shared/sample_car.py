"""The car of the tests, of a Lincoln MKZ's size."""

from __future__ import annotations

from eidrive_scenario.world.actor import ActorSpec

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
