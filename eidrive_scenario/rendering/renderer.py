"""Renderer from instances, weather and a camera to the light in each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.rendering.daylight import daylight, dome, horizon
from eidrive_scenario.rendering.lamps import Beam, Lamplight, lamplight
from eidrive_scenario.rendering.materials import SOAKS
from eidrive_scenario.rendering.model import MeshInstance
from eidrive_scenario.rendering.projection import CameraView, cull_and_project, runs
from eidrive_scenario.rendering.rasterization import Cover, rasterize, rasterize_reference
from eidrive_scenario.rendering.shading import Circumstances, Lit, lit_surfaces, points_at, sampled, shade, together
from eidrive_scenario.rendering.shadows import ShadowMap, dimmed, shadow_grid
from eidrive_scenario.rendering.surfaces import add_reflections
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.weather import Weather

DAYLIGHT = 1000.0
"""Illuminance of the ground below which headlamps are drawn [lx]."""
GLARE = 0.03
"""Share of light that the lens scatters around bright spots."""
_AT_ONCE = 16_384
"""Number of pixels that are shaded in one pass, chosen by the processor cache."""


class Subjects(NamedTuple):
    """Subjects of an image: ground, scenery that casts shadows, actors, and hidden actors that cast shadows."""

    ground: Sequence[MeshInstance]
    standing: Sequence[MeshInstance]
    actors: Sequence[MeshInstance]
    unseen: Sequence[MeshInstance] = ()

    @property
    def scenery(self) -> Sequence[MeshInstance]:
        """All instances except actors."""
        return (*self.ground, *self.standing)


class ImageContent(NamedTuple):
    """Inputs that determine the light in the pixels of an image.

    pose    (4, 4) camera to world, x right, y down, z forward
    ground  height of the road below the camera, for reflections [m]
    """

    subjects: Subjects
    beams: Sequence[Beam]
    weather: Weather
    pose: Array
    pinhole: Pinhole
    ground: float


class _Visible(NamedTuple):
    """Visible triangles, their light, the shadows of the sun, and the share (H, W) of sky light that bodies leave."""

    cover: Cover
    lit: Lit
    shadows: ShadowMap | None
    open_sky: Floats


class _Canvas(NamedTuple):
    """Light (3, P) [cd/m²], depth (P,) [m] and label (P,) of all pixels."""

    planes: Floats
    depth: Floats
    label: NDArray[np.int32]

    @classmethod
    def blank(cls, pixels: int) -> _Canvas:
        """Return a black canvas."""
        empty = np.empty((3, pixels), dtype=np.float32)
        return cls(empty, np.full(pixels, np.inf, dtype=np.float32), np.full(pixels, -1, dtype=np.int32))


class _Kept(NamedTuple):
    """Cached scenery of a stationary camera.

    cover, lit  visible triangles and their light
    canvas      image without actors, in daylight on dry roads
    heights     shadow heights of scenery, and the cells of the shadow grid of the pixels
    """

    cover: Cover
    lit: Lit
    canvas: _Canvas
    heights: Floats | None
    cells: NDArray[np.int32] | None


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
        import cv2

        subjects, beams, weather, pose, pinhole, ground = content
        light = daylight(weather)
        view = CameraView(pose, pinhole)
        grid = shadow_grid(light.towards, view) if light.sun.any() else None
        at = Circumstances(view, weather, light, dome(weather), grid)
        felt = beams if float(light.ground.max()) < DAYLIGHT else ()
        known = self._known(subjects, at) if self.MOST_KEPT > 0 else None
        canvas = _whole(subjects, felt, at, ground) if known is None else _renewed(known, subjects, felt, at, ground)
        planes = [plane.reshape(view.shape) for plane in canvas.planes]
        whole: Floats = np.asarray(cv2.merge(planes), dtype=np.float32)
        if weather.lamps_on:
            whole = _with_glare(whole)
        return Radiance(whole, canvas.depth.reshape(view.shape), canvas.label.reshape(view.shape))

    def _known(self, subjects: Subjects, at: Circumstances) -> _Kept | None:
        """Return the cached scenery if the previous image of this camera had the same content."""
        looks = tuple(
            (each.model, each.position.tobytes(), each.label, tuple(each.glow.items())) for each in subjects.scenery
        )
        key = (at.view.pose.tobytes(), at.view.pinhole, at.weather, looks)
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


def _whole(subjects: Subjects, beams: Sequence[Beam], at: Circumstances, ground: float) -> _Canvas:
    """Return a completely drawn image."""
    cover, lit = _staged([*subjects.scenery, *subjects.actors], at)
    casters = [*subjects.standing, *subjects.actors, *subjects.unseen]
    shadows = at.grid.drawn(casters) if at.grid is not None else None
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


def _draw(canvas: _Canvas, visible: _Visible, beams: Sequence[Beam], at: Circumstances, ground: float) -> None:
    """Draw all pixels."""
    cover, surfaces = visible.cover, visible.lit.surfaces
    triangle = cover.triangle.reshape(-1)
    for part in runs(np.flatnonzero(triangle < 0), _AT_ONCE):
        canvas.planes[:, part] = sampled(at.sky, *at.view.directions(part))
    shown = np.flatnonzero(triangle >= 0)
    lamps = lamplight(beams, cover, surfaces, at.view) if beams else None
    is_dry = at.weather.wetness <= 0.0
    _paint(canvas, shown, visible, lamps, at, fog=is_dry)
    if is_dry:
        return
    on_road = shown[SOAKS[surfaces.finish][triangle[shown]]]
    add_reflections(
        canvas.planes, on_road, cover, at.view,
        open_sky=visible.open_sky, dome=at.sky, wetness=at.weather.wetness, ground=ground,
    )  # fmt: skip
    for part in runs(shown, _AT_ONCE):
        distance = at.view.length[part] * (np.float32(1.0) / cover.nearness.reshape(-1)[part])
        canvas.planes[:, part] = _through_air(canvas.planes[:, part], distance, at.weather)


def _paint(
    canvas: _Canvas,
    pixels: NDArray[np.intp],
    visible: _Visible,
    lamps: Lamplight | None,
    at: Circumstances,
    *,
    fog: bool = True,
) -> None:
    """Draw pixels with a triangle, each independently."""
    lit = visible.lit
    for part in runs(pixels, _AT_ONCE):
        points = points_at(part, visible.cover, at.view)
        shone = None if lamps is None else Lamplight(lamps.received[part], lamps.across[part])
        luminance = shade(points, lit, at, visible.shadows, shone, visible.open_sky.reshape(-1)[part])
        canvas.planes[:, part] = _through_air(luminance, points.distance, at.weather) if fog else luminance
        label = lit.surfaces.label.take(points.triangle)
        beyond = np.flatnonzero(points.depth > at.view.pinhole.far)
        points.depth[beyond], label[beyond] = np.inf, -1
        canvas.depth[part], canvas.label[part] = points.depth, label


def _through_air(luminance: Floats, distance: Floats, weather: Weather) -> Floats:
    """Return light (3, n) attenuated over a distance, plus the light that the air scatters."""
    through = np.exp(np.float32(-weather.extinction) * distance)
    air = horizon(weather).astype(np.float32)[:, None]
    found: Floats = luminance - air
    found *= through
    found += air
    return found


def _scenery(subjects: Subjects, at: Circumstances) -> _Kept:
    """Return the image without actors, and the data that is needed to draw them."""
    view = at.view
    cover, lit = _staged(subjects.scenery, at)
    canvas = _Canvas.blank(cover.triangle.size)
    heights = cells = still = None
    if at.grid is not None:
        still = at.grid.drawn(subjects.standing)
        heights = np.full((at.grid.height, at.grid.width), np.float32(-np.inf))
        heights[still.window] = still.heights
        cells = np.full(cover.triangle.size, -1, dtype=np.int32)
        for part in runs(np.flatnonzero(cover.triangle.reshape(-1) >= 0), _AT_ONCE):
            points = points_at(part, cover, view)
            cells[part] = at.grid.numbers(points.x, points.y, points.z)
    _draw(canvas, _Visible(cover, lit, still, np.ones(view.shape, dtype=np.float32)), (), at, 0.0)
    return _Kept(cover, lit, canvas, heights, cells)


def _renewed(known: _Kept, subjects: Subjects, beams: Sequence[Beam], at: Circumstances, ground: float) -> _Canvas:
    """Return the image, redrawn in areas of actors and their shadows, or completely if neighbors emit light too."""
    view = at.view
    staged = cull_and_project(subjects.actors, view.pose, view.pinhole)
    seen = rasterize_reference(staged.x, staged.y, staged.nearness, view.pinhole.width, view.pinhole.height)
    lit = together(known.lit, lit_surfaces(staged.surfaces, at.light, at.weather))
    triangle, nearness = known.cover.triangle.copy(), known.cover.nearness.copy()
    before = (seen.triangle >= 0) & (seen.nearness >= nearness[seen.window])
    np.copyto(triangle[seen.window], seen.triangle + np.int32(len(known.lit.surfaces.finish)), where=before)
    np.copyto(nearness[seen.window], seen.nearness, where=before)
    cover = Cover(triangle, nearness)
    open_sky = dimmed(_dimming(subjects), cover, lit.upright, view)
    changed = open_sky < 1.0
    changed[seen.window] |= before
    shadows = None
    if at.grid is not None and known.heights is not None and known.cells is not None:
        shadows, cells = at.grid.drawn([*subjects.actors, *subjects.unseen]).over(known.heights)
        changed |= cells[known.cells].reshape(view.shape)
    visible = _Visible(cover, lit, shadows, open_sky)
    if beams or at.weather.wetness > 0.0:
        canvas = _Canvas.blank(triangle.size)
        _draw(canvas, visible, beams, at, ground)
        return canvas
    canvas = _Canvas._make(values.copy() for values in known.canvas)
    _paint(canvas, np.flatnonzero(changed), visible, None, at)
    return canvas


def _with_glare(image: Floats) -> Floats:
    """Return the image with light of bright lamps scattered into their surroundings."""

    import cv2

    height, width = image.shape[:2]
    small = cv2.resize(image, (max(width // 4, 1), max(height // 4, 1)), interpolation=cv2.INTER_AREA)
    spread = cv2.GaussianBlur(small, (0, 0), max(width / 4 / 50.0, 0.8)) * 0.7
    spread += cv2.GaussianBlur(small, (0, 0), max(width / 4 / 14.0, 1.5)) * 0.3
    wide = cv2.resize(spread, (width, height), interpolation=cv2.INTER_LINEAR)
    found: Floats = np.asarray(image * np.float32(1.0 - GLARE) + wide * np.float32(GLARE), dtype=np.float32)
    return found
