"""Tests of the renderer: coverage, depth, sun, shadows, fog, night, wet roads."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from sample_car import CarFactory

from eidrive_scenario.rendering import picture_maker, renderer
from eidrive_scenario.rendering.daylight import SIZE, daylight, dome, horizon
from eidrive_scenario.rendering.lamps import ABOVE_CUT_OFF, LOW_BEAM, intensity
from eidrive_scenario.rendering.rasterization import rasterize
from eidrive_scenario.rendering.shading import sampled
from eidrive_scenario.rendering.surfaces import hollows, puddles
from eidrive_scenario.rendering.tone_mapping import LUMA
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.weather import Weather, load_weather

PINHOLE = Pinhole.of_fov(160, 120, math.radians(80))


def looking(yaw: float, z: float = 1.5, x: float = 0.0, y: float = 0.0, pitch: float = 0.0) -> np.ndarray:
    """Return the pose of a camera with a heading, directed downwards by `pitch`."""
    forward = np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)])
    right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(forward, right), forward, (x, y, z)
    return pose


def brightness(light: np.ndarray) -> np.ndarray:
    found: np.ndarray = light @ LUMA.astype(np.float32)
    return found


def inside(corners: np.ndarray, x: float, y: float) -> bool:
    a, b, c = corners
    signs = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
    return all(s > 0 for s in signs) or all(s < 0 for s in signs)


def test_triangle_covers_pixels_with_centers_inside() -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(-5.0, 25.0, (40, 3, 2))
    nearness = np.repeat(rng.uniform(0.1, 1.0, 40)[None], 3, axis=0)
    shown = rasterize(corners[..., 0].T, corners[..., 1].T, nearness, 20, 16).triangle.ravel()
    for pixel in range(20 * 16):
        x, y = pixel % 20 + 0.5, pixel // 20 + 0.5
        holders = [k for k in range(40) if inside(corners[k], x, y)]
        nearest = max(holders, key=lambda k: nearness[0, k], default=-1)
        assert shown[pixel] == nearest


def test_adjacent_triangles_neither_overlap_nor_leave_gaps() -> None:
    """A fan of triangles around a point, also with corners on pixel centers: each center inside belongs to one
    triangle.
    """
    ring = np.array([(2.5, 2.5), (17.5, 3.5), (18.2, 14.5), (9.5, 17.5), (1.5, 12.5)])
    hub = np.array([9.5, 9.5])
    triangles = np.array([[hub, ring[k], ring[(k + 1) % 5]] for k in range(5)])
    counts = np.zeros(400, dtype=int)
    for one in triangles:
        counts += (rasterize(one[:, :1], one[:, 1:], np.ones((3, 1)), 20, 20).triangle >= 0).ravel()
    assert counts.max() == 1
    together = rasterize(triangles[..., 0].T, triangles[..., 1].T, np.ones((3, 5)), 20, 20).triangle >= 0
    assert counts.sum() == together.sum()
    grid = together.reshape(20, 20)
    for line in grid:
        covered = np.flatnonzero(line)
        assert len(covered) == 0 or np.all(np.diff(covered) == 1)


def test_large_triangles_cover_the_same_pixels_as_small_ones() -> None:
    """Triangles of thousands of pixels, some with thin tips, are compared with all pixel centers individually."""
    rng = np.random.default_rng(3)
    gap_in_its_tip = [(94.18172651875673, 149.27757363317045), (20.45740141210438, 28.0104538720336), (36.576, 287.222)]
    corners = np.concatenate([rng.uniform(-150.0, 400.0, (25, 3, 2)), [gap_in_its_tip]])
    nearness = rng.uniform(0.1, 1.0, (3, len(corners)))
    nearness[:, -1] = 2.0
    shown = rasterize(corners[..., 0].T, corners[..., 1].T, nearness, 300, 300)
    lines, columns = np.indices((300, 300)) + 0.5
    best, nearest = np.zeros((300, 300)), np.full((300, 300), -1)
    for number, (a, b, c) in enumerate(corners):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        share = [
            ((q[0] - p[0]) * (lines - p[1]) - (q[1] - p[1]) * (columns - p[0])) / area
            for p, q in ((b, c), (c, a), (a, b))
        ]
        near = sum(part * nearness[corner, number] for corner, part in enumerate(share))
        better = (np.minimum(np.minimum(*share[:2]), share[2]) > 0.0) & (near > best)
        best[better], nearest[better] = near[better], number
    np.testing.assert_array_equal(shown.triangle, nearest)
    np.testing.assert_allclose(shown.nearness, best, rtol=1e-5)


def test_nearness_equals_that_of_the_plane() -> None:
    corners = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0]])
    nearness = np.array([[0.1], [0.5], [0.3]])
    cover = rasterize(corners[:, :1], corners[:, 1:], nearness, 20, 20)
    lines, columns = np.nonzero(cover.triangle == 0)
    x, y = columns + 0.5, lines + 0.5
    np.testing.assert_allclose(cover.nearness[lines, columns], 0.1 + 0.4 * x / 20 + 0.2 * y / 20, rtol=1e-5)


def test_daylight_at_noon_and_dusk_equals_tables() -> None:
    """Sun at 90 degrees: 127.5 klx exp(-0.21) = 103.3 klx across its rays, and 16.3 klx of sky light."""
    noon = daylight(Weather(sun_elevation=90.0, cloud_cover=0.0, visual_range=1e9))
    assert float(noon.sun @ LUMA) == pytest.approx(103_350, rel=1e-3)
    assert float(noon.sky @ LUMA) == pytest.approx(16_300, rel=1e-3)
    dusk = daylight(Weather(sun_elevation=-6.0, cloud_cover=0.0))
    assert float(dusk.sky @ LUMA) == pytest.approx(3.42, rel=1e-2)
    assert not dusk.sun.any()
    overcast = daylight(Weather(sun_elevation=60.0, cloud_cover=1.0, visual_range=1e9))
    total = 127_500 * math.exp(-0.21 / math.sin(math.pi / 3)) * math.sin(math.pi / 3)
    total += 800 + 15_500 * math.sqrt(math.sin(math.pi / 3))
    assert float(overcast.ground @ LUMA) == pytest.approx(0.25 * total, rel=1e-3)
    assert not overcast.sun.any()


def test_dome_luminance_integrates_to_sky_illuminance() -> None:
    """The luminance of the dome times cosine, integrated over its solid angle, is the illuminance of the sky."""
    weather = Weather(cloud_cover=0.0, visual_range=1e9)
    axis = (np.arange(SIZE) - (SIZE - 1) / 2) / ((SIZE - 2) / 2)
    square = axis[None, :] ** 2 + axis[:, None] ** 2
    cosine = np.clip((1 - square) / (1 + square), 0.0, 1.0)
    solid_angle = (2.0 / (1.0 + square)) ** 2 / ((SIZE - 2) / 2) ** 2
    given = float((brightness(dome(weather)) * cosine * solid_angle)[square <= 1.0].sum())
    assert given == pytest.approx(float(daylight(weather).clear @ LUMA), rel=0.02)


def test_wall_towards_the_sun_is_brighter(world: World) -> None:
    """A house is seen from south and north in the morning."""
    world.add_building("house", (0.0, 0.0, 5.0), (10.0, 10.0, 10.0), color=(0.7, 0.7, 0.7))
    world.set_weather(Weather(sun_azimuth=180.0, sun_elevation=30.0, cloud_cover=0.0))
    south = world.radiance(looking(math.pi / 2, 5.0, y=-25.0), PINHOLE).luminance[40:80, 60:100]
    north = world.radiance(looking(-math.pi / 2, 5.0, y=25.0), PINHOLE).luminance[40:80, 60:100]
    assert brightness(south).mean() > 4 * brightness(north).mean()


@pytest.mark.parametrize(("azimuth", "side"), [(180.0, 1.0), (0.0, -1.0)])
def test_shadow_of_a_house_points_away_from_the_sun(world: World, azimuth: float, side: float) -> None:
    """At a height of 10 m and a sun elevation of 45 degrees the shadow is 10 m long: dark at 4 m, lit at 14 m from the
    wall.
    """
    world.add_building("house", (0.0, 0.0, 5.0), (30.0, 10.0, 10.0))
    world.set_weather(Weather(sun_azimuth=azimuth, sun_elevation=45.0, cloud_cover=0.0))
    above = looking(math.pi / 2, 60.0, pitch=math.pi / 2 - 1e-6)

    def ground(y: float) -> float:
        row = round(PINHOLE.center_y - PINHOLE.focal * y / 60.06)
        light = world.radiance(above, PINHOLE).luminance
        return float(brightness(light[row - 1 : row + 2, 70:90]).mean())

    assert ground(side * 9.0) < 0.3 * ground(side * 19.0)
    assert ground(-side * 9.0) > 0.8 * ground(side * 19.0)


def test_vehicles_cast_shadows_and_darken_the_ground_below(world: World, car: CarFactory) -> None:
    world.set_weather(Weather(sun_azimuth=180.0, sun_elevation=35.0, cloud_cover=0.0))
    pose = looking(math.pi / 2, 12.0, y=-6.0, x=1.35, pitch=0.9)
    before = brightness(world.radiance(pose, PINHOLE).luminance)
    world.add(car("Ego"), Placement(0.0, 0.0))
    seen = world.radiance(pose, PINHOLE)
    after = brightness(seen.luminance)
    shaded = (after < 0.5 * before) & (seen.segmentation < 0)
    assert shaded.sum() > 30
    # The shadow is behind the car (1.5 m / tan 35 degrees = 2.1 m), thus higher in the image.
    assert np.nonzero(shaded)[0].mean() < np.nonzero(seen.segmentation == 0)[0].mean()


@pytest.mark.parametrize("visual_range", [40.0, 100.0, 300.0])
def test_luminance_in_fog_follows_koschmieder(world: World, visual_range: float) -> None:
    """L = L0 exp(-3.912 d / V) + La (1 - exp(-3.912 d / V)) along the ground, which does not reflect."""
    clear = Weather(visual_range=1e9, cloud_cover=1.0, headlights="off")
    fog = Weather(visual_range=visual_range, cloud_cover=1.0, headlights="off")
    world.set_weather(clear)
    bare = world.radiance(looking(0.0), PINHOLE)
    world.set_weather(fog)
    foggy = world.radiance(looking(0.0), PINHOLE)
    rows, columns = np.indices(bare.depth.shape) + 0.5
    slant = np.hypot(1.0, np.hypot(columns - PINHOLE.center_x, rows - PINHOLE.center_y) / PINHOLE.focal)
    seen = np.isfinite(bare.depth) & (bare.depth * slant < 300.0)
    through = np.exp(-3.912 / visual_range * bare.depth[seen] * slant[seen])[:, None]
    expected = bare.luminance[seen] * through + horizon(fog) * (1.0 - through)
    np.testing.assert_allclose(foggy.luminance[seen], expected, rtol=2e-3)


def test_lamps_brighten_the_night(world: World, car: CarFactory) -> None:
    world.add(car("Ego"), Placement(0.0, 0.0))
    ahead = looking(0.0, 1.3, x=4.0)
    lower = np.s_[70:100, 60:100]

    def road(weather: Weather) -> float:
        world.set_weather(weather)
        return float(brightness(world.radiance(ahead, PINHOLE).luminance[lower]).mean())

    midnight = load_weather("midnight")
    dark = road(midnight.model_copy(update={"headlights": "off", "street_lighting": 0.0}))
    lit = road(midnight.model_copy(update={"street_lighting": 0.0}))
    street = road(midnight.model_copy(update={"headlights": "on"}))
    assert dark < 1e-3 * road(load_weather("sunny"))
    assert lit > 50 * dark
    assert street > lit


def test_low_beam_has_a_cut_off() -> None:
    """The maximum is just below the cut-off. Above it the regulation for oncoming drivers applies."""
    straight = np.zeros(1)
    below = float(intensity(straight, np.array([-0.022]), False)[0])
    assert below == pytest.approx(LOW_BEAM, rel=0.05)
    assert float(intensity(straight, np.array([0.01]), False)[0]) <= ABOVE_CUT_OFF
    assert float(intensity(straight, np.array([0.0]), True)[0]) > 50_000


def test_headlamps_illuminate_a_wall_by_inverse_square_law(world: World, car: CarFactory) -> None:
    """Two lamps of the car illuminate a white wall 20 m ahead: each pixel shows 2 I cos / (pi d²) of its point."""
    spec = car("Ego")
    world.add(spec, Placement(0.0, 0.0))
    lamp = np.array([3.6, 0.0, 0.675])
    world.add_building("wall", (lamp[0] + 21.0, 0.0, 2.0), (2.0, 40.0, 4.0), color=(1.0, 1.0, 1.0))
    world.set_weather(Weather(sun_elevation=-30.0, cloud_cover=0.0, visual_range=1e9))
    height, eye = 0.55, 8.0
    lines, columns = (part.astype(float) for part in np.mgrid[57:60, 70:90])  # The plinth of the wall is 0.5 m high.
    away = lamp[0] + 20.0 - eye
    y = -(columns + 0.5 - PINHOLE.center_x) / PINHOLE.focal * away
    z = height - (lines + 0.5 - PINHOLE.center_y) / PINHOLE.focal * away
    distance = np.sqrt(20.0**2 + y**2 + (z - lamp[2]) ** 2)
    candela = 2.0 * intensity(y / 20.0, (z - lamp[2]) / 20.0, False)
    expected = candela * (20.0 / distance) / distance**2 / math.pi
    seen = brightness(world.radiance(looking(0.0, height, x=eye), PINHOLE).luminance)[57:60, 70:90]
    np.testing.assert_allclose(seen, expected, rtol=0.02)


def test_light_of_headlamps_is_that_of_each_pixel(
    world: World, car: CarFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An image without its first column and line is the same: neighbors do not share their light."""
    monkeypatch.setattr(renderer, "_with_glare", lambda image: image)
    for name, x, y, yaw in (("Ego", 0.0, 0.0, 0.0), ("Ahead", 14.0, 1.0, 0.3), ("Oncoming", 25.0, 4.0, 3.0)):
        world.add(car(name), Placement(x, y, yaw=yaw))
    world.set_weather(load_weather("midnight"))
    cut = replace(PINHOLE, width=159, height=119, center_x=79.0, center_y=59.0)
    whole, part = (world.radiance(looking(0.0, x=2.0), pinhole).luminance for pinhole in (PINHOLE, cut))
    np.testing.assert_allclose(part, whole[1:, 1:], rtol=1e-5)


