"""Projections against the worked examples of the EPSG guidance, and against PROJ 9.5 (pyproj 3.7.2)."""

from __future__ import annotations

import math

import pytest

from eidrive_scenario.roads import PositionError, RoadNetwork
from eidrive_scenario.roads.georeference.geo_reference import parse_geo_reference

MAP = '<OpenDRIVE><header revMajor="1" revMinor="6">{inside}</header>{road}</OpenDRIVE>'


def plane(text: str, latitude: float, longitude: float) -> tuple[float, float]:
    return parse_geo_reference(text).plane(math.radians(latitude), math.radians(longitude))


@pytest.mark.parametrize(
    ("text", "latitude", "longitude", "x", "y", "tolerance"),
    [
        # EPSG Guidance Note 7-2 (2019): Transverse Mercator, British National Grid, 50°30'N 0°30'E
        (
            "+proj=tmerc +lat_0=49 +lon_0=-2 +k=0.9996012717 +x_0=400000 +y_0=-100000 +ellps=airy",
            *(50.5, 0.5, 577274.99, 69740.50, 0.01),
        ),
        # the same: Mercator variant A, Makassar / NEIEZ, 3°S 120°E
        ("+proj=merc +lon_0=110 +k=0.997 +x_0=3900000 +y_0=900000 +ellps=bessel", -3, 120, 5009726.58, 569150.82, 0.01),
        # the same: Lambert conic conformal (2SP), NAD27 / Texas South Central, 28°30'N 96°W, false easting in meters
        (
            "+proj=lcc +lat_0=27.8333333333333 +lon_0=-99 +lat_1=28.3833333333333 +lat_2=30.2833333333333"
            " +x_0=609601.21920 +y_0=0 +ellps=clrk66",
            *(28.5, -96.0, 2963503.91 * 0.30480061, 254759.80 * 0.30480061, 0.02),
        ),
        # PROJ
        ("+proj=utm +zone=32 +datum=WGS84", 48.0, 11.0, 649187.87496, 5318235.61388, 1e-4),
        ("EPSG:32633", -20.0, 15.0, 500000.0, -2211481.30767, 1e-4),
        ("+proj=tmerc +lat_0=0 +lon_0=9 +x_0=3500000 +ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7",
         52.0, 13.0, 3774730.78086, 5770466.69084, 1e-4),
    ],
)  # fmt: skip
def test_known_points(text: str, latitude: float, longitude: float, x: float, y: float, tolerance: float) -> None:
    assert plane(text, latitude, longitude) == pytest.approx((x, y), abs=tolerance)


def test_the_origin_of_a_projection_lies_at_its_false_coordinates() -> None:
    assert plane("+proj=tmerc +lat_0=49 +lon_0=8 +x_0=10 +y_0=20", 49, 8) == pytest.approx((10, 20), abs=1e-9)
    assert plane("+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=7 +y_0=6", 46.5, 3) == pytest.approx((7, 6))


def test_a_southern_zone_counts_from_ten_thousand_kilometers() -> None:
    north, south = plane("+proj=utm +zone=33", -20, 15), plane("+proj=utm +zone=33 +south", -20, 15)
    assert south == pytest.approx((north[0], north[1] + 1e7))


def test_a_map_of_carla_is_to_scale_at_its_latitude() -> None:
    """A minute of arc to the east is R cos(latitude) times its angle, and so is one to the north near by."""
    east, none = plane("+lat_0=49 +lon_0=8", 49, 8 + 1 / 60)
    minute = math.radians(1 / 60)
    assert (east, none) == pytest.approx((6_378_137.0 * math.cos(math.radians(49)) * minute, 0.0), abs=1e-6)
    _, north = plane("+lat_0=49 +lon_0=8", 49 + 1 / 60, 8)
    assert north == pytest.approx(6_378_137.0 * minute, rel=2e-4)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("+proj=tmrc +lat_0=0", "did you mean 'tmerc'"),
        ("+proj=utm", "zone is 'missing'"),
        ("+proj=utm +zone=99", "zone is '99'"),
        ("+proj=tmerc +ellps=besel", "did you mean 'bessel'"),
        ("+proj=tmerc +lat_0=north", "lat_0 is 'north'"),
        ("+proj=tmerc +axis=neu", "axes are 'neu'"),
        ("+proj=tmerc +towgs84=1,2", "towgs84 has 2 numbers"),
        ('PROJCS["WGS 84"]', "no PROJ text"),
        ("EPSG:2154", "EPSG:2154 is not known"),
    ],
)
def test_what_is_not_understood_is_said(text: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        parse_geo_reference(text)


def test_a_map_says_where_its_origin_lies(road: object) -> None:
    """20 km east of the zone's middle at 48°N; the file is shifted there and turned by a right angle."""
    text = "<geoReference><![CDATA[ +proj=utm +zone=32 +datum=WGS84 ]]></geoReference>"
    place = plane("+proj=utm +zone=32 +datum=WGS84", 48.0, 9.25)
    shifted = text + f'<offset x="{place[0]!r}" y="{place[1]!r}" z="100" hdg="{math.pi / 2!r}"/>'
    network = RoadNetwork.parse(MAP.format(inside=shifted, road=road()))  # type: ignore[operator]
    angles = math.radians(48.0), math.radians(9.25)
    assert network.geographic(*angles) == pytest.approx((0.0, 0.0), abs=1e-6)
    east = network.geographic(angles[0], angles[1] + 1e-6)
    assert east[0] == pytest.approx(0.0, abs=0.02)
    assert east[1] < -4.0
    plain = RoadNetwork.parse(MAP.format(inside=text, road=road()))  # type: ignore[operator]
    assert plain.geographic(*angles) == pytest.approx(place)


def test_a_map_without_a_place_on_the_globe(road: object) -> None:
    network = RoadNetwork.parse(MAP.format(inside="", road=road()))  # type: ignore[operator]
    with pytest.raises(PositionError, match="add <geoReference>"):
        network.geographic(0.8, 0.1)
    wrong = "<geoReference>+proj=mars</geoReference>"
    network = RoadNetwork.parse(MAP.format(inside=wrong, road=road()))  # type: ignore[operator]
    with pytest.raises(PositionError, match=r"'mars'.*\+proj=utm \+zone=32"):
        network.geographic(0.8, 0.1)
