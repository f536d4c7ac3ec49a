"""Entry points of pyproject.toml are complete: every extension of this project has exactly one line."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import tomllib
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import eidrive_behaviors
import eidrive_criteria
import pytest

import eidrive_scenario.driving
import eidrive_scenario.fusion
import eidrive_scenario.perception
import eidrive_scenario.sensing
import eidrive_scenario.v2x
from eidrive_scenario.api.actions import ActionBehaviour, Condition, ControllerModel, model
from eidrive_scenario.api.criteria import Criterion
from eidrive_scenario.api.driving import Planner, VehicleController
from eidrive_scenario.api.fusion import FusionMethod
from eidrive_scenario.api.perception import Detector, Sensor, TrackingMethod
from eidrive_scenario.api.v2x import Channel
from eidrive_scenario.extensions.project import GROUPS
from eidrive_scenario.extensions.registry import Registry

PROJECT = Path(__file__).parents[1] / "pyproject.toml"
PREFIX = "eidrive_scenario."
BASES: dict[str, tuple[type, ModuleType]] = {
    "actions": (ActionBehaviour, eidrive_behaviors),
    "conditions": (Condition, eidrive_behaviors),
    "controllers": (ControllerModel, eidrive_behaviors),
    "criteria": (Criterion, eidrive_criteria),
    "detectors": (Detector, eidrive_scenario.perception),
    "fusion": (FusionMethod, eidrive_scenario.fusion),
    "planners": (Planner, eidrive_scenario.driving),
    "channels": (Channel, eidrive_scenario.v2x),
    "sensors": (Sensor, eidrive_scenario.sensing),
    "trackers": (TrackingMethod, eidrive_scenario.perception),
    "vehicle_controllers": (VehicleController, eidrive_scenario.driving),
}
"""Base class of each group, and the package that contains its built-in extensions."""
UNREGISTERED = {
    "eidrive_behaviors.actions.values:SetAction": "base of ParameterSetAction and VariableSetAction",
    "eidrive_behaviors.actions.values:ModifyAction": "base of ParameterModifyAction and VariableModifyAction",
    "eidrive_scenario.perception.learned.detector:LearnedDetector": "base of SsdDetector and YoloDetector",
}
"""Concrete classes without an entry point, with the reason."""
SHARED = {"eidrive_scenario.perception.tracking.tracker:Tracker": "motion models cv and ctrv of one tracker"}
"""Classes with several entry points, with the reason."""
NOT_EXECUTED = {
    "choice of other actions": (
        *("Action", "AppearanceAction", "ControllerAction", "EntityAction", "GlobalAction", "InfrastructureAction"),
        *("LateralAction", "LongitudinalAction", "ParameterAction", "PrivateAction", "RoutingAction", "TrafficAction"),
        *("TrafficSignalAction", "TrailerAction", "UserDefinedAction", "VariableAction"),
    ),
    "part of OverrideControllerValueAction": (
        *("OverrideBrakeAction", "OverrideClutchAction", "OverrideGearAction", "OverrideParkingBrakeAction"),
        *("OverrideSteeringWheelAction", "OverrideThrottleAction"),
    ),
    "choice of other conditions": ("ByEntityCondition", "ByValueCondition", "EntityCondition"),
    "name, delay and edge of another condition": ("Condition",),
    "part of Environment": ("RoadCondition",),
}
"""Types of the standard without an entry point, by the reason."""


def entry_points() -> dict[str, dict[str, str]]:
    """Return the lines of pyproject.toml per group: `module:Class` by name."""
    groups = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["entry-points"]
    return {group.removeprefix(PREFIX): lines for group, lines in groups.items() if group.startswith(PREFIX)}


LINES = entry_points()
CUSTOM = "eidrive."
"""Start of the names of custom actions, which are no types of the standard."""


def modules_of(package: ModuleType) -> Iterator[ModuleType]:
    """Import all modules of a package."""
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield importlib.import_module(module.name)


def concrete_classes(base: type, package: ModuleType) -> list[type]:
    """Return the concrete subclasses of a base class that the modules of a package define."""
    return [
        member
        for module in modules_of(package)
        for member in vars(module).values()
        if inspect.isclass(member) and member.__module__ == module.__name__
        if issubclass(member, base) and not inspect.isabstract(member)
    ]


def test_registration_groups_are_those_of_the_registry() -> None:
    assert {*BASES, "commands"} == set(GROUPS) == set(LINES)


@pytest.mark.parametrize("group", BASES)
def test_registration_of_concrete_classes_is_complete_and_unique(group: str) -> None:
    values = list(LINES[group].values())
    assert {value for value in values if values.count(value) > 1} <= set(SHARED)
    found = {f"{found.__module__}:{found.__qualname__}" for found in concrete_classes(*BASES[group])}
    assert found - set(UNREGISTERED) == set(values)


@pytest.mark.parametrize("group", BASES)
def test_registration_lines_load_as_classes_of_their_group(group: str) -> None:
    points = [EntryPoint(name, value, f"{PREFIX}{group}") for name, value in LINES[group].items()]
    registry = Registry(group, points)
    for name in registry:
        assert registry.load(name, BASES[group][0]) in concrete_classes(*BASES[group])


def standard(group: str) -> dict[str, str]:
    """Return the lines of a group for types of the standard."""
    return {name: value for name, value in LINES[group].items() if not name.startswith(CUSTOM)}


def test_registration_names_are_those_of_the_classes() -> None:
    for group in ("actions", "conditions"):
        assert [value.partition(":")[2] for value in standard(group).values()] == list(standard(group))
    criteria = {found.name for found in concrete_classes(*BASES["criteria"]) if issubclass(found, Criterion)}
    assert criteria == set(LINES["criteria"])


@pytest.mark.parametrize(("group", "suffix"), [("actions", "Action"), ("conditions", "Condition")])
def test_registration_covers_every_type_of_the_standard(group: str, suffix: str) -> None:
    types = {name for name, member in vars(model).items() if inspect.isclass(member) and name.endswith(suffix)}
    exempt = {name for names in NOT_EXECUTED.values() for name in names if name.endswith(suffix)}
    assert exempt <= types
    assert types - exempt == set(standard(group))


def test_unregistered_classes_are_bases_of_registered_ones() -> None:
    registered = [load(value) for group in BASES for value in LINES[group].values()]
    for value in UNREGISTERED:
        assert any(issubclass(extension, load(value)) for extension in registered), value


def load(value: str) -> type:
    """Return the class of an entry point."""
    loaded = EntryPoint("", value, "").load()
    assert isinstance(loaded, type)
    return loaded