def test_wet_road_reflects_a_bright_wall(world: World) -> None:
    """At a low angle, the wet road is brighter than the dry one in front of a white wall, and darker elsewhere."""
    world.add_building("wall", (30.0, 0.0, 10.0), (2.0, 200.0, 20.0), color=(0.9, 0.1, 0.1))
    overcast = Weather(cloud_cover=1.0, visual_range=1e9)
    at = np.s_[66:72, 60:100]
    world.set_weather(overcast)
    dry = world.radiance(looking(0.0), PINHOLE).luminance[at].mean(axis=(0, 1))
    world.set_weather(overcast.model_copy(update={"wetness": 1.0}))
    wet = world.radiance(looking(0.0), PINHOLE).luminance[at].mean(axis=(0, 1))
    assert wet[0] / wet[1] > 1.5 * dry[0] / dry[1]


def test_ground_without_roads_surrounds_distant_cameras(world: World) -> None:
    near, distant = (world.radiance(looking(0.4, x=x, y=y), PINHOLE).depth for x, y in ((0.0, 0.0), (3e4, -8192.0)))
    assert np.isfinite(near[60:]).all()
    np.testing.assert_array_equal(distant, near)


def test_texture_of_the_ground_does_not_follow_the_camera(world: World) -> None:
    """Cameras 20 m above the ground and 1 m apart, with pixels of 0.05 m, see the same 2 x 1 m on both sides of x = 0.

    The ground is 0.06 m below the origin.
    """
    pinhole = Pinhole(40, 40, 400.0, 20.0, 20.0)
    right, left = (
        world.radiance(looking(math.pi / 2, 19.94, x=x, y=0.01, pitch=math.pi / 2), pinhole).luminance
        for x in (0.51, -0.49)
    )
    assert right[:, :20].std() > 0.02 * right.mean()
    np.testing.assert_allclose(left[:, 20:], right[:, :20], rtol=2e-3)


