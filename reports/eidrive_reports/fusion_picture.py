"""Picture of intermediate fusion in one run: `python -m eidrive_reports.fusion_picture`.

In plan view it shows the features of each station, the cells that are sent and arrive, and the objects in the fused
features beside the true ones.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import typer
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from eidrive_reports.cooperative_perception.receivers import Condition, Reception
from eidrive_reports.cooperative_perception.scores import Truth
from eidrive_reports.cooperative_perception.trial import Measurement, run_trial
from eidrive_reports.paper import EGO
from eidrive_reports.reproduction.learned import STUDY
from eidrive_reports.studies import command
from eidrive_scenario.api.common import Array, Floats, Integers, footprint
from eidrive_scenario.api.driving import Detections
from eidrive_scenario.api.pages import ImageCanvas, RoadDrawing, Window, road_drawing, write_figure
from eidrive_scenario.api.perception import FeatureMap
from eidrive_scenario.api.run import RunSettings
from eidrive_scenario.api.v2x import FeatureFrame

SCENARIO, SEED, TIME = "coop/scenario_5", 1, 7.0
"""Run and time [s] of the picture: three ambulances hide a car from the ego, and both senders detect it."""
ARMS: Mapping[str, Condition] = {
    "1 % of the cells": Condition("where2comm"),
    "10 % of the cells": Condition("where2comm, 10 %"),
    "10 %, 60 % of frames lost": Condition("where2comm, 10 %", loss=0.6),
}
"""Conditions of the ego by title of a column."""
SHARE_OF_MAXIMUM = 0.08
"""Least norm of the features of a drawn cell, as a share of the largest one."""
COLORS = ("#2563eb", "#ea580c", "#7e22ce", "#0f766e")
"""Colors of the stations: the ego, and the senders in order of their names."""
LOST, TRUE, HIDDEN, DETECTED = "#9ca3af", "#111827", "#dc2626", "#22c55e"
"""Colors of lost cells, and of outlines: objects, those hidden to the ego, and detected ones."""
LEAST_SCORE = 0.3
"""Minimum existence probability of a drawn detection."""
FEATURES = "YlGnBu"
"""Color map of the norm of the features of a cell."""
EXTENT = 58.0
"""Minimum width and height of the section [m]."""
PIXELS = 660
"""Width and height of a panel."""


def cell_corners(indices: Integers, grid: FeatureMap | FeatureFrame, shape: tuple[int, ...]) -> Array:
    """Return the corners (N, 4, 2) in the world of cells by their index (N,) in a grid of this shape."""
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    cells = np.stack(np.unravel_index(indices, shape), axis=-1)
    local = (cells[:, None] + corners - np.array(shape) / 2.0) * grid.cell
    cos, sin = np.cos(grid.yaw), np.sin(grid.yaw)
    world: Array = local @ np.array([[cos, sin], [-sin, cos]]) + (grid.x, grid.y)
    return world


class Panel(ImageCanvas):
    """One picture of the section with its roads."""

    def __init__(self, window: Window, roads: RoadDrawing) -> None:
        super().__init__(window, (PIXELS, PIXELS))
        self.roads(roads)

    def features(self, features: FeatureMap) -> None:
        """Draw the norm of the features of each cell above that of the median; most cells are empty."""
        norm: Floats = np.linalg.norm(features.features, axis=0)
        share = (norm - np.median(norm)).ravel() / (norm.max() - np.median(norm))
        indices = np.flatnonzero(share > SHARE_OF_MAXIMUM)
        colors = colormaps[FEATURES](np.sqrt(share[indices]))
        for cell, color in zip(cell_corners(indices, features, norm.shape), colors, strict=True):
            self.fill(cell, to_hex(color))

    def cells(self, reception: Reception, colors: Mapping[str, str]) -> None:
        """Draw the cells that were sent: those that have arrived in the color of their sender, above the others."""
        arrived = {(held.message.sender, held.message.number) for held in reception.arrived}
        for message in sorted(reception.sent, key=lambda message: (message.sender, message.number) in arrived):
            if (frame := message.features) is not None:
                color = colors[message.sender] if (message.sender, message.number) in arrived else LOST
                for cell in cell_corners(frame.indices, frame, frame.shape):
                    self.fill(cell, color)

    def outlines(self, boxes: Array, color: str, width: float) -> None:
        """Draw outlines of boxes (N, 7) with a width [m]."""
        for box in boxes:
            self.line(footprint(box), color, width, closed=True)

    def bodies(self, truth: Truth, stations: Mapping[str, Array], colors: Mapping[str, str]) -> None:
        """Draw the boxes (7,) of the stations, and the outlines of all objects."""
        for name, box in stations.items():
            self.body(box.tolist(), colors[name])
        self.outlines(truth.boxes[~truth.hidden], TRUE, 0.2)
        self.outlines(truth.boxes[truth.hidden], HIDDEN, 0.7)

    def detections(self, detections: Detections) -> None:
        """Draw the outlines of likely objects."""
        self.outlines(detections.boxes[detections.confidence >= LEAST_SCORE], DETECTED, 0.3)

    def show(self, axes: Axes, title: str) -> None:
        """Show the picture on the axes of a figure."""
        axes.imshow(self.image[..., ::-1], interpolation="none")
        axes.set_title(title, fontsize=10)


def fusion_figure(measurement: Measurement, arms: Mapping[str, Condition]) -> Figure:
    """Draw the last scan: features of the stations, cells of each arm, and objects in the fused features."""
    view, factory, truth = measurement.view, measurement.factory, measurement.truths[-1]
    assert view is not None
    assert factory.roads is not None
    colors = dict(zip([factory.ego, *factory.senders], COLORS, strict=False))
    stations = {name: view.boxes[view.row(name)] for name in colors}
    hidden = truth.boxes[truth.hidden & (truth.range_classes < STUDY.reach)]
    window = Window.enclosing([*stations.values(), *hidden]).widened(1.0, EXTENT)
    roads = road_drawing(factory.roads.roads.values(), window)
    columns = max(len(colors), len(arms))
    figure = Figure(figsize=(3.3 * columns, 10.7), layout="constrained")
    panels = figure.subplots(3, columns, squeeze=False)
    for axes in panels.ravel():
        axes.set_axis_off()
    for name, axes in zip(colors, panels[0], strict=False):
        panel, detector = Panel(window, roads), factory.detectors[name]
        if detector.features is not None:
            panel.features(detector.features)
        panel.bodies(truth, stations, colors)
        panel.detections(detector.detections)
        panel.show(axes, f"{name}: own features")
    for (title, condition), (sent, fused) in zip(arms.items(), panels[1:].T, strict=False):
        reception = measurement.receptions[condition]
        panel = Panel(window, roads)
        panel.cells(reception, colors)
        panel.bodies(truth, stations, colors)
        size = sum(message.size for message in reception.sent if message.features is not None)
        panel.show(sent, f"{title}: {size / 1e3:.1f} kB per scan")
        panel = Panel(window, roads)
        if reception.features is not None:
            panel.features(reception.features)
        panel.bodies(truth, stations, colors)
        panel.detections(reception.objects)
        panel.show(fused, "fused features and objects")
    lines = {"object": TRUE, "object hidden to the ego": HIDDEN, "detected object": DETECTED}
    entries = [
        *(Patch(color=color, label=label) for label, color in {**colors, "lost cells": LOST}.items()),
        *(Line2D([], [], color=color, label=label) for label, color in lines.items()),
    ]
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), fontsize=9, frameon=False)
    return figure


@command
def main(arguments: Sequence[str] | None = None) -> None:
    """Run the scenario and draw the picture."""
    parser = argparse.ArgumentParser(description="Draw features, transmitted cells and fused objects of one run.")
    parser.add_argument("--out", type=Path, default=Path("docs/figures/feature_fusion.png"))
    options = parser.parse_args(arguments)
    settings = RunSettings(detector="pillars", time_limit=TIME)
    _, measurement = run_trial(SCENARIO, SEED, settings, EGO, tuple(ARMS.values()))
    write_figure(fusion_figure(measurement, ARMS), options.out, 100)
    typer.echo(f"wrote {options.out}")


if __name__ == "__main__":
    sys.exit(main())
