"""Interface of vehicle controllers, and overrides of their controls by the scenario."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from eidrive_scenario.base.requests import Override, Overrides
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters


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


class ControlOverrides:
    """Controls of one vehicle with overrides. The last controls are stored for rate limits."""

    def __init__(self, spec: ActorSpec, dt: float) -> None:
        self._dt = dt
        parameters = VehicleParameters.of(spec)
        self._ratio = parameters.steering_ratio
        self._full_brake = parameters.mass * parameters.max_deceleration
        self._before: dict[str, float] = {}

    def apply(self, driver: Control, held: Overrides) -> Control:
        """Return the control of the driver with overrides applied."""
        wheel = driver.steering * self._ratio
        now = {"throttle": driver.throttle, "brake": driver.brake, "steeringWheel": wheel}
        now |= {"clutch": 0.0, "parkingBrake": 0.0}
        if not held:
            self._before = now
            return driver
        for control, override in held.items():
            if control in now:
                now[control] = self._moved(override)
        if "throttle" not in held and any(now[brake] > 0.0 for brake in ("brake", "parkingBrake") if brake in held):
            now["throttle"] = 0.0  # A driver that keeps its speed would compensate the brake
        self._before = now
        gear = held.get("gear")
        idle = gear is not None and gear.value == 0.0
        return Control(
            throttle=0.0 if idle else now["throttle"] * (1.0 - now["clutch"]),
            brake=1.0 if gear is not None and gear.parked else max(now["brake"], now["parkingBrake"]),
            steering=now["steeringWheel"] / self._ratio,
            reverse=driver.reverse if gear is None else gear.value < 0.0,
        )

    def _moved(self, override: Override) -> float:
        """Return the value of an overridden control after this step."""
        unit = self._full_brake if override.newton else 1.0
        target = override.value / unit
        if override.control != "steeringWheel":
            target = min(max(target, 0.0), 1.0)
        if override.max_rate is None:
            return target
        before, reach = self._before.get(override.control, 0.0), override.max_rate / unit * self._dt
        return before + min(max(target - before, -reach), reach)
