"""Drawings and pages: top views, charts, reports and replays.

All names may change in a minor version.
"""

from eidrive_scenario.experiments.reported_run import ReportedRun as ReportedRun
from eidrive_scenario.reporting.drawing.canvas import Canvas as Canvas
from eidrive_scenario.reporting.drawing.charts import ChartSeries as ChartSeries
from eidrive_scenario.reporting.drawing.charts import heat_cells as heat_cells
from eidrive_scenario.reporting.drawing.charts import line_chart as line_chart
from eidrive_scenario.reporting.drawing.image_canvas import Image as Image
from eidrive_scenario.reporting.drawing.image_canvas import ImageCanvas as ImageCanvas
from eidrive_scenario.reporting.drawing.road_drawing import house_outline as house_outline
from eidrive_scenario.reporting.drawing.road_drawing import road_drawing as road_drawing
from eidrive_scenario.reporting.drawing.snapshot_picture import draw_snapshot as draw_snapshot
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing as RoadDrawing
from eidrive_scenario.reporting.drawing.top_view import Window as Window
from eidrive_scenario.reporting.drawing.vector_canvas import LegendEntries as LegendEntries
from eidrive_scenario.reporting.drawing.vector_canvas import write_figure as write_figure
from eidrive_scenario.reporting.page import png_address as png_address
from eidrive_scenario.reporting.page import write_page as write_page
from eidrive_scenario.reporting.replay.page import write_replays as write_replays
from eidrive_scenario.reporting.run_report.report import write_run_report as write_run_report
from eidrive_scenario.reporting.run_report.reported_runs import run_of_result as run_of_result
from eidrive_scenario.reporting.snapshot import SnapshotBuilder as SnapshotBuilder
from eidrive_scenario.reporting.snapshot import StationSnapshot as StationSnapshot
