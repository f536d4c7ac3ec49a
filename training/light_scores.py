"""How well traffic lights are read: by the class that a network gives, and by their lamps where the map has them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned.classes import LIGHT_STATES
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.learned.lights import LightsOnMap
from training.light_scenes import LightScene
from training.tables import WEATHERS, Table

DISTANCES = ((0.0, 15.0), (15.0, 25.0), (25.0, 40.0), (40.0, 100.0))


class Reading(NamedTuple):
    """A light, and what was read of it: by way of reading; "" where nothing was. Red with yellow counts as red."""

    state: str
    distance: float
    weather: str
    to_read: bool
    hidden: bool
    read: Mapping[str, str]


def readings(networks: Mapping[str, ImageNetwork], scenes: Iterable[LightScene]) -> list[Reading]:
    """Every light in the pictures: by the class that each network gives, by class and lamps, and by lamps alone."""
    found = []
    for scene in scenes:
        cameras = {"camera": scene.reading}
        lights = LightsOnMap(scene.roads)
        read = {"lamps alone": {one.id: one.state for one in lights.read({}, cameras)}}
        for name, network in networks.items():
            pictures: dict[str, ImageDetections] = {"camera": network.find(scene.reading.rgb)}
            read[f"{name} alone"] = {one.id: one.state for one in lights.by_class(pictures, cameras)}
            read[f"{name} and lamps"] = {one.id: one.state for one in lights.read(pictures, cameras)}
        for light in scene.lights:
            states = {way: _plain(of.get(light.id, "")) for way, of in sorted(read.items())}
            hidden = light.box is None
            found.append(Reading(_plain(light.state), light.distance, scene.weather, light.to_read, hidden, states))
    return found


def _plain(state: str) -> str:
    return "red" if state == "redYellow" else state


def light_table(found: Sequence[Reading]) -> Table:
    """Shares of lights that are read rightly and wrongly; the others are not read."""
    asked = [one for one in found if one.to_read]
    parts: list[tuple[str, list[Reading]]] = [("all", asked)]
    parts += [(state, [one for one in asked if one.state == state]) for state in LIGHT_STATES]
    parts += [(weather, [one for one in asked if one.weather == weather]) for weather in WEATHERS]
    parts += [(f"{a:.0f} to {b:.0f} m", [one for one in asked if a <= one.distance < b]) for a, b in DISTANCES]
    parts.append(("hidden by something", [one for one in found if one.hidden]))
    ways = list(found[0].read) if found else []
    rows = []
    for name, part in parts:
        rows.append([name])
        for way in ways:
            right = sum(one.read[way] == one.state for one in part) / max(len(part), 1)
            wrong = sum(one.read[way] not in ("", one.state) for one in part) / max(len(part), 1)
            rows[-1] += [f"{right:.2f}", f"{wrong:.2f}"]
        rows[-1].append(str(len(part)))
    head = ["lights", *(f"{way}: {what}" for way in ways for what in ("right", "wrong")), "n"]
    return "Traffic lights in held-out pictures: shares that are read rightly and wrongly", head, rows
