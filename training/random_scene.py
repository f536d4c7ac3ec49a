"""Random traffic, cameras and weather at a place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import overlap, rotation_matrix
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.sensor import mounting
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import AnimationState, Appearance, LightState
from eidrive_scenario.world.road_objects import SignalHead
from eidrive_scenario.world.weather import Weather
from training.random_roads import LanePositions

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Camera axes (x right, y down, z forward) as columns in a frame of x forward, y left, z up."""

_CATEGORY = {"firetruck": "truck", "ambulance": "van", "rsu": "misc", "box": "misc"}
_SIZES: Mapping[str, tuple[tuple[float, float, float], ...]] = {
    "car": ((4.89, 1.84, 1.49), (4.6, 1.93, 1.85), (4.19, 1.82, 1.47), (4.79, 2.0, 1.49), (3.9, 1.7, 1.5)),
    "van": ((5.93, 2.02, 2.62), (5.0, 1.95, 2.1)),
    "ambulance": ((6.37, 2.35, 2.43),),
    "truck": ((8.3, 2.5, 3.55), (6.5, 2.3, 2.9), (10.0, 2.55, 3.9)),
    "firetruck": ((8.47, 2.89, 3.83), (7.5, 2.5, 3.2)),
    "bus": ((10.27, 3.94, 4.25), (12.0, 2.55, 3.1), (9.0, 2.5, 3.0)),
    "motorbike": ((2.2, 0.8, 1.6),),
    "bicycle": ((1.8, 0.65, 1.75),),
    "pedestrian": ((0.5, 0.5, 1.75), (0.4, 0.4, 1.86), (0.45, 0.45, 1.25)),
    "rsu": ((0.5, 0.5, 4.0),),
    "box": ((0.5, 0.5, 0.5), (1.0, 0.8, 1.0)),
}
_WHEELED = ("car", "van", "ambulance", "truck", "firetruck", "bus", "motorbike", "bicycle")
_ON_LANES: Mapping[str, Mapping[str, float]] = {
    "driving": {
        "car": 0.45, "van": 0.07, "ambulance": 0.04, "truck": 0.09, "firetruck": 0.05, "bus": 0.09, "motorbike": 0.08,
        "bicycle": 0.07, "pedestrian": 0.05, "box": 0.01,
    },
    "parking": {
        "car": 0.6, "van": 0.12, "ambulance": 0.04, "truck": 0.1, "firetruck": 0.06, "bus": 0.03, "motorbike": 0.05,
    },
    "shoulder": {"car": 0.2, "bicycle": 0.35, "motorbike": 0.1, "pedestrian": 0.3, "box": 0.05},
    "sidewalk": {"pedestrian": 0.78, "bicycle": 0.12, "rsu": 0.05, "box": 0.05},
}  # fmt: skip
_LIGHTS: Mapping[str, float] = {
    "brakeLights": 0.25, "indicatorLeft": 0.08, "indicatorRight": 0.08, "daytimeRunningLights": 0.15, "lowBeam": 0.08,
    "highBeam": 0.02, "fogLightsRear": 0.04, "reversingLights": 0.03, "warningLights": 0.03,
}  # fmt: skip
"""Probability that a vehicle has a light switched on."""
_MOTIONS = ("walking", "walking", "standing", "running", "reeling")
_IMAGE_SIZES = ((640, 480), (800, 600), (640, 384), (960, 540))


@dataclass(frozen=True)
class View:
    """Camera at a place: settings, pose (4, 4) camera to world, and the body that carries it, None for a roadside
    camera."""

    settings: CameraSettings
    pose: Array
    carrier: tuple[ActorSpec, Placement] | None


