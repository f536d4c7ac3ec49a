"""From instances, weather and a camera to the light in each of its pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.render import wet_road
from eidrive_scenario.world.render.contact import Ground, dimmed
from eidrive_scenario.world.render.daylight import daylight
from eidrive_scenario.world.render.lamps import Beam, numbered
from eidrive_scenario.world.render.materials import SOAKS
from eidrive_scenario.world.render.model import Array, Floats, Instance
from eidrive_scenario.world.render.rasterise import rasterise
from eidrive_scenario.world.render.shading import Points, shade
from eidrive_scenario.world.render.shadows import shadow_map
from eidrive_scenario.world.render.sky import dome, horizon, sample
from eidrive_scenario.world.render.staging import Stage, Surfaces, stage
from eidrive_scenario.world.render.surfaces import hollows
from eidrive_scenario.world.weather import Weather

DAYLIGHT = 1000.0
"""Light on the ground under which headlamps add nothing to see [lx]."""
GLARE = 0.03
"""Share of light that a lens scatters around a bright spot."""


def render(
    instances: Sequence[Instance],
    casters: Sequence[Instance],
    beams: Sequence[Beam],
    weather: Weather,
    pose: Array,
    pinhole: Pinhole,
    ground: float,
) -> Radiance:
    """The light that reaches a camera at `pose`; `ground` is the height of the road below it, where it mirrors [m]."""
    staged = stage(instances, pose, pinhole)
    cover = rasterise(staged.x, staged.y, staged.nearness, pinhole.width, pinhole.height)
    light, heaven = daylight(weather), dome(weather)
    eye = pose[:3, 3]
    rx, ry, rz, length = _rays(pinhole, pose)
    rays = (rx / length, ry / length, rz / length)
    shape = (pinhole.height, pinhole.width)
    picture = [np.ravel(plane) for plane in cv2.split(sample(heaven, *(part.reshape(shape) for part in rays)))]
    shown = np.flatnonzero(cover.triangle >= 0)
    depth = np.full(len(cover.triangle), np.inf, dtype=np.float32)
    label = np.full(len(cover.triangle), -1, dtype=np.int32)
    if len(shown):
        far = np.float32(1.0) / cover.nearness[shown]
        triangle, surfaces = _seen_surfaces(staged, cover.triangle[shown])
        points = Points(
            triangle,
            rx[shown] * far,
            ry[shown] * far,
            rz[shown] * far,
            (rays[0][shown], rays[1][shown], rays[2][shown]),
            length[shown] * far,
            numbered((cover.triangle >= 0).reshape(shape)),
        )
        shadows = shadow_map(casters, light.towards, pose, pinhole) if light.sun.any() else None
        upright = surfaces.normal[2][triangle] > 0.9
        ground_points = Ground(points.x, points.y, points.z, upright, points.where)
        open_sky = dimmed([each for each in instances if each.label >= 0], ground_points, pose, pinhole)
        felt = beams if float(light.ground.max()) < DAYLIGHT else ()
        luminance = shade(points, surfaces, eye, light, weather, heaven, shadows, felt, open_sky)
        if weather.wetness > 0.0:
            _wet(luminance, shown, points, surfaces.finish, open_sky, weather, pose, pinhole, ground)
        through = np.exp(np.float32(-weather.extinction) * points.distance)
        for plane, own, air in zip(picture, luminance, horizon(weather).tolist(), strict=True):
            plane[shown] = (own - np.float32(air)) * through + np.float32(air)
        near = np.flatnonzero(far <= pinhole.far)
        depth[shown[near]] = far[near]
        label[shown[near]] = surfaces.label[triangle[near]]
    whole: Floats = np.asarray(cv2.merge([plane.reshape(shape) for plane in picture]), dtype=np.float32)
    if weather.lamps_on:
        whole = _with_glare(whole)
    return Radiance(whole, depth.reshape(shape), label.reshape(shape))


def _seen_surfaces(staged: Stage, triangle: NDArray[np.int32]) -> tuple[NDArray[np.int32], Surfaces]:
    """The triangles that the picture shows, and their numbers among these."""
    marks = np.zeros(staged.x.shape[1], dtype=bool)
    marks[triangle] = True
    seen = np.flatnonzero(marks)
    number = np.empty(len(marks), dtype=np.int32)
    number[seen] = np.arange(len(seen), dtype=np.int32)
    return number[triangle], staged.surfaces(seen)


@lru_cache(maxsize=32)
def _own_rays(pinhole: Pinhole) -> tuple[Floats, Floats, Floats]:
    """x, y (H · W,) at depth 1 in the camera's frame, and the length of each ray there."""
    columns = (np.arange(pinhole.width) + 0.5 - pinhole.centre_x) / pinhole.focal
    rows = (np.arange(pinhole.height) + 0.5 - pinhole.centre_y) / pinhole.focal
    x, y = (grid.ravel().astype(np.float32) for grid in np.meshgrid(columns, rows))
    return x, y, np.sqrt(x * x + y * y + np.float32(1.0))


