"""Camera against closed forms: projection, noise, exposure, drops, and equal images for equal seeds."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import norm

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import SettingError
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.sensing.camera import (
    BASE_SPEED,
    LENS,
    SATURATION,
    Camera,
    Exposure,
    ImageSensor,
    develop,
    lens_of,
    meter_exposure,
)
from eidrive_scenario.sensing.precipitation import MAX_DROPS, drops_before
from eidrive_scenario.sensing.settings import CameraSettings, NoiseSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.weather import Weather, load_weather

BARREL = (-0.28, 0.07, 0.001, -0.0005, 0.0)
CRATE = ActorSpec("Crate", "box", "misc", (0.4, 0.4, 0.4), (0.0, 0.0, 0.2))


def level(x: float = 0.0, y: float = 0.0, z: float = 1.4) -> np.ndarray:
    """Return the pose of a camera that points along x."""
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    pose[:3, 3] = (x, y, z)
    return pose


@pytest.mark.parametrize("distortion", [(0.0,) * 5, BARREL, (0.12, 0.0, 0.0, 0.0, 0.0)])
@pytest.mark.parametrize("place", [(6.0, 0.0), (6.0, 3.5), (7.0, -4.5)])
def test_capture_projects_corners_like_opencv(distortion: Any, place: tuple[float, float]) -> None:
    """The edges of a small crate are at OpenCV's projections of its corners, to within a pixel.

    The lens bends its edges by less than that.
    """
    settings = CameraSettings(width=400, height=300, fov=90, distortion=distortion)
    with World(picture_maker=picture_maker) as world:
        world.add(CRATE, Placement(*place))
        reading = ImageSensor(settings).capture(world, level(z=0.2), generator(1, "test"))
    rows, columns = np.nonzero(reading.segmentation == 0)
    corners = np.array(
        [(-place[1] + x, y, place[0] + z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)]
    )
    expected = cv2.projectPoints(corners, np.zeros(3), np.zeros(3), reading.intrinsics, np.array(distortion))[0][:, 0]
    found = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    assert found == pytest.approx((*expected.min(axis=0), *expected.max(axis=0)), abs=1.0)
    assert len(rows) > 100


def test_distort_pixel_directions_agree_with_opencv() -> None:
    """The colors of the image are ray directions; the lens distorts them as OpenCV does."""
    settings = CameraSettings(width=160, height=120, fov=100, distortion=BARREL)
    optics = ImageSensor(settings)
    pinhole = optics.pinhole
    rows, columns = np.indices((pinhole.height, pinhole.width), dtype=np.float32) + 0.5
    rays = np.stack([(columns - pinhole.center_x) / pinhole.focal, (rows - pinhole.center_y) / pinhole.focal], axis=-1)
    light = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1).astype(np.float32)
    flat = np.zeros((pinhole.height, pinhole.width), np.float32)
    radiance = optics.distort(Radiance(light, flat, flat.astype(np.int32))).luminance
    lens = lens_of(settings)
    pixels = cv2.projectPoints(
        radiance.reshape(-1, 3).astype(float), np.zeros(3), np.zeros(3), lens.intrinsics, np.array(BARREL)
    )[0].reshape(120, 160, 2)
    expected = np.stack(np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5), axis=-1)
    np.testing.assert_allclose(pixels, expected, atol=1 / 32)  # OpenCV interpolates between 32nds of a pixel


def test_camera_settings_with_folding_distortion_are_refused() -> None:
    with pytest.raises(ValidationError, match="folds the image"):
        CameraSettings.model_validate({"fov": 100, "distortion": (-0.6, 0.0)})
    with pytest.raises(ValidationError, match="up to five coefficients"):
        CameraSettings.model_validate({"distortion": (0.0,) * 6})


@pytest.mark.parametrize("distortion", [(0, 0, 3), (0, 0, 0, 3), (0, 0, 1000), (0, 0, 0.3, 0.3), (0.2, 0, -1e3, 1e3)])
def test_camera_settings_with_strong_tangential_distortion_are_refused(distortion: Any) -> None:
    """The undistorted image would require up to 59 TiB."""
    with pytest.raises(ValidationError, match="folds the image"):
        CameraSettings(fov=90, distortion=distortion)


def test_camera_settings_with_large_undistorted_image_are_refused() -> None:
    """r (1 - 0.1 r²) is 1.03 at r = 1.16: the undistorted image has 1.27 times as many pixels as the 30.7 million."""
    lens = {"fov": 73.7, "distortion": (-0.1, 0.0)}
    CameraSettings.model_validate({**lens, "width": 6000, "height": 4000})
    with pytest.raises(ValidationError, match="the undistorted image has more than 32000000 pixels"):
        CameraSettings.model_validate({**lens, "width": 6400, "height": 4800})


def test_optics_with_non_invertible_distortion_raises() -> None:
    settings = CameraSettings(width=64, height=48, fov=139.363, distortion=(0.0, 0.977637, 0.0, 0.271634, -0.110679))
    with pytest.raises(SettingError, match="cannot be inverted"):
        ImageSensor(settings)


def test_optics_of_random_distortions_are_exact_or_refused() -> None:
    """Checked by OpenCV's projection of the pixel directions; the size of the undistorted image is bounded."""
    draw = generator(7, "distortions")
    refused = 0
    for _ in range(300):
        coefficients = draw.uniform(-1.0, 1.0, 5) * (1.0, 1.0, 0.1, 0.1, 1.0) * draw.integers(0, 2, 5)
        try:
            settings = CameraSettings(
                width=32, height=24, fov=draw.uniform(10.0, 170.0), distortion=tuple(coefficients)
            )
            pinhole = ImageSensor(settings).pinhole
        except (ValidationError, SettingError):
            refused += 1
            continue
        assert pinhole.width * pinhole.height < 20 * 32 * 24
    assert 50 < refused < 200