def random_view(rng: np.random.Generator, positions: LanePositions, heads: Sequence[SignalHead] = ()) -> View:
    """Return a camera on a vehicle, or at the roadside up to 8 m high; a third of the vehicles are before a signal."""
    width, height = _IMAGE_SIZES[int(rng.choice(4, p=[0.5, 0.2, 0.15, 0.15]))]
    fov = 100.0 if rng.random() < 0.4 else float(rng.uniform(55.0, 115.0))
    corner = math.tan(math.radians(fov) / 2) * math.hypot(1.0, height / width)
    bend = float(rng.uniform(-0.11, 0.04)) / corner**2 if rng.random() < 0.15 else 0.0
    settings = CameraSettings(width=width, height=height, fov=fov, distortion=(bend, 0.0, 0.0, 0.0, 0.0))
    if rng.random() < 0.35:
        return View(settings, _roadside(rng, positions), None)
    rows = np.flatnonzero(positions.kinds == "driving")
    before = rows_before(positions, heads[int(rng.integers(len(heads)))]) if heads else rows[:0]
    to_signal = len(before) > 0 and rng.random() < 0.6
    row = int(rng.choice(before if to_signal else rows))
    x, y, z, heading = positions.poses[row].tolist()
    heading += float(rng.normal(0.0, 0.08))
    spec = random_actor(rng, "Carrier", "car")
    on_roof = rng.random() < 0.25
    turned = not to_signal and rng.random() < 0.3
    lateral = float(rng.choice([math.radians(100.0), -math.radians(100.0), math.pi])) if turned else 0.0
    if on_roof or lateral:
        mount = (
            -0.5 + float(rng.uniform(-1.2, 0.8)),
            float(rng.uniform(-0.3, 0.3)),
            spec.size[2] + float(rng.uniform(0.2, 0.5)),
        )
    else:
        mount = (spec.size[0] / 2 + 0.06, float(rng.uniform(-0.3, 0.3)), float(rng.uniform(0.7, 1.5)))
    cos, sin = math.cos(heading), math.sin(heading)
    position = (x + cos * mount[0] - sin * mount[1], y + sin * mount[0] + cos * mount[1], z + mount[2])
    pose = _camera_pose(position, heading + lateral, float(rng.normal(0.0, 0.02)), float(rng.normal(0.0, 0.01)))
    return View(settings, pose, (spec, centered_placement(spec, x, y, z, heading)))


def centered_placement(spec: ActorSpec, x: float, y: float, z: float, heading: float) -> Placement:
    """Return the placement of a body whose center is above a point; its reference point is at the rear axle."""
    ahead, _, _ = spec.offset
    return Placement(x - math.cos(heading) * ahead, y - math.sin(heading) * ahead, z, heading)


def replace_actors(world: World, actors: Iterable[tuple[ActorSpec, Placement]]) -> None:
    """Replace all actors of a world."""
    for name in world.names:
        world.remove(name)
    for spec, placement in actors:
        world.add(spec, placement)


def view_of_carrier(world: World, settings: CameraSettings, carrier: tuple[ActorSpec, Placement]) -> View:
    """Put a body alone into the world, and return the view of a camera at its front."""
    replace_actors(world, [carrier])
    return View(settings, mounting(settings, carrier[0], "front").camera_pose(world.view(), 0), carrier)


ASIDE = 0.7
"""Maximum lateral offset of a signal that a driver approaches, as a share of the distance."""


def rows_before(
    positions: LanePositions, head: SignalHead, *, nearest: float = 4.0, farthest: float = 30.0
) -> Integers:
    """Return the lane positions from which a driver approaches this signal, between two distances ahead [m]."""
    rows = np.flatnonzero(positions.kinds == "driving")
    x, y, heading = positions.poses[rows, 0], positions.poses[rows, 1], positions.poses[rows, 3]
    dx, dy = head.pose.x - x, head.pose.y - y
    ahead = np.cos(heading) * dx + np.sin(heading) * dy
    lateral = np.abs(np.cos(heading) * dy - np.sin(heading) * dx)
    against = np.cos(heading - head.pose.h) < -0.8
    near = (ahead > nearest) & (ahead < farthest) & (lateral < ASIDE * ahead)
    return np.asarray(rows[near & against])


def _roadside(rng: np.random.Generator, positions: LanePositions) -> Array:
    edge = np.flatnonzero(positions.kinds != "driving")
    row = int(rng.choice(edge if len(edge) else len(positions.kinds)))
    x, y, z, heading = positions.poses[row].tolist()
    height = float(rng.uniform(2.2, 8.0))
    yaw = heading + float(rng.choice([0.0, math.pi])) + float(rng.uniform(-0.9, 0.9))
    pitch = float(rng.uniform(0.0, 0.35)) if rng.random() < 0.6 else 0.0
    return _camera_pose((x, y, z + height), yaw, pitch, 0.0)


def _camera_pose(position: tuple[float, float, float], yaw: float, pitch: float, roll: float) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = rotation_matrix(yaw, pitch, roll) @ OPTICAL
    pose[:3, 3] = position
    return pose


def random_actor(rng: np.random.Generator, name: str, shape: str) -> ActorSpec:
    """Return a body of this shape with random size and color."""
    sizes = _SIZES[shape]
    length, width, height = sizes[int(rng.integers(len(sizes)))]
    scale = rng.uniform(0.93, 1.07, 3) * rng.uniform(0.95, 1.05)
    size = (length * float(scale[0]), width * float(scale[1]), height * float(scale[2]))
    wheelbase = 0.58 * size[0] if shape in _WHEELED else 0.0
    radius = {"motorbike": 0.31, "bicycle": 0.34}.get(shape, 0.33 if size[2] < 2.2 else 0.45)
    color = None
    if rng.random() < 0.6:
        tone = float(rng.uniform(0.08, 0.95))
        red, green, blue = (tone + rng.normal(0.0, 0.18, 3)).clip(0.03, 0.97).tolist()
        color = (red, green, blue)
    return ActorSpec(
        name=name,
        shape=shape,
        category=_CATEGORY.get(shape, shape),
        size=size,
        offset=(0.5 * wheelbase, 0.0, size[2] / 2),
        wheelbase=wheelbase,
        wheel_radius=radius,
        color=color,
    )


def random_traffic(rng: np.random.Generator, positions: LanePositions, view: View) -> list[tuple[ActorSpec, Placement]]:
    """Return up to 30 actors that do not touch, most of them in front of the camera."""
    axis, origin = view.pose[:3, 2], view.pose[:3, 3]
    away = positions.poses[:, :2] - origin[:2]
    distance = np.hypot(away[:, 0], away[:, 1])
    cosine = (away @ axis[:2]) / np.maximum(distance * np.hypot(axis[0], axis[1]), 1e-6)
    inside = (cosine > math.cos(math.radians(view.settings.fov) / 2)) & (distance > 3.0) & (distance < 95.0)
    weight = np.where(inside, np.exp(-distance / 30.0), 1e-4)
    weight *= np.where(positions.kinds == "driving", 1.0, 0.6)
    boxes = [] if view.carrier is None else [_box(*view.carrier)]
    actors = []
    for number in range(int(rng.integers(3, 31))):
        index = int(rng.choice(len(weight), p=weight / weight.sum()))
        kinds = _ON_LANES[str(positions.kinds[index])]
        shape = str(rng.choice(list(kinds), p=np.array(list(kinds.values())) / sum(kinds.values())))
        spec = random_actor(rng, f"{shape} {number} {int(rng.integers(1000))}", shape)
        x, y, z, heading = positions.poses[index].tolist()
        lateral = float(rng.normal(0.0, 0.12)) * float(positions.widths[index])
        x, y = x - math.sin(heading) * lateral, y + math.cos(heading) * lateral
        turned = rng.random() < (0.95 if shape == "pedestrian" else 0.12)
        heading += float(rng.uniform(-math.pi, math.pi)) if turned else float(rng.normal(0.0, 0.07))
        placement = Placement(x, y, z, heading, speed=float(rng.uniform(0.0, 12.0)))
        box = _box(spec, placement)
        too_near = np.hypot(x - origin[0], y - origin[1]) < 0.6 + max(spec.size[0], spec.size[1]) / 2
        if too_near or any(overlap(box, other) for other in boxes):
            continue
        boxes.append(box)
        actors.append((spec, placement))
    return actors


