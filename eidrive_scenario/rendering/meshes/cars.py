"""Meshes of passenger cars, from hatchback to off-roader, and of vans and ambulances."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering.meshes.solids import BodyDimensions, Mesh, add_wheels, bevelled_box, box, loft, polygon

_TALL = 0.37
"""Minimum height over length of a car without a boot (off-roader or hatchback)."""


def car(frame: BodyDimensions) -> Mesh:
    """Return a saloon with bonnet and boot, or with an upright tail if it is tall or short."""
    mesh = Mesh()
    upright = frame.height / frame.length > _TALL or frame.length < 4.3
    belt, side = (0.60, 0.97) if upright else (0.635, 0.97)
    _shell(mesh, frame, belt, side, upright)
    rear, front = (0.03, 0.71) if upright else (0.13, 0.735)
    roof = (0.10, 0.545) if upright else (0.30, 0.555)
    _cabin(mesh, frame, belt, (rear, front), roof)
    _details(mesh, frame, belt, upright)
    add_wheels(mesh, frame, side * frame.side + 0.004, 0.24)
    return mesh


def _ring(frame: BodyDimensions, x: float, width: float, bottom: float, waist: float, top: float) -> Array:
    """Return a section of the shell at a share x of the length; widths and heights are shares as well."""
    y = width * frame.side
    half = [(y * 0.86, bottom), (y, bottom + 0.07), (y, waist), (y * 0.9, top - 0.015), (y * 0.55, top)]
    return _symmetric(frame, x, half)


def _symmetric(frame: BodyDimensions, x: float, half: list[tuple[float, float]]) -> Array:
    """Return a section from the distances of its corners from the middle [m] and their shares of the height."""
    points = [(-a, b) for a, b in half] + [(a, b) for a, b in reversed(half)]
    return np.array([(frame.x(x), a, frame.z(b)) for a, b in points])


def _shell(mesh: Mesh, frame: BodyDimensions, belt: float, side: float, upright: bool) -> None:
    """Add the body below the windows."""
    tail = belt if upright else belt + 0.02
    sections = [
        (0.000, 0.80, 0.24, 0.40, 0.47),
        (0.008, 0.90, 0.19, 0.46, 0.58),
        (0.035, 0.955, 0.15, 0.50, tail),
        (0.130, side, 0.13, 0.52, tail + 0.005),
        (0.300, side, 0.12, 0.52, belt + 0.01),
        (0.720, side, 0.12, 0.52, belt),
        (0.760, side, 0.12, 0.52, belt - 0.01),
        (0.880, 0.955, 0.13, 0.48, belt - 0.06),
        (0.955, 0.90, 0.15, 0.42, belt - 0.12),
        (0.988, 0.82, 0.18, 0.37, belt - 0.19),
        (1.000, 0.72, 0.22, 0.34, belt - 0.25),
    ]
    mesh.add("paint", loft([_ring(frame, *section) for section in sections]))


def _cabin(
    mesh: Mesh, frame: BodyDimensions, belt: float, sill: tuple[float, float], roof: tuple[float, float]
) -> None:
    """Add roof, pillars and windows above the belt line."""
    low, high = frame.z(belt - 0.01), frame.z(0.975)
    wide, narrow = 0.87 * frame.side, 0.66 * frame.side
    (x0, x3), (x1, x2) = (frame.x(sill[0]), frame.x(sill[1])), (frame.x(roof[0]), frame.x(roof[1]))
    bottom = np.array([(x0, -wide, low), (x3, -wide, low), (x3, wide, low), (x0, wide, low)])
    top = np.array([(x1, -narrow, high), (x2, -narrow, high), (x2, narrow, high), (x1, narrow, high)])
    crown = top * (1.0, 0.85, 1.0) + (0.0, 0.0, frame.z(0.025))
    crown[:, 0] = 0.93 * (crown[:, 0] - crown[:, 0].mean()) + crown[:, 0].mean()
    mesh.add("paint", loft([crown, top, bottom]))
    # Corners of the faces from left to right seen from outside, at the bottom and at the top
    rear, front, right = (np.concatenate([bottom[ends], top[ends]]) for ends in ([3, 0], [1, 2], [0, 1]))
    mesh.add("glass", _pane(rear, 0.08, 0.92, 0.10, 0.92), _pane(front, 0.05, 0.95, 0.04, 0.95))
    post = 0.47
    halves = ((0.07, post - 0.015), (post + 0.015, 0.92))
    mesh.add_mirrored("glass", *(_pane(right, start, end, 0.10, 0.88) for start, end in halves))


def _pane(face: Array, left: float, right: float, low: float, high: float) -> Array:
    """Return a window in a face between shares of its width and height, a centimeter outside the face."""
    p00, p10, p01, p11 = face
    normal = np.cross(p10 - p00, p01 - p00)
    lift = 0.012 * normal / np.linalg.norm(normal)

    def at(u: float, v: float) -> Array:
        point: Array = (1 - v) * ((1 - u) * p00 + u * p10) + v * ((1 - u) * p01 + u * p11) + lift
        return point

    return polygon([at(left, low), at(right, low), at(right, high), at(left, high)])


def _details(mesh: Mesh, frame: BodyDimensions, belt: float, upright: bool) -> None:
    """Add lights, grille, bumpers, plates, mirrors, door lines, handles."""
    x, z, side = frame.x, frame.z, frame.side
    nose, tail = x(1.0), x(0.0)
    mesh.add("trim", box((nose - 0.03, 0, z(0.30)), (0.08, 0.95 * side, z(0.11))))
    mesh.add("chrome", box((nose - 0.025, 0, z(0.365)), (0.08, 1.0 * side, z(0.012))))
    mesh.add("plastic", box((nose - 0.05, 0, z(0.19)), (0.12, 1.36 * side, z(0.05))))
    mesh.add("plastic", box((tail + 0.05, 0, z(0.235)), (0.12, 1.5 * side, z(0.08))))
    mesh.add("plate", box((nose - 0.01, 0, z(0.22)), (0.05, 0.52, 0.11)))
    mesh.add("plate", box((tail + 0.005, 0, z(0.42)), (0.03, 0.52, 0.11)))
    mesh.add_mirrored("headlight", box((x(0.972), 0.70 * side, z(belt - 0.19)), (0.16, 0.30 * side, z(0.055))))
    mesh.add_sided("indicator", box((x(0.955), 0.865 * side, z(belt - 0.19)), (0.12, 0.07 * side, z(0.045))))
    light = z(belt - 0.09)
    mesh.add_mirrored("taillight", box((x(0.02), 0.74 * side, light), (0.15, 0.36 * side, z(0.085))))
    mesh.add_sided("indicator", box((x(0.019), 0.86 * side, light), (0.15, 0.125 * side, z(0.08))))
    mesh.add_mirrored("reversing_light", box((x(0.019), 0.61 * side, light), (0.15, 0.10 * side, z(0.06))))
    mesh.add_mirrored("trim", box((x(0.70), 0.985 * side, z(belt + 0.05)), (0.10, 0.05, 0.05)))
    mesh.add_mirrored("paint", box((x(0.705), 0.99 * side, z(belt + 0.075)), (0.12, 0.16, 0.12)))
    for share in (0.245, 0.475, 0.70):
        mesh.add_mirrored("trim", box((x(share), 0.969 * side, z(0.37)), (0.012, 0.008, z(0.34))))
    for share in (0.30, 0.53):
        mesh.add_mirrored("chrome", box((x(share), 0.965 * side, z(0.51)), (0.16, 0.03, 0.025)))
    mesh.add_mirrored("plastic", box((x(0.49), 0.95 * side, z(0.135)), (0.42 * frame.length, 0.05, z(0.05))))
    if upright:
        mesh.add_mirrored("plastic", box((x(0.33), 0.60 * side, z(0.985)), (0.36 * frame.length, 0.04, z(0.025))))


def van(frame: BodyDimensions) -> Mesh:
    """Return a delivery van with a closed body."""
    mesh = Mesh()
    _body(mesh, frame, roof_from=0.0)
    _cab_details(mesh, frame)
    _rear_doors(mesh, frame)
    x, z, side = frame.x, frame.z, frame.side
    for share in (0.36, 0.60):
        mesh.add_mirrored("trim", box((x(share), 0.962 * side, z(0.48)), (0.014, 0.008, z(0.62))))
    mesh.add_mirrored("trim", box((x(0.30), 0.965 * side, z(0.56)), (0.55 * frame.length, 0.012, 0.03)))
    add_wheels(mesh, frame, 0.965 * side, 0.24)
    return mesh


def ambulance(frame: BodyDimensions) -> Mesh:
    """Return a van with a box behind the cab, stripes and blue lights."""
    mesh = Mesh()
    _body(mesh, frame, roof_from=0.60)
    _cab_details(mesh, frame)
    x, z, side = frame.x, frame.z, frame.side
    length = 0.66 * frame.length
    middle = x(0.0) + length / 2 + 0.04
    mesh.add("paint", bevelled_box((middle, 0, z(0.545)), (length, 2 * side * 0.985, z(0.81)), 0.06))
    flank = 0.985 * side
    mesh.add_mirrored("red", box((middle, flank, z(0.46)), (0.97 * length, 0.012, z(0.10))))
    mesh.add_mirrored("yellow", box((middle, flank, z(0.38)), (0.97 * length, 0.014, z(0.04))))
    mesh.add_mirrored("window", box((x(0.50), flank, z(0.72)), (0.13 * frame.length, 0.016, z(0.17))))
    # The star of life, as three bars.
    for angle in (0.0, np.pi / 3, 2 * np.pi / 3):
        across, up = 0.30 * np.cos(angle), 0.30 * np.sin(angle)
        wide, high = -0.07 * np.sin(angle), 0.07 * np.cos(angle)
        signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        corners = [(i * across + j * wide, i * up + j * high) for i, j in signs]
        bar = polygon([(x(0.24) + a, -flank - 0.02, z(0.70) + b) for a, b in reversed(corners)])
        mesh.add_mirrored("blue_light", bar)
    _rear_doors(mesh, frame)
    mesh.add("red", box((x(0.0) + 0.03, 0, z(0.46)), (0.03, 1.8 * side, z(0.10))))
    mesh.add("blue_light", bevelled_box((x(0.655), 0, z(0.965)), (0.30, 1.5 * side, z(0.07)), 0.03))
    mesh.add_mirrored("blue_light", box((x(0.02), 0.80 * side, z(0.92)), (0.09, 0.25, z(0.06))))
    add_wheels(mesh, frame, 0.965 * side, 0.24)
    return mesh


def _section(frame: BodyDimensions, x: float, width: float, bottom: float, shoulder: float, top: float) -> Array:
    """Return a section of the body: `width` is a share of half the width, the others of the height."""
    y = width * frame.side
    half = [(0.94 * y, bottom), (y, bottom + 0.05), (y, shoulder), (0.90 * y, top - 0.04), (0.80 * y, top)]
    return _symmetric(frame, x, half)


def _body(mesh: Mesh, frame: BodyDimensions, roof_from: float) -> None:
    """Add bonnet, cab, and the closed body back to a share of the length."""
    sections = [
        (0.80, 0.965, 0.13, 0.53, 0.985),
        (0.835, 0.96, 0.13, 0.52, 0.93),
        (0.925, 0.95, 0.14, 0.47, 0.575),
        (0.970, 0.92, 0.15, 0.40, 0.49),
        (0.993, 0.86, 0.17, 0.34, 0.41),
        (1.000, 0.76, 0.19, 0.30, 0.34),
    ]
    if roof_from == 0.0:
        sections = [
            (0.0, 0.94, 0.15, 0.52, 0.96),
            (0.015, 0.965, 0.13, 0.54, 1.0),
            (0.74, 0.965, 0.13, 0.54, 1.0),
            *sections,
        ]
    else:
        sections = [(roof_from, 0.965, 0.13, 0.53, 0.92), (0.74, 0.965, 0.13, 0.53, 0.93), *sections[1:]]
        floor = (0.62 * frame.length, 1.7 * frame.side, frame.z(0.08))
        mesh.add("plastic", box((frame.x(0.32), 0, frame.z(0.16)), floor))
    mesh.add("paint", loft([_section(frame, *section) for section in sections]))


def _cab_details(mesh: Mesh, frame: BodyDimensions) -> None:
    x, z, side = frame.x, frame.z, frame.side
    # The sections at 0.835 and 0.925 enclose the windscreen, which is on the skin.
    low, high = (x(0.921), z(0.60)), (x(0.840), z(0.905))
    screen = [(low[0], -0.74, low[1]), (low[0], 0.74, low[1]), (high[0], 0.76, high[1]), (high[0], -0.76, high[1])]
    lift = np.array([z(0.93) - z(0.575), 0.0, x(0.925) - x(0.835)])
    lift *= 0.015 / np.linalg.norm(lift)
    mesh.add("glass", polygon([np.array((a, b * side, c)) + lift for a, b, c in screen]))
    y = -0.972 * side
    sill, top = [(x(0.70), z(0.575)), (x(0.885), z(0.575))], [(x(0.835), z(0.83)), (x(0.70), z(0.86))]
    mesh.add_mirrored("glass", polygon([*((a, y, b) for a, b in sill), *((a, 0.985 * y, b) for a, b in top)]))
    for share in (0.675, 0.895):
        mesh.add_mirrored("trim", box((x(share), 0.962 * side, z(0.36)), (0.014, 0.008, z(0.38))))
    mesh.add_mirrored("trim", box((x(0.715), 0.97 * side, z(0.52)), (0.16, 0.02, 0.03)))
    nose = x(1.0)
    mesh.add("trim", box((nose - 0.05, 0, z(0.34)), (0.11, 1.1 * side, z(0.09))))
    mesh.add("plastic", bevelled_box((nose - 0.09, 0, z(0.18)), (0.20, 1.84 * side, z(0.10)), 0.04))
    mesh.add("plate", box((nose + 0.005, 0, z(0.18)), (0.03, 0.52, 0.11)))
    mesh.add_mirrored("headlight", box((x(0.975), 0.76 * side, z(0.36)), (0.16, 0.25 * side, z(0.09))))
    mesh.add_sided("indicator", box((x(0.962), 0.885 * side, z(0.37)), (0.12, 0.06 * side, z(0.07))))
    mesh.add_mirrored("trim", box((x(0.90), 0.985 * side, z(0.60)), (0.12, 0.10, 0.26)))


def _rear_doors(mesh: Mesh, frame: BodyDimensions) -> None:
    x, z, side = frame.x, frame.z, frame.side
    tail = x(0.0)
    mesh.add("trim", box((tail + 0.01, 0, z(0.53)), (0.03, 0.02, z(0.74))))
    for sign in (-1, 1):
        mesh.add("glass", box((tail + 0.015, sign * 0.42 * side, z(0.72)), (0.05, 0.60 * side, z(0.20))))
    mesh.add("plastic", box((tail + 0.06, 0, z(0.16)), (0.14, 1.8 * side, z(0.06))))
    mesh.add("plate", box((tail + 0.01, 0.45 * side, z(0.34)), (0.04, 0.52, 0.11)))
    mesh.add_mirrored("taillight", box((tail + 0.03, 0.88 * side, z(0.40)), (0.08, 0.13 * side, z(0.16))))
    mesh.add_sided("indicator", box((tail + 0.03, 0.88 * side, z(0.51)), (0.08, 0.13 * side, z(0.05))))
    mesh.add_mirrored("reversing_light", box((tail + 0.03, 0.88 * side, z(0.30)), (0.08, 0.13 * side, z(0.04))))
