"""With traffic on the left `behavior` drives the mirror image of its drive with traffic on the right.

Scenes and maps of the library are mirrored at the x axis: no term of the decisions may depend on the side.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mirrored_scenario import SCENES, write_mirrored

from eidrive_scenario.api.run import run_file
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.recording.frame import Frame

pytestmark = pytest.mark.exhaustive

FOLDER = Path(__file__).parents[4] / "xosc" / "driving"
ROUNDING = 1e-9
"""Tolerance of positions [m] and headings [rad]."""


class Drive:
    """Poses of all actors per tick, and the maneuvers of the ego."""

    def __init__(self) -> None:
        self.poses: list[np.ndarray] = []
        self.maneuvers: set[str] = set()

    def observe(self, frame: Frame) -> None:
        view = frame.view
        self.poses.append(np.column_stack([view.position[:, :2], view.yaw]))
        plan = frame.steps["Ego"].plan
        if plan is not None and plan.reason is not None and "; " in plan.reason:
            self.maneuvers.add(plan.reason.split("; ")[0])

    def close(self) -> None:
        """Do nothing."""


@pytest.mark.parametrize(("scene", "maneuver"), SCENES.items())
def test_drive_on_the_left_is_the_mirrored_drive(tmp_path: Path, scene: str, maneuver: str | None) -> None:
    source = FOLDER / f"{scene}.xosc"
    right, left = Drive(), Drive()
    with_traffic_on_the_right = run_file(source, seed=1, observers=[right])
    with_traffic_on_the_left = run_file(write_mirrored(source, tmp_path), seed=1, observers=[left])
    assert with_traffic_on_the_right.passed is with_traffic_on_the_left.passed is True
    assert {verdict.name for verdict in with_traffic_on_the_right.criteria} >= {"collision", "reach_position"}
    assert with_traffic_on_the_right.metrics["collision.count"] == 0.0
    assert not with_traffic_on_the_right.warnings
    assert len(left.poses) == len(right.poses) > 100
    difference = np.array(left.poses) - np.array(right.poses) * [1.0, -1.0, -1.0]
    difference[..., 2] = wrap_angle(difference[..., 2])
    assert np.abs(difference).max() < ROUNDING
    exchanged = {name.replace("left", "@").replace("right", "left").replace("@", "right") for name in right.maneuvers}
    assert left.maneuvers == exchanged
    assert maneuver is None or maneuver in right.maneuvers