def test_supersampling_averages_finer_pixels() -> None:
    with World(picture_maker=picture_maker) as world:
        world.add(CRATE, Placement(4.0, 0.5))
        fine = CameraSettings(width=80, height=60, fov=70, supersampling=2)
        pinhole = lens_of(fine)
        radiance = ImageSensor(fine).distort(world.radiance(level(), ImageSensor(fine).pinhole))
        double = world.radiance(level(), pinhole.finer(2)).luminance
    np.testing.assert_allclose(radiance.luminance, double.reshape(60, 2, 80, 2, 3).mean(axis=(1, 3)), rtol=1e-4)
    assert radiance.depth.shape == (60, 80)


def test_exposure_saturation_follows_iso_12232() -> None:
    """L_sat = 78 / S · N² / (0.65 t): at f/2, 1/100 s and 0 dB, 78 / 100 · 4 / 0.65 · 100 = 480 cd/m²; a tenth at 20
    dB."""
    gray = np.full((8, 8, 3), 10.0, np.float32)
    settings = CameraSettings(f_number=2.0, exposure_time=0.01, gain=0.0)
    assert meter_exposure(gray, settings).saturation == pytest.approx(SATURATION / BASE_SPEED * 4.0 / LENS / 0.01)
    assert meter_exposure(gray, settings).saturation == pytest.approx(480.0)
    louder = meter_exposure(gray, settings.model_copy(update={"gain": 20.0}))
    assert louder.saturation == pytest.approx(48.0)


def test_meter_exposure_increases_time_before_gain() -> None:
    settings = CameraSettings()
    noon, dusk, night = (
        meter_exposure(np.full((8, 8, 3), level, np.float32), settings) for level in (5000.0, 5.0, 0.05)
    )
    assert noon.time < 0.001
    assert noon.gain == dusk.gain == 0.0 or dusk.time == settings.max_exposure_time
    assert night.time == settings.max_exposure_time
    assert night.gain > 10.0
    assert noon.saturation > dusk.saturation > night.saturation
    pitch_dark = meter_exposure(np.full((8, 8, 3), 1e-6, np.float32), CameraSettings(max_gain=12.0))
    assert (pitch_dark.time, pitch_dark.gain) == (0.03, 12.0)


