"""Roads of the cooperative scenarios of EI-Drive.

Each has the lanes of one site of the paper. The ego vehicle starts at the origin and drives along x.
"""

from __future__ import annotations

from xosc.roads.crossings import Crossing
from xosc.roads.layout import Layout
from xosc.roads.streets import AVENUE, SIDE_STREET

COOP_SITES: tuple[Layout, ...] = (
    Crossing(
        name="coop_1",
        ego_street=SIDE_STREET,
        cross_street=AVENUE,
        y=1.75,
        x=38.25,
        box=(20.0, 54.5, -11.5, 14.5),
        reach=(-80.0, 134.5, -101.5, 114.5),
        control="stop",
    ).layout(),
    Crossing(
        name="coop_2",
        ego_street=AVENUE,
        cross_street=SIDE_STREET,
        y=1.75,
        x=26.75,
        box=(13.4, 39.9, -13.7, 23.5),
        reach=(-80.0, 129.9, -103.7, 113.5),
        control="light",
    ).layout(),
)
