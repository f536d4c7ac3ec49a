"""Meshes of trucks, fire engines and buses."""

from __future__ import annotations

from eidrive_scenario.rendering.meshes.solids import (
    BodyDimensions,
    Mesh,
    add_extra_wheels,
    add_wheels,
    bevelled_box,
    box,
    cylinder,
    tapered_box,
)


def truck(frame: BodyDimensions) -> Mesh:
    """Return a cab over the engine and a closed cargo body."""
    mesh = Mesh()
    x, z, side = frame.x, frame.z, frame.side
    cab = min(2.2, 0.30 * frame.length)
    _cab(mesh, frame, cab, 0.90, "paint")
    above_cab, size = (x(1.0) - 0.55 * cab, 0, z(0.93)), (0.75 * cab, 1.7 * side, z(0.10))
    mesh.add("paint", tapered_box(above_cab, size, (0.35 * cab, 1.5 * side), -0.12))
    floor = 2 * frame.wheel_radius + 0.12
    _cargo(mesh, frame, frame.length - cab - 0.12, floor)
    _tail(mesh, frame, floor)
    _chassis(mesh, frame)
    return mesh


def trailer(frame: BodyDimensions) -> Mesh:
    """Return a closed cargo body on its axles, with support legs."""
    mesh = Mesh()
    radius = max((axle.wheel_radius for axle in frame.extra_axles), default=0.0) or frame.wheel_radius
    floor = min(2 * radius + 0.12, 0.5 * frame.height)
    _cargo(mesh, frame, frame.length, floor)
    _tail(mesh, frame, floor)
    mesh.add("trim", box((0.0, 0, floor - 0.15), (0.96 * frame.length, 0.9 * frame.side, 0.28)))
    leg = (frame.x(0.8), 0.6 * frame.side, floor / 2 + 0.1)
    mesh.add_mirrored("gray", box(leg, (0.14, 0.14, floor - 0.2)))
    add_extra_wheels(mesh, frame, 0.985 * frame.side, 0.55, steered=0.32)
    return mesh


def _cargo(mesh: Mesh, frame: BodyDimensions, cargo: float, floor: float) -> None:
    """Add a closed body over `cargo` [m] from the rear end, with seams and a stripe."""
    x, side = frame.x, frame.side
    along, up, high = x(0.0) + cargo / 2, (floor + frame.height) / 2, frame.height - floor
    mesh.add("cargo", bevelled_box((along, 0, up), (cargo, 2 * side, high), 0.03))
    for share in range(1, 6):
        mesh.add_mirrored("gray", box((x(0.0) + cargo * share / 6, side, up), (0.03, 0.012, 0.96 * high)))
    mesh.add_mirrored("paint", box((along, side, floor + 0.35 * high), (cargo, 0.016, 0.22)))


def firetruck(frame: BodyDimensions) -> Mesh:
    """Return a crew cab, lockers with roller shutters, a ladder on the roof and blue lights."""
    mesh = Mesh()
    x, z, side = frame.x, frame.z, frame.side
    cab = 0.40 * frame.length
    _cab(mesh, frame, cab, 0.86, "paint", crew=True)
    body = frame.length - cab - 0.06
    middle = x(0.0) + body / 2
    floor, roof = 2 * frame.wheel_radius - 0.05, z(0.86)
    mesh.add("paint", bevelled_box((middle, 0, (floor + roof) / 2), (body, 1.98 * side, roof - floor), 0.04))
    count = 4
    wide = body / count
    axles = (frame.rear, *(axle.x for axle in frame.extra_axles))
    for index in range(count):
        center = x(0.0) + (index + 0.5) * wide
        above_wheel = any(abs(center - axle) <= 0.8 * wide for axle in axles)
        low = floor + 0.42 if above_wheel else floor + 0.12
        high = roof - 0.22
        mesh.add_mirrored("steel", box((center, 0.99 * side, (low + high) / 2), (0.84 * wide, 0.02, high - low)))
        for line in range(1, 7):
            at = low + (high - low) * line / 7
            mesh.add_mirrored("gray", box((center, 0.994 * side, at), (0.82 * wide, 0.02, 0.018)))
        mesh.add_mirrored("trim", box((center, 0.996 * side, low + 0.06), (0.5 * wide, 0.03, 0.035)))
    mesh.add_mirrored("white", box((x(0.5), 0.992 * side, floor + 0.05), (0.97 * frame.length, 0.02, 0.16)))
    mesh.add_mirrored("yellow", box((x(0.5), 0.992 * side, floor + 0.17), (0.97 * frame.length, 0.02, 0.06)))
    for sign in (-1, 1):
        rail = sign * 0.42 * side
        mesh.add("steel", box((x(0.36), rail, z(0.955)), (0.68 * frame.length, 0.07, z(0.035))))
    for rung in range(16):
        mesh.add("steel", box((x(0.05 + 0.041 * rung), 0, z(0.955)), (0.05, 0.84 * side, 0.05)))
    for share in (0.06, 0.62):
        mesh.add("trim", box((x(share), 0, z(0.90)), (0.12, 1.1 * side, z(0.08))))
    mesh.add("blue_light", bevelled_box((x(1.0) - 0.38 * cab, 0, z(0.895)), (0.42, 1.62 * side, z(0.06)), 0.04))
    mesh.add_mirrored("blue_light", box((x(0.02), 0.84 * side, z(0.88)), (0.20, 0.26, z(0.05))))
    mesh.add("white", box((x(1.0) - 0.04, 0, z(0.35)), (0.04, 1.5 * side, 0.10)))
    _tail(mesh, frame, floor)
    mesh.add("steel", box((x(0.0) + 0.01, 0, (floor + roof) / 2), (0.04, 1.2 * side, 0.8 * (roof - floor))))
    _chassis(mesh, frame)
    return mesh


