"""Generated scenario of many stations: cars on a straight road of four lanes that send CAM."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

from cars import VEHICLE, start

LENGTH = 2000.0
"""Default length over which the cars are spread at the start [m]."""
SPEED = 25.0
"""Speed of the cars [m/s]."""
EGO = "Car000"
"""Name of the car that always receives messages."""

_LANE = (
    '<lane id="{id}" type="driving" level="false"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    '<roadMark sOffset="0" type="broken" weight="standard" color="white" width="0.13" laneChange="both"/></lane>'
)
_CAR = """
<ScenarioObject name="{name}">
  {vehicle}
  <ObjectController><Controller name="{name}Stack"><Properties>
    <Property name="module" value="eidrive"/><Property name="planner" value="none"/>
    <Property name="detector" value="oracle"/><Property name="range" value="1"/>
    <Property name="messages" value="cam"/><Property name="generation" value="{generation}"/>{rate}
    <Property name="fusion" value="{fusion}"/><Property name="cooperates_with" value="{senders}"/>
  </Properties></Controller></ObjectController>
</ScenarioObject>"""


def write_scenario(
    folder: Path, stations: int, *, rate: float | None, all_listen: bool, length: float = LENGTH
) -> Path:
    """Write the scenario and its road to this folder, and return its path.

    The cars are scripted, without physics, so that the measurement covers stations and radio. They have an oracle with
    a range of one meter, because a CAM describes only its sender.

    rate        of the messages [Hz]; None: by the ETSI generation rules for CAM
    all_listen  whether every station receives from all others, or only the first one
    length      of the road over which the cars are spread at the start [m]
    """
    road = folder / "straight.xodr"
    road_length = length + 3.0 * LENGTH
    sides = {
        side: "".join(_LANE.format(id=lane) for lane in lanes)
        for side, lanes in (("left", (2, 1)), ("right", (-1, -2)))
    }
    road.write_text(
        '<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="6" name="straight"/>'
        f'<road name="straight" length="{road_length:g}" id="1" junction="-1" rule="RHT"><link/>'
        '<type s="0" type="motorway"/><planView>'
        f'<geometry s="0" x="0" y="0" hdg="0" length="{road_length:g}"><line/></geometry></planView>'
        f'<lanes><laneSection s="0"><left>{sides["left"]}</left>'
        '<center><lane id="0" type="none" level="false"/></center>'
        f"<right>{sides['right']}</right></laneSection></lanes></road></OpenDRIVE>"
    )
    names = [f"Car{number:03d}" for number in range(stations)]
    generation = "etsi" if rate is None else "rate"
    rate_property = "" if rate is None else f'<Property name="message_rate" value="{rate:g}"/>'
    cars = "".join(
        _CAR.format(
            name=name,
            vehicle=VEHICLE,
            generation=generation,
            rate=rate_property,
            senders="all" if all_listen or name == EGO else "none",
            fusion="covariance_intersection" if all_listen or name == EGO else "average",
        )
        for name in names
    )
    starts = "".join(
        start(name, "1", lane, f"{1.5 * LENGTH + length * number / stations:g}", f"{SPEED:g}", active="false")
        for number, (name, lane) in enumerate(zip(names, cycle((-2, -1, 1, 2)), strict=False))
    )
    scenario = folder / "stations.xosc"
    scenario.write_text(
        '<?xml version="1.0"?><OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" '
        f'author="eidrive-scenario" description="Many stations"/><CatalogLocations/><RoadNetwork>'
        f'<LogicFile filepath="{road.name}"/></RoadNetwork><Entities>{cars}</Entities>'
        f"<Storyboard><Init><Actions>{starts}</Actions></Init><StopTrigger/></Storyboard></OpenSCENARIO>"
    )
    return scenario
