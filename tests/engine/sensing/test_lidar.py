"""Lidar against closed forms: pattern, ranges, intensity, noise, drop-off, weather, symmetry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from eidrive_scenario.base.geometry import points_in_box
from eidrive_scenario.sensing.bodies import REFLECTIVITY
from eidrive_scenario.sensing.lidar import ASPHALT, BACKSCATTER, CONTRAST, Lidar, extinction, returns
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.world.view import GROUND, NOTHING
from eidrive_scenario.world.weather import Weather

EXACT: dict[str, Any] = {"range_noise": 0.0, "attenuation": 0.0}
FOG = Weather(visual_range=60.0)


def measure(boxes: Any, scene: Any, *, seed: int = 0, **settings: Any) -> LidarReading:
    lidar = Lidar(LidarSettings(**settings), boxes.spec("Ego"), seed=seed)
    reading: LidarReading = lidar.read(scene, scene.view, 0)
    return reading


def ego_and(boxes: Any, **others: tuple[float, float, float]) -> Any:
    return boxes.view({"Ego": (0.0, 0.0, 0.0), **others})


def test_range_to_wall_is_exact_in_every_ring_and_column(boxes: Any) -> None:
    """A wall at x = 20 m from (-0.5, 0, 1.9): the ray of azimuth a and elevation e has length 20.5 / (cos a cos e)."""
    scene = boxes.scene(ego_and(boxes), [(22.0, 0.0, 0.0, 4.0, 400.0, 400.0, 0.0)])
    found = measure(
        boxes, scene, channels=5, upper_fov=10, lower_fov=0, points_per_second=5 * 72 * 20, range=60, **EXACT
    )
    elevation = np.radians(np.linspace(10.0, 0.0, 5))[found.ring]
    distance = np.linalg.norm(found.points, axis=1)
    np.testing.assert_allclose(distance, 20.5 / np.cos(found.azimuth) / np.cos(elevation), rtol=1e-9)
    np.testing.assert_allclose(np.arctan2(found.points[:, 1], found.points[:, 0]), found.azimuth, atol=1e-9)
    np.testing.assert_allclose(np.arcsin(found.points[:, 2] / distance), elevation, atol=1e-9)
    # Columns of 5 degrees: within the range of 60 m, rays hit the wall up to acos(20.5 / 60) = 70.03 degrees.
    assert sorted(set(np.rint(np.degrees(found.azimuth[found.ring == 4])))) == list(range(-70, 75, 5))


def test_points_name_the_actor_the_ground_or_the_air(boxes: Any) -> None:
    """A box 20 m ahead is row 1. Fog of 60 m returns points of the air, which are nearer than any surface."""
    scene = boxes.scene(ego_and(boxes, Other=(20.0, 0.0, 0.0)))
    scene.ground = True
    found = measure(boxes, scene, channels=32, points_per_second=200_000, **EXACT)
    world = found.points + found.pose[:3, 3]
    assert set(found.rows.tolist()) == {GROUND, 1}
    assert np.abs(world[found.rows == GROUND, 2]).max() < 1e-9
    assert points_in_box(world[found.rows == 1], scene.view.boxes[1] + np.array([0, 0, 0, 1, 1, 1, 0]) * 1e-6).all()
    scene.weather = FOG
    air = measure(boxes, scene, channels=32, points_per_second=200_000, **EXACT)
    assert set(air.rows.tolist()) == {NOTHING, GROUND, 1}
    assert np.abs((air.points + air.pose[:3, 3])[air.rows == GROUND, 2]).max() < 1e-9
    assert np.linalg.norm(air.points[air.rows == NOTHING], axis=1).max() < 20.0


def test_rings_have_elevations_of_settings(boxes: Any) -> None:
    lidar = Lidar(LidarSettings(channels=3, elevations=(5.0, 1.0, -20.0), points_per_second=3000), boxes.spec("Ego"))
    up = np.unique(np.round(np.degrees(np.arcsin(lidar.directions(0.0)[:, 2])), 9))
    np.testing.assert_allclose(up, [-20.0, 1.0, 5.0])


def test_horizontal_field_of_view_is_centered_on_mount(boxes: Any) -> None:
    lidar = Lidar(LidarSettings(field_of_view=90.0, points_per_second=32 * 360 * 20), boxes.spec("Ego"))
    azimuths = np.unique(np.round(np.degrees(np.arctan2(*lidar.directions(0.0)[:, 1::-1].T)), 6))
    assert (azimuths.min(), azimuths.max(), len(azimuths)) == (-45.0, 45.0, 91)


def test_directions_continue_rotation_between_readings(boxes: Any) -> None:
    """10 Hz at steps of 0.02 s: a fifth of a revolution each; five of them contain each column once."""
    lidar = Lidar(LidarSettings(channels=1, rotation=10.0, points_per_second=3600), boxes.spec("Ego"))
    lidar.directions(0.0)
    parts = [lidar.directions(0.02 * step) for step in range(1, 6)]
    assert [len(part) for part in parts] == [72] * 5
    turns = np.degrees(np.arctan2(*np.concatenate(parts)[:, 1::-1].T)) % 360.0
    np.testing.assert_allclose(np.sort(np.rint(turns) % 360), np.arange(360))


def test_reading_after_many_revolutions_has_the_rays_of_one(boxes: Any) -> None:
    """2,600,000 rays per second at 10 revolutions per second are 260,000 rays per revolution, also if read at 1 Hz."""
    settings = LidarSettings(channels=128, points_per_second=2_600_000, rotation=10.0, rate=1.0)
    lidar = Lidar(settings, boxes.spec("Ego"))
    assert [len(lidar.directions(time)) for time in (0.0, 1.0)] == [2031 * 128] * 2


def test_intensity_is_reflectivity_times_cosine_times_attenuation(boxes: Any) -> None:
    view = ego_and(boxes, Car=(20.0, 0.0, 0.6))
    scene = boxes.scene(view, ground=True)
    settings: dict[str, Any] = {"range_noise": 0.0, "attenuation": 0.01, "weather": False}
    found = measure(boxes, scene, points_per_second=32 * 180 * 20, **settings)
    points = found.points + found.pose[:3, 3]
    distance = np.linalg.norm(found.points, axis=1)
    ground = np.abs(points[:, 2]) < 1e-9
    expected = ASPHALT * 1.9 / distance[ground] * np.exp(-0.01 * distance[ground])
    np.testing.assert_allclose(found.intensity[ground], expected, rtol=1e-6)
    # Battens at the rear of a crate, whose normal points back along its yaw of 0.6 rad; rays at angle c to the normal.
    normal = np.array([-math.cos(0.6), -math.sin(0.6)])
    rear = ~ground & (np.abs((points[:, :2] - (20.0, 0.0)) @ -normal + 4.892 / 2) < 1e-6) & (points[:, 2] < 1.48)
    assert rear.sum() > 3
    cosine = np.abs(found.points[rear][:, :2] @ normal) / distance[rear]
    np.testing.assert_allclose(
        found.intensity[rear], REFLECTIVITY["plastic"] * cosine * np.exp(-0.01 * distance[rear]), rtol=1e-6
    )


def test_range_noise_has_stated_deviation(boxes: Any) -> None:
    scene = boxes.scene(ego_and(boxes), [(22.0, 0.0, 0.0, 4.0, 400.0, 400.0, 0.0)])
    rays = {"channels": 20, "upper_fov": 1, "lower_fov": -1, "points_per_second": 20 * 240 * 20}
    exact = measure(boxes, scene, **rays, **EXACT)
    noisy = measure(boxes, scene, **rays, range_noise=0.05, attenuation=0.0)
    error = np.linalg.norm(noisy.points, axis=1) - np.linalg.norm(exact.points, axis=1)
    assert len(error) > 1300
    assert abs(error.mean()) < 4 * 0.05 / math.sqrt(len(error))
    assert error.std() == pytest.approx(0.05, rel=4 / math.sqrt(2 * len(error)))


def test_dropoff_loses_stated_shares(boxes: Any) -> None:
    """A third at random; of returns with intensity i below 0.4, a share of 0.8 (1 - i / 0.4)."""
    scene = boxes.scene(ego_and(boxes), [(12.0, 0.0, 0.0, 4.0, 400.0, 400.0, 0.0)])
    rays = {"channels": 20, "upper_fov": 1, "lower_fov": -1, "points_per_second": 20 * 240 * 20}
    complete = measure(boxes, scene, **rays, **EXACT)
    kept = len(measure(boxes, scene, **rays, dropoff=1 / 3, **EXACT).points) / len(complete.points)
    assert kept == pytest.approx(2 / 3, abs=4 * math.sqrt(2 / 9 / len(complete.points)))
    dark = measure(boxes, scene, **rays, dropoff_intensity=0.4, dropoff_dark=0.8, **EXACT)
    expected = np.mean(1.0 - 0.8 * np.maximum(1.0 - complete.intensity / 0.4, 0.0))
    share = len(dark.points) / len(complete.points)
    assert share == pytest.approx(expected, abs=4 * math.sqrt(expected * (1 - expected) / len(complete.points)))


def test_same_seed_returns_same_points(boxes: Any) -> None:
    scene = boxes.scene(ego_and(boxes, Car=(15.0, 2.0, 0.4)), ground=True)
    scene.weather = FOG
    rays = {"channels": 8, "points_per_second": 8 * 120 * 20, "dropoff": 0.1}
    first, again, other = (measure(boxes, scene, seed=seed, **rays) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.points, again.points)
    assert first.points.shape != other.points.shape or not np.array_equal(first.points, other.points)


def test_returns_end_at_ten_percent_range() -> None:
    """Reflectivity 0.1 is measured up to 100 m, 0.4 up to twice that (power falls with 1 / d²)."""
    distance = np.array([99.0, 101.0, 199.0, 201.0])
    brightness = np.array([0.1, 0.1, 0.4, 0.4])
    clear = Weather(visual_range=1e9)
    back = returns(
        distance, brightness, clear, attenuation=0.0, ten_percent_range=100.0, draws=np.random.default_rng(1)
    )
    assert back.detected.tolist() == [True, False, True, False]


def test_fog_attenuates_returns_and_hides_distant_objects() -> None:
    """Kruse's exponent at 60 m is 0.585 · 0.06^(1/3) = 0.229: the extinction at 905 nm is 0.892 of the visible one;
    light travels both ways."""
    assert extinction(FOG) == pytest.approx(3.912 / 60.0 * (0.905 / 0.55) ** -0.229, rel=1e-3)
    draws = np.random.default_rng(3)
    near = returns(np.full(1000, 4.0), np.full(1000, 0.8), FOG, attenuation=0.0, ten_percent_range=150.0, draws=draws)
    np.testing.assert_allclose(near.distance, 4.0)
    np.testing.assert_allclose(near.intensity, 0.8 * math.exp(-8.0 * extinction(FOG)))
    far = returns(np.full(1000, 45.0), np.full(1000, 0.45), FOG, attenuation=0.0, ten_percent_range=150.0, draws=draws)
    assert far.detected.mean() > 0.99, "the fog itself returns enough light"
    assert (far.distance < 20.0).mean() > 0.99
    assert np.median(far.distance) < 6.0


def test_car_in_fog_is_measured_up_to_third_of_visibility() -> None:
    """Distance of equal return from a car and from the fog, by hand.

    0.45 exp(-2 a d) / pi d² = 0.046 / V 0.75 m f, where f is the maximum of (r - 0.9) / 9.1 exp(-2 a r) / r², which for
    a = 0.058 / m is 0.0252 / m² at r = 1.7 m.
    """
    fade = extinction(FOG)
    radius = np.linspace(0.9, 10.0, 2000)
    peak = np.max((radius - 0.9) / 9.1 * np.exp(-2 * fade * radius) / radius**2)
    assert peak == pytest.approx(0.0252, rel=0.02)
    air = BACKSCATTER * FOG.extinction / CONTRAST * 0.75 * peak
    distances = np.linspace(5.0, 40.0, 3501)
    equal = distances[np.argmin(np.abs(0.45 * np.exp(-2 * fade * distances) / math.pi / distances**2 - air))]
    assert 18.0 < equal < 26.0
    back = returns(
        np.repeat([0.6 * equal, equal, 1.6 * equal], 2000),
        np.full(6000, 0.45),
        FOG,
        attenuation=0.0,
        ten_percent_range=150.0,
        draws=np.random.default_rng(5),
    )
    true = (back.distance == np.repeat([0.6 * equal, equal, 1.6 * equal], 2000)).reshape(3, 2000).mean(axis=1)
    assert true[0] > 0.9
    assert 0.4 < true[1] < 0.75
    assert true[2] < 0.1


def test_rain_causes_false_returns_and_clear_air_none() -> None:
    nothing = np.full(20_000, np.inf)

    def share(weather: Weather) -> float:
        back = returns(
            nothing, np.zeros(20_000), weather, attenuation=0.0, ten_percent_range=150.0, draws=np.random.default_rng(7)
        )
        return float(back.detected.mean())

    drizzle, downpour = (Weather(precipitation="rain", precipitation_intensity=rate) for rate in (2.0, 50.0))
    assert share(Weather()) == 0.0
    assert 0.0 < share(drizzle) < 0.04 < share(downpour) < 0.3


@pytest.mark.parametrize("rate", [0.0, 0.01])
def test_traces_of_rain_hardly_change_returns_of_fog(rate: float) -> None:
    """0.01 mm/h attenuate by 0.05 dB/km, and fog of 200 m by 85 dB/km."""

    def share(weather: Weather) -> float:
        back = returns(
            np.full(20_000, np.inf),
            np.zeros(20_000),
            weather,
            attenuation=0.0,
            ten_percent_range=150.0,
            draws=np.random.default_rng(7),
        )
        return float(back.detected.mean())

    fog = Weather(visual_range=200.0)
    rain = Weather(visual_range=200.0, precipitation="rain", precipitation_intensity=rate)
    assert share(rain) == pytest.approx(share(fog), abs=0.003)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "weather", [Weather(visual_range=1e-3), Weather(precipitation="snow", precipitation_intensity=1e-9)]
)
def test_air_without_measurable_scattering_returns_nothing(weather: Weather) -> None:
    """Fog of 1 mm leaves exp(-7,000) of light over 0.9 m; flakes of 1e-9 mm/h scatter less than 1e-12 / (m sr)."""
    back = returns(
        np.full(100, np.inf),
        np.zeros(100),
        weather,
        attenuation=0.0,
        ten_percent_range=150.0,
        draws=np.random.default_rng(7),
    )
    assert not back.detected.any()


def test_air_is_measured_within_the_range(boxes: Any) -> None:
    scene = boxes.scene(ego_and(boxes))
    scene.weather = FOG
    distance = np.linalg.norm(measure(boxes, scene, range=5.0, **EXACT).points, axis=1)
    assert 4.5 < distance.max() <= 5.0


def test_wet_road_has_lower_intensity(boxes: Any) -> None:
    scene = boxes.scene(ego_and(boxes), ground=True)
    rays = {"channels": 8, "upper_fov": -10, "points_per_second": 8 * 60 * 20, **EXACT}
    dry = measure(boxes, scene, **rays)
    scene.weather = Weather(wetness=0.5)
    wet = measure(boxes, scene, **rays)
    assert len(dry.points) == len(wet.points) > 100
    np.testing.assert_allclose(wet.intensity / dry.intensity, 0.06 / 0.17)


@pytest.mark.parametrize("angle", [0.7, -2.5, math.pi])
def test_rotated_scene_returns_same_points(boxes: Any, angle: float) -> None:
    """The point cloud in the sensor frame is invariant under rotation of the whole scene about the origin."""
    cos, sin = math.cos(angle), math.sin(angle)
    actors = {"Ego": (2.0, 1.0, 0.3), "A": (14.0, 3.0, 1.0), "B": (-9.0, 6.0, -0.4)}
    turned = {name: (cos * x - sin * y, sin * x + cos * y, yaw + angle) for name, (x, y, yaw) in actors.items()}
    settings: dict[str, Any] = {"channels": 16, "points_per_second": 16 * 120 * 20, "range_noise": 0.0}
    first = measure(boxes, boxes.scene(boxes.view(actors), ground=True), **settings)
    second = measure(boxes, boxes.scene(boxes.view(turned), ground=True), **settings)
    assert len(first.points) > 500
    np.testing.assert_allclose(first.points, second.points, atol=1e-7)
    np.testing.assert_allclose(first.intensity, second.intensity, atol=1e-9)


def test_mirrored_scene_returns_mirrored_points(boxes: Any) -> None:
    actors = {"Ego": (0.0, 0.0, 0.0), "A": (14.0, 3.0, 1.0), "B": (-9.0, 6.0, -0.4)}
    mirrored = {name: (x, -y, -yaw) for name, (x, y, yaw) in actors.items()}
    settings: dict[str, Any] = {"channels": 16, "points_per_second": 16 * 120 * 20, "range_noise": 0.0}
    first = measure(boxes, boxes.scene(boxes.view(actors), ground=True), **settings)
    second = measure(boxes, boxes.scene(boxes.view(mirrored), ground=True), **settings)

    def by_ray(found: LidarReading, sign: float) -> dict[tuple[int, int], tuple[float, ...]]:
        turns = np.rint(np.degrees(sign * found.azimuth)).astype(int) % 360
        places = found.points * (1.0, sign, 1.0)
        return {(int(r), int(a)): tuple(np.round(p, 6)) for r, a, p in zip(found.ring, turns, places, strict=True)}

    assert by_ray(first, 1.0).keys() == by_ray(second, -1.0).keys()
    places = by_ray(first, 1.0)
    for ray, place in by_ray(second, -1.0).items():
        assert place == pytest.approx(places[ray], abs=1e-5)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"channels": 0}, "greater than or equal to 1"),
        ({"channels": 3, "elevations": [1, 2]}, r"elevations has the wrong length \(got 2; expected 3"),
        ({"channels": 3, "elevations": [1, 2, 0]}, "elevations rise"),
        ({"channels": 64, "points_per_second": 100}, "less than one column"),
        ({"points_per_second": 2_000_100, "rotation": 1.0}, "too many rays"),
        ({"range": -1}, "greater than 0"),
        ({"dropoff": 1.0}, "less than 1"),
    ],
)
def test_invalid_lidar_settings_are_errors(settings: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValidationError, match=expected):
        LidarSettings(**settings)
