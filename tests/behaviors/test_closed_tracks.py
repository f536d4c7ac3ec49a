"""Actions on a closed track: two half circles a and b with a radius of 50 m, counter-clockwise, lanes of 4 m."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import lane_links_xml, lane_xml, ring_xml, section_xml
from storyboard_xml import init_xml, lane_position_xml, speed_xml, teleport_xml
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import InputError

HALF = 50.0 * math.pi
"""Length of a half circle along the reference line [m]."""
TRACK = ring_xml(
    50.0, section_xml(lane_xml(1, 4, link=lane_links_xml(1, 1)), lane_xml(-1, 4, link=lane_links_xml(-1, -1)))
)


def drive(run: Run, end: float, action: str, ego: float, other: tuple[int, float]) -> RecordedRun:
    """Return a run of Ego in lane -1 and Other, both with 10 m/s, at distances along the track [m]."""
    places = {"Ego": (-1, ego), "Other": other}
    init = "".join(
        init_xml(name, teleport_xml(lane_position_xml(lane, s % HALF, "ab"[int(s // HALF)])) + speed_xml(10))
        for name, (lane, s) in places.items()
    )
    start = (-1, 10.0, 10.0)
    street = TRACK.replace('id="a"', 'id="1"').replace('elementId="a"', 'elementId="1"')
    init = init.replace('roadId="a"', 'roadId="1"')
    return run(end, ("Ego", action), driven=False, ego=start, others={"Other": start}, street=street, init=init)


def along(played: RecordedRun, name: str) -> list[float]:
    """Return the distances along the reference line of the track [m]."""
    rows = [frame.view.position[frame.view.rows[name]] for frame in played.frames]
    return [math.atan2(y, x) % (2.0 * math.pi) * 50.0 for x, y, _ in rows]


@pytest.mark.element("LongitudinalDistanceAction")
@pytest.mark.parametrize("ego", [280.0, 300.0, 130.0])
def test_follower_closes_the_gap_over_the_seam_of_a_track(run: Run, ego: float) -> None:
    """Other is 34 m ahead; the follower keeps 20 m and never drives backward."""
    action = """<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Other" distance="20"
      freespace="false" continuous="true" coordinateSystem="road" displacement="trailingReferencedEntity">
      <DynamicConstraints maxAcceleration="3" maxDeceleration="3" maxSpeed="25"/></LongitudinalDistanceAction>
      </LongitudinalAction></PrivateAction>"""
    played = drive(run, 15, action, ego, (-1, (ego + 34.0) % (2.0 * HALF)))
    gap = (along(played, "Other")[-1] - along(played, "Ego")[-1]) % (2.0 * HALF)
    assert gap == pytest.approx(20.0, abs=0.3)
    assert min(played.of("Ego", "speed")) > 5.0


@pytest.mark.element("SynchronizeAction")
def test_synchronize_drives_ahead_to_a_target_that_is_nearer_behind(run: Run) -> None:
    """The target is 200 m ahead and 114 m behind. Other needs 100 m along a lane with a radius of 48 m: 9.6 s."""
    action = f"""<PrivateAction><SynchronizeAction masterEntityRef="Other">
      <TargetPositionMaster><LanePosition roadId="b" laneId="1" s="30"/></TargetPositionMaster>
      <TargetPosition><LanePosition roadId="b" laneId="-1" s="{210.0 - HALF}"/></TargetPosition>
      </SynchronizeAction></PrivateAction>"""
    played = drive(run, 12, action, 10.0, (1, HALF + 130.0))
    assert along(played, "Ego")[round(9.6 / 0.05)] == pytest.approx(210.0, abs=2.0)


@pytest.mark.element("AcquirePositionAction")
def test_acquired_position_off_the_road_is_an_error(run: Run) -> None:
    action = """<PrivateAction><RoutingAction><AcquirePositionAction><Position><WorldPosition x="0" y="0"/></Position>
      </AcquirePositionAction></RoutingAction></PrivateAction>"""
    with pytest.raises(InputError, match="the position is not on a road"):
        drive(run, 1, action, 10.0, (-1, 50.0))
