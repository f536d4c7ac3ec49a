"""A small scenario of two cars on the library's first road, which the tests here make hostile."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol
from xml.sax.saxutils import quoteattr

from eidrive_scenario.library import library_path


class Write(Protocol):
    """A function that writes a scenario; see `scenario_writer`."""

    def __call__(
        self,
        properties: dict[str, str] | None = None,
        channel: str = "",
        before: str = "",
        catalogs: str = "",
        road: str | None = None,
        init: str = "",
        opening: str = '<?xml version="1.0" encoding="UTF-8"?>',
    ) -> Path: ...


_CAR = """<ScenarioObject name="{name}"><Vehicle name="{name}" vehicleCategory="car">
<BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
<Performance maxSpeed="50" maxAcceleration="5" maxDeceleration="9"/><Axles>
<FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles><Properties/>
</Vehicle>{controller}</ScenarioObject>"""
_TELEPORT = """<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
<LanePosition roadId="1" laneId="-1" s="{s}" offset="0"/></Position></TeleportAction></PrivateAction></Private>"""


def scenario_writer(folder: Path) -> Write:
    """A function that writes a scenario into a folder and returns its path.

    properties  of the ego's controller, as texts;  channel  text of a channel command
    before      elements behind the header, such as parameters;  catalogs  content of CatalogLocations
    """

    def scenario(
        properties: dict[str, str] | None = None,
        channel: str = "",
        before: str = "",
        catalogs: str = "",
        road: str | None = None,
        init: str = "",
        opening: str = '<?xml version="1.0" encoding="UTF-8"?>',
    ) -> Path:
        given = {"module": "eidrive", **(properties or {})}
        entries = "\n".join(f"<Property name={quoteattr(name)} value={quoteattr(v)}/>" for name, v in given.items())
        agent = f'<ObjectController><Controller name="c"><Properties>\n{entries}\n</Properties></Controller>'
        cars = _CAR.format(name="Ego", controller=agent + "</ObjectController>") + _CAR.format(name="B", controller="")
        actions = init + "".join(_TELEPORT.format(name=name, s=s) for name, s in (("Ego", 2), ("B", 15)))
        if channel:
            command = f'<CustomCommandAction type="eidrive.channel">{channel}</CustomCommandAction>'
            actions = f"<UserDefinedAction>{command}</UserDefinedAction>{actions}"
        road = str(library_path() / "roads" / "coop_1.xodr") if road is None else road
        path = folder / "hostile.xosc"
        path.write_text(
            f'{opening}\n<OpenSCENARIO>\n<FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" '
            f'author="" description=""/>\n{before}\n<CatalogLocations>{catalogs}</CatalogLocations>\n'
            f"<RoadNetwork><LogicFile filepath={quoteattr(road)}/></RoadNetwork>\n<Entities>{cars}</Entities>\n"
            f"<Storyboard><Init><Actions>{actions}</Actions></Init><StopTrigger/></Storyboard>\n</OpenSCENARIO>\n",
            encoding="utf-8",
        )
        return path

    return scenario
