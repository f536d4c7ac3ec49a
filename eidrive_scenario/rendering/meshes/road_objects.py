"""Meshes of what stands beside the road, true to scale: road objects, traffic lights, buildings, roadside units."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering.meshes.solids import (
    BodyDimensions,
    Mesh,
    ball,
    bevelled_box,
    box,
    cylinder,
    polygon,
    tapered_box,
)
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.road_objects import STOREY

CONIFERS = ("fir", "pine", "spruce", "conifer", "tanne", "fichte")


@lru_cache(maxsize=512)
def road_object_mesh(
    kind: str, name: str, length: float, width: float, height: float, radius: float
) -> Mapping[str, Array]:
    """Return triangles (K, 3, 3) of a road object by material; its name selects between versions of some kinds."""
    mesh, words = Mesh(), name.lower()
    match kind:
        case "tree":
            _add_tree(mesh, any(word in words for word in CONIFERS), length, width, height, radius)
        case "vegetation":
            small = ball((0.2 * length, -0.15 * width, 0.35 * height), (0.3 * length, 0.3 * width, 0.4 * height), 4, 6)
            mesh.add("leaves", ball((0, 0, 0.45 * height), (length / 2, width / 2, 0.55 * height), 4, 7), small)
        case "pole" | "post" if radius:
            mesh.add("steel", cylinder((0, 0, 0), (0, 0, height), radius, 0.8 * radius, sides=8))
        case "lamp" if radius:
            mesh.add("steel", cylinder((0, 0, 0), (0, 0, height), radius, 0.6 * radius, sides=8))
            mesh.add("steel", cylinder((0, 0, height - 0.1), (1.4, 0, height), 0.6 * radius, 0.5 * radius, sides=6))
            mesh.add("plastic", box((1.6, 0, height), (0.6, 0.25, 0.1)))
        case "guide post" if radius:
            size, top = (2 * radius, 2 * radius, height), (1.6 * radius, 1.6 * radius)
            mesh.add("white", tapered_box((0, 0, height / 2), size, top))
            mesh.add("trim", box((0, 0, 0.8 * height), (2.1 * radius, 2.1 * radius, 0.15 * height)))
            mesh.add("plate", box((-radius, 0, 0.8 * height), (0.02, radius, 0.1 * height)))
        case "barrier":
            narrow = (length, 0.6 * width)
            mesh.add("concrete", tapered_box((0, 0, 0.16 * height), (length, width, 0.32 * height), narrow))
            upper = tapered_box((0, 0, 0.66 * height), (*narrow, 0.68 * height), (length, 0.4 * width))
            mesh.add("concrete", upper)
        case "railing":
            mesh.add("steel", box((0, 0, 0.7 * height), (length, 0.25 * width, 0.6 * height)))
            mesh.add("steel", box((0, 0, 0.35 * height), (0.1, 0.4 * width, 0.7 * height)))
        case "obstacle" if "cone" in words:
            mesh.add("trim", box((0, 0, 0.02), (length, width, 0.04)))
            mesh.add("orange", cylinder((0, 0, 0.04), (0, 0, height), 0.38 * min(length, width), 0.03, sides=10))
        case "obstacle" if radius:
            mesh.add("gray", cylinder((0, 0, 0), (0, 0, height), radius, sides=12))
        case "obstacle" | "pole" | "lamp" | "guide post":
            material = "steel" if "post" in words or "pole" in words else "cargo"
            mesh.add(material, box((0, 0, height / 2), (length, width, height)))
        case "gantry":
            mesh.add_mirrored("steel", box((0, width / 2, height / 2), (0.3, 0.3, height)))
            mesh.add("steel", box((0, 0, height - 0.3), (0.3, width, 0.6)))
        case "island":
            top = (0.97 * length, 0.97 * width)
            mesh.add("pavement", tapered_box((0, 0, height / 2), (length, width, height), top))
    return mesh.materials()


def _add_tree(mesh: Mesh, conifer: bool, length: float, width: float, height: float, radius: float) -> None:
    girth = 0.6 * radius
    mesh.add("bark", cylinder((0, 0, 0), (0, 0, 0.45 * height), girth, 0.7 * girth, sides=6))
    if conifer:
        for low, high, share in ((0.15, 0.62, 1.0), (0.42, 0.85, 0.7), (0.68, 1.0, 0.45)):
            reach = share * (length + width) / 4
            mesh.add("needles", cylinder((0, 0, low * height), (0, 0, high * height), reach, 0.02, sides=7))
        return
    middle, half = 0.65 * height, (length / 2, width / 2, 0.35 * height)
    aside = (0.22 * length, 0.1 * width, middle - 0.1 * height)
    mesh.add("leaves", ball((0, 0, middle), half, 5, 8))
    mesh.add("leaves", ball(aside, (0.3 * length, 0.3 * width, 0.2 * height), 4, 7))


@lru_cache(maxsize=64)
def traffic_light(colors: tuple[str, ...], width: float, height: float) -> Mapping[str, Array]:
    """Return a signal head with lamps from top to bottom, facing +x; origin at the center of its lower edge.

    The lamps are separate materials: `lamp_red 0`, … numbered from the top.
    """
    mesh = Mesh()
    deep, cell = 0.5 * width, height / max(len(colors), 1)
    lens = min(0.36 * width, 0.40 * cell)
    mesh.add("plastic", box((-deep / 2, 0, height / 2), (deep, width, height)))
    for number, color in enumerate(colors):
        z = height - (number + 0.5) * cell
        mesh.add(f"lamp_{color} {number}", cylinder((0.0, 0, z), (0.012, 0, z), lens, sides=12))
        visor = tapered_box((0.07, 0, z + 1.12 * lens), (0.14, 2.0 * lens, 0.02), (0.14, 1.6 * lens))
        mesh.add("plastic", visor)
    return mesh.materials()


def roadside_unit(frame: BodyDimensions) -> Mesh:
    """Return a mast with a cabinet at its base and a head of camera, lidar and antenna."""
    mesh = Mesh()
    z, side = frame.z, frame.side
    half = frame.length / 2
    pole = min(0.09, 0.35 * side)
    mesh.add("steel", cylinder((0, 0, 0), (0, 0, z(0.94)), pole, 0.7 * pole, sides=12))
    mesh.add("plastic", cylinder((0, 0, 0), (0, 0, 0.06), 2.0 * pole, sides=12))
    cabinet = min(1.3, 0.35 * frame.height)
    mesh.add("white", bevelled_box((-0.35 * half, 0, cabinet), (0.6 * half, 1.3 * side, 0.6), 0.03))
    mesh.add("white", bevelled_box((0.45 * half, 0, z(0.90)), (1.0 * half, 0.7 * side, 0.16), 0.03))
    mesh.add("glass", box((0.96 * half, 0, z(0.90)), (0.03, 0.45 * side, 0.10)))
    mesh.add("trim", cylinder((0, 0, z(0.94)), (0, 0, z(0.965)), 1.4 * pole, sides=14))
    mesh.add("glass", cylinder((0, 0, z(0.965)), (0, 0, z(0.985)), 1.2 * pole, sides=14))
    foot, tip = ((-0.4 * half, 0.5 * side, z(share)) for share in (0.90, 1.0))
    mesh.add_mirrored("trim", cylinder(foot, tip, 0.02, sides=6))
    mesh.add("trim", box((-0.3 * half, 0, z(0.90)), (0.3 * half, 1.1 * side, 0.03)))
    mesh.add("blue_light", box((-0.35 * half, 0, cabinet + 0.31), (0.2 * half, 0.4 * side, 0.03)))
    return mesh


def crate(frame: BodyDimensions) -> Mesh:
    """Return a box with battens, for objects without a specific mesh."""
    mesh = Mesh()
    length, width, height = frame.length, frame.width, frame.height
    batten = 0.06 * min(length, width, height)
    inner = (length - 2 * batten, width - 2 * batten, height - 2 * batten)
    mesh.add("paint", box((0, 0, height / 2), inner))
    thick, middle = 2 * batten, height / 2
    x, y, z = ((extent - thick) / 2 for extent in (length, width, height))
    for sy in (-1, 1):
        lying = (box((0, sy * y, middle + sz * z), (length, thick, thick)) for sz in (-1, 1))
        upright = (box((sx * x, sy * y, middle), (thick, thick, height)) for sx in (-1, 1))
        mesh.add("plastic", *lying, *upright)
    corners = [(sx, sz) for sx in (-1, 1) for sz in (-1, 1)]
    mesh.add("plastic", *(box((sx * x, 0, middle + sz * z), (thick, width, thick)) for sx, sz in corners))
    return mesh


WINDOW = (1.3, 1.5)
"""Width and height of a window [m]."""
PITCH = 3.0
"""Distance between windows [m]."""
_PROUD = 0.03


def building(size: Vector3) -> dict[str, Array]:
    """Return triangles by material of a building of this size; origin at its center on the ground."""
    length, width, height = size
    mesh = Mesh()
    mesh.add("wall", box((0, 0, height / 2 - 0.1), (length - 2 * _PROUD, width - 2 * _PROUD, height - 0.2)))
    mesh.add("roof", box((0, 0, height - 0.15), (length, width, 0.3)))
    mesh.add("plastic", box((0, 0, 0.25), (length, width, 0.5)))
    storeys = max(int((height - 0.8) / STOREY), 1)
    for wall, reach, turned in ((length, width / 2, False), (width, length / 2, True)):
        columns = int((wall - 1.0) / PITCH)
        for storey in range(storeys):
            low = 0.5 + storey * STOREY + 0.9
            high = min(low + WINDOW[1], height - 0.4)
            for column in range(columns):
                center = (column - (columns - 1) / 2) * PITCH
                for sign in (-1.0, 1.0):
                    mesh.add("window", _window(center, sign * (reach - _PROUD / 2), low, high, turned))
    return mesh.materials()


def _window(center: float, at: float, low: float, high: float, turned: bool) -> Array:
    half = WINDOW[0] / 2 * (1.0 if at < 0.0 else -1.0)
    corners = [(center - half, low), (center + half, low), (center + half, high), (center - half, high)]
    if turned:
        return polygon([(at, -along, up) for along, up in corners])
    return polygon([(along, at, up) for along, up in corners])
