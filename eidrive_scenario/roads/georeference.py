"""Geodetic reference of a road map: <geoReference> as a PROJ transformation from WGS 84 to the map's plane.

The text comes from an untrusted file, and PROJ opens files that a PROJ string names (`+nadgrids`, `+init`, pipelines).
PROJ therefore receives a string of checked names and numbers instead of the text. Grid files are never used, so that
results do not depend on the machine.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from eidrive_scenario.errors import suggestion

if TYPE_CHECKING:
    from pyproj import Transformer

PROJECTIONS = (
    *("aea", "aeqd", "cass", "eqc", "etmerc", "krovak", "laea", "lcc", "merc", "omerc", "poly", "somerc", "stere"),
    *("sterea", "tmerc", "utm", "webmerc"),
)
"""Projections to a plane with x to the east and y to the north [m]."""

DATUMS: Mapping[str, tuple[str, str]] = {
    "WGS84": ("WGS84", ""),
    "NAD83": ("GRS80", ""),
    "potsdam": ("bessel", "598.1,73.7,418.2,0.202,0.045,-2.455,6.7"),
    "OSGB36": ("airy", "446.448,-125.157,542.060,0.1502,0.2470,0.8421,-20.4894"),
}
"""Ellipsoid and `towgs84` by datum. PROJ itself may select a grid file for a datum's name."""

CARLA_RADIUS = 6_378_137.0
"""Radius of CARLA's sphere [m]."""

_ANGLES = ("lat_0", "lon_0", "lat_1", "lon_1", "lat_2", "lon_2", "lat_ts", "lonc", "alpha", "gamma")
_SCALE_AND_ORIGIN = ("k", "k_0", "x_0", "y_0")
_VARIANTS = ("no_uoff", "no_off", "no_rot", "guam", "hyperbolic", "czech", "approx")
"""Parameters without a value that select a variant of a projection."""
_ELLIPSOID_NUMBERS = ("R", "a", "b", "rf", "f", "es", "e")
_SPHERES = ("R_A", "R_V", "R_a", "R_g", "R_h")
_SPHERE_LATITUDES = ("R_lat_a", "R_lat_g")
"""Parameters that replace the ellipsoid by a sphere, without a value or with a latitude."""
_HELMERT = ("x", "y", "z", "rx", "ry", "rz", "s")


@dataclass(frozen=True)
class GeoReference:
    """Transformation from WGS 84 to the plane of a map."""

    transformer: Transformer

    def plane(self, latitude: float, longitude: float) -> tuple[float, float]:
        """Return x and y [m] of a point in WGS 84 [rad]. Raise ValueError if the projection is undefined there."""
        x, y = self.transformer.transform(longitude, latitude, radians=True)
        if not (math.isfinite(x) and math.isfinite(y)):
            point = f"{math.degrees(latitude):g}°, {math.degrees(longitude):g}°"
            raise ValueError(f"<geoReference>: the projection is undefined at latitude and longitude {point}")
        return x, y

    def geodetic(self, x: float, y: float) -> tuple[float, float]:
        """Return latitude and longitude in WGS 84 [rad] of a point of the plane [m].

        Raise ValueError if the projection is undefined there.
        """
        from pyproj.enums import TransformDirection

        longitude, latitude = self.transformer.transform(x, y, radians=True, direction=TransformDirection.INVERSE)
        if not (math.isfinite(latitude) and math.isfinite(longitude)):
            raise ValueError(f"<geoReference>: the projection is undefined at x and y {x:g} m, {y:g} m")
        return latitude, longitude


def parse_geo_reference(text: str) -> GeoReference:
    """Parse a PROJ string or the EPSG number of a projected coordinate system. Raise ValueError if it is invalid.

    A text of latitude and longitude without a projection is CARLA's: a Mercator projection of a sphere, true to scale
    at that latitude.
    """
    number = re.search(r"(?i)epsg:*([0-9]{1,9})\s*$", text.strip())
    if number:
        return GeoReference(_epsg_transformer(int(number[1])))
    given = {name: value for name, _, value in (part.lstrip("+").partition("=") for part in text.split())}
    if "proj" in given:
        return GeoReference(_build_transformer(_pipeline(given)))
    if "lat_0" not in given or "lon_0" not in given:
        raise ValueError(f"<geoReference>: the text is not a PROJ string (got {text.strip()[:60]!r})")
    latitude, longitude = _number(given, "lat_0"), _number(given, "lon_0")
    if not abs(latitude) < 90.0:
        raise ValueError(f"<geoReference>: lat_0 is out of range (got {latitude:g}; expected less than 90)")
    north = CARLA_RADIUS * math.cos(math.radians(latitude)) * math.asinh(math.tan(math.radians(latitude)))
    projection = f"+proj=merc +R={CARLA_RADIUS!r} +lat_ts={latitude!r} +lon_0={longitude!r} +y_0={-north!r}"
    return GeoReference(_build_transformer(projection))


def _build_transformer(definition: str) -> Transformer:
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_pipeline(definition)
    except ProjError as error:
        raise ValueError(f"<geoReference>: PROJ rejects the parameters ({_reason(error)})") from error


