"""Reasons of plans."""

from __future__ import annotations

from planned_drive import KnownBox, PlannedDrive, behavior, two_lane_road


def test_end_of_the_road_without_objects_is_no_traffic() -> None:
    """From 4 m/s the vehicle reaches 10 m/s just before it brakes for the end, so that it prefers less than 10 m/s."""
    roads = two_lane_road(85.0)
    run = PlannedDrive(behavior(roads), roads, speed=4.0)
    run.run(12.0, lambda now: [])
    run.world.close()
    assert max(run.speeds) < 9.0
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
