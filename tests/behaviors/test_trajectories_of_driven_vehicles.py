"""Trajectories of driven vehicles: their start, their progress, laps, and synchronized partners."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from openscenario_xml import round_car_xml
from storyboard_xml import private_xml, speed_xml, teleport_xml
from street_scene import AGENT, after
from trajectories import RELATIVE, curve, follow, world
from whole_run import RecordedRun, Run

STRAIGHT = curve(world(100.0, -2.0), world(220.0, -2.0))


def row(played: RecordedRun, time: float, name: str) -> tuple[float, float, float]:
    view = played.frames[round(time / 0.05)].view
    index = view.rows[name]
    return float(view.position[index, 0]), float(view.position[index, 1]), float(view.speed[index])


def ends_of_action(played: RecordedRun) -> list[float]:
    changes = [change for frame in played.frames for change in frame.changes if change.element == "action 0"]
    return [change.time for change in changes if change.after.value == "completeState"]


@pytest.mark.element("FollowTrajectoryAction")
@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("speed_first", [True, False])
def test_driven_vehicle_without_a_position_appears_on_its_trajectory(run: Run, mode: str, speed_first: bool) -> None:
    action = follow(curve(world(300.0, -2.0), world(500.0, -2.0)), mode).replace(
        "<FollowTrajectoryAction>", '<FollowTrajectoryAction initialDistanceOffset="25">'
    )
    actions = (speed_xml(10.0), action) if speed_first else (action, speed_xml(10.0))
    init = f'<Private entityRef="Second">{"".join(actions)}</Private>'
    played = run(3.0, more=round_car_xml("Second", AGENT), init=init)
    assert row(played, 0.0, "Second") == pytest.approx((325.0, -2.0, 10.0), abs=1e-6)
    assert row(played, 3.0, "Second") == pytest.approx((355.0, -2.0, 10.0), abs=1.0)


@pytest.mark.statistical
@pytest.mark.element("SynchronizeAction")
@pytest.mark.parametrize("target", [STRAIGHT, None], ids=["trajectory", "lane"])
def test_partner_arrives_together_with_driven_master_on_trajectory(run: Run, target: str | None) -> None:
    """The other car is to be at y = 4.5 when Ego is at x = 180."""
    master = '<LanePosition roadId="1" laneId="-1" s="180"/>'
    if target is not None:
        master = f'<TrajectoryPosition s="80"><TrajectoryRef>{target}</TrajectoryRef></TrajectoryPosition>'
    crossing = curve(world(180.0, 8.0, -math.pi / 2), world(180.0, -9.0, -math.pi / 2))
    together = f"""<PrivateAction><SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>{master}
      </TargetPositionMaster><TargetPosition>{world(180.0, 4.5)}</TargetPosition></SynchronizeAction></PrivateAction>"""
    played = run(
        20.0,
        ("Second", together),
        ego=(-1, 100.0, 8.0),
        more=round_car_xml("Second"),
        init=f'<Private entityRef="Ego">{follow(STRAIGHT, "follow")}</Private>'
        f'<Private entityRef="Second">{follow(crossing)}</Private>',
    )
    x = played.x("Ego")
    assert x[-1] > 180.0
    there = next(n for n, place in enumerate(x) if place >= 180.0)
    assert row(played, 0.05 * there, "Second")[1] == pytest.approx(4.5, abs=0.3)


def test_trajectory_of_driven_vehicle_ends_at_its_end(run: Run) -> None:
    played = run(9.0, ("Ego", follow(STRAIGHT, "follow")), ego=(-1, 100.0, 20.0))
    (ended,) = ends_of_action(played)
    assert row(played, ended, "Ego")[0] == pytest.approx(219.0, abs=1.5)


@pytest.mark.parametrize(("stopped", "y"), [(100.0, -6.0), (1.5, -2.0)])
def test_driven_vehicle_leaves_a_trajectory_that_is_stopped(run: Run, stopped: float, y: float) -> None:
    """From lane -1 (y = -2) it leads to lane -2 (y = -6); an action on the lateral domain stops it in lane -1."""
    offset = """<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="step"/>
      <LaneOffsetTarget><AbsoluteTargetLaneOffset value="0"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>"""
    way = curve(world(100.0, -2.0), world(180.0, -6.0), world(400.0, -6.0))
    played = run(
        8.0, ("Ego", follow(way, "follow")), ("Ego", private_xml(offset), after(stopped)), ego=(-1, 100.0, 15.0)
    )
    assert row(played, 8.0, "Ego")[1] == pytest.approx(y, abs=0.1)


def test_trajectory_behind_a_driven_vehicle_does_not_end_and_warns(run: Run) -> None:
    """Ego starts 370 m beyond the end of the trajectory, and driving stacks do not turn around."""
    played = run(1.0, ("Ego", follow(STRAIGHT), after(0.25)), ego=(-1, 590.0, 10.0))
    assert ends_of_action(played) == pytest.approx([1.0]), "with the run"
    (warning,) = [text for text in played.result.warnings if "FollowTrajectoryAction" in text]
    assert "the action does not end: 'Ego' passes the end of the trajectory at a distance" in warning


def test_trajectory_that_returns_to_its_start_is_driven_to_its_end(run: Run) -> None:
    """A circle as an open polyline: its end is its start."""
    circle = [(100.0 + 30.0 * math.sin(a), 28.0 - 30.0 * math.cos(a)) for a in np.linspace(0.0, math.tau, 73)]
    played = run(40.0, ("Ego", follow(curve(*(world(x, y) for x, y in circle)), "follow")), ego=(-1, 100.0, 8.0))
    (ended,) = ends_of_action(played)
    assert 8.0 * ended > 0.9 * math.tau * 30.0


def test_closed_trajectory_of_driven_vehicle_is_driven_in_laps(run: Run) -> None:
    circle = [(100.0 + 30.0 * math.sin(a), 28.0 - 30.0 * math.cos(a)) for a in np.linspace(0.0, math.tau, 73)]
    way = curve(*(world(x, y) for x, y in circle), closed=True)
    played = run(60.0, ("Ego", follow(way, "follow")), ego=(-1, 100.0, 8.0))
    places = np.array([frame.view.position[0, :2] for frame in played.frames]) - (100.0, 28.0)
    assert np.hypot(*places.T) == pytest.approx(np.full(len(places), 30.0), abs=1.0)
    angle = np.unwrap(np.arctan2(places[:, 1], places[:, 0]))
    assert angle[-1] - angle[0] > 2.0 * math.tau
    assert ends_of_action(played) == [pytest.approx(60.0, abs=0.1)]  # the end of the run


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_vehicle_whose_controller_is_deactivated_continues_from_its_place(run: Run, mode: str) -> None:
    off = private_xml(
        '<ControllerAction><ActivateControllerAction lateral="false" longitudinal="false"/></ControllerAction>'
    )
    init = f'<Private entityRef="Ego">{follow(STRAIGHT, mode)}</Private>'
    played = run(5.0, ("Ego", off, after(2.0)), ego=(-1, 100.0, 10.0), init=init)
    x = played.x("Ego")
    assert max(abs(later - earlier) for earlier, later in pairwise(x)) < 0.7
    assert x[-1] > 145.0


@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize("teleported", [True, False])
def test_driven_vehicle_has_the_speeds_of_a_timed_trajectory(run: Run, teleported: bool, mode: str) -> None:
    """15 m/s for 4 s, a stop of 6 s, then 10 m/s."""
    way = curve(*(world(x, -2.0) for x in (300.0, 360.0, 360.0, 460.0)), times=(0.0, 4.0, 10.0, 20.0))
    actions = (teleport_xml(world(300.0, -2.0)) if teleported else "", follow(way, mode, RELATIVE))
    init = f'<Private entityRef="Second">{"".join(actions)}</Private>'
    played = run(18.0, ego=(-1, 600.0, 20.0), more=round_car_xml("Second", AGENT), init=init)
    assert row(played, 0.0, "Second") == pytest.approx((300.0, -2.0, 15.0), abs=1e-6)
    assert row(played, 3.9, "Second") == pytest.approx((358.5, -2.0, 15.0), abs=1.0)
    assert row(played, 9.9, "Second")[2] == pytest.approx(0.0, abs=0.01)
    assert row(played, 18.0, "Second")[2] == pytest.approx(10.0, abs=0.3)


def test_negative_speed_of_a_driven_vehicle_is_a_warning(run: Run) -> None:
    played = run(3.0, ("Ego", speed_xml(-2.0)), ego=(-1, 100.0, 5.0))
    assert any("'Ego' stops instead of reversing" in warning for warning in played.result.warnings)
    assert row(played, 3.0, "Ego")[2] == pytest.approx(0.0, abs=0.01)
