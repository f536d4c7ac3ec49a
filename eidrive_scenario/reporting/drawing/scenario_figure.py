"""Figure of a scenario before its run, or of a road file."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.extensions.library import ROADS_SUFFIX, definition
from eidrive_scenario.reporting.drawing.canvas import Canvas
from eidrive_scenario.reporting.drawing.road_drawing import network_drawing
from eidrive_scenario.reporting.drawing.road_labels import RoadLabels
from eidrive_scenario.reporting.drawing.scenario_picture import ScenarioPicture
from eidrive_scenario.reporting.drawing.top_view import Window
from eidrive_scenario.reporting.drawing.vector_canvas import Size, scene_figure
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import Simulation


def is_road_file(source: str | Path) -> bool:
    """Return whether a source is a road file, not a scenario."""
    path = Path(source)
    return path.suffix.lower() == ROADS_SUFFIX or definition(path) == "roads"


def source_figure(path: Path, size: Size, station: str | None = None) -> Figure:
    """Return the picture of a scenario before its run, or of a road file.

    size     width and height [mm]
    station  whose shadow is drawn; by default the first that drives, else the first

    Raise InputError for a file that is invalid, too large or cannot be run, SettingError for a station of a road file.
    """
    if not is_road_file(path):
        with Simulation(path, load_weights=False) as simulation:
            picture = ScenarioPicture.of(simulation, station)
        roads = network_drawing(simulation.roads)
        labels = RoadLabels(simulation.roads) if simulation.roads is not None else None
        return scene_figure(lambda canvas: picture.draw(canvas, roads, labels), picture.section, size)
    if station is not None:
        raise SettingError(
            Diagnostic(f"a road file has no station (got {quoted(station)})", "give a scenario", str(path))
        )
    network = RoadNetwork.load(path)
    drawing, road_labels = network_drawing(network), RoadLabels(network)
    left, bottom, right, top = network.bounds()

    def draw(canvas: Canvas) -> None:
        canvas.roads(drawing)
        road_labels.draw(canvas)
        road_labels.write(canvas)

    return scene_figure(draw, lambda ratio: Window.enclosing([(left, bottom), (right, top)]).widened(ratio, 20.0), size)
