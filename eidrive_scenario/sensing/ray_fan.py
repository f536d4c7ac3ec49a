"""Rays of a rotating sensor against the triangles of bodies, as a kernel.

All rays begin at one point and form columns of equal azimuth, so that a triangle is compared only with the rays of its
columns, and those of a column that meet it are an interval of elevations. In contrast to rays one by one, this needs no
hierarchy of the triangles.
"""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.world.surfaces import Surfaces
from eidrive_scenario.world.view import NOTHING

_BINS = 4
"""Number of bins of the table of columns for each column."""
_ROUNDING = 1e-9
"""Widening of the azimuths of a triangle, so that none of its columns is lost by rounding, in quarters of a turn."""


class RayFan:
    """Rays of all columns of a revolution.

    columns  (T, 2) cosine and sine of the azimuths
    order    (R,) rings in ascending order of their elevations
    rings    (R, 3) tangent, cosine and sine of the elevations in this order
    table    first column of each bin of the azimuth, over two revolutions, for triangles across the first column
    """

    def __init__(self, azimuths: Array, elevations: Array) -> None:
        """Take the azimuths (T,) of the columns in ascending order from 0 to below 2 pi, and elevations (R,) [rad]."""
        self.columns = np.column_stack([np.cos(azimuths), np.sin(azimuths)])
        self.order = np.argsort(elevations, kind="stable")
        rising = elevations[self.order]
        self.rings = np.column_stack([np.tan(rising), np.cos(rising), np.sin(rising)])
        quarters = np.array([_quarter_turns(x, y) for x, y in self.columns.tolist()])
        bins = np.arange(8 * _BINS * len(azimuths) + 2) / (_BINS * len(azimuths))
        self.table = np.searchsorted(np.concatenate([quarters, quarters + 4.0]), bins)


class FanHits:
    """First hits of the rays of some columns (C,) of a fan.

    rows      (C, R) row of the hit, NOTHING without one
    distance  (C, R) distance of the hit, `reach` without one [m]
    brightness  (C, R) reflectivity of the surface times the cosine of the angle between ray and normal
    """

    def __init__(self, fan: RayFan, columns: Integers, pose: Array, reach: float) -> None:
        """Begin without hits; `pose` (4, 4) is that of the sensor in the world."""
        self._fan, self._reach = fan, reach
        self._to_sensor, self._origin = pose[:3, :3].T, pose[:3, 3]
        self._slots = np.full(len(fan.columns), -1)
        self._slots[columns] = np.arange(len(columns))
        shape = len(columns), len(fan.order)
        self.rows = np.full(shape, NOTHING)
        self.distance = np.full(shape, reach)
        self.brightness = np.zeros(shape)

    def meet(self, surfaces: Surfaces, row: int, rotation: Array, position: Array) -> None:
        """Add the hits on surfaces with this rotation (3, 3) and position (3,) in the world."""
        fan = self._fan
        _meet(
            surfaces.triangles, surfaces.first, surfaces.spheres, surfaces.reflectivity, surfaces.closed,
            np.ascontiguousarray(self._to_sensor @ rotation),
            self._to_sensor @ (position - self._origin), row, self._reach, fan.columns, fan.table, self._slots,
            fan.rings, fan.order, self.rows, self.distance, self.brightness,
        )  # fmt: skip


