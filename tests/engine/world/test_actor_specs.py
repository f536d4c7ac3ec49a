"""Tests of actor specifications from entities of scenarios and of the library catalogs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from corpora import corpora_folder
from lxml import etree

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters
from eidrive_scenario.world.specs import COLOR_PROPERTY, SHAPE_PROPERTY, SHAPES, actor_spec

CATALOGS = Path(__file__).parents[3] / "xosc" / "catalogs"
PROPERTIES = (
    "power",
    "drag_area",
    "rolling_resistance",
    "tire_friction",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
    "weight_front",
    "drive_front",
    "yaw_inertia",
    "steering_rate",
    "steering_ratio",
)
BODIES_OF_CATEGORIES = "Without it the body follows from category"


def bounding_box(length: float, width: float, height: float, x: float = 0.0) -> model.BoundingBox:
    return model.BoundingBox(
        center=model.Center(x=x, y=0.0, z=height / 2),
        dimensions=model.Dimensions(length=length, width=width, height=height, line=7, source="a.xosc"),
    )


def properties(**entries: str) -> model.Properties:
    return model.Properties(
        property=tuple(
            model.Property(name=name, value=value, line=9, source="a.xosc") for name, value in entries.items()
        )
    )


def vehicle(name: str, category: str, **entries: str) -> model.Vehicle:
    axle: dict[str, Any] = {"position_z": 0.35, "track_width": 1.6, "wheel_diameter": 0.7}
    return model.Vehicle(
        name=name,
        vehicle_category=model.VehicleCategory(category),
        mass=1800.0,
        bounding_box=bounding_box(5.0, 2.0, 1.5, x=1.4),
        performance=model.Performance(max_speed=60.0, max_acceleration=5.0, max_deceleration=9.0),
        axles=model.Axles(
            front_axle=model.Axle(max_steering=0.5, position_x=2.9, **axle),
            rear_axle=model.Axle(max_steering=0.0, position_x=0.1, **axle),
        ),
        properties=properties(**{key.replace("__", "."): value for key, value in entries.items()}),
    )


def test_actor_spec_of_vehicle_has_its_values() -> None:
    spec = actor_spec("Ego", vehicle("car_white", "car", power="90000"))
    assert (spec.name, spec.shape, spec.category) == ("Ego", "car", "car")
    assert spec.size == (5.0, 2.0, 1.5)
    assert spec.offset == (1.4, 0.0, 0.75)
    assert spec.wheelbase == pytest.approx(2.8)
    assert (spec.max_steering, spec.wheel_radius, spec.mass) == (0.5, 0.35, 1800.0)
    assert (spec.max_speed, spec.max_acceleration, spec.max_deceleration) == (60.0, 5.0, 9.0)
    assert VehicleParameters.of(spec).power == 90_000.0


@pytest.mark.parametrize(
    ("name", "category", "shape", "kind"),
    [
        ("vehicle.carlamotors.firetruck", "truck", "firetruck", "truck"),
        ("vehicle.ford.ambulance", "van", "ambulance", "van"),
        ("semi_1", "truck", "truck", "truck"),
        ("car_bus_driver", "car", "car", "car"),
        ("bus_blue", "bus", "bus", "bus"),
        ("mc", "motorbike", "motorbike", "motorbike"),
        ("crossbike", "bicycle", "bicycle", "bicycle"),
        ("tram_line_9", "tram", "bus", "bus"),
    ],
)
def test_shape_follows_category_and_name(name: str, category: str, shape: str, kind: str) -> None:
    spec = actor_spec("A", vehicle(name, category))
    assert (spec.shape, spec.category) == (shape, kind)


def test_shape_property_has_priority() -> None:
    spec = actor_spec("A", vehicle("anything", "truck", eidrive__shape="firetruck", eidrive__color="#ff8000"))
    assert spec.shape == "firetruck"
    assert spec.color == pytest.approx((1.0, 128 / 255, 0.0))


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"eidrive__shape": "firetruk"}, r"a.xosc:9: unknown shape 'firetruk'; did you mean 'firetruck'\?"),
        ({"eidrive__color": "red"}, "a.xosc:9: color 'red'.*#rrggbb"),
    ],
)
def test_invalid_property_is_an_error_with_line(entries: dict[str, str], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        actor_spec("A", vehicle("x", "car", **entries))


def test_negative_dimensions_are_errors_and_missing_ones_are_defaults() -> None:
    def walker(height: float) -> model.Pedestrian:
        return model.Pedestrian(
            name="walker", mass=75.0, pedestrian_category=model.PedestrianCategory.PEDESTRIAN,
            bounding_box=bounding_box(0.0, 0.0, height), properties=properties(),
        )  # fmt: skip

    with pytest.raises(ScenarioError, match=r"a\.xosc:7: the bounding box of 'P'"):
        actor_spec("P", walker(-1.0))
    spec = actor_spec("P", walker(0.0))
    assert min(spec.size) > 0.3
    assert spec.offset[2] == spec.size[2] / 2


def test_mast_has_shape_of_roadside_unit() -> None:
    def thing(name: str) -> model.MiscObject:
        category = model.MiscObjectCategory.POLE
        return model.MiscObject(name=name, mass=10.0, misc_object_category=category, bounding_box=bounding_box(1, 1, 4))

    assert actor_spec("R", thing("rsu")).shape == "rsu"
    assert actor_spec("R", thing("north_RSU_2")).shape == "rsu"
    assert actor_spec("R", thing("pole")).shape == "box"


@pytest.mark.parametrize("file", ["vehicles", "pedestrians", "misc_objects"])
def test_catalogs_are_valid_by_the_schema(file: str) -> None:
    schema = etree.XMLSchema(etree.parse(corpora_folder() / "schema" / "OpenSCENARIOv1.3.1.xsd"))
    schema.assertValid(etree.parse(CATALOGS / f"{file}.xosc"))


def test_catalog_vehicles_are_consistent() -> None:
    tree = etree.parse(CATALOGS / "vehicles.xosc")
    entries = tree.findall(".//Vehicle")
    expected = "lincoln_mkz firetruck ambulance bus nissan_patrol seat_leon tesla_model3 truck van motorbike bicycle"
    assert set(expected.split()) <= {entry.get("name") for entry in entries}
    for entry in entries:
        (center,), (size,), (front,) = (entry.findall(f".//{tag}") for tag in ("Center", "Dimensions", "FrontAxle"))
        radius = float(front.attrib["wheelDiameter"]) / 2
        # Both axles are inside the box.
        reach = float(center.attrib["x"]) + float(size.attrib["length"]) / 2
        assert float(front.attrib["positionX"]) + radius <= reach + 0.02, entry.get("name")
        assert float(center.attrib["x"]) - float(size.attrib["length"]) / 2 <= 0.02 - radius, entry.get("name")
        assert float(center.attrib["z"]) == pytest.approx(float(size.attrib["height"]) / 2, abs=1e-3)
        known = {prop.get("name") for prop in entry.findall(".//Property")}
        assert known - {SHAPE_PROPERTY, COLOR_PROPERTY} <= set(PROPERTIES)


def test_documented_properties_of_a_vehicle_are_complete() -> None:
    section = vehicle_section()
    documented = set(re.findall(r"`([a-z_.]+)`", section.split(BODIES_OF_CATEGORIES)[0]))
    assert documented == {*PROPERTIES, SHAPE_PROPERTY, COLOR_PROPERTY, *SHAPES}
    rows = [line.split("|")[1].strip().strip("`") for line in section.splitlines() if line.startswith("| `")]
    assert sorted(rows) == sorted(PROPERTIES)


def test_documented_bodies_of_categories_are_those_of_vehicles() -> None:
    text = " ".join(vehicle_section().split(BODIES_OF_CATEGORIES)[1].split(". Other properties")[0].split())
    clauses = re.findall(r"((?:`\w+`(?:, | and )?)+) (?:have )?that of a (\w+)", text)
    documented = {name: body for names, body in clauses for name in re.findall(r"`(\w+)`", names)}
    of_their_own = {name: name for name in ("bicycle", "bus", "car", "motorbike", "truck", "van")}
    bodies = {category.value: actor_spec("A", vehicle("x", category.value)).shape for category in model.VehicleCategory}
    assert documented | of_their_own == bodies


def vehicle_section() -> str:
    page = (CATALOGS.parents[1] / "docs" / "scenario_files.md").read_text(encoding="utf-8")
    return page.split("\n## Dynamics and appearance: properties of a vehicle\n")[1].split("\n## ")[0]