def bus(frame: BodyDimensions) -> Mesh:
    """Return a bus with a band of windows, doors on the right and a sign above the windscreen."""
    mesh = Mesh()
    x, z, side = frame.x, frame.z, frame.side
    floor = 0.085
    body = (frame.length - 0.02, 1.98 * side, z(0.97 - floor))
    mesh.add("paint", bevelled_box((0, 0, z((floor + 0.97) / 2)), body, 0.10))
    mesh.add("white", bevelled_box((x(0.45), 0, z(0.965)), (0.62 * frame.length, 1.5 * side, z(0.07)), 0.05))
    mesh.add_mirrored("white", box((x(0.5), 0.99 * side, z(0.245)), (0.95 * frame.length, 0.016, z(0.05))))
    band, high = z(0.655), z(0.33)
    count = 7
    wide = 0.88 * frame.length / count
    for index in range(count):
        at = x(0.045) + (index + 0.5) * wide
        mesh.add_mirrored("glass", box((at, 0.99 * side, band), (wide - 0.10, 0.025, high)))
    middle = x(0.045) + 0.44 * frame.length
    mesh.add_mirrored("trim", box((middle, 0.99 * side, band), (0.88 * frame.length, 0.012, high + 0.10)))
    nose, tail = x(1.0) - 0.01, x(0.0) + 0.01
    mesh.add("glass", box((nose, 0, z(0.58)), (0.04, 1.76 * side, z(0.42))))
    mesh.add("trim", box((nose, 0, z(0.87)), (0.04, 1.5 * side, z(0.085))))
    mesh.add("marker_light", box((nose + 0.012, 0, z(0.87)), (0.03, 1.0 * side, z(0.045))))
    mesh.add("glass", box((tail, 0, z(0.68)), (0.04, 1.5 * side, z(0.26))))
    for share in (0.90, 0.50):
        for leaf in (-1, 1):
            at = x(share) + leaf * 0.035 * frame.length
            mesh.add("trim", box((at, -0.99 * side, z(0.47)), (0.066 * frame.length, 0.03, z(0.66))))
            mesh.add("glass", box((at, -0.992 * side, z(0.49)), (0.052 * frame.length, 0.036, z(0.56))))
    for at in (nose - 0.02, tail + 0.02):
        mesh.add("plastic", box((at, 0, z(0.135)), (0.08, 1.9 * side, z(0.09))))
    mesh.add_mirrored("headlight", box((nose, 0.74 * side, z(0.235)), (0.05, 0.30 * side, z(0.055))))
    mesh.add_sided("indicator", box((nose, 0.93 * side, z(0.235)), (0.05, 0.06 * side, z(0.055))))
    mesh.add_mirrored("taillight", box((tail, 0.86 * side, z(0.32)), (0.05, 0.14 * side, z(0.15))))
    mesh.add_sided("indicator", box((tail, 0.86 * side, z(0.425)), (0.05, 0.14 * side, z(0.045))))
    mesh.add_mirrored("reversing_light", box((tail, 0.86 * side, z(0.22)), (0.05, 0.14 * side, z(0.035))))
    mesh.add("plate", box((nose + 0.02, 0, z(0.135)), (0.03, 0.52, 0.11)))
    mesh.add("plate", box((tail, 0, z(0.25)), (0.05, 0.52, 0.11)))
    mesh.add("plastic", box((0, 0, z(floor)), (0.96 * frame.length, 1.8 * side, z(0.04))))
    mesh.add_mirrored("trim", box((nose - 0.12, 0.95 * side, z(0.74)), (0.10, 0.14, z(0.12))))
    add_wheels(mesh, frame, 0.998 * side, 0.30)
    return mesh


