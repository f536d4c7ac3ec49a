"""Ellipsoids, and the shift from WGS 84 to another datum."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

ARC_SECOND = math.pi / 180.0 / 3600.0


@dataclass(frozen=True)
class Ellipsoid:
    """Half of the longer axis [m], and the flattening."""

    axis: float
    flattening: float

    @property
    def eccentricity(self) -> float:
        """The first one."""
        return math.sqrt(self.flattening * (2.0 - self.flattening))


WGS84 = Ellipsoid(6_378_137.0, 1.0 / 298.257223563)

ELLIPSOIDS: Mapping[str, Ellipsoid] = {
    "WGS84": WGS84,
    "GRS80": Ellipsoid(6_378_137.0, 1.0 / 298.257222101),
    "airy": Ellipsoid(6_377_563.396, 1.0 / 299.3249646),
    "bessel": Ellipsoid(6_377_397.155, 1.0 / 299.1528128),
    "clrk66": Ellipsoid(6_378_206.4, 1.0 - 6_356_583.8 / 6_378_206.4),
    "intl": Ellipsoid(6_378_388.0, 1.0 / 297.0),
    "krass": Ellipsoid(6_378_245.0, 1.0 / 298.3),
    "sphere": Ellipsoid(6_370_997.0, 0.0),
}
"""By their names in PROJ."""

DATUMS: Mapping[str, tuple[str, tuple[float, ...]]] = {
    "WGS84": ("WGS84", ()),
    "NAD83": ("GRS80", ()),
    "potsdam": ("bessel", (598.1, 73.7, 418.2, 0.202, 0.045, -2.455, 6.7)),
    "OSGB36": ("airy", (446.448, -125.157, 542.060, 0.1502, 0.2470, 0.8421, -20.4894)),
}
"""PROJ's name of a datum to its ellipsoid and `towgs84`."""


@dataclass(frozen=True)
class Shift:
    """Seven parameters of Helmert's transformation to WGS 84, as PROJ's `towgs84` has them.

    Translations [m], rotations of the position vector [arc seconds], growth of the scale [parts per million].
    """

    parameters: tuple[float, float, float, float, float, float, float]

    @classmethod
    def of(cls, numbers: Sequence[float]) -> Shift | None:
        """The shift with three or seven parameters; None where all are 0. Raises ValueError for another count."""
        if len(numbers) not in (3, 7):
            raise ValueError(f"towgs84 has {len(numbers)} numbers")
        dx, dy, dz, rx, ry, rz, growth = (*numbers, 0.0, 0.0, 0.0, 0.0)[:7]
        return cls((dx, dy, dz, rx, ry, rz, growth)) if any(numbers) else None

    def from_wgs84(self, latitude: float, longitude: float, ellipsoid: Ellipsoid) -> tuple[float, float]:
        """Latitude and longitude [rad] on the other ellipsoid of a point given in WGS 84, at height 0."""
        dx, dy, dz, rx, ry, rz, growth = self.parameters
        rx, ry, rz, scale = rx * ARC_SECOND, ry * ARC_SECOND, rz * ARC_SECOND, 1.0 + growth * 1e-6
        x, y, z = _geocentric(latitude, longitude)
        x, y, z = (x - dx) / scale, (y - dy) / scale, (z - dz) / scale
        x, y, z = x + rz * y - ry * z, y - rz * x + rx * z, z + ry * x - rx * y
        return _latitude(math.hypot(x, y), z, ellipsoid), math.atan2(y, x)


def _geocentric(latitude: float, longitude: float) -> tuple[float, float, float]:
    square = WGS84.eccentricity**2
    radius = WGS84.axis / math.sqrt(1.0 - square * math.sin(latitude) ** 2)
    out = radius * math.cos(latitude)
    return out * math.cos(longitude), out * math.sin(longitude), radius * (1.0 - square) * math.sin(latitude)


def _latitude(out: float, up: float, ellipsoid: Ellipsoid) -> float:
    """Geographic latitude [rad] of a point `out` from the axis and `up` from the equator's plane [m], by iteration."""
    square = ellipsoid.eccentricity**2
    latitude = math.atan2(up, out * (1.0 - square))
    for _ in range(6):
        sine = math.sin(latitude)
        radius = ellipsoid.axis / math.sqrt(1.0 - square * sine * sine)
        latitude = math.atan2(up + square * radius * sine, out)
    return latitude
