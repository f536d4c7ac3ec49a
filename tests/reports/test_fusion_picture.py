"""Picture of intermediate fusion: places and colors of cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from eidrive_reports.cooperative_perception.receivers import Reception
from eidrive_reports.fusion_picture import COLORS, LOST, PIXELS, Panel, cell_corners

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame, to_cells
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState


def frame(index: int, yaw: float = 0.0) -> FeatureFrame:
    """Return a frame with one cell of a grid of 4 x 6 cells of 2 m about (10, 20)."""
    cells = to_cells(np.array([index]), np.zeros((8, 1), np.int8))
    return FeatureFrame(0, 1, 0, 1, 0.0, 10.0, 20.0, yaw, 1.9, 0.0, 2.0, (4, 6), "int8", 0.1, cells)


@pytest.mark.parametrize(("yaw", "center"), [(0.0, (13.0, 25.0)), (math.pi / 2.0, (5.0, 23.0))])
def test_cell_is_at_its_place_in_the_world(yaw: float, center: tuple[float, float]) -> None:
    """The last cell ends 4 m ahead and 6 m to the left of the center of the grid."""
    (corners,) = cell_corners(np.array([23]), frame(23, yaw), (4, 6))
    assert corners.mean(axis=0) == pytest.approx(center)
    assert np.ptp(corners, axis=0) == pytest.approx((2.0, 2.0))


def message(number: int, features: FeatureFrame) -> Message:
    state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Message("RSU", number, 0.0, state, Detections(0.0), 100, kind="features", features=features)


def test_lost_cells_have_another_color_than_received_ones() -> None:
    """The window is 16 m wide about the grid; cell 0 at (7, 15) arrives, and cell 23 at (13, 25) is lost."""
    received, lost = message(1, frame(0)), message(2, frame(23))
    panel = Panel(Window.centered((10.0, 20.0), 16.0, 1.0), RoadDrawing())
    panel.cells(
        Reception([received, lost], [ReceivedMessage(received, 0.1)], None, Detections(0.0)), {"RSU": COLORS[1]}
    )

    def color_at(x: float, y: float) -> str:
        blue, green, red = panel.image[round((28.0 - y) / 16.0 * PIXELS), round((x - 2.0) / 16.0 * PIXELS)].tolist()
        return f"#{red:02x}{green:02x}{blue:02x}"

    assert (color_at(7.0, 15.0), color_at(13.0, 25.0)) == (COLORS[1], LOST)
    assert color_at(7.0, 25.0) not in (COLORS[1], LOST)
