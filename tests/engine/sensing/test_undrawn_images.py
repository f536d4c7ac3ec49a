"""Camera images that are drawn when their pixels are read, and their digests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.rendering.renderer import Renderer
from eidrive_scenario.sensing.camera import Camera
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.sensing.settings import CameraSettings, Mount, NoiseSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.weather import load_weather

EGO = ActorSpec("Ego", "car", "car", (4.5, 1.8, 1.5), (1.3, 0.0, 0.75), wheelbase=2.7)
OTHER = ActorSpec("Other", "car", "car", (4.5, 1.8, 1.5), (1.3, 0.0, 0.75), wheelbase=2.7)
USUAL: dict[str, Any] = {"width": 64, "height": 48, "noise": NoiseSettings(), "far": 40.0}
ALTERED: dict[str, Any] = {
    "mount": Mount(x=1.0, y=0.2, z=1.5),
    "rate": 10.0,
    "width": 70,
    "height": 40,
    "fov": 80.0,
    "distortion": (-0.02, 0.0, 0.0, 0.0, 0.0),
    "near": 0.5,
    "far": 9.0,
    "noise": NoiseSettings(read_noise=900.0),
    "f_number": 3.5,
    "exposure_time": 0.0001,
    "gain": 30.0,
    "max_exposure_time": 1e-5,
    "max_gain": 1.0,
    "lens_drops": False,
    "supersampling": 2,
}
"""Another value for each setting of a camera."""


def reading_of(
    *, seed: int = 1, name: str = "front", spec: ActorSpec = EGO, speed: float = 5.0, ticks: int = 0, **settings: Any
) -> CameraReading:
    """Return the reading of a camera in rain, behind another car."""
    with World(picture_maker=picture_maker) as world:
        world.set_weather(load_weather("storm"))
        world.add(spec, Placement(0.0, 0.0, speed=speed))
        world.add(OTHER, Placement(10.0, 1.0))
        for _ in range(ticks):
            world.step({spec.name: Placement(0.0, 0.0, speed=speed, teleport=True)}, {})
        camera = Camera(CameraSettings(**{**USUAL, **settings}), spec, name, seed)
        return camera.read(world, world.view(), 0)


def pixels(reading: CameraReading) -> bytes:
    return reading.rgb.tobytes() + reading.depth.tobytes() + reading.segmentation.tobytes()


@pytest.mark.parametrize("name", ALTERED)
def test_each_camera_setting_changes_the_digest_or_no_pixel(name: str) -> None:
    usual, other = reading_of(), reading_of(**{name: ALTERED[name]})
    assert other.image_digest != usual.image_digest or pixels(other) == pixels(usual)


def test_altered_settings_are_all_settings() -> None:
    assert set(CameraSettings.model_fields) == {"kind", *ALTERED}


@pytest.mark.parametrize(
    "changes", [{"seed": 2}, {"name": "back"}, {"speed": 9.0}, {"ticks": 1}, {"ticks": 41}, {"spec": OTHER}], ids=str
)
def test_random_numbers_and_motion_change_image_and_digest(changes: dict[str, Any]) -> None:
    if "spec" in changes:
        changes = {"spec": ActorSpec("Alter", "car", "car", EGO.size, EGO.offset, wheelbase=2.7)}
    usual, other = reading_of(), reading_of(**changes)
    assert other.image_digest != usual.image_digest
    assert pixels(other) != pixels(usual)


def test_equal_inputs_give_equal_digests_and_images() -> None:
    one, other = reading_of(ticks=3), reading_of(ticks=3)
    assert one.image_digest == other.image_digest is not None
    assert pixels(one) == pixels(other)


def test_images_are_drawn_once_and_only_if_read(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    original = Renderer.render

    def render(self: Renderer, content: Any) -> Any:
        drawn.append(1)
        return original(self, content)

    monkeypatch.setattr(Renderer, "render", render)
    reading = reading_of()
    moved = reading.at(np.eye(4))
    assert reading.size == (64, 48)
    assert reading.image_digest is not None
    assert drawn == []
    assert reading.rgb.shape == (48, 64, 3)
    assert moved.depth is reading.depth
    assert len(drawn) == 1
    np.testing.assert_array_equal(moved.pose, np.eye(4))


def test_reading_of_given_arrays_has_no_digest() -> None:
    image = np.zeros((3, 5, 3), np.uint8)
    reading = CameraReading(image, np.ones((3, 5), np.float32), np.zeros((3, 5), np.int32), np.eye(3), np.eye(4))
    assert reading.image_digest is None
    assert reading.size == (5, 3)
    assert reading.at(2.0 * np.eye(4)).rgb is image
    np.testing.assert_array_equal(reading.distortion, np.zeros(5))