def random_signals(rng: np.random.Generator, roads: RoadNetwork) -> dict[str, str]:
    """Return a state for every traffic light."""
    states = ("red", "redYellow", "yellow", "green", "off")
    odds = [0.28, 0.06, 0.24, 0.28, 0.14]
    return {name: str(rng.choice(states, p=odds)) for name, signal in roads.signals.items() if signal.dynamic}


def random_appearances(
    rng: np.random.Generator, actors: Sequence[tuple[ActorSpec, Placement]], weather: Weather
) -> dict[str, Appearance]:
    """Return switched lights of vehicles, and motions of pedestrians."""
    appearances = {}
    for spec, _ in actors:
        if spec.shape == "pedestrian":
            motion = str(rng.choice(_MOTIONS))
            appearances[spec.name] = Appearance(animations={"motion": AnimationState("motion", motion)})
        elif spec.wheelbase > 0.0 and spec.shape != "bicycle":
            odds = dict(_LIGHTS)
            if spec.shape in ("ambulance", "firetruck"):
                odds["specialPurposeLights"] = 0.4
            switched_on = [light for light, share in odds.items() if rng.random() < share]
            lights = {light: LightState(light, "on") for light in switched_on}
            if weather.lamps_on and rng.random() < 0.08:
                lights["lowBeam"] = LightState("lowBeam", "off")
            if lights:
                appearances[spec.name] = Appearance(lights=lights)
    return appearances


def _box(spec: ActorSpec, placement: Placement) -> tuple[float, ...]:
    cos, sin = math.cos(placement.yaw), math.sin(placement.yaw)
    ahead, _, up = spec.offset
    length, width, height = spec.size
    return (
        placement.x + cos * ahead, placement.y + sin * ahead, placement.z + up,
        length + 0.3, width + 0.2, height, placement.yaw,
    )  # fmt: skip


def random_weather(rng: np.random.Generator) -> Weather:
    """Return a weather: half of them clear days; otherwise overcast, fog, rain, snow, dusk and night."""

    def uniform(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    kinds = ("clear", "overcast", "fog", "rain", "snow", "dusk", "night")
    kind = str(rng.choice(kinds, p=[0.45, 0.12, 0.14, 0.09, 0.02, 0.06, 0.12]))
    azimuth, day = uniform(0.0, 360.0), uniform(10.0, 75.0)
    weather = partial(Weather, name=kind, sun_azimuth=azimuth)
    match kind:
        case "clear":
            return weather(sun_elevation=day, cloud_cover=uniform(0.0, 0.4))
        case "overcast":
            return weather(sun_elevation=day, cloud_cover=uniform(0.7, 1.0), visual_range=8000.0)
        case "fog":
            return weather(
                sun_elevation=uniform(3.0, 45.0),
                cloud_cover=uniform(0.2, 1.0),
                visual_range=float(np.exp(uniform(math.log(40.0), math.log(500.0)))),
                wetness=0.25,
            )
        case "rain" | "snow":
            return weather(
                sun_elevation=day,
                cloud_cover=1.0,
                visual_range=uniform(1500.0, 6000.0),
                precipitation=kind,
                precipitation_intensity=uniform(2.0, 50.0 if kind == "rain" else 4.0),
                wetness=uniform(0.3, 0.9),
                wind_direction=azimuth,
                wind_speed=uniform(0.0, 12.0),
            )
        case "dusk":
            return weather(sun_elevation=uniform(-6.0, 8.0), street_lighting=4.0)
    lamps = float(rng.choice([0.0, 5.0, 15.0], p=[0.25, 0.5, 0.25]))
    return weather(sun_elevation=uniform(-50.0, -8.0), street_lighting=lamps)
