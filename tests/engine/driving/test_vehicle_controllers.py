"""Vehicle controllers of third parties, selected by a property of the station."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import ClassVar

import numpy as np
import pytest

from eidrive_scenario.driving.agent_factory import build_agent, selected_extension
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.settings import parse_station_settings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading
from eidrive_scenario.world.actor import ActorSpec, Control

EMPTY = TruthReading((), (), np.empty((0, 7)), np.empty((0, 2)), np.empty(0))


class ConstantThrottleSettings(Settings):
    """Settings of the controller below."""

    throttle: float = 0.25


class ConstantThrottle(VehicleController):
    """Applies a constant throttle."""

    settings_type: ClassVar[type[Settings] | None] = ConstantThrottleSettings

    def __init__(self, spec: ActorSpec, dt: float, settings: ConstantThrottleSettings) -> None:
        super().__init__(spec, dt)
        self.settings = settings

    def control(self, ego: EgoState, plan: Plan) -> Control:
        return Control(self.settings.throttle, 0.0, 0.0)


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("constant_throttle")
    module.ConstantThrottle = ConstantThrottle  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "constant_throttle", module)
    group = "eidrive_scenario.vehicle_controllers"
    point = EntryPoint("constant", "constant_throttle:ConstantThrottle", group)
    monkeypatch.setitem(registry("vehicle_controllers")._points, "constant", point)


@pytest.mark.parametrize(("given", "throttle"), [({}, 0.25), ({"throttle": 0.5}, 0.5)])
def test_selected_vehicle_controller_computes_the_control(
    car: ActorSpec, given: dict[str, float], throttle: float
) -> None:
    properties = {"vehicle_controller": "constant", "vehicle_controller_settings": given}
    agent = build_agent(parse_station_settings(properties), car, None, seed=0, dt=0.05)
    ego = EgoState(0.0, np.zeros(3), 0.0, 0.0, 0.0, 5.0, 0.0, 0.0)
    assert agent.act(Readings(0.0, ego, EMPTY), (), 0.0, None).control == Control(throttle, 0.0, 0.0)


def test_vehicle_controller_without_plan_holds_the_brake(car: ActorSpec) -> None:
    properties = {"vehicle_controller": "constant", "planner": "none"}
    agent = build_agent(parse_station_settings(properties), car, None, seed=0, dt=0.05)
    ego = EgoState(0.0, np.zeros(3), 0.0, 0.0, 0.0, 5.0, 0.0, 0.0)
    assert agent.act(Readings(0.0, ego, EMPTY), (), 0.0, None).control == Control(0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"vehicle_controller": "constant", "vehicle_controller_settings": {"thrttle": 1}}, "did you mean 'throttle'"),
        ({"vehicle_controller_settings": {"throttle": 1}}, "vehicle controller 'pid' has no settings"),
    ],
)
def test_invalid_settings_of_a_vehicle_controller_are_reported_before_the_run(
    properties: dict[str, object], message: str
) -> None:
    with pytest.raises(SettingError, match=message):
        selected_extension(parse_station_settings(properties), "vehicle_controller", VehicleController)
