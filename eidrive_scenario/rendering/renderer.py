"""Renderer from instances, weather and a camera to the light in each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers
from eidrive_scenario.rendering.daylight import daylight, dome
from eidrive_scenario.rendering.lamps import Beam, Lamp
from eidrive_scenario.rendering.materials import SOAKS
from eidrive_scenario.rendering.model import MeshInstance
from eidrive_scenario.rendering.projection import CameraView, cull_and_project
from eidrive_scenario.rendering.rasterization import Cover, rasterize
from eidrive_scenario.rendering.shading import (
    Circumstances,
    Lit,
    draw_pixels,
    draw_through_air,
    label_pixels,
    lit_surfaces,
    sampled,
    shade,
    together,
)
from eidrive_scenario.rendering.shadows import Shadows, dimmed, shadow_grid
from eidrive_scenario.rendering.surfaces import LEVEL, RoadPlane, add_reflections
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.weather import Weather

DAYLIGHT = 1000.0
"""Illuminance of the ground below which headlamps are drawn [lx]."""
GLARE = 0.03
"""Share of light that the lens scatters around bright spots."""
_AT_ONCE = 16_384
"""Number of pixels that are shaded in one pass, chosen by the processor cache."""


class Subjects(NamedTuple):
    """Subjects of an image: ground, scenery that casts shadows, actors, hidden actors that cast shadows, and decks of
    bridges, which only cast shadows.
    """

    ground: Sequence[MeshInstance]
    standing: Sequence[MeshInstance]
    actors: Sequence[MeshInstance]
    unseen: Sequence[MeshInstance] = ()
    decks: Sequence[MeshInstance] = ()

    @property
    def scenery(self) -> Sequence[MeshInstance]:
        """All instances except actors."""
        return (*self.ground, *self.standing)


class ImageContent(NamedTuple):
    """Inputs that determine the light in the pixels of an image.

    pose    (4, 4) camera to world, x right, y down, z forward
    ground  plane of the road below the camera, for reflections
    relief  heights of the lowest and the highest road within reach of the shadows [m]
    """

    subjects: Subjects
    beams: Sequence[Beam]
    weather: Weather
    pose: Array
    pinhole: Pinhole
    ground: RoadPlane
    relief: tuple[float, float]


class _Visible(NamedTuple):
    """Visible triangles, their light, the shadows of the sun, and the share (H, W) of sky light that bodies leave."""

    cover: Cover
    lit: Lit
    shadows: Shadows
    open_sky: Floats


class _Canvas(NamedTuple):
    """Light (P, 3) [cd/m²], depth (P,) [m] and label (P,) of all pixels."""

    light: Floats
    depth: Floats
    label: NDArray[np.int32]

    @classmethod
    def blank(cls, pixels: int) -> _Canvas:
        """Return a black canvas."""
        empty = np.empty((pixels, 3), dtype=np.float32)
        return cls(empty, np.full(pixels, np.inf, dtype=np.float32), np.full(pixels, -1, dtype=np.int32))


class _Kept(NamedTuple):
    """Cached scenery of a stationary camera.

    cover, lit  visible triangles and their light
    canvas      image without actors, in daylight on dry roads
    heights     of the shadows of scenery, None without a sun that casts shadows
    """

    cover: Cover
    lit: Lit
    canvas: _Canvas
    heights: Floats | None


class Renderer:
    """Renderer with a cache of the scenery of stationary cameras. The image is bit by bit the same as without the
    cache.
    """

    MOST_KEPT = 24
    """Maximum number of cameras with cached scenery; an image of 800 x 600 pixels takes 13 MB."""
    MOST_SHOWN = 400
    """Maximum number of stored keys of previous images, by which stationary cameras are recognized among moving ones.
    """

    def __init__(self) -> None:
        self._shown: dict[object, None] = {}
        """Keys of previous images."""
        self._kept: dict[object, _Kept] = {}

    def render(self, content: ImageContent) -> Radiance:
        """Return the light that reaches a camera.

        Scenery is cached from the second image with the same scenery on.
        """
        subjects, beams, weather, pose, pinhole, ground, relief = content
        light = daylight(weather)
        view = CameraView(pose, pinhole)
        grid = shadow_grid(light.towards, view, *relief) if light.sun.any() else None
        at = Circumstances(view, weather, light, dome(weather), grid)
        felt = beams if float(light.ground.max()) < DAYLIGHT else ()
        cached = self._cached(subjects, at) if self.MOST_KEPT > 0 else None
        canvas = _whole(subjects, felt, at, ground) if cached is None else _renewed(cached, subjects, felt, at, ground)
        whole = canvas.light.reshape(*view.shape, 3)
        if weather.lamps_on:
            whole = _with_glare(whole)
        return Radiance(whole, canvas.depth.reshape(view.shape), canvas.label.reshape(view.shape))

    def _cached(self, subjects: Subjects, at: Circumstances) -> _Kept | None:
        """Return the cached scenery if the previous image of this camera had the same content."""
        looks = tuple(
            (each.model, each.position.tobytes(), each.label, tuple(each.glow.items())) for each in subjects.scenery
        )
        key = (at.view.pose.tobytes(), at.view.pinhole, at.weather, looks)
        scenery = self._kept.pop(key, None)
        if scenery is None:
            if key not in self._shown:
                self._shown[key] = None
                _forget_first(self._shown, self.MOST_SHOWN)
                return None
            scenery = _scenery(subjects, at)
        self._kept[key] = scenery
        _forget_first(self._kept, self.MOST_KEPT)
        return scenery


def _forget_first(memory: dict[object, Any], most: int) -> None:
    while len(memory) > most:
        del memory[next(iter(memory))]


def _whole(subjects: Subjects, beams: Sequence[Beam], at: Circumstances, ground: RoadPlane) -> _Canvas:
    """Return a completely drawn image."""
    cover, lit = _staged([*subjects.scenery, *subjects.actors], at)
    casters = [*subjects.standing, *subjects.decks, *subjects.actors, *subjects.unseen]
    shadows = Shadows.of(at.grid, at.grid.drawn(casters) if at.grid is not None else None)
    open_sky = dimmed(_dimming(subjects), cover, lit.upright, at.view)
    canvas = _Canvas.blank(cover.triangle.size)
    _draw(canvas, _Visible(cover, lit, shadows, open_sky), beams, at, ground)
    return canvas


def _staged(instances: Sequence[MeshInstance], at: Circumstances) -> tuple[Cover, Lit]:
    """Return the visible triangles of instances, and the light of all that face the camera."""
    staged = cull_and_project(instances, at.view.pose, at.view.pinhole)
    cover = rasterize(staged.x, staged.y, staged.nearness, at.view.pinhole.width, at.view.pinhole.height)
    return cover, lit_surfaces(staged.surfaces, at.light, at.weather)


def _dimming(subjects: Subjects) -> list[MeshInstance]:
    return [each for each in (*subjects.standing, *subjects.actors) if each.label >= 0]


def _draw(canvas: _Canvas, visible: _Visible, beams: Sequence[Beam], at: Circumstances, ground: RoadPlane) -> None:
    """Draw all pixels."""
    cover, surfaces = visible.cover, visible.lit.surfaces
    triangle = cover.triangle.ravel()
    above = np.flatnonzero(triangle < 0)
    draw_pixels(canvas.light, above, sampled(at.sky, *at.view.directions(above)))
    shown = np.flatnonzero(triangle >= 0)
    lamps = [Lamp.of(beam, at.view) for beam in beams]
    is_dry = at.weather.wetness <= 0.0
    _paint(canvas, shown, visible, lamps, at, fog=is_dry)
    if is_dry:
        return
    on_road = shown[SOAKS[surfaces.finish][triangle[shown]]]
    add_reflections(
        canvas.light, on_road, cover, at.view,
        open_sky=visible.open_sky, dome=at.sky, wetness=at.weather.wetness, ground=ground,
    )  # fmt: skip
    distance = at.view.places(shown, cover.nearness)[3]
    draw_through_air(canvas.light, shown, canvas.light[shown], distance, at.weather)


def _paint(
    canvas: _Canvas,
    pixels: Integers,
    visible: _Visible,
    lamps: Sequence[Lamp],
    at: Circumstances,
    *,
    fog: bool = True,
) -> None:
    """Draw pixels with a triangle, each independently."""
    cover, lit = visible.cover, visible.lit
    for start in range(0, len(pixels), _AT_ONCE):
        part = pixels[start : start + _AT_ONCE]
        triangle, places = cover.triangle.ravel()[part], at.view.places(part, cover.nearness)
        luminance = shade(triangle, places, lit, at, visible.shadows, lamps, visible.open_sky.ravel()[part])
        draw_through_air(canvas.light, part, luminance, places[3], at.weather if fog else None)
    far = np.float32(at.view.pinhole.far)
    label_pixels(
        pixels, cover.triangle.ravel(), cover.nearness.ravel(), lit.surfaces.label, far, canvas.depth, canvas.label
    )


def _scenery(subjects: Subjects, at: Circumstances) -> _Kept:
    """Return the image without actors, and the data that is needed to draw them."""
    cover, lit = _staged(subjects.scenery, at)
    canvas = _Canvas.blank(cover.triangle.size)
    heights = at.grid.drawn([*subjects.standing, *subjects.decks]) if at.grid is not None else None
    open_sky = np.ones(at.view.shape, dtype=np.float32)
    _draw(canvas, _Visible(cover, lit, Shadows.of(at.grid, heights), open_sky), (), at, LEVEL)
    return _Kept(cover, lit, canvas, heights)


def _renewed(cached: _Kept, subjects: Subjects, beams: Sequence[Beam], at: Circumstances, ground: RoadPlane) -> _Canvas:
    """Return the image, redrawn in areas of actors and their shadows, or completely if neighbors emit light too."""
    view = at.view
    staged = cull_and_project(subjects.actors, view.pose, view.pinhole)
    lit = together(cached.lit, lit_surfaces(staged.surfaces, at.light, at.weather))
    cover, first = Cover(cached.cover.triangle.copy(), cached.cover.nearness.copy()), len(cached.lit.surfaces.finish)
    cover.draw(staged.x, staged.y, staged.nearness, first)
    open_sky = dimmed(_dimming(subjects), cover, lit.upright, view)
    changed = ((open_sky < 1.0) | (cover.triangle >= first)).ravel()
    heights = None
    if at.grid is not None and cached.heights is not None:
        heights = at.grid.drawn([*subjects.actors, *subjects.unseen], cached.heights)
    shadows = Shadows.of(at.grid, heights)
    if cached.heights is not None:
        unchanged = np.flatnonzero(~changed & (cached.cover.triangle.ravel() >= 0))
        shadows.mark_new(cached.heights, view.places(unchanged, cached.cover.nearness), unchanged, changed)
    visible = _Visible(cover, lit, shadows, open_sky)
    if beams or at.weather.wetness > 0.0:
        canvas = _Canvas.blank(changed.size)
        _draw(canvas, visible, beams, at, ground)
        return canvas
    canvas = _Canvas._make(values.copy() for values in cached.canvas)
    _paint(canvas, np.flatnonzero(changed), visible, (), at)
    return canvas


def _with_glare(image: Floats) -> Floats:
    """Return the image with light of bright lamps scattered into their surroundings."""

    import cv2

    height, width = image.shape[:2]
    small = cv2.resize(image, (max(width // 4, 1), max(height // 4, 1)), interpolation=cv2.INTER_AREA)
    spread = cv2.GaussianBlur(small, (0, 0), max(width / 4 / 50.0, 0.8)) * 0.7
    spread += cv2.GaussianBlur(small, (0, 0), max(width / 4 / 14.0, 1.5)) * 0.3
    wide = cv2.resize(spread, (width, height), interpolation=cv2.INTER_LINEAR)
    scattered: Floats = np.asarray(image * np.float32(1.0 - GLARE) + wide * np.float32(GLARE), dtype=np.float32)
    return scattered
