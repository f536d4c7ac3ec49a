"""A small scenario of two cars on the library's first road, which the tests here make hostile."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import init_xml, lane_position_xml, teleport_xml

from eidrive_scenario.extensions.library import library_path


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
        actions = init + "".join(
            init_xml(name, teleport_xml(lane_position_xml(-1, s))) for name, s in (("Ego", 2), ("B", 15))
        )
        if channel:
            command = f'<CustomCommandAction type="eidrive.channel">{channel}</CustomCommandAction>'
            actions = f"<UserDefinedAction>{command}</UserDefinedAction>{actions}"
        text = scenario_xml(
            minor=2,
            declarations=before,
            catalogs=catalogs,
            road=road_file_xml(library_path() / "roads" / "coop_1.xodr" if road is None else road),
            entities=object_xml("Ego", controller=agent_xml(**(properties or {}))) + object_xml("B"),
            init=actions,
        )
        path = folder / "hostile.xosc"
        path.write_bytes(f"{opening}\n".encode() + text)
        return path

    return scenario
