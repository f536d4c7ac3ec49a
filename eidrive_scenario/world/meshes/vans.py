"""Meshes of vans and ambulances."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.meshes.body_dimensions import BodyDimensions, add_wheels
from eidrive_scenario.world.meshes.solids import Mesh, bevelled_box, box, loft, polygon


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
        corners = [
            (across + wide, up + high),
            (-across + wide, -up + high),
            (-across - wide, -up - high),
            (across - wide, up - high),
        ]
        bar = polygon([(x(0.24) + a, -flank - 0.02, z(0.70) + b) for a, b in reversed(corners)])
        mesh.add_mirrored("blue_light", bar)
    _rear_doors(mesh, frame)
    mesh.add("red", box((x(0.0) + 0.03, 0, z(0.46)), (0.03, 1.8 * side, z(0.10))))
    mesh.add("blue_light", bevelled_box((x(0.655), 0, z(0.965)), (0.30, 1.5 * side, z(0.07)), 0.03))
    mesh.add_mirrored("blue_light", box((x(0.02), 0.80 * side, z(0.92)), (0.09, 0.25, z(0.06))))
    add_wheels(mesh, frame, 0.965 * side, 0.24)
    return mesh


def _ring(frame: BodyDimensions, x: float, width: float, bottom: float, shoulder: float, top: float) -> Array:
    """Return a section of the body: `width` is a share of half the width, the others of the height."""
    y = width * frame.side
    half = [(0.94 * y, bottom), (y, bottom + 0.05), (y, shoulder), (0.90 * y, top - 0.04), (0.80 * y, top)]
    points = [(-a, b) for a, b in half] + [(a, b) for a, b in reversed(half)]
    return np.array([(frame.x(x), a, frame.z(b)) for a, b in points])


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
        mesh.add(
            "plastic", box((frame.x(0.32), 0, frame.z(0.16)), (0.62 * frame.length, 1.7 * frame.side, frame.z(0.08)))
        )
    mesh.add("paint", loft([_ring(frame, *section) for section in sections]))


def _cab_details(mesh: Mesh, frame: BodyDimensions) -> None:
    x, z, side = frame.x, frame.z, frame.side
    # The sections at 0.835 and 0.925 enclose the windscreen, which is on the skin.
    low, high = (x(0.921), z(0.60)), (x(0.840), z(0.905))
    screen = [(low[0], -0.74, low[1]), (low[0], 0.74, low[1]), (high[0], 0.76, high[1]), (high[0], -0.76, high[1])]
    lift = np.array([z(0.93) - z(0.575), 0.0, x(0.925) - x(0.835)])
    lift *= 0.015 / np.linalg.norm(lift)
    mesh.add("glass", polygon([np.array((a, b * side, c)) + lift for a, b, c in screen]))
    y = -0.972 * side
    window = [
        (x(0.70), y, z(0.575)),
        (x(0.885), y, z(0.575)),
        (x(0.835), 0.985 * y, z(0.83)),
        (x(0.70), 0.985 * y, z(0.86)),
    ]
    mesh.add_mirrored("glass", polygon(window))
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
