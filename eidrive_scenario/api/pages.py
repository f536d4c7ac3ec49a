"""Drawings and pages: top views, charts, reports and replays.

All names may change in a minor version.
"""

from eidrive_scenario.reporting.drawing.canvas import Canvas, Image
from eidrive_scenario.reporting.drawing.charts import ChartSeries, heat_cells, line_chart
from eidrive_scenario.reporting.drawing.road_drawing import house_outline, road_drawing
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window, legend, roads_symbol, top_view
from eidrive_scenario.reporting.page import png_address, write_page
from eidrive_scenario.reporting.replay.page import write_replays
from eidrive_scenario.reporting.run_report.report import write_report
from eidrive_scenario.reporting.run_report.reported_runs import ReportedRun, run_of_result
from eidrive_scenario.reporting.snapshot import SnapshotBuilder, StationSnapshot

__all__ = [
    "Canvas",
    "ChartSeries",
    "Image",
    "ReportedRun",
    "RoadDrawing",
    "SnapshotBuilder",
    "StationSnapshot",
    "Window",
    "heat_cells",
    "house_outline",
    "legend",
    "line_chart",
    "png_address",
    "road_drawing",
    "roads_symbol",
    "run_of_result",
    "top_view",
    "write_page",
    "write_replays",
    "write_report",
]
