"""Participants of background traffic: bodies and drivers, drawn by the weights of the scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Generic, TypeVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from eidrive_scenario.base.car_following import IntelligentDriver
from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.extensions.library import CATALOGS, library_path
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.openscenario import Scenario, model, read_document
from eidrive_scenario.openscenario.conventions import property_entries
from eidrive_scenario.openscenario.model.entity_enumerations import Role, VehicleCategory
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.specs import SHAPE_BY_CATEGORY, actor_spec

T = TypeVar("T")

MODULE = "eidrive.traffic"
"""Value of `module` of a controller with driver parameters of background traffic."""

_OLD_ROLES = {Role.FIRE_BRIGADE: Role.FIRE, Role.ROADSIDE_ASSISTANCE: Role.ROAD_ASSISTANCE}
"""Names of roles before OpenSCENARIO 1.4, which the vehicles of the library have."""

ON_FOOT = IntelligentDriver(time_gap=0.5, standstill_gap=0.5, acceleration=0.6, deceleration=1.0)
"""Parameters of the model for pedestrians that walk in a row."""
WALKING = 1.34
"""Mean free speed of pedestrians [m/s]; Weidmann, Transporttechnik der Fussgänger, ETH Zürich (1993)."""


class DriverSettings(Settings):
    """Properties of a controller with module `eidrive.traffic`; units as in IntelligentDriver.

    speed_factor   mean share of the speed limit that is the desired speed
    ignore_lights  share of the drivers that ignore traffic lights
    """

    module: str = MODULE
    time_gap: NonNegativeFloat | None = None
    standstill_gap: NonNegativeFloat | None = None
    acceleration: PositiveFloat | None = None
    deceleration: PositiveFloat | None = None
    speed_factor: PositiveFloat = 1.0
    ignore_lights: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0

    def driver(self, usual: IntelligentDriver) -> IntelligentDriver:
        """Return the default driver with these parameters."""
        names = ("time_gap", "standstill_gap", "acceleration", "deceleration")
        return replace(usual, **{name: value for name in names if (value := getattr(self, name)) is not None})


@dataclass(frozen=True)
class Participant:
    """Body without a name, and its driver."""

    spec: ActorSpec
    driver: IntelligentDriver
    speed_factor: float = 1.0
    ignore_lights: float = 0.0

    @property
    def walks(self) -> bool:
        """True for a pedestrian."""
        return self.spec.category == "pedestrian"

    @property
    def front(self) -> float:
        """Distance from the reference point to the front bumper [m]."""
        return self.spec.offset[0] + 0.5 * self.spec.size[0]


@dataclass(frozen=True)
class WeightedChoice(Generic[T]):
    """Items with weights."""

    choices: Sequence[T]
    weights: Sequence[float]

    def draw(self, rng: np.random.Generator) -> T:
        """Return a random item."""
        shares = np.cumsum(self.weights)
        return self.choices[int(np.searchsorted(shares, rng.uniform(0.0, shares[-1]), side="right"))]


class TrafficMix:
    """Participants of a TrafficDefinition or a TrafficDistribution; without either, the cars of the library.

    Raise ScenarioError if weights are negative or all 0, or if an entity neither drives nor walks.
    """

    def __init__(
        self,
        scenario: Scenario,
        definition: model.TrafficDefinition | None,
        distribution: model.TrafficDistribution | None,
    ) -> None:
        self._scenario = scenario
        self._groups: WeightedChoice[WeightedChoice[Participant]] | None = None
        self._categories: WeightedChoice[VehicleCategory] = WeightedChoice([VehicleCategory.CAR], [1.0])
        self._roles: WeightedChoice[Role] = WeightedChoice([Role.NONE], [1.0])
        self._drivers: WeightedChoice[DriverSettings] = WeightedChoice([DriverSettings()], [1.0])
        if distribution is not None:
            entries = self._entries(distribution)
            self._groups = self._weighted([self._group(entry) for entry in entries], entries)
        elif definition is not None:
            categories = definition.vehicle_category_distribution.vehicle_category_distribution_entry
            self._categories = self._weighted([entry.category for entry in categories], categories)
            if definition.vehicle_role_distribution is not None:
                roles = definition.vehicle_role_distribution.vehicle_role_distribution_entry
                self._roles = self._weighted([_OLD_ROLES.get(entry.role, entry.role) for entry in roles], roles)
            controllers = definition.controller_distribution.controller_distribution_entry
            self._drivers = self._weighted([self._settings(entry) for entry in controllers], controllers)

    def draw(self, rng: np.random.Generator) -> Participant:
        """Return a random participant."""
        if self._groups is not None:
            return self._groups.draw(rng).draw(rng)
        category, role, settings = self._categories.draw(rng), self._roles.draw(rng), self._drivers.draw(rng)
        bodies = library_bodies(SHAPE_BY_CATEGORY[category.value])
        by_role = ([body for body, own in bodies if own is wanted] for wanted in (role, Role.NONE))
        fitting = next(filter(None, by_role), [body for body, _ in bodies])
        return _participant(fitting[int(rng.integers(len(fitting)))], settings)

    @property
    def categories(self) -> frozenset[str]:
        """Categories of all bodies that can be drawn."""
        if self._groups is None:
            similar = [SHAPE_BY_CATEGORY[category.value] for category in self._categories.choices]
            return frozenset(body.category for category in similar for body, _ in library_bodies(category))
        return frozenset(member.spec.category for group in self._groups.choices for member in group.choices)

    def _entries(self, distribution: model.TrafficDistribution) -> list[model.TrafficDistributionEntry]:
        """Return the entries in the file and those of catalogs, whose kind the reader has checked."""
        referenced = map(self._scenario.resolved, distribution.catalog_references)
        listed = [entry for entry in referenced if isinstance(entry, model.TrafficDistributionEntry)]
        return [*distribution.traffic_distribution_entry, *listed]

    def _group(self, entry: model.TrafficDistributionEntry) -> WeightedChoice[Participant]:
        members = entry.entity_distribution.entity_distribution_entry
        return self._weighted([self._member(member.scenario_object_template) for member in members], members)

    def _member(self, template: model.ScenarioObjectTemplate) -> Participant:
        entity: model.Element = template.chosen()
        if isinstance(entity, model.CatalogReference):
            entity = self._scenario.resolved(entity)
        if not isinstance(entity, model.Vehicle | model.Pedestrian):
            message = f"background traffic cannot contain a {type(entity).__name__}"
            raise ScenarioError(Diagnostic.at(template, message, "give a Vehicle or a Pedestrian"))
        settings = next((self._settings(controller) for controller in template.object_controller), DriverSettings())
        return _participant(actor_spec(entity.name, entity), settings)

    def _settings(self, holder: model.ControllerDistributionEntry | model.ObjectController) -> DriverSettings:
        """Return the driver of a controller with module `eidrive.traffic`, else the default driver."""
        controller: model.Element | None = holder.controller
        if holder.catalog_reference is not None:
            controller = self._scenario.resolved(holder.catalog_reference)
        if not isinstance(controller, model.Controller):
            return DriverSettings()
        entries = property_entries(controller)
        properties, lines = {each.name: each.value for each in entries}, {each.name: each.line for each in entries}
        if properties.get("module") != MODULE:
            return DriverSettings()
        return parse_settings(DriverSettings, properties, source=controller.source, line=controller.line, lines=lines)

    def _weighted(self, choices: Sequence[T], entries: Sequence[model.Element]) -> WeightedChoice[T]:
        weights = [float(getattr(entry, "weight")) for entry in entries]  # noqa: B009
        if min(weights) < 0.0 or not sum(weights) > 0.0:
            message = f"the weights {', '.join(f'{weight:g}' for weight in weights)} are invalid"
            raise ScenarioError(Diagnostic.at(entries[0], message, "give weights of at least 0, not all 0"))
        pairs = [(choice, weight) for choice, weight in zip(choices, weights, strict=True) if weight > 0.0]
        return WeightedChoice(*zip(*pairs, strict=True))


def _participant(spec: ActorSpec, settings: DriverSettings) -> Participant:
    usual = IntelligentDriver()
    usual = replace(usual, acceleration=min(usual.acceleration, spec.max_acceleration))
    driver = settings.driver(ON_FOOT if spec.category == "pedestrian" else usual)
    return Participant(spec, driver, settings.speed_factor, settings.ignore_lights)


@cache
def library_bodies(category: str) -> tuple[tuple[ActorSpec, Role], ...]:
    """Return the library vehicles of a category with their roles (NONE for everyday vehicles)."""
    document = read_document(library_path() / CATALOGS / "vehicles.xosc")
    vehicles = document.catalog.vehicle if document.catalog is not None else ()
    return tuple(
        (actor_spec(vehicle.name, vehicle), Role.NONE if vehicle.role in (None, Role.CIVIL) else vehicle.role)
        for vehicle in vehicles
        if vehicle.vehicle_category.value == category
    )
