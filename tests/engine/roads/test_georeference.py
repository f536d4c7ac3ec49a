"""Tests of geodetic references by worked examples of EPSG and swisstopo, values of PROJ, and hostile texts."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.roads import PositionError, RoadNetwork
from eidrive_scenario.roads.georeference import parse_geo_reference

RoadText = Callable[..., str]


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
        # the same: Hotine oblique Mercator, Timbalai 1948 / RSO Borneo, origin at the natural origin (variant A)
        (
            "+proj=omerc +lat_0=4 +lonc=115 +alpha=53.315820472222 +gamma=53.130102361111 +k=0.99984 +no_uoff"
            " +a=6377298.556 +f=0.003324449296663",
            *(5.387253583333, 115.805505444444, 679245.73, 596562.78, 0.01),
        ),
        # and at the center of the projection (variant B)
        (
            "+proj=omerc +lat_0=4 +lonc=115 +alpha=53.315820472222 +gamma=53.130102361111 +k=0.99984 +x_0=590476.87"
            " +y_0=442857.65 +a=6377298.556 +rf=300.8017",
            *(5.387253583333, 115.805505444444, 679245.73, 596562.78, 0.01),
        ),
        # Moritz, Geodetic Reference System 1980 (Journal of Geodesy 74, 2000): radius of the sphere of equal surface
        ("+proj=merc +ellps=GRS80 +R_A", 0.0, 45.0, 6371007.1810 * math.pi / 4, 0.0, 1e-3),
        # PROJ 9.5
        ("+proj=utm +zone=32 +datum=WGS84", 48.0, 11.0, 649187.87496, 5318235.61388, 1e-4),
        ("EPSG:32633", -20.0, 15.0, 500000.0, -2211481.30767, 1e-4),
        ("+proj=tmerc +lat_0=0 +lon_0=9 +x_0=3500000 +ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7",
         52.0, 13.0, 3774730.78086, 5770466.69084, 1e-4),
        # swisstopo, "Approximate formulas for the transformation between Swiss projection coordinates and WGS84":
        # 46°02'38.87"N 8°43'49.79"E has the rigorous coordinates 2,700,000 and 1,100,000
        ("EPSG:2056", 46.0441306, 8.7304972, 2_700_000.0, 1_100_000.0, 0.2),
        # definition of Lambert-93 (RGF93): origin at 46.5°N 3°E with false coordinates
        ("EPSG:2154", 46.5, 3.0, 700_000.0, 6_600_000.0, 1e-6),
        # Ordnance Survey, "A guide to coordinate systems in Great Britain", Caister Water Tower by OSTN15; the
        # Helmert transformation without the grid file has an accuracy of 5 m
        ("EPSG:27700", 52.6580078, 1.7160740, 651409.80, 313177.45, 5.0),
    ],
)  # fmt: skip
def test_plane_of_known_points_matches_their_sources(
    text: str, latitude: float, longitude: float, x: float, y: float, tolerance: float
) -> None:
    assert plane(text, latitude, longitude) == pytest.approx((x, y), abs=tolerance)


@pytest.mark.parametrize("shape", ["f=0.00335281068118", "es=0.00669438002290", "e=0.0818191910428"])
def test_ellipsoid_by_flattening_or_eccentricity_is_that_of_its_name(shape: str) -> None:
    """Moritz (2000) gives the flattening and the squared eccentricity of GRS 80."""
    numbers, name = (f"+proj=tmerc +lat_0=48 +lon_0=11 {form}" for form in (f"+a=6378137 +{shape}", "+ellps=GRS80"))
    assert plane(numbers, 49, 12) == pytest.approx(plane(name, 49, 12), abs=1e-4)


def test_oblique_projection_by_two_points_has_its_axis_through_them() -> None:
    """With the origin of x and y on the axis, and x along it, both points have y = 0."""
    text = "+proj=omerc +lat_0=48 +lat_1=47 +lon_1=8 +lat_2=49 +lon_2=14 +no_rot +ellps=GRS80"
    assert [plane(text, *point)[1] for point in ((47, 8), (49, 14))] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_projection_at_its_origin_gives_false_coordinates() -> None:
    assert plane("+proj=tmerc +lat_0=49 +lon_0=8 +x_0=10 +y_0=20", 49, 8) == pytest.approx((10, 20), abs=1e-9)
    assert plane("+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=7 +y_0=6", 46.5, 3) == pytest.approx((7, 6))


def test_utm_south_adds_ten_thousand_kilometers() -> None:
    north, south = plane("+proj=utm +zone=33", -20, 15), plane("+proj=utm +zone=33 +south", -20, 15)
    assert south == pytest.approx((north[0], north[1] + 1e7))


def test_carla_map_is_true_to_scale_at_its_latitude() -> None:
    """A minute of arc to the east is R cos(latitude) times its angle, and so is a minute to the north nearby."""
    east, none = plane("+lat_0=49 +lon_0=8", 49, 8 + 1 / 60)
    minute = math.radians(1 / 60)
    assert (east, none) == pytest.approx((6_378_137.0 * math.cos(math.radians(49)) * minute, 0.0), abs=1e-6)
    _, north = plane("+lat_0=49 +lon_0=8", 49 + 1 / 60, 8)
    assert north == pytest.approx(6_378_137.0 * minute, rel=2e-4)


def test_null_grid_of_a_web_map_equals_webmerc() -> None:
    null_grid = "+proj=merc +a=6378137 +b=6378137 +lat_ts=0 +lon_0=0 +k=1 +nadgrids=@null +wktext +no_defs"
    assert plane(null_grid, 48, 11) == pytest.approx(plane("EPSG:3857", 48, 11), abs=1e-6)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("+proj=tmrc +lat_0=0", "did you mean 'tmerc'"),
        ("+proj=longlat +datum=WGS84", "projection 'longlat' is not supported"),
        ("+proj=utm", "zone is 'missing'"),
        ("+proj=utm +zone=99", "zone is '99'"),
        ("+proj=tmerc +ellps=besel", "did you mean 'bessel'"),
        ("+proj=tmerc +datum=postdam", "did you mean 'potsdam'"),
        ("+proj=tmerc +lat_0=north", "lat_0 is not a number"),
        ("+proj=tmerc +lat_0=nan", "lat_0 is not a number"),
        ("+proj=tmerc +axis=neu", "axis is not supported"),
        ("+proj=tmerc +pm=paris", "pm is not supported"),
        ("+proj=tmerc +towgs84=1,2", "expected 3 or 7 numbers"),
        ("+proj=tmerc +towgs84=1,2,inf", "expected 3 or 7 numbers"),
        ("+proj=tmerc +k=0", "PROJ rejects the parameters .*k_0"),
        ("+proj=merc +R=-1", "PROJ rejects the parameters"),
        ("+lat_0=90 +lon_0=8", "lat_0 is out of range"),
        ('PROJCS["WGS 84"]', "not a PROJ string"),
        ("EPSG:9999", "EPSG:9999 is not in the EPSG register"),
        ("EPSG:999999", "EPSG:999999 is not in the EPSG register"),
        ("EPSG:4326", "is not a plane with axes to the east and north"),  # degrees
        ("EPSG:5513", "is not a plane with axes to the east and north"),  # south and west
        ("EPSG:2225", "is not a plane with axes to the east and north"),  # US survey feet
    ],
)
def test_invalid_geo_reference_is_an_error(text: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        parse_geo_reference(text)


@pytest.mark.parametrize(
    "text",
    [
        "+proj=utm +zone=32 +nadgrids={file}",
        "+proj=tmerc +nadgrids=@{file},@null",
        "+init={file}:32632",
        "+proj=pipeline +step +proj=hgridshift +grids={file}",
        "+proj=vgridshift +grids={file}",
        "+proj=tmerc +ellps=WGS84+nadgrids={file}",
        "+proj=tmerc +datum={file}",
        "+proj=tmerc +lat_0=1+nadgrids={file}",
        "file://{file}",
        "@{file}",
    ],
)
def test_geo_reference_with_a_file_is_rejected(text: str, tmp_path: Path) -> None:
    """The named file is a pipe without a writer: opening it would block until the timeout of the test."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(ValueError, match="<geoReference>"):
        parse_geo_reference(text.format(file=pipe))


