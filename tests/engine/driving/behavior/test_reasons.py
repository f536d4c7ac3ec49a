"""Reasons of plans."""

from __future__ import annotations

import math

import pytest
from planned_drive import KnownBox, PlannedDrive, behavior, two_lane_road


@pytest.mark.parametrize(("length", "tolerance"), [(60.0, 0.5), (70.0, 0.5), (85.0, 0.1)])
def test_end_of_the_road_without_objects_is_no_traffic(length: float, tolerance: float) -> None:
    """From 20 m on it accelerates from 4 m/s with 1.5 m/s² and stops with 2 m/s²: (v² - 16) / 3 + v² / 4 is its way.

    It wants 10 m/s at most. Below, its plans round the peak over time steps of 0.25 s.
    """
    roads = two_lane_road(length)
    run = PlannedDrive(behavior(roads), roads, speed=4.0)
    run.run(12.0, lambda now: [])
    run.world.close()
    peak = math.sqrt((length - 20.0 + 16.0 / 3.0) / (1.0 / 3.0 + 1.0 / 4.0))
    assert max(run.speeds) == pytest.approx(min(peak, 10.0), abs=tolerance)
    assert set(run.reasons) == {"keep speed", "curve or end of route ahead"}


def test_reversing_vehicle_approaches() -> None:
    """A truck 68 m ahead moves towards the vehicle at 1.5 m/s, and stands from 6 s on."""
    roads = two_lane_road()
    run = PlannedDrive(behavior(roads), roads, start=20.0)

    def truck(now: float) -> list[KnownBox]:
        speed = 1.5 if now < 6.0 else 0.0
        return [KnownBox(88.0 - 1.5 * min(now, 6.0), vx=-speed, kind="truck", size=(8.0, 2.5))]

    run.run(7.5, truck)
    run.world.close()
    texts = [plan.reason for plan in run.plans if "truck" in plan.reason]
    moving = [text for text in texts if text.endswith("at 1.5 m/s")]
    assert moving
    assert all(
        text.startswith("stop for truck ") and text.endswith("ahead that approaches at 1.5 m/s") for text in moving
    )
    assert any(text.startswith("follow truck ") and text.endswith("ahead at 0.0 m/s") for text in texts)