def test_puddles_have_the_period_of_their_table_around_the_origin() -> None:
    """The table has 12 values per meter and 512 in all: 128 m are three periods."""
    x, y = (np.arange(2, dtype=np.float32)[:, None] * 128.0 + np.arange(-64, 64) / 12.0 + 0.04 for _ in range(2))
    smoothness = puddles(x.astype(np.float32), y.astype(np.float32), 0.5, hollows())
    np.testing.assert_array_equal(smoothness[0], smoothness[1])


def test_sky_is_sampled_in_directions_of_ten_million_pixels() -> None:
    sky, level, up = dome(Weather()), np.zeros(10_000_000, np.float32), np.ones(10_000_000, np.float32)
    zenith = sky[SIZE // 2 - 1 : SIZE // 2 + 1, SIZE // 2 - 1 : SIZE // 2 + 1].mean(axis=(0, 1))
    np.testing.assert_allclose(sampled(sky, level, level, up)[-1], zenith, rtol=1e-5)


def test_depth_beyond_far_plane_is_infinite(world: World) -> None:
    seen = world.radiance(looking(0.0), Pinhole.of_fov(160, 120, math.radians(80), 0.1, 30.0))
    finite = np.isfinite(seen.depth)
    assert seen.depth[finite].max() <= 30.0
    assert not finite[:60].any()
    assert (seen.segmentation[~finite] == -1).all()


def test_radiance_is_deterministic(car: CarFactory) -> None:
    def take() -> bytes:
        with World(picture_maker=picture_maker) as world:
            world.add(car("A"), Placement(8.0, 1.0, yaw=0.4))
            world.set_weather(load_weather("storm"))
            return world.radiance(looking(0.0), PINHOLE).luminance.tobytes()

    assert take() == take()
