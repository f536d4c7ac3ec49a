"""From latitude and longitude to the plane of a map: the projections by which OpenDRIVE files say where they lie.

Transverse Mercator: L. Krüger's series to the sixth order of the third flattening, in the form of C. F. F. Karney,
"Transverse Mercator with an accuracy of a few nanometers", J. Geodesy 85 (2011), equations 7 to 14. Mercator and
Lambert conformal conic: J. P. Snyder, "Map projections: a working manual", USGS 1395 (1987), sections 7 and 15.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from eidrive_scenario.roads.georeference.geodetic_datum import Ellipsoid, Shift

CARLA_RADIUS = 6_378_137.0


@dataclass(frozen=True)
class TangentFrame:
    """Where a projection has its origin: latitude and longitude [rad], false easting and northing [m], scale."""

    latitude: float = 0.0
    longitude: float = 0.0
    x: float = 0.0
    y: float = 0.0
    scale: float = 1.0


class TransverseMercator:
    """Also UTM and Gauss-Krüger."""

    def __init__(self, ellipsoid: Ellipsoid, frame: TangentFrame) -> None:
        n = ellipsoid.flattening / (2.0 - ellipsoid.flattening)
        self._eccentricity = ellipsoid.eccentricity
        self._frame = frame
        self._radius = ellipsoid.axis / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0 + n**6 / 256.0)
        self._alpha = (
            n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180 - 127 * n**5 / 288 + 7891 * n**6 / 37800,
            13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440 + 281 * n**5 / 630 - 1983433 * n**6 / 1935360,
            61 * n**3 / 240 - 103 * n**4 / 140 + 15061 * n**5 / 26880 + 167603 * n**6 / 181440,
            49561 * n**4 / 161280 - 179 * n**5 / 168 + 6601661 * n**6 / 7257600,
            34729 * n**5 / 80640 - 3418889 * n**6 / 1995840,
            212378941 * n**6 / 319334400,
        )
        self._northing = self._across_and_along(frame.latitude, 0.0)[1]

    def __call__(self, latitude: float, longitude: float) -> tuple[float, float]:
        """x to the east and y to the north [m]."""
        x, y = self._across_and_along(latitude, longitude - self._frame.longitude)
        scale = self._frame.scale * self._radius
        return self._frame.x + scale * x, self._frame.y + scale * (y - self._northing)

    def _across_and_along(self, latitude: float, longitude: float) -> tuple[float, float]:
        tau = _conformal(math.tan(latitude), self._eccentricity)
        xi = math.atan2(tau, math.cos(longitude))
        eta = math.asinh(math.sin(longitude) / math.hypot(tau, math.cos(longitude)))
        return (
            eta + sum(a * math.cos(2 * j * xi) * math.sinh(2 * j * eta) for j, a in enumerate(self._alpha, 1)),
            xi + sum(a * math.sin(2 * j * xi) * math.cosh(2 * j * eta) for j, a in enumerate(self._alpha, 1)),
        )


class Mercator:
    """Upright Mercator; on a sphere also the one of web maps and of CARLA."""

    def __init__(self, ellipsoid: Ellipsoid, frame: TangentFrame) -> None:
        self._eccentricity, self._radius, self._frame = ellipsoid.eccentricity, ellipsoid.axis, frame

    def __call__(self, latitude: float, longitude: float) -> tuple[float, float]:
        """x to the east and y to the north [m]."""
        scale, frame = self._radius * self._frame.scale, self._frame
        north = _isometric(latitude, self._eccentricity) - _isometric(frame.latitude, self._eccentricity)
        return frame.x + scale * (longitude - frame.longitude), frame.y + scale * north


class LambertConformalConic:
    """On one or two standard parallels [rad]."""

    def __init__(self, ellipsoid: Ellipsoid, frame: TangentFrame, first: float, second: float) -> None:
        self._eccentricity, self._frame = ellipsoid.eccentricity, frame
        width, steepness = self._width(first), math.sin(first)
        if abs(first - second) > 1e-10:
            isometric = _isometric(second, self._eccentricity) - _isometric(first, self._eccentricity)
            steepness = math.log(width / self._width(second)) / isometric
        self._steepness = steepness
        grown = width / steepness * math.exp(steepness * _isometric(first, self._eccentricity))
        self._radius = ellipsoid.axis * frame.scale * grown
        self._origin = self._distance(frame.latitude)

    def __call__(self, latitude: float, longitude: float) -> tuple[float, float]:
        """x to the east and y to the north [m]."""
        turn, rho = self._steepness * (longitude - self._frame.longitude), self._distance(latitude)
        return self._frame.x + rho * math.sin(turn), self._frame.y + self._origin - rho * math.cos(turn)

    def _width(self, latitude: float) -> float:
        """Radius of the parallel over the ellipsoid's axis."""
        return math.cos(latitude) / math.sqrt(1.0 - (self._eccentricity * math.sin(latitude)) ** 2)

    def _distance(self, latitude: float) -> float:
        return self._radius * math.exp(-self._steepness * _isometric(latitude, self._eccentricity))


Projection = TransverseMercator | Mercator | LambertConformalConic


@dataclass(frozen=True)
class GeoReference:
    """A map's place on the globe: its projection, and the shift of its datum against WGS 84 where it has one."""

    projection: Projection
    ellipsoid: Ellipsoid
    shift: Shift | None = None

    def plane(self, latitude: float, longitude: float) -> tuple[float, float]:
        """x and y [m] of a point given in WGS 84 [rad]."""
        if self.shift is not None:
            latitude, longitude = self.shift.from_wgs84(latitude, longitude, self.ellipsoid)
        return self.projection(latitude, longitude)


def _conformal(tau: float, eccentricity: float) -> float:
    """Tangent of the conformal latitude by that of the geographic one (Karney, equations 7 and 9)."""
    sigma = math.sinh(eccentricity * math.atanh(eccentricity * tau / math.hypot(1.0, tau)))
    return tau * math.hypot(1.0, sigma) - sigma * math.hypot(1.0, tau)


def _isometric(latitude: float, eccentricity: float) -> float:
    """Isometric latitude, by which Mercator's map grows northwards."""
    return math.asinh(_conformal(math.tan(latitude), eccentricity))