@pytest.mark.parametrize("extra", ["geoidgrids", "grids", "init", "step +proj=hgridshift +grids", "file", "catalog"])
def test_unused_parameters_never_reach_proj(extra: str, tmp_path: Path) -> None:
    """RoadRunner writes `geoidgrids`; heights are not transformed."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = f"+proj=tmerc +{extra}={pipe}"
    if "+proj=hgridshift" in text:
        with pytest.raises(ValueError, match="hgridshift"):
            parse_geo_reference(text)
    else:
        assert str(pipe) not in parse_geo_reference(text).transformer.definition


def test_epsg_number_uses_neither_network_nor_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    """With network access, PROJ would select the grid BETA2007 of its server for Gauss-Krüger zones."""
    from pyproj import network

    network.set_network_enabled(True)
    try:
        transformer = parse_geo_reference("EPSG:31467").transformer
        assert network.is_network_enabled()
    finally:
        network.set_network_enabled(False)
    assert "grids" not in transformer.definition
    explicit = "+proj=tmerc +lat_0=0 +lon_0=9 +x_0=3500000 +datum=potsdam"
    assert plane("EPSG:31467", 48, 9) == pytest.approx(plane(explicit, 48, 9), abs=1e-6)


def test_import_of_roads_does_not_import_pyproj() -> None:
    code = "import sys, eidrive_scenario.roads; sys.exit('pyproj' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_offset_shifts_and_rotates_the_plane() -> None:
    """The origin is 20 km east of the central meridian at 48°N, and the file is rotated by a right angle."""
    text = "<geoReference><![CDATA[ +proj=utm +zone=32 +datum=WGS84 ]]></geoReference>"
    place = plane("+proj=utm +zone=32 +datum=WGS84", 48.0, 9.25)
    shifted = text + f'<offset x="{place[0]!r}" y="{place[1]!r}" z="100" hdg="{math.pi / 2!r}"/>'
    network = RoadNetwork.parse(map_xml(road_xml(), header=shifted))
    angles = math.radians(48.0), math.radians(9.25)
    assert network.geographic(*angles) == pytest.approx((0.0, 0.0), abs=1e-6)
    east = network.geographic(angles[0], angles[1] + 1e-6)
    assert east[0] == pytest.approx(0.0, abs=0.02)
    assert east[1] < -4.0
    plain = RoadNetwork.parse(map_xml(road_xml(), header=text))
    assert plain.geographic(*angles) == pytest.approx(place)
    for roads in (network, plain):
        found = roads.geodetic(*roads.geographic(*angles))
        assert found == pytest.approx(angles, abs=1e-12)


def test_map_without_valid_geo_reference_has_no_geographic_positions() -> None:
    network = RoadNetwork.parse(map_xml(road_xml()))
    with pytest.raises(PositionError, match="add <geoReference>"):
        network.geographic(0.8, 0.1)
    with pytest.raises(PositionError, match="add <geoReference>"):
        network.geodetic(0.0, 0.0)
    invalid = "<geoReference>+proj=mars</geoReference>"
    network = RoadNetwork.parse(map_xml(road_xml(), header=f"\n{invalid}"), "mars.xodr")
    with pytest.raises(PositionError, match=r"mars.xodr:2: <geoReference>: .*'mars'.*\+proj=utm \+zone=32"):
        network.geographic(0.8, 0.1)


def test_point_outside_the_projection_is_an_error() -> None:
    """UTM is undefined 92° from its central meridian at the equator."""
    text = "<geoReference>+proj=utm +zone=32</geoReference>"
    network = RoadNetwork.parse(map_xml(road_xml(), header=text))
    with pytest.raises(PositionError, match="the projection is undefined at latitude and longitude 0°, 101°"):
        network.geographic(0.0, math.radians(101.0))
