"""Trajectories with and without times, with values calculated by hand.

Ego drives at 20 m/s from x = 100 in lane -1 (y = -2).
"""

from __future__ import annotations

import math

import pytest
from recorded_scene import RunScene
from street_scene import after
from trajectories import CORNER, RELATIVE, curve, follow, follow_points, world
from whole_run import Run

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation


@pytest.mark.element("FollowTrajectoryAction", "Polyline")
def test_trajectory_without_timing_keeps_the_own_speed(scene: RunScene) -> None:
    played = scene(2, ("Ego", follow_points(CORNER)))
    assert (played.at(0.4).x, played.at(0.4).y) == pytest.approx((108.0, -2.0))
    assert (played.at(1.0).x, played.at(1.0).y, played.at(1.0).yaw) == pytest.approx((110.0, 8.0, math.pi / 2))
    assert played.when("action 0", "completeState") == pytest.approx(1.5)


@pytest.mark.parametrize("timing", [RELATIVE, "<None/>", RELATIVE.replace('"relative"', '"absolute"')])
def test_closed_trajectory_is_driven_in_laps_without_absolute_times(run: Run, timing: str) -> None:
    """10 m of a square in each second: 4 s for a lap; absolute times end at 3 s at the last vertex."""
    square = [(300.0, -2.0), (310.0, -2.0), (310.0, 8.0), (300.0, 8.0)]
    closed = follow(curve(*(world(x, y) for x, y in square), closed=True, times=(0, 1, 2, 3)), reference=timing)
    played = run(6.0, ("Ego", closed), ego=(-1, 300.0, 10.0), driven=False)
    places = [tuple(played.frames[20 * second].view.position[0, :2]) for second in range(6)]
    assert places[:4] == [pytest.approx(place) for place in square]
    if "absolute" not in timing:
        assert places[4:] == [pytest.approx(place, abs=1e-6) for place in square[:2]]
    else:
        assert any("closed has no effect" in text for text in played.result.warnings)
        assert played.frames[60].changes[0].element == "action 0"


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_closed_circle_with_times_is_driven_in_laps(run: Run, mode: str) -> None:
    """A polygon of 72 corners, nearly a circle of 40 m, in 18 s at 13.96 m/s: 6 s after two laps, 120° are covered."""
    angles = [math.radians(5 * corner - 90) for corner in range(72)]
    corners = [world(300 + 40 * math.cos(angle), 38 + 40 * math.sin(angle)) for angle in angles]
    lap = follow(curve(*corners, closed=True, times=tuple(0.25 * corner for corner in range(72))), mode, RELATIVE)
    played = run(42.5, ("Ego", lap), ego=(-1, 300.0, 13.96), driven=False)
    x, y, _ = played.frames[20 * 42].view.position[0]
    assert (x, y) == pytest.approx((300 + 40 * math.cos(math.radians(30)), 38 + 40 * 0.5), abs=0.2)
    assert played.frames[20 * 42].view.speed[0] == pytest.approx(80 * math.pi / 18.0, rel=1e-2)


@pytest.mark.element("FollowTrajectoryAction", "Timing")
@pytest.mark.parametrize(
    ("domain", "offset", "scale", "start"),
    [("relative", 0, 1, 0.5), ("absolute", 0.5, 1, 0.5), ("relative", 1, 2, 1.5)],
)
def test_trajectory_with_timing_passes_vertices_at_their_times(
    scene: RunScene, domain: str, offset: float, scale: float, start: float
) -> None:
    """10 m in 2 s from 0.5 s: 5 m/s, and half of it with doubled times."""
    timed = [(100.0, -2.0, 0.0), (110.0, -2.0, 2.0)]
    timing = f'<Timing domainAbsoluteRelative="{domain}" offset="{offset}" scale="{scale}"/>'
    later = after(0.45)
    played = scene(6, ("Ego", follow_points(timed, reference=timing), later))
    assert played.at(start + scale).x == pytest.approx(105.0)
    assert played.at(start + scale).speed == pytest.approx(5.0 / scale)
    assert played.when("action 0", "completeState") == pytest.approx(start + 2 * scale)


@pytest.mark.element("FollowTrajectoryAction", "Timing")
@pytest.mark.parametrize("domain", ["relative", "absolute"])
@pytest.mark.parametrize("first", [0.0, 0.5])
def test_time_to_reach_the_initial_offset_is_deducted_from_all_times(
    scene: RunScene, domain: str, first: float
) -> None:
    """40 m at 10 m/s from `first`, with doubled times from 2 · first at 5 m/s: 10 m after the offset of 20 m 2 s later.

    Until then the actor waits. The action starts with the run, so that both domains have the same times.
    """
    timed = [(100.0, -2.0, first), (140.0, -2.0, first + 4.0)]
    timing = f'<Timing domainAbsoluteRelative="{domain}" offset="0" scale="2"/>'
    action = follow_points(timed, reference=timing).replace(
        "<FollowTrajectoryAction>", '<FollowTrajectoryAction initialDistanceOffset="20">'
    )
    played = scene(6, ("Ego", action))
    assert played.at(2 * first + 0.2).x == pytest.approx(121.0)
    assert played.at(2 * first + 2.0).x == pytest.approx(130.0)
    assert played.when("action 0", "completeState") == pytest.approx(2 * first + 4.0)


def test_trajectory_in_follow_mode_changes_speed_linearly(scene: RunScene) -> None:
    """From 20 m/s, 10 m in 1 s: braking to standstill."""
    timed = [(100.0, -2.0, 0.0), (110.0, -2.0, 1.0)]
    played = scene(2, ("Ego", follow_points(timed, "follow")))
    assert played.at(0.5).x == pytest.approx(107.5)


@pytest.mark.parametrize("later", [False, True])
def test_timing_over_trajectory_without_times_keeps_the_speed_and_warns(run: Run, later: bool) -> None:
    """At 20 m/s from x = 110, in an event as in Init: x = 150 after 2 s."""
    action = follow_points([(110.0, -2.0, None), (500.0, -2.0, None)], reference=RELATIVE)
    warnings: list[str] = []

    def look(simulation: Simulation, frame: Frame) -> None:
        warnings[:] = [str(diagnostic) for diagnostic in simulation.storyboard.context.warnings]

    if later:
        played = run(3, ("Ego", action, after(0.45)), driven=False, during=look)
    else:
        played = run(3, driven=False, init=f'<Private entityRef="Ego">{action}</Private>', during=look)
    start = 0.5 if later else 0.0
    for frame, x in zip(played.frames, played.x("Ego"), strict=True):
        if frame.view.time > start + 0.1:
            assert x == pytest.approx(110.0 + 20.0 * (frame.view.time - start), abs=1e-6)
    (warning,) = [text for text in warnings if "no times for Timing to scale" in text]
    assert "scene.xosc:" in warning
    assert warning.endswith("specify the time of each vertex, or <None/> as the TimeReference")
