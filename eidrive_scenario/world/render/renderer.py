"""From instances, weather and a camera to the light in each of its pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.render import wet_road
from eidrive_scenario.world.render.camera_view import CameraView, runs
from eidrive_scenario.world.render.culling import cull_and_project
from eidrive_scenario.world.render.illumination.contact import dimmed
from eidrive_scenario.world.render.illumination.daylight import Daylight, daylight
from eidrive_scenario.world.render.illumination.lamplight import Lamplight, lamplight
from eidrive_scenario.world.render.illumination.lamps import Beam
from eidrive_scenario.world.render.illumination.shadows import ShadowGrid, ShadowMap, shadow_grid
from eidrive_scenario.world.render.illumination.sky import dome, horizon
from eidrive_scenario.world.render.materials import SOAKS
from eidrive_scenario.world.render.model import MeshInstance
from eidrive_scenario.world.render.rasterization import Cover, rasterize, rasterize_reference
from eidrive_scenario.world.render.shading import Lit, lit_surfaces, points_at, sampled, shade, together
from eidrive_scenario.world.weather import Weather

DAYLIGHT = 1000.0
"""Light on the ground under which headlamps add nothing to see [lx]."""
GLARE = 0.03
"""Share of light that a lens scatters around a bright spot."""
_AT_ONCE = 16_384
"""Pixels that are shaded at once: as many as a processor keeps near it."""


class Subjects(NamedTuple):
    """What there is to see: what lies on the ground, what stands on it and shades, actors, and such that are not seen,
    but shade."""

    ground: Sequence[MeshInstance]
    standing: Sequence[MeshInstance]
    actors: Sequence[MeshInstance]
    unseen: Sequence[MeshInstance] = ()

    @property
    def scenery(self) -> Sequence[MeshInstance]:
        """All but actors."""
        return (*self.ground, *self.standing)


class _Circumstances(NamedTuple):
    """What all pixels have in common."""

    eye: CameraView
    weather: Weather
    light: Daylight
    sky: Floats
    grid: ShadowGrid | None


class _Canvas(NamedTuple):
    """Of all pixels: light (3, P) [cd/m²], depth (P,) [m], label (P,)."""

    planes: Floats
    depth: Floats
    label: NDArray[np.int32]

    @classmethod
    def blank(cls, pixels: int) -> _Canvas:
        """Nothing drawn, nothing lit."""
        empty = np.empty((3, pixels), dtype=np.float32)
        return cls(empty, np.full(pixels, np.inf, dtype=np.float32), np.full(pixels, -1, dtype=np.int32))

    def copy(self) -> _Canvas:
        """Return one to draw on."""
        return _Canvas(self.planes.copy(), self.depth.copy(), self.label.copy())


class _Kept(NamedTuple):
    """The scenery in front of a camera that stands still.

    cover and lit of it; canvas of the picture without actors, in daylight on dry roads; heights of what shades, and the
    cells of the sun's grid where the pixels' points lie
    """

    cover: Cover
    lit: Lit
    canvas: _Canvas
    heights: Floats | None
    cells: NDArray[np.int32] | None


class Renderer:
    """Draws pictures. Of cameras that stand still it keeps the scenery, and draws anew what actors change: the picture
    is the same, bit by bit."""

    MOST_KEPT = 24
    """Cameras of which the scenery is kept; a picture of 800 x 600 pixels takes 13 MB."""
    MOST_SHOWN = 400
    """Of so many pictures it is known what they showed, lest those of moving cameras hide that one stands still."""

    def __init__(self) -> None:
        self._shown: dict[object, None] = {}
        """What earlier pictures showed, each from a place of its own."""
        self._kept: dict[object, _Kept] = {}

    def render(
        self,
        subjects: Subjects,
        beams: Sequence[Beam],
        weather: Weather,
        pose: Array,
        pinhole: Pinhole,
        ground: float,
    ) -> Radiance:
        """The light that reaches a camera at `pose`; `ground` is the height of the road below it, where it mirrors [m].

        Scenery is kept from the second picture on that shows the same.
        """
        light = daylight(weather)
        eye = CameraView(pose, pinhole)
        grid = shadow_grid(light.towards, eye) if light.sun.any() else None
        at = _Circumstances(eye, weather, light, dome(weather), grid)
        felt = beams if float(light.ground.max()) < DAYLIGHT else ()
        known = self._known(subjects, at) if self.MOST_KEPT > 0 else None
        canvas = _whole(subjects, felt, at, ground) if known is None else _renewed(known, subjects, felt, at, ground)
        planes = [plane.reshape(eye.shape) for plane in canvas.planes]
        whole: Floats = np.asarray(cv2.merge(planes), dtype=np.float32)
        if weather.lamps_on:
            whole = _with_glare(whole)
        return Radiance(whole, canvas.depth.reshape(eye.shape), canvas.label.reshape(eye.shape))

    def _known(self, subjects: Subjects, at: _Circumstances) -> _Kept | None:
        """Return the scenery of a picture, if the one before from there showed the same."""
        looks = tuple(
            (each.model, each.position.tobytes(), each.label, tuple(each.glow.items())) for each in subjects.scenery
        )
        key = (at.eye.pose.tobytes(), at.eye.pinhole, at.weather, looks)
        found = self._kept.pop(key, None)
        if found is None:
            if key not in self._shown:
                self._shown[key] = None
                _forget_first(self._shown, self.MOST_SHOWN)
                return None
            found = _scenery(subjects, at)
        self._kept[key] = found
        _forget_first(self._kept, self.MOST_KEPT)
        return found


def _forget_first(memory: dict[object, Any], most: int) -> None:
    while len(memory) > most:
        del memory[next(iter(memory))]


def _whole(subjects: Subjects, beams: Sequence[Beam], at: _Circumstances, ground: float) -> _Canvas:
    """Return the picture, all drawn anew."""
    staged = cull_and_project([*subjects.scenery, *subjects.actors], at.eye.pose, at.eye.pinhole)
    cover = rasterize(staged.x, staged.y, staged.nearness, at.eye.pinhole.width, at.eye.pinhole.height)
    lit = lit_surfaces(staged.surfaces, at.light, at.weather)
    casters = [*subjects.standing, *subjects.actors, *subjects.unseen]
    shadows = at.grid.drawn(casters) if at.grid is not None else None
    open_sky = dimmed(_dimming(subjects), cover, lit.upright, at.eye)
    canvas = _Canvas.blank(cover.triangle.size)
    _draw(canvas, cover, lit, shadows, open_sky, beams, at, ground)
    return canvas


def _dimming(subjects: Subjects) -> list[MeshInstance]:
    return [each for each in (*subjects.standing, *subjects.actors) if each.label >= 0]


def _draw(
    canvas: _Canvas,
    cover: Cover,
    lit: Lit,
    shadows: ShadowMap | None,
    open_sky: Floats,
    beams: Sequence[Beam],
    at: _Circumstances,
    ground: float,
) -> None:
    """Draw all pixels."""
    triangle = cover.triangle.reshape(-1)
    for part in runs(np.flatnonzero(triangle < 0), _AT_ONCE):
        canvas.planes[:, part] = sampled(at.sky, *at.eye.directions(part))
    shown = np.flatnonzero(triangle >= 0)
    lamps = lamplight(beams, cover, lit.surfaces, at.eye) if beams else None
    if at.weather.wetness <= 0.0:
        _paint(canvas, shown, cover, lit, shadows, open_sky, lamps, at)
        return
    _paint(canvas, shown, cover, lit, shadows, open_sky, lamps, at, fog=False)
    on_road = shown[SOAKS[lit.surfaces.finish][triangle[shown]]]
    wet_road.add_reflections(canvas.planes, on_road, cover, open_sky, at.sky, at.eye, at.weather.wetness, ground)
    for part in runs(shown, _AT_ONCE):
        distance = at.eye.length[part] * (np.float32(1.0) / cover.nearness.reshape(-1)[part])
        canvas.planes[:, part] = _through_air(canvas.planes[:, part], distance, at.weather)


def _paint(
    canvas: _Canvas,
    pixels: NDArray[np.intp],
    cover: Cover,
    lit: Lit,
    shadows: ShadowMap | None,
    open_sky: Floats,
    lamps: Lamplight | None,
    at: _Circumstances,
    fog: bool = True,
) -> None:
    """Draw pixels that show something, each by itself."""
    for part in runs(pixels, _AT_ONCE):
        points = points_at(part, cover, at.eye)
        shone = None if lamps is None else Lamplight(lamps.received[part], lamps.across[part])
        sky_left = open_sky.reshape(-1)[part]
        luminance = shade(points, lit, at.eye.place, at.light, at.weather, at.sky, shadows, shone, sky_left)
        canvas.planes[:, part] = _through_air(luminance, points.distance, at.weather) if fog else luminance
        label = lit.surfaces.label.take(points.triangle)
        beyond = np.flatnonzero(points.depth > at.eye.pinhole.far)
        points.depth[beyond], label[beyond] = np.inf, -1
        canvas.depth[part], canvas.label[part] = points.depth, label


def _through_air(luminance: Floats, distance: Floats, weather: Weather) -> Floats:
    """What is left of light (3, n) over a distance, and what the air adds."""
    through = np.exp(np.float32(-weather.extinction) * distance)
    air = horizon(weather).astype(np.float32)[:, None]
    found: Floats = luminance - air
    found *= through
    found += air
    return found


def _scenery(subjects: Subjects, at: _Circumstances) -> _Kept:
    """Return the picture without actors, and what is needed to draw them into it."""
    eye = at.eye
    staged = cull_and_project(subjects.scenery, eye.pose, eye.pinhole)
    cover = rasterize(staged.x, staged.y, staged.nearness, eye.pinhole.width, eye.pinhole.height)
    lit = lit_surfaces(staged.surfaces, at.light, at.weather)
    canvas = _Canvas.blank(cover.triangle.size)
    heights = cells = still = None
    if at.grid is not None:
        still = at.grid.drawn(subjects.standing)
        heights = np.full((at.grid.height, at.grid.width), np.float32(-np.inf))
        heights[still.window] = still.heights
        cells = np.full(cover.triangle.size, -1, dtype=np.int32)
        for part in runs(np.flatnonzero(cover.triangle.reshape(-1) >= 0), _AT_ONCE):
            points = points_at(part, cover, eye)
            cells[part] = at.grid.numbers(points.x, points.y, points.z)
    _draw(canvas, cover, lit, still, np.ones(eye.shape, dtype=np.float32), (), at, 0.0)
    return _Kept(cover, lit, canvas, heights, cells)


def _renewed(known: _Kept, subjects: Subjects, beams: Sequence[Beam], at: _Circumstances, ground: float) -> _Canvas:
    """The picture, drawn anew where actors are, shade or dim; and all of it where light comes from neighbors too."""
    eye = at.eye
    staged = cull_and_project(subjects.actors, eye.pose, eye.pinhole)
    seen = rasterize_reference(staged.x, staged.y, staged.nearness, eye.pinhole.width, eye.pinhole.height)
    lit = together(known.lit, lit_surfaces(staged.surfaces, at.light, at.weather))
    triangle, nearness = known.cover.triangle.copy(), known.cover.nearness.copy()
    before = (seen.triangle >= 0) & (seen.nearness >= nearness[seen.window])
    np.copyto(triangle[seen.window], seen.triangle + np.int32(len(known.lit.upright)), where=before)
    np.copyto(nearness[seen.window], seen.nearness, where=before)
    cover = Cover(triangle, nearness)
    open_sky = dimmed(_dimming(subjects), cover, lit.upright, eye)
    changed = open_sky < 1.0
    changed[seen.window] |= before
    shadows = None
    if at.grid is not None and known.heights is not None and known.cells is not None:
        shadows, cells = at.grid.drawn([*subjects.actors, *subjects.unseen]).over(known.heights)
        changed |= cells[known.cells].reshape(eye.shape)
    if beams or at.weather.wetness > 0.0:
        canvas = _Canvas.blank(triangle.size)
        _draw(canvas, cover, lit, shadows, open_sky, beams, at, ground)
        return canvas
    canvas = known.canvas.copy()
    _paint(canvas, np.flatnonzero(changed), cover, lit, shadows, open_sky, None, at)
    return canvas


def _with_glare(picture: Floats) -> Floats:
    """Bright lamps bleed into their surroundings."""
    height, width = picture.shape[:2]
    small = cv2.resize(picture, (max(width // 4, 1), max(height // 4, 1)), interpolation=cv2.INTER_AREA)
    spread = cv2.GaussianBlur(small, (0, 0), max(width / 4 / 50.0, 0.8)) * 0.7
    spread += cv2.GaussianBlur(small, (0, 0), max(width / 4 / 14.0, 1.5)) * 0.3
    wide = cv2.resize(spread, (width, height), interpolation=cv2.INTER_LINEAR)
    found: Floats = np.asarray(picture * np.float32(1.0 - GLARE) + wide * np.float32(GLARE), dtype=np.float32)
    return found
