"""The text of OpenDRIVE's <geoReference>: a PROJ string, or the number of a coordinate system."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from eidrive_scenario.errors import suggestion
from eidrive_scenario.roads.georeference.geodesy import (
    CARLA_RADIUS,
    GeoReference,
    LambertConformalConic,
    Mercator,
    Projection,
    TangentFrame,
    TransverseMercator,
)
from eidrive_scenario.roads.georeference.geodetic_datum import DATUMS, ELLIPSOIDS, Ellipsoid, Shift

PROJECTIONS = ("tmerc", "etmerc", "utm", "merc", "webmerc", "lcc")
UTM_SCALE, UTM_EASTING, UTM_SOUTHERN_NORTHING = 0.9996, 500_000.0, 10_000_000.0


def parse_geo_reference(text: str) -> GeoReference:
    """The map's place on the globe. Raises ValueError, in words, for what is not understood.

    A text of latitude and longitude alone, without a projection, is CARLA's: a Mercator map on a sphere, to scale at
    that latitude.
    """
    numbered = re.search(r"(?i)epsg:*([0-9]{4,5})\s*$", text.strip())
    said = _parameters(_proj_of(int(numbered[1])) if numbered else text)
    if "proj" not in said:
        if "lat_0" not in said or "lon_0" not in said:
            raise ValueError(f"the map's geoReference is {text.strip()[:60]!r}, which is no PROJ text")
        sphere = Ellipsoid(CARLA_RADIUS, 0.0)
        latitude = _angle(said, "lat_0")
        return GeoReference(
            Mercator(sphere, TangentFrame(latitude, _angle(said, "lon_0"), scale=math.cos(latitude))), sphere
        )
    kind = said["proj"]
    if kind not in PROJECTIONS:
        raise ValueError(f"the map's projection is {kind!r}; {suggestion(kind, PROJECTIONS)}")
    if said.get("axis", "enu") != "enu":
        raise ValueError(f"the map's axes are {said['axis']!r}, and only 'enu' is known")
    ellipsoid, shift = _datum(said)
    if kind == "webmerc":
        ellipsoid = Ellipsoid(CARLA_RADIUS, 0.0)
    return GeoReference(_projection(kind, said, ellipsoid), ellipsoid, shift)


def _projection(kind: str, said: Mapping[str, str], ellipsoid: Ellipsoid) -> Projection:
    latitude, longitude = _angle(said, "lat_0"), _angle(said, "lon_0")
    scale = _number(said, "k_0" if "k_0" in said else "k", 1.0)
    x, y = _number(said, "x_0", 0.0), _number(said, "y_0", 0.0)
    if kind == "utm":
        zone = _number(said, "zone", math.nan)
        if not 1.0 <= zone <= 60.0:
            raise ValueError(f"the map's UTM zone is {said.get('zone', 'missing')!r}, and 1 to 60 are expected")
        middle = math.radians(6.0 * int(zone) - 183.0)
        north = UTM_SOUTHERN_NORTHING if "south" in said else 0.0
        return TransverseMercator(ellipsoid, TangentFrame(0.0, middle, UTM_EASTING, north, UTM_SCALE))
    if kind in ("tmerc", "etmerc"):
        return TransverseMercator(ellipsoid, TangentFrame(latitude, longitude, x, y, scale))
    if kind == "lcc":
        first = _angle(said, "lat_1" if "lat_1" in said else "lat_0")
        second = _angle(said, "lat_2") if "lat_2" in said else first
        return LambertConformalConic(ellipsoid, TangentFrame(latitude, longitude, x, y, scale), first, second)
    if "lat_ts" in said:
        true = _angle(said, "lat_ts")
        scale = math.cos(true) / math.sqrt(1.0 - (ellipsoid.eccentricity * math.sin(true)) ** 2)
    return Mercator(ellipsoid, TangentFrame(0.0, longitude, x, y, scale))


def _datum(said: Mapping[str, str]) -> tuple[Ellipsoid, Shift | None]:
    name, shift = "WGS84", ()  # type: tuple[str, tuple[float, ...]]
    if "datum" in said:
        if said["datum"] not in DATUMS:
            raise ValueError(f"the map's datum is {said['datum']!r}; {suggestion(said['datum'], DATUMS)}")
        name, shift = DATUMS[said["datum"]]
    elif "ellps" in said:
        name = said["ellps"]
    if name not in ELLIPSOIDS:
        raise ValueError(f"the map's ellipsoid is {name!r}; {suggestion(name, ELLIPSOIDS)}")
    ellipsoid = ELLIPSOIDS[name]
    axis = _number(said, "a", ellipsoid.axis)
    if "R" in said:
        ellipsoid = Ellipsoid(_number(said, "R", axis), 0.0)
    elif "rf" in said:
        ellipsoid = Ellipsoid(axis, 1.0 / _number(said, "rf", math.inf))
    elif "b" in said:
        ellipsoid = Ellipsoid(axis, 1.0 - _number(said, "b", axis) / axis)
    elif "a" in said:
        ellipsoid = Ellipsoid(axis, ellipsoid.flattening)
    if "towgs84" in said:
        try:
            shift = tuple(float(part) for part in said["towgs84"].split(","))
        except ValueError:
            raise ValueError(f"the map's towgs84 is {said['towgs84']!r}, and numbers are expected") from None
    return ellipsoid, Shift.of(shift) if shift else None


def _proj_of(number: int) -> str:
    """The PROJ text of a coordinate system of the EPSG register: those of UTM, Gauss-Krüger zones, web maps."""
    zone = number % 100
    for family, south, ellipsoid in ((326, "", "WGS84"), (327, " +south", "WGS84"), (258, "", "GRS80")):
        if number // 100 == family and 1 <= zone <= 60:
            return f"+proj=utm +zone={zone}{south} +ellps={ellipsoid}"
    if 31466 <= number <= 31469:
        zone = number - 31464
        return f"+proj=tmerc +lat_0=0 +lon_0={3 * zone} +k=1 +x_0={zone}500000 +y_0=0 +datum=potsdam"
    if number == 3857:
        return "+proj=webmerc"
    raise ValueError(f"the map's coordinate system EPSG:{number} is not known here")


def _parameters(text: str) -> dict[str, str]:
    return {name: value for name, _, value in (part.lstrip("+").partition("=") for part in text.split())}


def _number(said: Mapping[str, str], name: str, usual: float) -> float:
    try:
        value = float(said[name]) if name in said else usual
    except ValueError:
        value = math.nan
    if not math.isfinite(value) and name in said:
        raise ValueError(f"the map's {name} is {said[name]!r}, and a number is expected")
    return value


def _angle(said: Mapping[str, str], name: str) -> float:
    return math.radians(_number(said, name, 0.0))