def _epsg_transformer(number: int) -> Transformer:
    """Select the most accurate transformation from WGS 84 without a grid file."""
    from pyproj import CRS, network
    from pyproj.exceptions import ProjError
    from pyproj.transformer import TransformerGroup

    try:
        target = CRS.from_epsg(number)
    except ProjError as error:
        raise ValueError(f"<geoReference>: EPSG:{number} is not in the EPSG register") from error
    axes = {(axis.direction, axis.unit_conversion_factor) for axis in target.axis_info}
    if not target.is_projected or axes != {("east", 1.0), ("north", 1.0)}:
        raise ValueError(f"<geoReference>: EPSG:{number} is not a plane with axes to the east and north [m]")
    was_enabled = network.is_network_enabled()
    network.set_network_enabled(False)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Best transformation is not available")
            group = TransformerGroup("EPSG:4326", target, always_xy=True, allow_ballpark=False)
    finally:
        network.set_network_enabled(was_enabled)
    for transformer in group.transformers:
        if "grids=" not in transformer.definition:
            return transformer
    raise ValueError(f"<geoReference>: no transformation from WGS 84 to EPSG:{number} works without a grid file")


def _pipeline(given: Mapping[str, str]) -> str:
    """Return the PROJ pipeline of a PROJ string: shift of the datum at height 0, then projection."""
    name = given["proj"]
    if name not in PROJECTIONS:
        raise ValueError(f"<geoReference>: projection {name!r} is not supported ({suggestion(name, PROJECTIONS)})")
    for key, usual in (("axis", ("enu",)), ("pm", ("greenwich", "0")), ("nadgrids", ("@null",))):
        if given.get(key, usual[0]) not in usual:
            raise ValueError(f"<geoReference>: {key} is not supported (got {given[key]!r}; expected {usual[0]!r})")
    ellipsoid, shift = _datum(given)
    numbers = [f"+{key}={_number(given, key)!r}" for key in _ANGLES + _SCALE_AND_ORIGIN if key in given]
    if name == "utm":
        zone = _number(given, "zone") if "zone" in given else math.nan
        if not 1.0 <= zone <= 60.0:
            raise ValueError(f"<geoReference>: zone is {given.get('zone', 'missing')!r} (expected 1 to 60)")
        numbers = [f"+zone={int(zone)}", *(["+south"] if "south" in given else [])]
    step = (f"+step +proj={name}", ellipsoid, *numbers, *(f"+{key}" for key in _VARIANTS if key in given))
    return " ".join(("+proj=pipeline", *_shift_steps(shift, ellipsoid), *step))


def _shift_steps(shift: tuple[float, ...], ellipsoid: str) -> tuple[str, ...]:
    """Return the steps of a Helmert transformation from WGS 84, with PROJ's `towgs84` as parameters."""
    if not any(shift):
        return ()
    helmert = " ".join(f"+{key}={value!r}" for key, value in zip(_HELMERT, shift, strict=False))
    convention = "+convention=position_vector" if len(shift) == len(_HELMERT) else ""
    return (
        "+step +proj=cart +ellps=WGS84",
        f"+step +inv +proj=helmert {helmert} {convention}",
        f"+step +inv +proj=cart {ellipsoid}",
    )


def _datum(given: Mapping[str, str]) -> tuple[str, tuple[float, ...]]:
    """Return the ellipsoid as PROJ parameters, and the shift of the datum (`towgs84`)."""
    from pyproj.list import get_ellps_map

    numbers = [f"+{key}={_number(given, key)!r}" for key in _ELLIPSOID_NUMBERS if key in given]
    name, shift = given.get("ellps", "" if numbers else "WGS84"), given.get("towgs84", "")
    if "datum" in given:
        datum = given["datum"]
        if datum not in DATUMS:
            raise ValueError(f"<geoReference>: datum {datum!r} is not supported ({suggestion(datum, DATUMS)})")
        name = DATUMS[datum][0]
        shift = shift or DATUMS[datum][1]
    if name and name not in get_ellps_map():
        raise ValueError(f"<geoReference>: ellipsoid {name!r} is unknown ({suggestion(name, get_ellps_map())})")
    try:
        values = tuple(float(part) for part in shift.split(",")) if shift else ()
    except ValueError:
        values = (math.nan,)
    if values and not (len(values) in (3, 7) and all(map(math.isfinite, values))):
        raise ValueError(f"<geoReference>: towgs84 is invalid (got {shift[:60]!r}; expected 3 or 7 numbers)")
    spheres = [f"+{key}={_number(given, key)!r}" for key in _SPHERE_LATITUDES if key in given]
    spheres += [f"+{key}" for key in _SPHERES if key in given]
    return " ".join([*([f"+ellps={name}"] if name else []), *numbers, *spheres]), values


def _number(given: Mapping[str, str], name: str) -> float:
    try:
        value = float(given[name])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"<geoReference>: {name} is not a number (got {given[name][:60]!r})")
    return value


def _reason(error: Exception) -> str:
    """Return PROJ's own reason, without the definition that precedes it."""
    return str(error).split("(Internal Proj Error: ")[-1].removesuffix(")").rsplit("ipeline: ", 1)[-1]
