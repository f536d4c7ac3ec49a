"""Interface of vehicle controllers (abstract base class `VehicleController`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.settings import Settings
from eidrive_scenario.world.actor import ActorSpec, Control


class VehicleController(ABC):
    """Controller that follows the trajectories of the planner of one vehicle. Built once for each vehicle and run.

    A class is registered in the entry points `eidrive_scenario.vehicle_controllers`. It is built as `cls(spec, dt)`, or
    as `cls(spec, dt, settings)` if it has a `settings_type`.
    """

    settings_type: ClassVar[type[Settings] | None] = None
    """Type of the property `vehicle_controller_settings`; None if the controller has no settings."""

    def __init__(self, spec: ActorSpec, dt: float) -> None:
        self.spec = spec
        self.dt = dt

    @abstractmethod
    def control(self, ego: EgoState, plan: Plan) -> Control:
        """Return throttle, brake and steering of the next time step."""

    def hold_standstill(self) -> Control:
        """Return the control of a vehicle without a plan: brake applied, wheels straight."""
        return Control(0.0, 1.0, 0.0)