@kernel(
    "void(f8[:,:,::1], i8[::1], f8[:,::1], f8[::1], b1, f8[:,::1], f8[::1], i8, f8, f8[:,::1], i8[::1], i8[::1], "
    "f8[:,::1], i8[::1], i8[:,::1], f8[:,::1], f8[:,::1])"
)
def _meet(
    triangles: Array,
    first: Integers,
    spheres: Array,
    reflectivity: Array,
    closed: bool,
    rotation: Array,
    shift: Array,
    row: int,
    reach: float,
    columns: Array,
    table: Integers,
    slots: Integers,
    rings: Array,
    order: Integers,
    rows: Integers,
    distance: Array,
    brightness: Array,
) -> None:
    """Replace hits by nearer ones on triangles, which `rotation` and `shift` move into the frame of the sensor.

    slots    (T,) rows of the columns in the results, -1 for columns that are not read
    """
    count, last = len(slots), len(rings)
    scale, ring = (len(table) - 2) / 8.0, 0
    for group in range(len(first) - 1):
        x, y, z = _moved(spheres[group], rotation, shift)
        if math.sqrt(x * x + y * y + z * z) - spheres[group, 3] > reach:
            continue
        for triangle in range(first[group], first[group + 1]):
            ax, ay, az = _moved(triangles[triangle, 0], rotation, shift)
            bx, by, bz = _moved(triangles[triangle, 1], rotation, shift)
            cx, cy, cz = _moved(triangles[triangle, 2], rotation, shift)
            # Normals of the planes through the origin and an edge, whose sum is normal to the triangle. Seen from
            # inside, all are reversed: the volume is positive.
            ux, uy, uz = _cross(bx, by, bz, cx, cy, cz)
            volume = ax * ux + ay * uy + az * uz
            if volume > 0.0 and closed:
                continue
            if volume < 0.0:
                bx, by, bz, cx, cy, cz = cx, cy, cz, bx, by, bz
                ux, uy, uz, volume = -ux, -uy, -uz, -volume
            vx, vy, vz = _cross(cx, cy, cz, ax, ay, az)
            wx, wy, wz = _cross(ax, ay, az, bx, by, bz)
            nx, ny, nz = ux + vx + wx, uy + vy + wy, uz + vz + wz
            square = nx * nx + ny * ny + nz * nz
            if not volume > 0.0 or volume * volume > reach * reach * square:
                continue
            a, b, c = _quarter_turns(ax, ay), _quarter_turns(bx, by), _quarter_turns(cx, cy)
            low, high = min(a, b, c), max(a, b, c)
            if high - low > 2.0 - _ROUNDING:
                a, b, c = a + 4.0 * (a < 2.0), b + 4.0 * (b < 2.0), c + 4.0 * (c < 2.0)
                low, high = min(a, b, c), max(a, b, c)
                if high - low > 2.0 - _ROUNDING:  # The sensor is above or below the triangle
                    low, high = 0.0, 4.0 - 2.0 * _ROUNDING
            begin = table[int(max(low - _ROUNDING, 0.0) * scale)]
            for number in range(begin, table[int((high + _ROUNDING) * scale) + 1]):
                slot = slots[number % count]
                if slot < 0:
                    continue
                x, y = columns[number % count, 0], columns[number % count, 1]
                low, high = _narrowed(-math.inf, math.inf, ux * x + uy * y, uz)
                low, high = _narrowed(low, high, vx * x + vy * y, vz)
                low, high = _narrowed(low, high, wx * x + wy * y, wz)
                if low > high:
                    continue
                # The lowest ring of the interval is near that of the column before
                while ring > 0 and rings[ring - 1, 0] >= low:
                    ring -= 1
                while ring < last and rings[ring, 0] < low:
                    ring += 1
                level = nx * x + ny * y
                while ring < last and rings[ring, 0] <= high:
                    ahead, column = level * rings[ring, 1] + nz * rings[ring, 2], order[ring]
                    if ahead > 0.0 and volume < ahead * distance[slot, column]:
                        rows[slot, column] = row
                        distance[slot, column] = volume / ahead
                        brightness[slot, column] = reflectivity[triangle] * ahead / math.sqrt(square)
                    ring += 1


@kernel("UniTuple(f8, 3)(f8[::1], f8[:,::1], f8[::1])")
def _moved(point: Array, rotation: Array, shift: Array) -> tuple[float, float, float]:
    """Return the coordinates of a rotated and shifted point."""
    x, y, z = point[0], point[1], point[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + shift[0],
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + shift[1],
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + shift[2],
    )


@kernel("UniTuple(f8, 3)(f8, f8, f8, f8, f8, f8)")
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """Return the cross product of two vectors."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel("UniTuple(f8, 2)(f8, f8, f8, f8)")
def _narrowed(low: float, high: float, level: float, up: float) -> tuple[float, float]:
    """Return the interval of tangents of elevations on the inner side of a plane: level + up * tangent >= 0."""
    if up > 0.0:
        return max(low, -level / up), high
    if up < 0.0:
        return low, min(high, -level / up)
    return low, high if level >= 0.0 else -math.inf


@kernel("f8(f8, f8)")
def _quarter_turns(x: float, y: float) -> float:
    """Return a measure of the azimuth of a point that rises from 0 to 4 in a turn, without trigonometry."""
    share = y / (abs(x) + abs(y) + 1e-300)
    if x < 0.0:
        return 2.0 - share
    return share if y >= 0.0 else 4.0 + share
