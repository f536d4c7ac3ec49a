"""Digests of images before they are drawn: a change of any input changes the digest, or the image stays the same."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import msgspec
import numpy as np
import pytest
from eidrive_reports.street_view import look_at

from eidrive_scenario.base.content_digest import content_digest
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.rendering.lamps import Beam
from eidrive_scenario.rendering.model import MeshInstance, Model, gridded, model
from eidrive_scenario.rendering.renderer import ImageContent, Subjects
from eidrive_scenario.rendering.surfaces import RoadPlane
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle, Placement
from eidrive_scenario.world.appearance import AnimationState, Appearance, LightState, Visibility
from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.road_objects import Building
from eidrive_scenario.world.weather import Weather

AXLES = (ExtraAxle(-1.2, 1.6, 0.3),)
CAR = ActorSpec("Car", "truck", "truck", (5.0, 2.0, 2.0), (1.3, 0.0, 1.0), wheelbase=2.7, extra_axles=AXLES)
WALKER = ActorSpec("Walker", "pedestrian", "pedestrian", (0.6, 0.6, 1.8), (0.0, 0.0, 0.9))
LAMP = LightState("lowBeam", "flashing", since=-1.2, fade=0.5)
MOTION = AnimationState("motion", "walking")


@dataclass(frozen=True)
class Street:
    """Inputs of an image: a truck with lamps, a pedestrian and a building in front of a camera."""

    spec: ActorSpec = CAR
    place: Placement = Placement(8.0, 0.5, 0.0, 2.8, 0.01, 0.01, 1.0)  # noqa: RUF009
    light: LightState = LAMP
    motion: AnimationState = MOTION
    visibility: Visibility = Visibility()  # noqa: RUF009 - it is immutable
    weather: Weather = Weather(sun_elevation=0.9, street_lighting=20.0, wetness=0.3)  # noqa: RUF009
    building: Building = Building("House", (25.0, 8.0, 3.0), (8.0, 6.0, 6.0), 0.3)  # noqa: RUF009
    pinhole: Pinhole = Pinhole.of_fov(96, 64, 1.4)  # noqa: RUF009
    eye: tuple[float, float, float] = (0.0, 0.0, 1.5)
    ignore: tuple[str, ...] = ()


ALTERED: Mapping[str, Mapping[str, Any]] = {
    "spec": {
        "name": "Other",
        "shape": "bus",
        "category": "bus",
        "size": (5.0, 2.0, 2.5),
        "offset": (1.3, 0.2, 1.0),
        "wheelbase": 2.5,
        "max_steering": 0.5,
        "wheel_radius": 0.4,
        "extra_axles": (replace(AXLES[0], x=-0.8),),
        "mass": 900.0,
        "max_speed": 40.0,
        "max_acceleration": 3.0,
        "max_deceleration": 6.0,
        "properties": {"a": "b"},
        "color": (0.9, 0.1, 0.1),
    },
    "place": {
        "x": 8.3,
        "y": 0.7,
        "z": 0.1,
        "yaw": 2.6,
        "pitch": 0.05,
        "roll": 0.1,
        "speed": 3.0,
        "teleport": True,
        "across": False,
    },
    "light": {
        "light": "highBeam",
        "mode": "off",
        "intensity": 5.0,
        "color": (0.0, 0.0, 1.0),
        "since": -0.8,
        "fade": 0.0,
        "on_for": 0.15,
        "off_for": 0.15,
    },
    "motion": {
        "kind": "gesture",
        "what": "squatting",
        "state": 0.4,
        "since": 0.1,
        "duration": 2.0,
        "loop": True,
        "gestures": ("umbrella",),
    },
    "visibility": {"graphics": False, "traffic": False, "sensors": False, "named": {"front": False}},
    "weather": {
        "name": "other",
        "description": "other",
        "sun_azimuth": 200.0,
        "sun_elevation": 40.0,
        "sun_illuminance": 5000.0,
        "sun_share": 0.0,
        "cloud_cover": 0.9,
        "visual_range": 60.0,
        "precipitation": "rain",
        "precipitation_intensity": 10.0,
        "wetness": 0.9,
        "friction": 0.4,
        "wind_direction": 90.0,
        "wind_speed": 5.0,
        "street_lighting": 60.0,
        "headlights": "off",
    },
    "building": {
        "name": "Shop",
        "center": (25.0, 7.0, 3.0),
        "size": (8.0, 6.0, 8.0),
        "yaw": 0.5,
        "color": (0.1, 0.8, 0.1),
    },
    "pinhole": {
        "width": 100,
        "height": 30,
        "focal": 40.0,
        "center_x": 20.0,
        "center_y": 10.0,
        "near": 9.0,
        "far": 15.0,
    },
}
"""Another value for each field of each input."""
UNSEEN = {
    "spec": {"category", "max_steering", "mass", "max_speed", "max_acceleration", "max_deceleration", "properties"},
    "place": {"speed", "teleport", "across"},
    "light": {"intensity", "fade"},
    "motion": {"state", "since", "duration", "loop", "gestures", "kind"},
    "visibility": {"traffic", "sensors", "named"},
    "weather": {"name", "description", "friction", "wind_direction", "wind_speed"},
    "building": set(),
    "pinhole": set(),
}
"""Fields that no image shows."""


def field_names(value: Any) -> set[str]:
    if isinstance(value, Weather):
        return set(Weather.model_fields)
    if isinstance(value, msgspec.Struct):
        return set(value.__struct_fields__)
    return {each.name for each in fields(value)} if is_dataclass(value) else set(value._fields)


def with_field(value: Any, name: str, other: Any) -> Any:
    if isinstance(value, Weather):
        changed = {"precipitation": "rain", name: other} if name == "precipitation_intensity" else {name: other}
        return Weather(
            **{**value.model_dump(), **changed, **({"precipitation_intensity": 5.0} if other == "rain" else {})}
        )
    if isinstance(value, msgspec.Struct):
        return msgspec.structs.replace(value, **{name: other})
    if hasattr(value, "_replace"):
        return value._replace(**{name: other})
    return replace(value, **{name: other})


def image_of(street: Street) -> tuple[bytes, bytes]:
    """Return the digest and the pixels, depths and labels of an image."""
    with World(picture_maker=picture_maker) as world:
        house = street.building
        world.add_building(house.name, house.center, house.size, house.yaw, house.color)
        world.add(street.spec, street.place)
        world.add(WALKER, Placement(6.0, -1.5))
        world.set_weather(street.weather)
        truck = Appearance({street.light.light: street.light}, visibility=street.visibility)
        world.set_display_state(
            {}, {street.spec.name: truck, "Walker": Appearance(animations={street.motion.kind: street.motion})}
        )
        image = world.image(look_at(street.eye, (20.0, 0.0, 1.0)), street.pinhole, ignore=street.ignore)
        digest, seen = image.digest, image.draw()
    return digest, b"".join(part.tobytes() for part in seen)


CASES = [(part, name) for part, values in ALTERED.items() for name in values]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("part", "name"), CASES)
def test_every_visible_change_of_an_input_changes_the_digest(part: str, name: str) -> None:
    usual = Street()
    street = replace(usual, **{part: with_field(getattr(usual, part), name, ALTERED[part][name])})
    (digest, pixels), (before, unchanged) = image_of(street), image_of(usual)
    assert digest != before or pixels == unchanged
    if name not in UNSEEN[part]:
        assert pixels != unchanged, "the changed field is visible, so the test is not empty"


def test_all_fields_of_all_inputs_are_altered() -> None:
    usual = Street()
    for part, values in ALTERED.items():
        assert field_names(getattr(usual, part)) == set(values), part


def test_pose_of_camera_and_hidden_actors_change_the_digest() -> None:
    others = [Street(), Street(eye=(0.0, 0.0, 1.6)), Street(ignore=("Car",)), Street(ignore=("Walker",))]
    digests = {image_of(street)[0] for street in others}
    assert len(digests) == len(others)


def test_equal_worlds_have_equal_digests_and_images() -> None:
    assert image_of(Street()) == image_of(Street())


def test_images_show_the_time_of_their_request() -> None:
    with World(dt=0.5, picture_maker=picture_maker) as world:
        world.add(CAR, Placement(8.0, 0.5))
        pose = look_at((0.0, 0.0, 1.5), (20.0, 0.0, 1.0))
        early, at_once = world.image(pose, Street.pinhole), world.radiance(pose, Street.pinhole)
        digest = early.digest
        world.step({"Car": Placement(12.0, -1.0)}, {})
        late = world.image(pose, Street.pinhole)
        assert late.draw().depth.tobytes() != at_once.depth.tobytes()
        assert early.draw().luminance.tobytes() == at_once.luminance.tobytes()
        assert early.digest == digest != late.digest


def test_lamps_that_flash_change_the_digest_with_time() -> None:
    with World(dt=0.25, picture_maker=picture_maker) as world:
        world.add(CAR, Placement(8.0, 0.5, yaw=math.pi))
        world.set_display_state({}, {"Car": Appearance({"warningLights": LightState("warningLights", "flashing")})})
        digests = []
        for _ in range(4):
            digests.append(world.image(look_at((0.0, 0.0, 1.5), (20.0, 0.0, 1.0)), Street.pinhole).digest)
            world.step({}, {})
    assert digests[0] == digests[1] != digests[2] == digests[3]


def small_model() -> Model:
    return gridded(
        model(
            {"paint": np.random.default_rng(1).random((6, 3, 3)), "asphalt": np.ones((2, 3, 3))},
            {"paint": (0.5, 0.2, 0.1)},
        )
    )


def small_content() -> ImageContent:
    instance = MeshInstance(small_model(), np.eye(3), np.zeros(3), 1, {"paint": (1.0, 2.0, 3.0)})
    beam = Beam(np.zeros(3), np.eye(3), 0.5, False)
    subjects = Subjects([instance], [instance], [instance], [instance], [instance])
    road = RoadPlane(0.5, np.eye(3)[2])
    return ImageContent(subjects, [beam], Weather(), np.eye(4), Street.pinhole, road, (0.25, 0.75))


def variants(value: Any) -> list[Any]:
    """Return values that differ from this one in a single number, text, element or field."""
    if isinstance(value, (np.ndarray, np.generic)):
        flat = np.array(value).reshape(-1)
        found = [flat.copy() for _ in range(min(len(flat), 3))]
        for place, one in zip((0, len(flat) // 2, len(flat) - 1), found, strict=False):
            one[place] += 1
        return [one.reshape(np.shape(value)) for one in found]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, (int, float)):
        return [value + 1]
    if isinstance(value, str):
        return [value + "x"]
    if isinstance(value, Mapping):
        return [{**value, "x": (1.0, 1.0, 1.0)}, *({key: one} for key, held in value.items() for one in variants(held))]
    if isinstance(value, Weather):
        return [with_field(value, name, other) for name, other in ALTERED["weather"].items()]
    if is_dataclass(value) or hasattr(value, "_fields"):
        return [with_field(value, name, one) for name in field_names(value) for one in variants(getattr(value, name))]
    held = list(value)
    assert held, "an empty sequence has no variants"
    changed = [(*held[:row], one, *held[row + 1 :]) for row, each in enumerate(held) for one in variants(each)]
    return [held[:-1], *changed]


@pytest.mark.parametrize("part", ImageContent._fields)
def test_each_element_of_the_content_counts_in_the_digest(part: str) -> None:
    content = small_content()
    others = [content._replace(**{part: one}) for one in variants(getattr(content, part))]
    digests = [content_digest(one) for one in others]
    assert content_digest(content) not in digests
    assert len(set(digests)) == len(digests)


def test_equal_models_of_other_runs_have_the_same_digest() -> None:
    assert content_digest(small_content()) == content_digest(small_content())
