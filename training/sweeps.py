"""Recall against the density of fog and against darkness: equal scenes in a sequence of weathers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib import pyplot

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.average_precision import match
from eidrive_scenario.perception.learned.image_network import VEHICLES, ImageNetwork
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world.weather import Weather
from training.image_evaluation import objects_of
from training.labels import Label, actor_labels
from training.random_roads import random_place
from training.random_scene import random_traffic, random_view, replace_actors

VISUAL_RANGES = (30_000.0, 1000.0, 500.0, 300.0, 200.0, 150.0, 100.0, 70.0, 50.0, 35.0)
ELEVATIONS = (40.0, 20.0, 10.0, 5.0, 2.0, 0.0, -3.0, -6.0, -9.0, -12.0, -18.0)
FARTHEST, LOWEST = 40.0, 15.0
"""Maximum distance [m] and minimum height in the image [px] of required vehicles."""
LAMPS: Mapping[str, Literal["on", "off"]] = {"headlights": "on", "no lamps": "off"}


def sweeps(networks: Mapping[str, ImageNetwork], seed: int, worlds: int) -> dict[str, Any]:
    """Return the recall of each network at its confidence.

    The curves are by visual range [m], and by sun elevation [degrees] with lamps on and off.
    """
    weathers = {
        ("fog", value): Weather(visual_range=value, cloud_cover=0.5, sun_elevation=30.0) for value in VISUAL_RANGES
    }
    for title, lamps in LAMPS.items():
        weathers |= {(title, value): Weather(sun_elevation=value, headlights=lamps) for value in ELEVATIONS}
    detected = {key: dict.fromkeys(networks, 0) for key in weathers}
    required = 0
    for number in range(worlds):
        rng = generator(seed, "training data", "sweeps", number)
        place = random_place(rng)
        view = random_view(rng, place.positions)
        camera = ImageSensor(CameraSettings())
        with place.world() as world:
            actors = random_traffic(rng, place.positions, view)
            replace_actors(world, actors)
            specs = {spec.name: spec for spec, _ in actors}
            boxes = None
            for key, weather in weathers.items():
                world.set_weather(weather)
                reading = camera.capture(world, view.pose, generator(seed, "sweeps", number))
                if boxes is None:
                    boxes = _vehicles(actor_labels(reading, world.view(), specs))
                    required += len(boxes)
                if not len(boxes):
                    break
                none_ignored = np.zeros(len(boxes), dtype=bool)
                for name, network in networks.items():
                    detections = network.find(reading.rgb)
                    vehicles = [index for index, category in enumerate(detections.classes) if category in VEHICLES]
                    matches = match(detections.boxes[vehicles], detections.scores[vehicles], boxes, none_ignored)
                    detected[key][name] += int(matches.found.sum())
    return {
        "vehicles": required,
        "curves": {
            title: {
                "at": list(values),
                **{name: [detected[title, at][name] / max(required, 1) for at in values] for name in networks},
            }
            for title, values in (("fog", VISUAL_RANGES), *((title, ELEVATIONS) for title in LAMPS))
        },
    }


def _vehicles(labels: list[Label]) -> Array:
    """Return boxes (M, 4) of the required vehicles."""
    objects = objects_of(labels)
    is_vehicle = np.array([name in VEHICLES for name in objects.names], dtype=bool)
    near = (objects.distance < FARTHEST) & (objects.height >= LOWEST)
    return np.asarray(objects.boxes[objects.to_find & is_vehicle & near])


def plot_sweeps(curves: Mapping[str, Any], path: Path) -> None:
    """Write the curves as an image."""
    matplotlib.use("Agg")
    figure, (fog, dark) = pyplot.subplots(1, 2, figsize=(11, 4), sharey=True)
    names = [name for name in curves["curves"]["fog"] if name != "at"]
    for color, name in zip(("tab:blue", "tab:orange", "tab:green"), names, strict=False):
        data = curves["curves"]["fog"]
        fog.plot(data["at"], data[name], "o-", color=color, label=name)
        for title, line in zip(LAMPS, ("-", "--"), strict=True):
            data = curves["curves"][title]
            dark.plot(data["at"], data[name], f"o{line}", color=color, label=f"{name}, {title}")
    fog.set_xscale("log")
    fog.set_xlabel("visual range [m]")
    fog.set_ylabel(f"recall, vehicles within {FARTHEST:.0f} m (n = {curves['vehicles']})")
    dark.set_xlabel("elevation of the sun [degrees]")
    for axes in (fog, dark):
        axes.grid(alpha=0.3)
        axes.set_ylim(0.0, 1.02)
        axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