@pytest.mark.parametrize("gain", [0.0, 20.0])
@pytest.mark.parametrize("signal", [0.0, 0.1, 0.7])
def test_noise_follows_emva_1288(signal: float, gain: float) -> None:
    """A share s of a well of W electrons at a gain G: standard deviation √(s W / G + r²) / (W / G)."""
    settings = NoiseSettings(full_well=12_000.0, read_noise=5.0)
    well = 12_000.0 / 10 ** (gain / 20)
    light = np.full((200, 200, 3), signal * 1000.0, np.float32)
    count = light.size
    numbers = generator(5, "noise").bit_generator.random_raw(count // 4).view(np.uint16)
    drawn = np.sqrt(signal * well + 25.0) / well * norm.ppf((numbers + 0.5) / 65_536)
    assert drawn.std() == pytest.approx(math.sqrt(signal * well + 25.0) / well, rel=5 / math.sqrt(2 * count))
    assert abs(drawn.mean()) < 5 * drawn.std() / math.sqrt(count)
    # The image is that of the light with this noise, but for pixels that are rounded to the next value.
    noisy = (light + 1000.0 * drawn.reshape(light.shape)).astype(np.float32)
    expected = develop(noisy, Exposure(0.01, gain, 1000.0), None, generator(1))
    image = develop(light, Exposure(0.01, gain, 1000.0), settings, generator(5, "noise"))
    assert np.mean(image != expected) < 0.005
    assert np.abs(image.astype(int) - expected).max() <= 1


def test_develop_clips_saturation_to_white_and_keeps_black() -> None:
    exposure = Exposure(0.01, 0.0, 100.0)
    light = np.array([[[0.0, 100.0, 1e6]]], np.float32)
    assert develop(light, exposure, None, generator(1)).tolist() == [[[0, 255, 255]]]
    tones = develop(np.linspace(0, 100, 500, dtype=np.float32)[None, :, None], exposure, None, generator(1)).ravel()
    assert np.all(np.diff(tones.astype(int)) >= 0)


def test_drops_follow_marshall_palmer_distribution() -> None:
    """At 5 mm/h: L = 4.1 · 5^-0.21 = 2.92 / mm, 8000 / 2.92 · exp(-2.92 · 0.6) = 475 drops per m³ above 0.6 mm."""
    rain = Weather(precipitation="rain", precipitation_intensity=5.0)
    pinhole = Pinhole.of_fov(100, 75, math.radians(70))
    runs = [drops_before(rain, pinhole, generator(seed, "drops")) for seed in range(60)]
    diameters = np.concatenate([run.diameters for run in runs])
    slope = 4.1 * 5.0**-0.21
    assert slope == pytest.approx(2.92, abs=0.01)
    assert diameters.min() >= 0.6
    assert diameters.mean() == pytest.approx(0.6 + 1 / slope, rel=5 / math.sqrt(len(diameters)))
    farthest = pinhole.focal * (0.6 + 1 / slope) * 1e-3 / 0.22
    farthest = max(farthest, 0.8)
    volume = 4 * 0.55 * 100 / pinhole.focal * 0.65 * 75 / pinhole.focal * farthest**3 / 3
    expected = 8000 / slope * math.exp(-slope * 0.6) * volume
    assert len(diameters) / 60 == pytest.approx(expected, rel=5 / math.sqrt(60 * expected))
    fall = np.concatenate([run.velocities[:, 2] for run in runs])
    np.testing.assert_allclose(fall, -(9.65 - 10.3 * np.exp(-0.6 * diameters)))


@pytest.mark.parametrize("kind", ["rain", "snow"])
def test_drops_at_almost_180_degrees_are_at_most_the_maximum(kind: Any) -> None:
    pinhole = lens_of(CameraSettings(fov=math.nextafter(180.0, 0.0)))
    weather = Weather(precipitation=kind, precipitation_intensity=5.0)
    assert len(drops_before(weather, pinhole, generator(1, "drops")).places) == MAX_DROPS


def test_rain_changes_image_and_dry_weather_does_not() -> None:
    settings = CameraSettings(width=200, height=150, noise=None, lens_drops=False)

    def images(weather: Weather) -> list[np.ndarray]:
        with World(picture_maker=picture_maker) as world:
            world.set_weather(weather)
            camera = ImageSensor(settings)
            return [camera.capture(world, level(), generator(seed, "rain")).rgb.astype(int) for seed in (1, 2)]

    first, second = images(Weather())
    np.testing.assert_array_equal(first, second)
    first, second = images(load_weather("storm"))
    assert np.any(np.abs(first - second) > 3, axis=2).mean() > 0.005


def test_image_depends_on_seed_and_sensor_name() -> None:
    spec = ActorSpec("Ego", "car", "car", (4.5, 1.8, 1.5), (1.3, 0.0, 0.75), wheelbase=2.7)

    def capture_bytes(seed: int, name: str = "front") -> bytes:
        with World(picture_maker=picture_maker) as world:
            world.add(spec, Placement(0.0, 0.0))
            world.add(CRATE, Placement(9.0, 1.0))
            world.set_weather(load_weather("storm"))
            camera = Camera(CameraSettings(width=96, height=64), spec, name, seed)
            return camera.read(world, world.view(), 0).rgb.tobytes()

    assert capture_bytes(1) == capture_bytes(1)
    assert len({capture_bytes(1), capture_bytes(2), capture_bytes(1, "back")}) == 3


def test_noise_is_independent_of_other_cameras(boxes: Any) -> None:
    view = boxes.view({"Ego": (0.0, 0.0, 0.0)})
    scene = boxes.scene(view)
    camera = Camera(CameraSettings(width=16, height=12), boxes.spec("Ego"), "front", 4)
    alone = camera.read(scene, view, 0).rgb
    Camera(CameraSettings(width=16, height=12), boxes.spec("Ego"), "back", 4).read(scene, view, 0)
    np.testing.assert_array_equal(camera.read(scene, view, 0).rgb, alone)


@pytest.mark.parametrize(
    "settings",
    [
        {"width": 0},
        {"height": -3},
        {"fov": 180},
        {"fov": 1e-4},
        {"near": 2, "far": 1},
        {"noise": {"read_noise": -1}},
        {"gain": 100},
    ],
)
def test_invalid_camera_settings_are_errors(settings: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        CameraSettings(**settings)


def test_camera_noise_none_and_off_disable_noise() -> None:
    assert CameraSettings.model_validate({"noise": "none"}).noise is None
    assert CameraSettings.model_validate({"noise": False}).noise is None
