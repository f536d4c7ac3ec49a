"""Kernels of pixels against plain statements of their formulas, in 64 bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.rendering.lamps import _shine
from eidrive_scenario.rendering.projection import CameraView
from eidrive_scenario.rendering.rasterization import rasterize
from eidrive_scenario.rendering.shading import _add_grain, _attenuate, _illuminate, _mix, _reflect, label_pixels
from eidrive_scenario.rendering.shadows import Shadows, _darken
from eidrive_scenario.rendering.surfaces import _mirror
from eidrive_scenario.rendering.tone_mapping import tone_map
from eidrive_scenario.world.camera import Pinhole

COUNT = 500
DRAWS = np.random.default_rng(1)


def floats(low: float, high: float, *shape: int) -> np.ndarray:
    return DRAWS.uniform(low, high, shape).astype(np.float32)


def unit(vectors: np.ndarray) -> np.ndarray:
    lengths: np.ndarray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return lengths.astype(np.float32)


def test_places_of_pixels_are_on_their_rays_at_their_depth() -> None:
    pinhole = Pinhole.of_fov(40, 30, math.radians(70))
    turn = np.linalg.qr(DRAWS.normal(size=(3, 3)))[0]
    view = CameraView(np.block([[turn, np.ones((3, 1))], [np.zeros((1, 3)), 1.0]]), pinhole)
    pixels, nearness = DRAWS.integers(0, 1200, COUNT), floats(0.01, 1.0, 30, 40)
    depth = 1.0 / nearness.ravel()[pixels]
    x, y = pixels % 40 + 0.5 - pinhole.center_x, pixels // 40 + 0.5 - pinhole.center_y
    expected = turn @ np.stack([x / pinhole.focal, y / pinhole.focal, np.ones(COUNT)]) * depth
    places = view.places(pixels, nearness)
    np.testing.assert_allclose(places[:3], expected, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(places[3], np.linalg.norm(expected, axis=0), rtol=1e-5)
    np.testing.assert_allclose(view.directions(pixels), unit(expected.T).T, atol=1e-6)


def test_pixels_of_a_needle_are_between_its_corners_in_depth() -> None:
    """Triangles of a millionth of a pixel and less in width; about one in sixty contains the center of a pixel."""
    rng = np.random.default_rng(3)
    shares = rng.uniform(-1.0, 2.0, 20_000)
    for share in shares:
        begin, along = rng.uniform(0.0, 64.0, 2).round() / 2.0, rng.normal(size=2) * 10.0 ** rng.uniform(0.0, 4.0)
        bend = begin + share * along + rng.normal(size=2) * 10.0 ** rng.uniform(-16.0, -6.0)
        x, y = np.stack([begin, begin + along, bend], axis=1)[:, :, None]
        nearness = rng.uniform(0.01, 10.0, (3, 1))
        drawn = rasterize(x, y, nearness, 32, 32).nearness
        drawn = drawn[drawn > 0.0]
        assert (drawn <= 1.01 * nearness.max()).all()
        assert (drawn >= 0.99 * nearness.min()).all()


def test_share_of_the_sun_is_interpolated_between_lit_and_dark_cells() -> None:
    """Grid along x and y with 2 cells per meter; a cell is dark for points below its height."""
    heights = np.where(DRAWS.random((20, 30)) < 0.5, floats(-2.0, 2.0, 20, 30), np.float32(-np.inf))
    rows = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.25], [0, 0, 1, 0], [2, 2, 2, 2]], dtype=np.float32)
    places = np.stack([floats(-2.0, 17.0, COUNT), floats(-2.0, 12.0, COUNT), floats(-2.0, 2.0, COUNT)])
    share = Shadows(heights, rows).sun_share(places)
    for x, y, z, value in zip(*places.astype(float), share, strict=True):
        column, line = (x + 0.5) * 2.0 - 0.5, (y + 0.25) * 2.0 - 0.5
        expected = 1.0
        if 0.0 <= column < 29.0 and 0.0 <= line < 19.0:
            left, top = math.floor(column), math.floor(line)
            for row, height in ((top, 1.0 - line + top), (top + 1, line - top)):
                for cell, width in ((left, 1.0 - column + left), (left + 1, column - left)):
                    expected -= height * width * (heights[row, cell] > z)
        assert value == pytest.approx(expected, abs=1e-5)


def test_new_shadows_mark_points_between_higher_cells() -> None:
    before, rows = floats(0.0, 1.0, 20, 30), np.eye(4, dtype=np.float32)
    rows[3] = 1.0
    heights = before.copy()
    heights[5, 7] += 1.0
    places = np.array([[7.0, 6.6, 8.4, 8.6, 40.0], [5.0, 4.6, 6.4, 5.0, 5.0], [0.0, 0.0, 0.0, 0.0, 0.0]], np.float32)
    changed = np.zeros(5, dtype=bool)
    Shadows(heights, rows).mark_new(before, places, np.arange(5), changed)
    assert changed.tolist() == [True, True, True, False, False]


def test_ground_is_darkened_by_its_distance_from_a_body() -> None:
    """Half extents 2 m and 1 m: darkest up to 0.35 m inside the edge, then a parabola over 1.25 m."""
    places = np.zeros((4, 4), dtype=np.float32)
    places[:3] = [[1.0, 2.4, 4.0, 2.4], [0.0, 0.0, 0.0, 0.0], [0.1, 0.1, 0.1, 0.3]]
    share = np.ones(4, dtype=np.float32)
    _darken(np.arange(4), places, np.array([0, 0, 0, 2, 1, 1, 0], dtype=np.float32), share)
    rise = 0.75 / 1.25
    np.testing.assert_allclose(share, [0.12, 0.12 + 0.88 * rise * (2.0 - rise), 1.0, 1.0], rtol=1e-6)


def test_luminance_is_that_of_sky_and_sun_by_their_shares() -> None:
    triangle = DRAWS.integers(0, 9, COUNT).astype(np.int32)
    steady, sunny, open_sky, sun = floats(0, 9, 9, 3), floats(0, 9, 9, 3), floats(0, 1, COUNT), floats(0, 1, COUNT)
    luminance = np.empty((COUNT, 3), dtype=np.float32)
    _illuminate(triangle, steady, sunny, open_sky, sun, luminance)
    expected = steady[triangle] * open_sky[:, None] + sunny[triangle] * sun[:, None]
    np.testing.assert_array_equal(luminance, expected)


def test_grain_varies_luminance_by_two_tables() -> None:
    patches, grit, luminance = floats(-1, 1, 8, 8), floats(-1, 1, 8, 8), floats(1, 2, COUNT, 3)
    finish, places = DRAWS.integers(0, 2, COUNT).astype(np.uint8), floats(-20.0, 20.0, 4, COUNT)
    places[3] = np.abs(places[3])
    grain, wet, place = np.array([0.0, 0.5], np.float32), np.array([1.0, 0.7], np.float32), floats(0.0, 99.0, 2)
    expected = luminance.copy()
    for row in np.flatnonzero(finish):
        x, y, distance = places[0, row] + place[0], places[1, row] + place[1], places[3, row]
        wide = 0.35 * patches[math.floor(y * 4) % 8, math.floor(x * 4) % 8]
        fine = grit[math.floor(y * 24) % 8, math.floor(x * 24) % 8] * 4.0 / (6.0 + distance)
        expected[row] *= max((1.0 + 0.5 * (wide + fine)) * 0.7, 0.2)
    _add_grain(luminance, places, finish, grain, wet, place, patches, grit)
    np.testing.assert_allclose(luminance, expected, rtol=1e-6)


def test_reflected_rays_obey_the_laws_of_reflection_and_of_fresnel() -> None:
    rows, normal, away = np.arange(COUNT), unit(DRAWS.normal(size=(COUNT, 3))), unit(DRAWS.normal(size=(COUNT, 3)))
    away *= np.where((away * normal).sum(axis=1) > 0.0, -1, 1)[:, None].astype(np.float32)
    places = np.ascontiguousarray(np.vstack([away.T * np.float32(5.0), np.full((1, COUNT), 5.0, np.float32)]))
    mirror, sun = floats(0.02, 0.6, COUNT), unit(np.array([1.0, 2.0, 3.0]))
    rays, share = np.empty((4, COUNT), dtype=np.float32), np.empty(COUNT, dtype=np.float32)
    _reflect(rows, places, rows.astype(np.int32), normal, mirror, sun, rays, share)
    cosine = np.minimum((away * normal).sum(axis=1), -1e-3)
    np.testing.assert_allclose(rays[:3].T, away - 2.0 * cosine[:, None] * normal, atol=1e-5)
    np.testing.assert_allclose(rays[3], rays[:3].T @ sun, atol=1e-5)
    np.testing.assert_allclose(share, mirror + (1.0 - mirror) * (1.0 + cosine) ** 5, atol=1e-5)


def test_mirrored_light_replaces_a_share_of_the_own_one() -> None:
    own, sky, lobe = floats(0, 9, COUNT, 3), floats(0, 9, COUNT, 3), floats(0, 1, COUNT)
    mirror, share, upwards = floats(0, 1, COUNT), floats(0, 1, COUNT), floats(-1, 1, COUNT)
    below, sun, luminance = floats(0, 9, 3), floats(0, 9, 3), own.copy()
    _mix(np.arange(COUNT), luminance, mirror, share, upwards, below, sky, lobe, sun)
    rise = np.clip(upwards * 8.0 + 0.5, 0.0, 1.0)[:, None]
    seen = below * (1.0 - rise) + sky * rise + lobe[:, None] * sun
    hidden = np.minimum(mirror, 0.5)[:, None]
    np.testing.assert_allclose(luminance, own + (seen - own * hidden) * share[:, None], rtol=1e-4, atol=1e-4)


def test_air_attenuates_light_and_adds_its_own() -> None:
    luminance, through, air, image = floats(0, 9, 3, 3), floats(0, 1, 3), floats(0, 9, 3), np.zeros((5, 3), np.float32)
    _attenuate(luminance, through, air, np.array([4, 0, 2]), image)
    np.testing.assert_allclose(image[[4, 0, 2]], luminance * through[:, None] + air * (1 - through[:, None]), rtol=1e-5)
    assert not image[[1, 3]].any()


def test_pixels_beyond_the_maximum_distance_have_no_label() -> None:
    depth, label = np.zeros(3, dtype=np.float32), np.zeros(3, dtype=np.int32)
    triangle, nearness = np.array([1, 0, 1], dtype=np.int32), np.array([0.5, 0.01, 0.1], dtype=np.float32)
    label_pixels(np.arange(3), triangle, nearness, np.array([7, 8], np.int32), np.float32(50.0), depth, label)
    assert depth.tolist() == [2.0, math.inf, 10.0]
    assert label.tolist() == [8, -1, 8]


def test_mirror_in_the_ground_shows_the_nearest_point_upside_down() -> None:
    """Camera at a height of 1 m that looks along x: points at 10 m and 20 m appear below the horizon."""
    turn = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], dtype=np.float32)
    places = np.array([[20.0, 10.0, 10.0], [0.0, 0.0, 0.0], [6.0, 2.0, -1.0]], dtype=np.float32)
    light, image = np.eye(3, dtype=np.float32), np.zeros((40, 40, 3), dtype=np.float32)
    lens = np.array([20.0, 20.0, 20.0, -0.85, -2.0], dtype=np.float32)
    _mirror(light, places, lens, turn, np.zeros((40, 40), dtype=np.float32), image)
    assert np.argwhere(image).tolist() == [[28, 20, 1]]


@pytest.mark.parametrize("is_beside", [False, True])
def test_beam_lights_points_in_its_cone_by_intensity_distance_and_angle(is_beside: bool) -> None:
    """Lamp at (1, 2, 3) that shines along y with an intensity of 1 + 3 times the row of the vertical angle."""
    triangle, places = np.arange(COUNT, dtype=np.int32)[::-1].copy(), floats(-30.0, 30.0, 4, COUNT)
    frame = np.array([[1, 2, 3], [0, 1, 0], [-1, 0, 0], [0, 0, 1]], dtype=np.float32)
    normals, light = unit(DRAWS.normal(size=(COUNT, 3))), np.zeros((2, COUNT), dtype=np.float32)
    table = (1.0 + 3.0 * np.repeat(np.arange(481), 481)).astype(np.float32)
    _shine(triangle, places, normals, frame, table, np.float32(2.0), is_beside, light)
    for point, (x, y, z) in enumerate((places[:3].T - frame[0]).astype(float)):
        expected = [0.0, 0.0]
        if 0.3 < y < 70.0 and abs(x / y) < 1.2 and abs(z / y) < 0.6:
            square = x * x + y * y + z * z
            across = 2.0 * (1.0 + 3.0 * int((z / y + 0.6) * 400.0)) / square
            expected = [
                across * max(-normals[triangle[point]] @ (x, y, z) / math.sqrt(square), 0.0),
                across * is_beside,
            ]
        np.testing.assert_allclose(light[:, point], expected, rtol=1e-3, atol=1e-4)


def test_pixel_value_without_a_number_is_black() -> None:
    assert tone_map(np.full((1, 1, 3), np.nan, dtype=np.float32), 1.0).tolist() == [[[0, 0, 0]]]
