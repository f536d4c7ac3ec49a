"""A vehicle that drives: the world's single-track model, without contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from sample_car import CAR

from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.physics.dynamics import SingleTrack
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters

SUBSTEPS = 10


@dataclass
class Vehicle:
    """The reference point is the rear axle; the model moves the center of gravity."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    speed: float = 0.0
    dt: float = 0.05
    spec: ActorSpec = CAR
    time: float = 0.0
    left: float = 0.0
    yaw_rate: float = 0.0
    track: list[tuple[float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.model = SingleTrack(VehicleParameters.of(self.spec), self.dt / SUBSTEPS)

    def state(self) -> EgoState:
        return EgoState(self.time, np.array([self.x, self.y, 0.0]), self.yaw, 0.0, 0.0, self.speed, self.yaw_rate, 0.0)

    def drive(self, control: Control) -> None:
        step, rear = self.dt / SUBSTEPS, self.model.to_rear
        demand = self.model.demand(control, 1.0, 0.0)
        for _ in range(SUBSTEPS):
            forward, left, rate = self.speed, self.left, self.yaw_rate
            self.speed, self.left, self.yaw_rate = self.model.advance(forward, left, rate, demand)
            self.speed += left * rate * step
            self.left -= forward * rate * step
            aside = self.left - rear * self.yaw_rate
            self.x += step * (math.cos(self.yaw) * self.speed - math.sin(self.yaw) * aside)
            self.y += step * (math.sin(self.yaw) * self.speed + math.cos(self.yaw) * aside)
            self.yaw += step * self.yaw_rate
        self.time += self.dt
        self.track.append((self.x, self.y, self.speed))


@pytest.fixture
def car() -> ActorSpec:
    return CAR


@pytest.fixture
def vehicle() -> type[Vehicle]:
    return Vehicle
