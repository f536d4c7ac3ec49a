"""Specification of an actor from an entity of the scenario."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

from eidrive_scenario.errors import Diagnostic, ScenarioError, suggestion
from eidrive_scenario.openscenario.conventions import property_entries
from eidrive_scenario.openscenario.model import MiscObject, Pedestrian, Property, Vehicle
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle, Vector3

SHAPE_PROPERTY = "eidrive.shape"
COLOR_PROPERTY = "eidrive.color"

_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("firetruck", ("firetruck", "fire_truck", "fireengine", "fire_engine", "firebrigade")),
    ("ambulance", ("ambulance",)),
    ("bus", ("bus", "fusorosa", "coach")),
    ("van", ("van", "sprinter", "transporter")),
)
"""Shapes by words in the name of a vehicle, the first one that it contains."""
_MORE_PRECISE = {
    "car": ("van", "ambulance"),
    "van": ("ambulance",),
    "truck": ("firetruck", "ambulance", "van"),
}
"""Shapes that the name may select instead of that of the category."""
SHAPE_BY_CATEGORY = {
    "aircraft": "bus",
    "bicycle": "bicycle",
    "bus": "bus",
    "car": "car",
    "heavyTruck": "truck",
    "landVehicle": "car",
    "micromobilityDevice": "bicycle",
    "motorbike": "motorbike",
    "motorcycle": "motorbike",
    "other": "car",
    "semitractor": "truck",
    "semitrailer": "truck",
    "standupScooter": "bicycle",
    "trailer": "truck",
    "train": "bus",
    "tram": "bus",
    "truck": "truck",
    "van": "van",
    "watercraft": "bus",
    "wheelchair": "bicycle",
    "workMachine": "truck",
}
"""Shape by vehicle category: the name of the most similar category among those with a shape."""
_SHAPES: dict[str, tuple[str, float, Vector3]] = {
    "car": ("car", 1500.0, (4.5, 1.8, 1.5)),
    "firetruck": ("truck", 14000.0, (8.5, 2.5, 3.3)),
    "ambulance": ("van", 3000.0, (6.0, 2.1, 2.6)),
    "bus": ("bus", 12000.0, (12.0, 2.55, 3.1)),
    "van": ("van", 2200.0, (5.9, 2.0, 2.6)),
    "truck": ("truck", 9000.0, (8.0, 2.5, 3.5)),
    "motorbike": ("motorbike", 280.0, (2.2, 0.8, 1.6)),
    "bicycle": ("bicycle", 90.0, (1.8, 0.6, 1.7)),
    "pedestrian": ("pedestrian", 80.0, (0.5, 0.5, 1.75)),
    "rsu": ("misc", 80.0, (0.5, 0.5, 5.0)),
    "box": ("misc", 80.0, (0.5, 0.5, 0.5)),
}
"""Category, and default mass [kg] and size [m], by shape."""
SHAPES = tuple(_SHAPES)


def actor_spec(name: str, entity: Vehicle | Pedestrian | MiscObject) -> ActorSpec:
    """Return the specification of the actor `name` by its Vehicle, Pedestrian or MiscObject.

    The shape is the Property `eidrive.shape`, or else follows from the category, the name and the 3D model. The paint
    is the Property `eidrive.color` (`#rrggbb`). Some catalogs omit the box by dimensions of 0; these are replaced by
    defaults of the shape. Raise ScenarioError with the line of an invalid Property or dimension.
    """
    properties = {entry.name: entry for entry in property_entries(entity)}
    shape = _shape(entity, properties.get(SHAPE_PROPERTY))
    category, usual_mass, usual_size = _SHAPES[shape]
    dimensions, center = entity.bounding_box.dimensions, entity.bounding_box.center
    given = (dimensions.length, dimensions.width, dimensions.height)
    if min(given) < 0.0:
        message = f"the bounding box of {name!r} is {given[0]:g} x {given[1]:g} x {given[2]:g} m"
        raise ScenarioError(Diagnostic.at(dimensions, message, "give length, width and height above 0"))
    length, width, height = (own or usual for own, usual in zip(given, usual_size, strict=True))
    lift = 0.0 if dimensions.height else height / 2
    common = ActorSpec(
        name=name,
        shape=shape,
        category=category,
        size=(length, width, height),
        offset=(center.x, center.y, center.z + lift),
        mass=entity.mass or usual_mass,
        properties={name: entry.value for name, entry in properties.items()},
        color=_color(properties.get(COLOR_PROPERTY)),
    )
    return _with_axles(common, entity) if isinstance(entity, Vehicle) else common


def _with_axles(spec: ActorSpec, vehicle: Vehicle) -> ActorSpec:
    axles, performance = vehicle.axles, vehicle.performance
    front = axles.front_axle
    wheelbase = front.position_x - axles.rear_axle.position_x if front is not None else 0.0
    # A trailer without a front axle has its rear axle among the additional ones, relative to its reference point.
    origin = axles.rear_axle.position_x if front is not None else 0.0
    others = axles.additional_axle if front is not None else (axles.rear_axle, *axles.additional_axle)
    return replace(
        spec,
        wheelbase=wheelbase,
        max_steering=abs(front.max_steering) if front is not None else 0.0,
        wheel_radius=axles.rear_axle.wheel_diameter / 2,
        extra_axles=tuple(
            ExtraAxle(axle.position_x - origin, axle.track_width, axle.wheel_diameter / 2, abs(axle.max_steering))
            for axle in others
        ),
        max_speed=performance.max_speed,
        max_acceleration=performance.max_acceleration,
        max_deceleration=performance.max_deceleration,
    )


def _shape(entity: Vehicle | Pedestrian | MiscObject, wanted: Property | None) -> str:
    if wanted is not None:
        if wanted.value not in SHAPES:
            hint = suggestion(wanted.value, SHAPES)
            raise ScenarioError(Diagnostic.at(wanted, f"unknown shape {wanted.value!r}", hint))
        return wanted.value
    if isinstance(entity, Pedestrian):
        return "pedestrian"
    words = _words(entity)
    if isinstance(entity, MiscObject):
        return "rsu" if "rsu" in words else "box"
    by_category = SHAPE_BY_CATEGORY[entity.vehicle_category.value]
    named = next((shape for shape, names in _WORDS if not words.isdisjoint(names)), by_category)
    return named if named in _MORE_PRECISE.get(by_category, ()) else by_category


def _words(entity: Vehicle | MiscObject) -> set[str]:
    """Return the words in the name and 3D model of the entity, single and as consecutive pairs."""
    words: set[str] = set()
    for text in (entity.name, (entity.model3d or "").rsplit("/", 1)[-1]):
        parts = [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", text)]
        words.update(parts)
        words.update(f"{first}_{second}" for first, second in pairwise(parts))
    return words


def _color(wanted: Property | None) -> Vector3 | None:
    if wanted is None:
        return None
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", wanted.value):
        raise ScenarioError(Diagnostic.at(wanted, f"color {wanted.value!r} is invalid", "write it as #rrggbb"))
    red, green, blue = (int(wanted.value[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue
