from __future__ import annotations

import base64
import json
import math
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.rendering.meshes import BUILDERS, actor_mesh
from eidrive_scenario.rendering.model import linear
from eidrive_scenario.reporting import replay
from eidrive_scenario.reporting.replay.frame_data import replay_data
from eidrive_scenario.reporting.replay.light import LightChanges, light_entry
from eidrive_scenario.reporting.replay.models import ActorModels, street_models, three_library
from eidrive_scenario.roads import RoadNetwork, surface_meshes
from eidrive_scenario.simulation import RunSettings
from eidrive_scenario.simulation.recorded_outcome import Body, recorded_bodies
from eidrive_scenario.world.actor import ActorSpec, Placement, Vector3
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.road_objects import buildings
from eidrive_scenario.world.specs import SHAPES
from eidrive_scenario.world.view import WorldView
from eidrive_scenario.world.weather import Weather
from eidrive_scenario.world.world import World

CAR: Vector3 = (4.89, 1.84, 1.49)
OFFSET: Vector3 = (1.42, 0.0, 0.745)


def unpacked(model: dict[str, Any]) -> dict[str, Array]:
    """Return the triangles (K, 3, 3) [m] by material, by the format that the module states."""
    numbers = np.frombuffer(zlib.decompress(base64.b64decode(model["data"])), "<i4")
    triangles: dict[str, list[Array]] = {}
    for material, _, vertices, faces in model["parts"]:
        points, corners = (np.cumsum(numbers[: 3 * count].reshape(3, count), axis=1).T if index == 0 else
                           np.cumsum(numbers[3 * vertices : 3 * (vertices + count)].reshape(3, count), axis=1).T
                           for index, count in enumerate((vertices, faces)))  # fmt: skip
        triangles.setdefault(material, []).append(points[corners] / 1000.0)
        numbers = numbers[3 * (vertices + faces) :]
    assert not len(numbers)
    return {material: np.concatenate(parts) for material, parts in triangles.items()}


@pytest.mark.parametrize("shape", SHAPES)
def test_model_of_actor_is_that_of_cameras_and_in_its_box(shape: str) -> None:
    size: Vector3 = {"pedestrian": (0.6, 0.6, 1.8), "rsu": (0.5, 0.5, 5.0)}.get(shape, CAR)
    models = ActorModels({"A": Body(shape, (1.0, 0.0, 0.0), 2.8, 0.33)})
    assert models.describe("A", "car", size, OFFSET) == {"model": 0, "paint": [1.0, 0.0, 0.0]}
    (model,) = models.take().values()
    spec = ActorSpec("A", shape, "car", size, OFFSET, wheelbase=2.8, wheel_radius=0.33)
    drawn = unpacked(model)
    for material, triangles in actor_mesh(spec).items():
        areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        assert drawn.pop(material) == pytest.approx(triangles[areas > 1e-12], abs=0.00051)
    assert not drawn
    corners = np.concatenate([part.reshape(-1, 3) for part in unpacked(model).values()])
    low, high = corners.min(axis=0), corners.max(axis=0)
    assert abs(low[2]) < 0.02, "it stands on the ground"
    # Mirrors, rims and arms may protrude by a quarter of a meter
    assert (high - low <= np.array(size) + 0.5).all()
    assert (low[:2] >= -np.array(size[:2]) / 2 - 0.25).all()
    assert high[2] <= size[2] + 0.1


def test_equal_bodies_share_a_model_and_differ_in_paint() -> None:
    models = ActorModels({"A": Body("car", (1.0, 0.0, 0.0), 2.8), "B": Body("car", (0.0, 0.0, 1.0), 2.8)})
    first, second = (models.describe(name, "car", CAR, OFFSET) for name in ("A", "B"))
    assert first["model"] == second["model"] == 0
    assert (first["paint"], second["paint"]) == ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    assert list(models.take()) == [0]
    assert models.describe("C", "bus", (12.0, 2.5, 3.0), (3.0, 0.0, 1.5))["model"] == 1
    assert list(models.take()) == [1]


