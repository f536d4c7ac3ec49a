"""Tests of the participants of background traffic."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import pytest

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.model.entity_enumerations import Role, VehicleCategory
from eidrive_scenario.traffic import TrafficMix
from eidrive_scenario.traffic.spawning.bodies import library_bodies

NO_CONTROLLER = model.ControllerDistribution(
    controller_distribution_entry=(
        model.ControllerDistributionEntry(weight=1.0, controller=model.Controller(name="somebody")),
    )
)


def definition(categories: dict[VehicleCategory, float], roles: dict[Role, float] | None = None) -> TrafficMix:
    entries = tuple(model.VehicleCategoryDistributionEntry(category=c, weight=w) for c, w in categories.items())
    shares = None
    if roles is not None:
        shares = model.VehicleRoleDistribution(
            vehicle_role_distribution_entry=tuple(
                model.VehicleRoleDistributionEntry(role=r, weight=w) for r, w in roles.items()
            )
        )
    element = model.TrafficDefinition(
        name="mix",
        vehicle_category_distribution=model.VehicleCategoryDistribution(vehicle_category_distribution_entry=entries),
        vehicle_role_distribution=shares,
        controller_distribution=NO_CONTROLLER,
    )
    return TrafficMix(SimpleNamespace(), element, None)  # type: ignore[arg-type]


def drawn(mixture: TrafficMix, count: int = 400) -> Counter[str]:
    return Counter(mixture.draw(generator(5, "bodies", n)).spec.name for n in range(count))


def test_mix_without_definition_contains_library_cars() -> None:
    found = drawn(TrafficMix(SimpleNamespace(), None, None))  # type: ignore[arg-type]
    assert set(found) == {spec.name for spec, role in library_bodies("car") if role is Role.NONE}
    assert len(found) >= 3


def test_mix_draws_categories_by_weight() -> None:
    """Of 400 draws with weights 3 : 1, the mean is 100 vans and the standard deviation 8.7."""
    found = drawn(definition({VehicleCategory.CAR: 3.0, VehicleCategory.VAN: 1.0}))
    assert 65 <= found["van"] <= 135
    assert "truck" not in found


@pytest.mark.parametrize(
    ("name", "value"), [("acceleration", "0"), ("deceleration", "-2"), ("time_gap", "nan"), ("speed_factor", "0")]
)
def test_invalid_driver_settings_are_errors_with_line(name: str, value: str) -> None:
    entries = (("module", "eidrive.traffic", 3), (name, value, 4))
    properties = tuple(model.Property(name=key, value=text, line=line) for key, text, line in entries)
    controller = model.Controller(
        name="driver", line=2, source="a.xosc", properties=model.Properties(property=properties)
    )
    entry = model.ControllerDistributionEntry(weight=1.0, controller=controller)
    categories = model.VehicleCategoryDistribution(
        vehicle_category_distribution_entry=(
            model.VehicleCategoryDistributionEntry(category=VehicleCategory.CAR, weight=1.0),
        )
    )
    element = model.TrafficDefinition(
        name="mix",
        vehicle_category_distribution=categories,
        controller_distribution=model.ControllerDistribution(controller_distribution_entry=(entry,)),
    )
    with pytest.raises(SettingError, match=f"a.xosc:4: setting '{name}' is '{value}'"):
        TrafficMix(SimpleNamespace(), element, None)  # type: ignore[arg-type]


def test_bodies_have_dimensions_of_the_catalog() -> None:
    truck = definition({VehicleCategory.TRUCK: 1.0}).draw(generator(1, "one"))
    assert truck.spec.size == (8.3, 2.5, 3.55)
    assert truck.driver.acceleration == 1.0
    bicycle = definition({VehicleCategory.BICYCLE: 1.0}).draw(generator(1, "one"))
    assert bicycle.spec.category == "bicycle"
    assert bicycle.spec.max_speed == 12.0


@pytest.mark.parametrize(
    ("category", "role", "names"),
    [
        (VehicleCategory.TRUCK, Role.FIRE, {"fire_engine", "firetruck"}),
        (VehicleCategory.VAN, Role.AMBULANCE, {"ambulance"}),
        (VehicleCategory.CAR, Role.POLICE, {"police_charger"}),
        (VehicleCategory.TRUCK, Role.CIVIL, {"truck"}),
        (VehicleCategory.TRUCK, Role.POLICE, {"truck"}),
        (VehicleCategory.TRAM, Role.NONE, {"bus"}),
        (VehicleCategory.SEMITRAILER, Role.NONE, {"truck"}),
    ],
)
def test_roles_select_vehicles_of_a_category(category: VehicleCategory, role: Role, names: set[str]) -> None:
    assert set(drawn(definition({category: 1.0}, {role: 2.0}), 20)) == names


def test_everyday_traffic_has_no_emergency_vehicles() -> None:
    """Every everyday car of the catalog is drawn at least once in 300 draws; the police car never is."""
    names = set(drawn(definition({VehicleCategory.CAR: 1.0}), 300))
    assert {"dodge_charger", "ford_mustang", "lincoln_mkz"} <= names
    assert "police_charger" not in names


def test_categories_of_mix_are_those_it_draws() -> None:
    mixture = definition({VehicleCategory.CAR: 1.0, VehicleCategory.BUS: 0.0, VehicleCategory.VAN: 2.0})
    assert mixture.categories == {"car", "van"}
