"""Scenario with added stations that load its radio channel."""

from __future__ import annotations

import math
from pathlib import Path

from lxml import etree

from eidrive_scenario.api.common import generator

INNER, OUTER = 30.0, 200.0
"""Distance of the added stations from the center of the scene [m]."""
CLEAR = 20.0
"""Minimum distance of the added stations from both axes through the center, along which the roads run [m]."""
HEIGHT = 1.5
"""Height of the antennas [m], as on the roof of a car (3GPP TR 37.885)."""
RATE = 10.0
"""Rate of the CAM of each station [Hz], the maximum of EN 302 637-2."""
CENTER = (40.0, 0.0)
"""Center of the crossing of scenario 1 [m]."""

_STATION = """<ScenarioObject name="{name}">
  <CatalogReference catalogName="misc_objects" entryName="rsu">
    <ParameterAssignments><ParameterAssignment parameterRef="Height" value="{height}"/></ParameterAssignments>
  </CatalogReference>
  <ObjectController><Controller name="{name}Stack"><Properties>
    <Property name="module" value="eidrive"/>
    <Property name="detector" value="oracle"/>
    <Property name="range" value="1"/>
    <Property name="fusion" value="average"/>
    <Property name="messages" value="cam"/>
    <Property name="message_rate" value="{rate}"/>
  </Properties></Controller></ObjectController>
</ScenarioObject>"""
_PLACE = """<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
  <WorldPosition x="{x!r}" y="{y!r}" z="0"/>
</Position></TeleportAction></PrivateAction></Private>"""


def with_load(path: Path, count: int) -> etree._Element:
    """Return the scenario with `count` masts beside the roads that send CAM and use no messages.

    Their places are uniform in area and random, but equal in all runs; fewer stations are the first ones of more.
    """
    root = etree.parse(path).getroot()
    entities, actions = root.find("Entities"), root.find("Storyboard/Init/Actions")
    if entities is None or actions is None:
        raise ValueError(f"{path} has no entities or no initial actions")
    names = [f"Load{number:03d}" for number in range(count)]
    for offset, name in enumerate(names):
        station = etree.fromstring(_STATION.format(name=name, height=HEIGHT, rate=RATE))
        entities.insert(offset, station)
    for name, (x, y) in zip(names, places(count), strict=True):
        actions.append(etree.fromstring(_PLACE.format(name=name, x=x, y=y)))
    return root


def places(count: int) -> list[tuple[float, float]]:
    """Return the places of the stations [m]."""
    random = generator(0, "channel load")
    positions: list[tuple[float, float]] = []
    while len(positions) < count:
        radius = math.sqrt(random.uniform(INNER**2, OUTER**2))
        angle = random.uniform(0.0, 2.0 * math.pi)
        x, y = radius * math.cos(angle), radius * math.sin(angle)
        if min(abs(x), abs(y)) > CLEAR:
            positions.append((CENTER[0] + x, CENTER[1] + y))
    return positions