@pytest.mark.parametrize("category", ["car", "truck", "bus", "van", "motorbike", "bicycle", "pedestrian", "misc", "?"])
@pytest.mark.parametrize("size", [(4.0, 1.8, 1.5), (0.01, 0.01, 0.01), (60.0, 0.1, 9.0)])
def test_actors_of_old_recordings_have_the_model_of_their_category(category: str, size: Vector3) -> None:
    models = ActorModels(None, None)
    models.describe("A", category, size, (math.nan, 0.0, 0.0))
    (model,) = models.take().values()
    assert all(np.isfinite(part).all() for part in unpacked(model).values())


def test_actor_without_extent_has_no_model() -> None:
    models = ActorModels({"A": Body("unknown shape")})
    assert models.describe("A", "car", (0.0, 1.0, 1.0), OFFSET)["model"] is None
    assert not models.take()


def test_recording_contains_bodies_and_poses_of_sensors(tmp_path: Path) -> None:
    run_and_save("coop/scenario_1", settings=RunSettings(detector="oracle", time_limit=0.2), out=tmp_path)
    recording = read_recording(tmp_path)
    bodies = recorded_bodies(recording)
    assert {name: body.shape for name, body in bodies.items()} == {
        "Ego": "car", "Incoming": "car", "Firetruck": "firetruck", "RSU": "rsu",
    }  # fmt: skip
    stations = json.loads(recording.metadata["settings"])["stations"]
    actors = replay_data(recording.frames(), models=ActorModels(bodies, stations))["actors"]
    # At the top of the mast of 3 m; the mount `front` is 1 m above the ground and 5.4 cm ahead of the body
    assert actors["RSU"]["sensors"] == [["truth", "truth", 0.0, 0.0, 3.0, 0.0, 0.0, 1.7453, 50.0]]
    length = actors["Ego"]["size"][0]
    name, kind, ahead, left, up, *_ = actors["Ego"]["sensors"][0]
    assert (name, kind, left, up) == ("truth", "truth", 0.0, pytest.approx(1.0, abs=0.01))
    assert ahead == pytest.approx(length / 2 + 0.054, abs=0.01)
    assert "sensors" not in actors["Firetruck"]


@pytest.mark.parametrize("stations", [{"A": None}, {"A": {"detector": "no such"}}, {"A": {"sensors": 7}}, [], "A"])
def test_settings_that_cannot_be_read_give_no_sensors(stations: Any) -> None:
    assert not ActorModels({}, stations).describe("A", "car", CAR, OFFSET).get("sensors")


def doubled_areas(triangles: Array) -> Array:
    """Return twice the area in plan view of triangles (K, 3, 3), positive if their front is above [m²]."""
    (ax, ay), (bx, by) = ((triangles[:, k, :2] - triangles[:, 0, :2]).T for k in (1, 2))
    doubled: Array = ax * by - ay * bx
    return doubled


def test_street_has_the_surfaces_and_houses_of_the_map() -> None:
    path = library_path() / "roads" / "coop_1.xodr"
    network = RoadNetwork.parse(path.read_bytes(), str(path))
    street = street_models(network)
    drawn = unpacked(street["surfaces"])
    for mesh in surface_meshes(network):
        shown = doubled_areas(drawn[mesh.kind])
        assert shown.sum() == pytest.approx(doubled_areas(mesh.vertices[mesh.faces]).sum(), rel=1e-3)
        assert (shown > -1e-6).all(), "the front is above"
    assert street["level"]
    assert street["land"]["z"] < 0.0
    corners = np.concatenate([part.reshape(-1, 3) for part in unpacked(street["houses"]).values()])
    expected = max(house.size[2] for house in buildings(network))
    assert corners[:, 2].max() == pytest.approx(expected, abs=0.01)
    assert json.loads(json.dumps(street)) == street_models(network), "the values are plain and repeatable"


def test_street_with_coordinates_of_utm_keeps_its_shape() -> None:
    """Integers of 32 bits in millimeters end at 2,147 km, and single precision resolves 0.5 m at 5,334 km."""
    offset = (691000.0, 5334000.0, 0.0)
    near, far = (
        street_models(RoadNetwork.parse(map_xml(road_xml(x=x, y=y, length=100.0))))
        for x, y, _ in ((0.0, 0.0, 0.0), offset)
    )
    assert np.subtract(far["origin"], near["origin"]).tolist() == list(offset)
    for kind, triangles in unpacked(near["surfaces"]).items():
        assert np.abs(unpacked(far["surfaces"])[kind] - triangles).max() < 0.002


def test_run_without_roads_has_bare_ground() -> None:
    street = street_models(None)
    assert (street["surfaces"], street["houses"], street["objects"], street["level"]) == (None, None, [], True)


def view(time: float = 0.0, z: float = 0.0, pitch: float = 0.0) -> WorldView:
    with World(None) as world:
        world.add(ActorSpec("A", "car", "car", CAR, OFFSET), Placement(10.0, 0.0, z, pitch=pitch))
        return world.view()


def test_light_follows_environment_unless_an_option_sets_the_weather() -> None:
    low = Environment(sun_azimuth=math.pi / 2, sun_elevation=0.2)
    frames = [Frame(view(), environment=environment) for environment in (None, low, low)]
    light = replay_data(frames)["light"]
    assert len(light) == 2
    assert light[0] == light_entry(Weather(), 0.0)
    assert light[1]["towards"] == pytest.approx([math.cos(0.2), 0.0, math.sin(0.2)], abs=1e-3)  # azimuth 90°: along x
    night = Weather(sun_elevation=-30.0)
    assert replay_data(frames, light=LightChanges(night))["light"] == [light_entry(night, 0.0)]
    assert not any(light_entry(night, 0.0)["sun"])


def test_sunlit_asphalt_has_about_the_brightness_of_pictures_of_cameras() -> None:
    """Cameras map the mean of a picture to the key of Krawczyk et al., here 0.85 (1.03 - 2 / (2 + log10(L + 1)))."""
    light = light_entry(Weather(), 0.0)
    ground = np.array(light["sky"]) + np.array(light["sun"]) * light["towards"][2]
    asphalt = linear((0.27, 0.27, 0.28)) * ground / math.pi
    assert 0.1 < asphalt.mean() < 0.6
    assert np.array(light["air"]).mean() > asphalt.mean()


def test_pose_of_actor_on_a_slope_has_height_pitch_and_roll() -> None:
    assert len(replay_data([Frame(view())])["poses"][0]["A"]) == 4
    _, _, yaw, speed, height, pitch, roll = replay_data([Frame(view(z=5.0, pitch=-0.1))])["poses"][0]["A"]
    # The center of the box is 1.42 m ahead of the reference point and 0.745 m above it; the nose is up
    assert height == pytest.approx(5.0 + 1.42 * math.sin(0.1) + 0.745 * math.cos(0.1) - 1.49 / 2, abs=0.006)
    assert (yaw, speed, pitch, roll) == (0.0, 0.0, -0.1, 0.0)


def test_three_js_is_the_published_build_with_its_license() -> None:
    core, module = (zlib.decompress(base64.b64decode(text)).decode() for text in three_library())
    assert 'from"./three.core.min.js"' in module
    folder = Path(replay.__file__).parents[1] / "templates" / "replay" / "three"
    assert "three.js authors" in (folder / "LICENSE").read_text(encoding="utf-8")
    (release,) = re.findall(r"0\.(\d+)\.0", (folder / "README.md").read_text(encoding="utf-8"))
    assert f'"{release}"' in core[:200]
    for source in (core, module):
        assert "SPDX-License-Identifier: MIT" in source[:200]
    # Lines of its shaders that the view replaces
    assert "vec3 CustomToneMapping( vec3 color ) { return color; }" in core + module
    assert "fogDensity * fogDensity * vFogDepth * vFogDepth" in core + module


def test_every_shape_has_a_mesh() -> None:
    assert set(SHAPES) <= set(BUILDERS)
