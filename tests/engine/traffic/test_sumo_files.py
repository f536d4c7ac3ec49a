"""Checks of the files of SUMO that need no SUMO."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario.model import CustomCommandAction
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import sumo_files

ROADS = road_xml(), road_xml("2", x=150.0, y=-50.0, hdg=1.5707963267948966)
"""Two roads along x and y, with a lane of 3.5 m in each direction."""
LANES = (
    (0.0, -1.75, 100.0, -1.75),
    (100.0, 1.75, 0.0, 1.75),
    (151.75, -50.0, 151.75, 50.0),
    (148.25, 50.0, 148.25, -50.0),
)
"""Centers of their lanes: both ends [m]."""
HEADER = '<offset x="690403.37" y="5336141.84" z="0" hdg="0"/>'


def files_offset(
    folder: Path, stated: tuple[float, float], actual: tuple[float, float], header: str
) -> tuple[float, float]:
    """Return the offset of a network with a `stated` netOffset and `actual` coordinates."""
    x, y = actual
    edges = "".join(
        f'<edge id="{number}"><lane length="100" speed="10" shape="{a + x},{b + y} {c + x},{d + y}"/></edge>'
        for number, (a, b, c, d) in enumerate(LANES)
    )
    location = f'<location netOffset="{stated[0]:.2f},{stated[1]:.2f}"/>'
    (folder / "town.net.xml").write_text(f"<net>{location}{edges}</net>")
    (folder / "town.rou.xml").write_text("<routes/>")
    content = "{network: town.net.xml, routes: [town.rou.xml]}"
    command = CustomCommandAction(type="eidrive.sumo", content=content, source=str(folder / "scene.xosc"))
    return sumo_files(command, RoadNetwork.parse(map_xml(*ROADS, header=header))).offset


@pytest.mark.parametrize(
    ("stated", "actual", "header"),
    [
        ((80.0, 120.25), (80.0, 120.25), ""),
        ((-690402.97, -5336141.70), (0.40, 0.14), HEADER),
        ((-690403.37, -5336141.84), (0.0, 0.0), HEADER),
        ((2.5, 2.5), (0.0, 0.0), ""),
    ],
)
def test_offset_of_imported_and_exported_networks_is_that_of_coordinates(
    tmp_path: Path, stated: tuple[float, float], actual: tuple[float, float], header: str
) -> None:
    """Netconvert 1.28.0 imports roads with the offsets of header and network: two networks of the roads.

    It exports roads in the coordinates of the network: with the header offset -netOffset if the network is projected,
    without one otherwise.
    """
    assert files_offset(tmp_path, stated, actual, header) == pytest.approx(actual, abs=1e-6)


def test_network_beside_the_roads_is_an_error(tmp_path: Path) -> None:
    """1 m from the centers of the lanes along y, and of those along x."""
    with pytest.raises(SettingError, match=r"the lanes of the network are 1\.0 m beside those of the scenario"):
        files_offset(tmp_path, (40.0, 40.0), (1.0, 1.0), "")
