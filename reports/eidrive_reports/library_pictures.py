"""Pictures of the scenarios of the library, and their page docs/library.md.

`python -m eidrive_reports.library_pictures` in the checkout runs each scenario once, and draws its actors
and their paths from above.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import typer

from eidrive_reports.paper import EGO
from eidrive_reports.studies import command
from eidrive_scenario.api.common import write_atomically
from eidrive_scenario.api.experiments import LibraryScenario, describe_scenarios
from eidrive_scenario.api.pages import Image, ImageCanvas, RoadDrawing, Window, house_outline, road_drawing
from eidrive_scenario.api.run import Simulation, buildings

EGO_COLOR, SENDER, OTHER, WALKER, TRAFFIC = "#2563eb", "#ea580c", "#334155", "#dc2626", "#94a3b8"
"""Colors of the ego, stations that send messages, other vehicles, pedestrians, and background traffic."""
MARGIN = 8.0
"""Distance of the shown actors from the edge of the picture [m]."""
LEAST_WIDTH = 60.0
"""Minimum width of the section that is shown [m]."""


@dataclass
class RunPaths:
    """Boxes (7,) of the actors at their first frame, and their positions (N, 2) over time, by name."""

    boxes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    paths: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def add(self, names: Sequence[str], boxes: Sequence[Sequence[float]]) -> None:
        """Append one frame; positions closer than half a meter to the last one are omitted."""
        for name, box in zip(names, boxes, strict=True):
            self.boxes.setdefault(name, tuple(box))
            path = self.paths.setdefault(name, [])
            if not path or np.hypot(box[0] - path[-1][0], box[1] - path[-1][1]) >= 0.5:
                path.append((box[0], box[1]))


def run_picture(
    run: RunPaths,
    roads: RoadDrawing,
    colors: Mapping[str, str],
    *,
    size: tuple[int, int] = (480, 300),
) -> Image:
    """Return the picture (height, width, 3) in the channel order of OpenCV.

    colors  color by actor; the last one is drawn on top, and its path is inside the section that is shown. Actors
            without a color belong to the background traffic: they have no path and do not determine that section
    size    width and height [pixels]
    """
    window = _window(run, colors, size[0] / size[1])
    canvas = ImageCanvas(window, size)
    canvas.roads(roads)
    for name, color in colors.items():
        path = run.paths.get(name, ())
        if len(path) > 1:
            canvas.line(path, color, 0.45)
    for name in [*(other for other in run.boxes if other not in colors), *colors]:
        if name in run.boxes:
            canvas.body(run.boxes[name], colors.get(name, TRAFFIC))
    return canvas.image


def _window(run: RunPaths, colors: Mapping[str, str], ratio: float) -> Window:
    """Return the section with the actors and the path of the last one, in the ratio of width to height."""
    points = [box[:2] for name, box in run.boxes.items() if name in colors]
    points += run.paths.get(next(reversed(list(colors)), ""), [])
    return Window.enclosing(points or [(0.0, 0.0)], MARGIN).widened(ratio, LEAST_WIDTH)


PAGE = "docs/library.md"
"""Page of the scenarios in the checkout."""
FOLDER = "docs/library"
"""Folder of the pictures in the checkout."""
INTRODUCTION = """# Scenarios of the library

`eidrive list scenarios` lists them; the parameters are described in the files and in
[scenario_files.md](scenario_files.md). Blue is the ego, orange are stations that send messages, red are pedestrians,
light gray is background traffic; lines are paths. `make library-pictures` draws them.
"""
COLUMNS = 3
"""Scenarios in a row of the table."""


def picture(name: str, *, seed: int = 1) -> Image:
    """Run a scenario of the library and return its picture."""
    run = RunPaths()
    with Simulation(name, seed=seed) as simulation:
        frame, end = simulation.tick()
        categories = dict(zip(frame.view.names, frame.view.categories, strict=True))
        stations = set(frame.steps)
        while end is None:
            run.add(frame.view.names, frame.view.plain_boxes)
            frame, end = simulation.tick()
        entities, roads = simulation.scenario.entities, simulation.roads
    colors = {
        entity: SENDER if entity in stations else WALKER if categories.get(entity) == "pedestrian" else OTHER
        for entity in entities
        if entity != EGO
    }
    drawing = RoadDrawing()
    if roads is not None:
        houses = tuple((house_outline(house), house.size[2]) for house in buildings(roads, without=entities))
        drawing = replace(road_drawing(roads.roads.values()), houses=houses)
    return run_picture(run, drawing, {**colors, EGO: EGO_COLOR})


def file_name(scenario: LibraryScenario) -> str:
    """Return the name of the file of a picture."""
    return scenario.name.replace("/", "_") + ".png"


def library_page(scenarios: Sequence[LibraryScenario]) -> str:
    """Return the page of the scenarios with their pictures, one table per family."""
    lines = [INTRODUCTION]
    for family in dict.fromkeys(scenario.family for scenario in scenarios):
        cells = [
            f"![{scenario.name}](library/{file_name(scenario)}) `{scenario.name}`: {scenario.description}".replace(
                "|", "\\|"
            )
            for scenario in scenarios
            if scenario.family == family
        ]
        cells += [""] * (-len(cells) % COLUMNS)
        lines += [f"## `xosc/{family}`", "", "| | | |", "|---|---|---|"]
        lines += [f"| {' | '.join(cells[first : first + COLUMNS])} |" for first in range(0, len(cells), COLUMNS)]
        lines += [""]
    return "\n".join(lines)


@command
def main(arguments: Sequence[str] | None = None) -> None:
    """Write the pictures and the page."""
    parser = argparse.ArgumentParser(description="Draw the scenarios of the library, and write their page.")
    parser.add_argument("names", nargs="*", help="scenarios to draw, such as coop/scenario_1 (default: all)")
    parser.add_argument("--root", type=Path, default=Path(), help="folder of the checkout")
    options = parser.parse_args(arguments)
    scenarios = describe_scenarios()
    unknown = set(options.names) - {scenario.name for scenario in scenarios}
    if unknown:
        parser.error(f"no scenario {min(unknown)!r} in the library")
    for scenario in scenarios:
        if options.names and scenario.name not in options.names:
            continue
        path = options.root / FOLDER / file_name(scenario)
        _, encoded = cv2.imencode(".png", picture(scenario.name), [cv2.IMWRITE_PNG_COMPRESSION, 9])
        with write_atomically(path) as stream:
            stream.write(encoded.tobytes())
        typer.echo(f"wrote {path}")
    with write_atomically(options.root / PAGE) as stream:
        stream.write(library_page(scenarios).encode())


if __name__ == "__main__":
    sys.exit(main())