def _rays(pinhole: Pinhole, pose: Array) -> tuple[Floats, Floats, Floats, Floats]:
    """The rays through the pixels in the world's axes, at depth 1, and their lengths."""
    x, y, length = _own_rays(pinhole)
    turn = pose[:3, :3].astype(np.float32)
    rx, ry, rz = (turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2] for axis in range(3))
    return rx, ry, rz, length


def _wet(
    luminance: Floats,
    shown: NDArray[np.int64],
    points: Points,
    finish: NDArray[np.uint8],
    open_sky: Floats,
    weather: Weather,
    pose: Array,
    pinhole: Pinhole,
    ground: float,
) -> None:
    """Add to luminance (3, n) what a wet road mirrors, from a picture of half as many lines and columns."""
    on_road = np.flatnonzero(SOAKS[finish[points.triangle]])
    if not len(on_road):
        return
    shape = (pinhole.height, pinhole.width)
    some = points.where[::2, ::2]
    small = replace(pinhole.finer(0.5), width=some.shape[1], height=some.shape[0])
    rx, ry, rz, length = (part.reshape(shape)[::2, ::2] for part in _rays(pinhole, pose))
    sky = sample(dome(weather), rx / length, ry / length, np.abs(rz / length))
    rows = some[some >= 0]
    places = (points.x[rows], points.y[rows], points.z[rows])
    image = wet_road.mirrored(luminance[:, rows], places, sky, ground - float(pose[2, 3]), pose, small)
    image = np.asarray(cv2.resize(wet_road.blurred(image), shape[::-1], interpolation=cv2.INTER_LINEAR))
    x, y = points.x[on_road] + np.float32(pose[0, 3] % 4096.0), points.y[on_road] + np.float32(pose[1, 3] % 4096.0)
    share = wet_road.reflectance(np.abs(points.ray[2][on_road]))
    share *= wet_road.puddles(x, y, weather.wetness, hollows())
    dim = open_sky[on_road]
    for own, plane in zip(luminance, cv2.split(image), strict=True):
        before = own[on_road]
        own[on_road] = before + share * (np.ravel(plane)[shown[on_road]] * dim - before)


def _with_glare(picture: Floats) -> Floats:
    """Bright lamps bleed into their surroundings."""
    height, width = picture.shape[:2]
    small = cv2.resize(picture, (max(width // 4, 1), max(height // 4, 1)), interpolation=cv2.INTER_AREA)
    spread = cv2.GaussianBlur(small, (0, 0), max(width / 4 / 50.0, 0.8)) * 0.7
    spread += cv2.GaussianBlur(small, (0, 0), max(width / 4 / 14.0, 1.5)) * 0.3
    wide = cv2.resize(spread, (width, height), interpolation=cv2.INTER_LINEAR)
    found: Floats = np.asarray(picture * np.float32(1.0 - GLARE) + wide * np.float32(GLARE), dtype=np.float32)
    return found
