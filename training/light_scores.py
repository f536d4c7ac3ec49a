"""Accuracy of traffic light states: from the class of a network, and from lamps at the map position."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.learned.image_network import LIGHT_STATES, ImageNetwork
from eidrive_scenario.perception.learned.lights import LightsOnMap
from training.light_scenes import LightScene
from training.tables import WEATHERS, Table

DISTANCES = ((0.0, 15.0), (15.0, 25.0), (25.0, 40.0), (40.0, 100.0))


class Reading(NamedTuple):
    """Traffic light and its states as read, by method; "" if it was not read. Red with yellow counts as red."""

    state: str
    distance: float
    weather: str
    to_read: bool
    hidden: bool
    read: Mapping[str, str]


def readings(networks: Mapping[str, ImageNetwork], scenes: Iterable[LightScene]) -> list[Reading]:
    """Return every light in the images: read by class, by class and lamps, and by lamps alone."""
    light_readings = []
    for scene in scenes:
        cameras = {"camera": scene.reading}
        lights = LightsOnMap(scene.roads)
        read = {"lamps alone": {light.id: light.state for light in lights.read({}, cameras)}}
        for name, network in networks.items():
            images: dict[str, ImageDetections] = {"camera": network.find(scene.reading.rgb)}
            by_class = lights.match(images["camera"], scene.reading) if lights.ids else {}
            read[f"{name} alone"] = {lights.ids[row]: state for row, (_, state) in by_class.items()}
            read[f"{name} and lamps"] = {light.id: light.state for light in lights.read(images, cameras)}
        for light in scene.lights:
            states = {method: _merge_red(of.get(light.id, "")) for method, of in sorted(read.items())}
            hidden = light.box is None
            light_readings.append(
                Reading(_merge_red(light.state), light.distance, scene.weather, light.to_read, hidden, states)
            )
    return light_readings


def _merge_red(state: str) -> str:
    return "red" if state == "redYellow" else state


def light_table(light_readings: Sequence[Reading]) -> Table:
    """Return shares of lights that are read correctly and incorrectly; the others are not read."""
    required = [reading for reading in light_readings if reading.to_read]
    parts: list[tuple[str, list[Reading]]] = [("all", required)]
    parts += [(state, [reading for reading in required if reading.state == state]) for state in LIGHT_STATES]
    parts += [(weather, [reading for reading in required if reading.weather == weather]) for weather in WEATHERS]
    parts += [
        (f"{a:.0f} to {b:.0f} m", [reading for reading in required if a <= reading.distance < b]) for a, b in DISTANCES
    ]
    parts.append(("occluded", [reading for reading in light_readings if reading.hidden]))
    methods = list(light_readings[0].read) if light_readings else []
    rows = []
    for name, part in parts:
        rows.append([name])
        for method in methods:
            correct = sum(reading.read[method] == reading.state for reading in part) / max(len(part), 1)
            incorrect = sum(reading.read[method] not in ("", reading.state) for reading in part) / max(len(part), 1)
            rows[-1] += [f"{correct:.2f}", f"{incorrect:.2f}"]
        rows[-1].append(str(len(part)))
    head = ["lights", *(f"{method}: {result}" for method in methods for result in ("correct", "incorrect")), "n"]
    return "Traffic lights in held-out images: shares that are read correctly and incorrectly", head, rows