def _cab(mesh: Mesh, frame: BodyDimensions, length: float, top: float, material: str, *, crew: bool = False) -> None:
    """Add the cab at the front end; its height is a share of the total height."""
    x, z, side = frame.x, frame.z, frame.side
    nose, floor, roof = x(1.0), 0.75 * frame.wheel_radius, z(top)
    high, middle = roof - floor, nose - length / 2
    sill = floor + 0.50 * high
    mesh.add(material, bevelled_box((middle, 0, (floor + sill) / 2), (length, 1.96 * side, sill - floor), 0.05))
    center, size = (middle - 0.02, 0, (sill + roof) / 2), (length - 0.06, 1.94 * side, roof - sill)
    mesh.add(material, tapered_box(center, size, (length - 0.34, 1.80 * side), -0.10))
    # The windscreen follows the slope of the upper part.
    front_low, front_high = nose - 0.05, nose - 0.27
    glass_low, glass_high = sill + 0.06, roof - 0.16
    glass_middle, tall = (glass_low + glass_high) / 2, glass_high - glass_low
    lean = (front_low - front_high) * (tall / (roof - sill))
    start = front_low - (front_low - front_high) * (glass_low - sill) / (roof - sill)
    screen = (start - 0.02, 0, glass_middle)
    mesh.add("glass", tapered_box(screen, (0.06, 1.78 * side, tall), (0.06, 1.70 * side), -lean))
    doors = ((0.30, 0.34), (0.72, 0.34)) if crew else ((0.42, 0.50),)
    for back, share in doors:
        at, wide = nose - back * length, share * length
        window = (at, 0.925 * side, glass_middle)
        mesh.add_mirrored("glass", tapered_box(window, (wide, 0.10 * side, tall), (0.92 * share * length, 0.02 * side)))
        edge = (at - 0.56 * share * length, 0.982 * side, (floor + sill) / 2 + 0.2)
        mesh.add_mirrored("trim", box(edge, (0.02, 0.012, sill - floor)))
        mesh.add_mirrored("chrome", box((at - 0.42 * share * length, 0.985 * side, sill - 0.12), (0.20, 0.03, 0.04)))
    mesh.add("trim", box((nose - 0.01, 0, floor + 0.30 * high), (0.05, 1.3 * side, 0.22 * high)))
    mesh.add("plastic", bevelled_box((nose - 0.12, 0, floor + 0.06), (0.28, 1.96 * side, 0.30), 0.05))
    mesh.add("plate", box((nose + 0.005, 0, floor + 0.05), (0.05, 0.52, 0.11)))
    low, mirror = floor + 0.16 * high, 0.42 * (roof - sill)
    mesh.add_mirrored("headlight", box((nose - 0.01, 0.78 * side, low), (0.05, 0.28 * side, 0.10 * high)))
    mesh.add_sided("indicator", box((nose - 0.02, 0.95 * side, low), (0.06, 0.06 * side, 0.10 * high)))
    mesh.add_mirrored("trim", box((nose - 0.20, 0.965 * side, sill + mirror), (0.10, 0.13, mirror)))


def _tail(mesh: Mesh, frame: BodyDimensions, floor: float) -> None:
    x, side = frame.x(0.0), frame.side
    mesh.add("plastic", box((x + 0.08, 0, floor - 0.30), (0.12, 1.84 * side, 0.16)))
    mesh.add_mirrored("taillight", box((x + 0.02, 0.82 * side, floor - 0.13), (0.06, 0.26 * side, 0.14)))
    mesh.add_sided("indicator", box((x + 0.018, 0.90 * side, floor - 0.13), (0.06, 0.09 * side, 0.12)))
    mesh.add_mirrored("reversing_light", box((x + 0.018, 0.72 * side, floor - 0.13), (0.06, 0.06 * side, 0.10)))
    mesh.add("plate", box((x + 0.015, 0, floor - 0.30), (0.03, 0.52, 0.11)))


def _chassis(mesh: Mesh, frame: BodyDimensions) -> None:
    """Add frame, tank and wheels, with twin tires at the rear."""
    radius, side = frame.wheel_radius, frame.side
    mesh.add("trim", box((-0.02, 0, 1.3 * radius), (0.94 * frame.length, 0.9 * side, 0.6 * radius)))
    middle = (frame.front + frame.rear) / 2
    start, end = ((middle + along, 0.72 * side, 1.15 * radius) for along in (-0.5, 0.5))
    mesh.add_mirrored("gray", cylinder(start, end, 0.55 * radius))
    add_wheels(mesh, frame, 0.985 * side, 0.32, axles=(frame.front,))
    add_wheels(mesh, frame, 0.985 * side, 0.55, axles=(frame.rear,))
    add_extra_wheels(mesh, frame, 0.985 * side, 0.55, steered=0.32)
    mesh.add_mirrored("plastic", box((frame.rear, 0.80 * side, 2.12 * radius), (2.5 * radius, 0.38 * side, 0.06)))
