"""Tests of traffic lights, signs and lamps in images: luminance, labels and visibility."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from camera_image import camera_image
from opendrive_xml import lanes_xml, map_xml, road_xml
from sample_car import CarFactory

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.rendering.meshes import actor_mesh
from eidrive_scenario.rendering.meshes.signs import (
    NO_ENTRY,
    OTHER,
    PRIORITY,
    STOP,
    WARNING,
    YIELD,
    SignFace,
    sign,
    sign_face,
)
from eidrive_scenario.roads import RoadNetwork, Signal, SignalPlace
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import AnimationState, Appearance, LightState, Visibility
from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.weather import Weather

SIGNALS = """<signals><signal id="L" name="" s="30" t="-5" zOffset="2" height="0.9" width="0.4" type="1000001"
  subtype="-1" dynamic="yes" orientation="+"/><signal id="P" name="" s="30" t="-7" zOffset="2" height="0.6" width="0.4"
  type="1000002" subtype="-1" dynamic="yes" orientation="+"/><signal id="S" name="" s="30" t="1" zOffset="2"
  height="0.8" width="0.8" type="206" country="DE" subtype="-1" dynamic="no" orientation="+"/></signals>"""
STREET = map_xml(road_xml(length=200.0, lanes=lanes_xml(0, 1, 4), extra=SIGNALS))


def looking(x: float, y: float, z: float, yaw: float = 0.0) -> np.ndarray:
    """Return the pose of a level camera."""
    pose = np.eye(4)
    pose[:3, 0] = (math.sin(yaw), -math.cos(yaw), 0.0)
    pose[:3, 1] = (0.0, 0.0, -1.0)
    pose[:3, 2] = (math.cos(yaw), math.sin(yaw), 0.0)
    pose[:3, 3] = (x, y, z)
    return pose


def picture(world: World, *pose: float) -> Any:
    return camera_image(world, looking(*pose), 400, 300, math.radians(40))


@pytest.fixture
def street() -> Any:
    with World(RoadNetwork.parse(STREET), picture_maker=picture_maker) as world:
        yield world


# Signals


def lit_lamps(world: World, state: str, signal: str = "L", time: float = 0.0) -> list[str]:
    """Return the colors of the lit thirds (or halves) of a signal head from the top."""
    while world.time < time - 1e-9:
        world.step({}, {})
    world.set_display_state({signal: state}, {})
    label = next(label for label, name in world.signal_labels.items() if name == signal)
    shot = picture(world, 22.0, -5.0 if signal == "L" else -7.0, 2.45)
    rows, columns = np.nonzero(shot.segmentation == label)
    count = 3 if signal == "L" else 2
    found = []
    for part in np.array_split(np.arange(rows.min(), rows.max() + 1), count):
        inside = np.isin(rows, part)
        colors = shot.rgb[rows[inside], columns[inside]].astype(float)
        red, green, blue = colors[colors.max(axis=1).argsort()[-12:]].mean(axis=0)
        bright = max(red, green, blue) > 150
        found.append("" if not bright else "yellow" if min(red, green) > 110 else "red" if red > green else "green")
    return found


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ("red", ["red", "", ""]),
        ("off;on;off", ["", "yellow", ""]),
        ("GREEN", ["", "", "green"]),
        ("redYellow", ["red", "yellow", ""]),
        ("off", ["", "", ""]),
        ("some state", ["", "", ""]),
    ],
)
def test_lamps_are_lit_by_signal_state(street: World, state: str, expected: list[str]) -> None:
    assert lit_lamps(street, state) == expected


def test_pedestrian_light_has_two_lamps_that_are_dark_without_state(street: World) -> None:
    assert lit_lamps(street, "off;on", "P") == ["", "green"]
    assert lit_lamps(street, "red", "P") == ["red", ""]
    street.set_display_state({}, {})
    assert lit_lamps(street, "off") == ["", "", ""]


def test_flashing_lamp_is_dark_half_of_each_second(street: World) -> None:
    assert [lit_lamps(street, "flashing", time=time)[1] for time in (0.0, 0.25, 0.6, 1.1)] == [
        *("yellow", "yellow", "", "yellow")
    ]


def test_segmentation_separates_signals(street: World) -> None:
    assert set(street.signal_labels.values()) == {"L", "P", "S"}
    assert max(street.signal_labels) == -10
    shot = picture(street, 15.0, -3.0, 2.4)
    assert set(np.unique(shot.segmentation)) == {-1, *street.signal_labels}


def test_back_of_a_sign_is_gray(street: World) -> None:
    label = next(label for label, name in street.signal_labels.items() if name == "S")

    def redness(shot: Any) -> float:
        colors = shot.rgb[shot.segmentation == label].astype(float)
        return float((colors[:, 0] - colors[:, 1]).mean())

    assert redness(picture(street, 25.0, 1.0, 2.4)) > 40.0
    assert abs(redness(picture(street, 35.0, 1.0, 2.4, math.pi))) < 10.0


# Faces of signs


def signal(
    kind: str, *, country: str = "DE", subtype: str = "-1", value: float | None = None, name: str = ""
) -> Signal:
    place = SignalPlace("1", 0.0, 0.0, "+")
    return Signal("x", name, kind, subtype, country, value, "", "", False, place, 2.0, 0.0, 0.6, 0.6)


@pytest.mark.parametrize(
    ("given", "face"),
    [
        (signal("206"), STOP),
        (signal("205", country="OpenDRIVE"), YIELD),
        (signal("306"), PRIORITY),
        (signal("267"), NO_ENTRY),
        (signal("101"), WARNING),
        (signal("R1-1", country="US"), STOP),
        (signal("b", country="se", subtype="2"), STOP),
        (signal("unheard of", name="Sign_Stop"), STOP),
        (signal("99999"), OTHER),
        (signal("274", value=50.0), SignFace("disc", "white", "red", "50")),
        (signal("274", name="Sg274-120.flt"), SignFace("disc", "white", "red", "120")),
        (signal("c", country="se", subtype="31", value=5.0, name="speed_50_1"), SignFace("disc", "white", "red", "50")),
        (signal("R2-1", country="US", value=35.0), SignFace("board", "white", "black", "35")),
    ],
)
def test_sign_face_by_country_and_number(given: Signal, face: SignFace) -> None:
    assert sign_face(given) == face


@pytest.mark.parametrize("face", [STOP, YIELD, PRIORITY, NO_ENTRY, WARNING, OTHER])
def test_sign_mesh_has_its_size_and_faces_the_traffic(face: SignFace) -> None:
    parts = np.concatenate(list(sign(face, 0.6, 0.9).values()))
    assert parts[..., 1].min() >= -0.301
    assert parts[..., 1].max() <= 0.301
    assert parts[..., 2].min() >= -1e-3
    assert parts[..., 2].max() <= 0.901
    normals = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
    behind = parts[..., 0].mean(axis=1) < -1e-3
    assert (normals[~behind, 0] > 0.0).all()
    assert (normals[behind, 0] < 0.0).all()


# Lamps of vehicles


def tail(world: World) -> np.ndarray:
    """Return the mean colors of the brightest area in the left and the right half of the rear of the car."""
    shot = picture(world, 0.0, 0.0, 1.0)
    rows, columns = np.nonzero(shot.segmentation == 0)
    halves = []
    middle = (columns.min() + columns.max()) / 2
    for side in (columns < middle, columns > middle):
        colors = shot.rgb[rows[side], columns[side]].astype(float)
        strength = colors[:, 0] - colors[:, 2]
        halves.append(colors[strength.argsort()[-15:]].mean(axis=0))
    return np.array(halves)


def lights(*states: LightState) -> dict[str, Appearance]:
    return {"Ego": Appearance(lights={state.light: state for state in states})}


@pytest.fixture
def gray(car: CarFactory) -> ActorSpec:
    return replace(car("Ego"), color=(0.4, 0.4, 0.4))


def test_brake_lights_brighten_both_sides(world: World, gray: ActorSpec) -> None:
    world.add(gray, Placement(8.0, 0.0))
    dark = tail(world)
    world.set_display_state({}, lights(LightState("brakeLights", "on")))
    assert (tail(world)[:, 0] > dark[:, 0] + 25.0).all()
    world.set_display_state({}, lights(LightState("brakeLights", "off")))
    assert tail(world) == pytest.approx(dark, abs=3.0)


def test_indicator_flashes_on_its_side(world: World, gray: ActorSpec) -> None:
    world.add(gray, Placement(8.0, 0.0))
    dark = tail(world)[:, 1]
    world.set_display_state({}, lights(LightState("indicatorLeft", "flashing")))
    left, right = tail(world)[:, 1]
    assert left > dark[0] + 30.0
    assert right == pytest.approx(dark[1], abs=3.0)
    while world.time < 0.6:
        world.step({}, {})
    assert tail(world)[0, 1] == pytest.approx(dark[0], abs=3.0)


def test_low_beam_is_on_at_night_automatically_or_by_the_scenario(world: World, gray: ActorSpec) -> None:
    world.add(gray, Placement(0.0, 0.0))
    world.set_weather(Weather(sun_elevation=-30.0, street_lighting=1.0))

    def road() -> float:
        return float(world.radiance(looking(-2.0, 3.0, 3.0), _pinhole()).luminance[200:].mean())

    by_itself = road()
    world.set_display_state({}, lights(LightState("lowBeam", "off")))
    switched_off = road()
    world.set_display_state({}, lights(LightState("lowBeam", "off"), LightState("highBeam", "on")))
    assert switched_off < 0.8 * by_itself
    assert road() > 1.05 * switched_off


def _pinhole() -> Pinhole:
    return Pinhole.of_fov(400, 300, math.radians(60))


# Visibility


def test_actor_without_graphics_is_not_drawn(world: World, gray: ActorSpec) -> None:
    world.add(gray, Placement(8.0, 0.0))
    assert (picture(world, 0.0, 0.0, 1.0).segmentation == 0).any()
    world.set_display_state({}, {"Ego": Appearance(visibility=Visibility(graphics=False))})
    assert not (picture(world, 0.0, 0.0, 1.0).segmentation == 0).any()
    assert world.raycast((0.0, 0.0, 0.5), [(20.0, 0.0, 0.5)]).rows[0] == 0


# Postures


@pytest.mark.parametrize(
    ("motion", "tall"),
    [("", 1.8), ("standing", 1.8), ("lying", 0.3), ("sitting", 1.4), ("crawling", 0.75), ("unknown", 1.8)],
)
def test_pedestrian_height_depends_on_posture(motion: str, tall: float) -> None:
    spec = ActorSpec("Anna", "pedestrian", "pedestrian", (0.6, 0.5, 1.8), (0.0, 0.0, 0.9))
    points = np.concatenate(list(actor_mesh(spec, motion).values())).reshape(-1, 3)
    assert points[:, 2].max() - points[:, 2].min() == pytest.approx(tall, abs=0.15)
    assert points[:, 2].min() == pytest.approx(0.0, abs=0.02)


def test_posture_is_visible_in_image(world: World) -> None:
    spec = ActorSpec("Anna", "pedestrian", "pedestrian", (0.6, 0.5, 1.8), (0.0, 0.0, 0.9))
    world.add(spec, Placement(8.0, 0.0, yaw=math.pi / 2))

    def extent() -> tuple[int, int]:
        rows, columns = np.nonzero(picture(world, 0.0, 0.0, 1.0).segmentation == 0)
        return int(np.ptp(columns)), int(np.ptp(rows))

    wide, tall = extent()
    assert tall > 2 * wide
    world.set_display_state({}, {"Anna": Appearance(animations={"motion": AnimationState("motion", "lying")})})
    wide, tall = extent()
    assert wide > 2 * tall
