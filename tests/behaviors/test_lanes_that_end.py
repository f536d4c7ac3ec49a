"""Lateral actions in a lane that ends within its road: they continue in the adjacent lane from the actor's position."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from opendrive_xml import lanes_xml
from street_scene import LANES, street
from whole_run import RecordedRun, Run

NARROWED = street(LANES + lanes_xml(0, 1, 4, s=150.0))
"""Street whose lane -2 (y = -6) ends at x = 150; lane -1 (y = -2) continues."""


def change(shape: str, dimension: str, value: float) -> str:
    return f"""<PrivateAction><LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
      <LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction>
      </PrivateAction>"""


def offset(continuous: str) -> str:
    return f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="{continuous}">
      <LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="2"/>
      <LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>
      </PrivateAction>"""


def fastest_sideways(played: RecordedRun) -> float:
    y = [float(frame.view.position[frame.view.rows["Ego"], 1]) for frame in played.frames]
    return max(abs(b - a) / 0.05 for a, b in pairwise(y))


def ends(played: RecordedRun) -> float:
    return next(
        change.time
        for frame in played.frames
        for change in frame.changes
        if change.element == "action 0" and change.after.value == "completeState"
    )


@pytest.mark.element("LaneChangeAction")
@pytest.mark.parametrize(
    ("action", "time"), [(change("sinusoidal", "time", 4.0), 4.0), (change("linear", "distance", 40.0), 4.02)]
)
def test_lane_change_into_a_lane_that_ends_returns_smoothly(run: Run, action: str, time: float) -> None:
    """The change takes 40 m, but lane -2 ends after 15 m: the rest of the 40 m leads back to lane -1."""
    played = run(6, ("Ego", action), ego=(-1, 135.0, 10.0), driven=False, street=NARROWED)
    assert float(played.frames[-1].view.position[0, 1]) == pytest.approx(-2.0, abs=1e-6)
    assert ends(played) == pytest.approx(time, abs=0.06)
    assert fastest_sideways(played) < 0.5 * math.pi * 4.0 / 4.0


@pytest.mark.element("LaneOffsetAction")
@pytest.mark.parametrize("continuous", ["false", "true"])
def test_lane_offset_after_lane_end_refers_to_the_adjacent_lane(run: Run, continuous: str) -> None:
    """At x = 150 (1.5 s) 4 m remain from y = -5 to -1; at 2 m/s² they take π s, with at most 2 m/s lateral speed."""
    played = run(7, ("Ego", offset(continuous)), ego=(-2, 135.0, 10.0), driven=False, street=NARROWED)
    assert float(played.frames[-1].view.position[0, 1]) == pytest.approx(-1.0, abs=1e-6)
    assert fastest_sideways(played) == pytest.approx(2.0, abs=0.05)
    if continuous == "false":
        assert ends(played) == pytest.approx(1.5 + math.pi, abs=0.1)
