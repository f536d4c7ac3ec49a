"""RelativeClearanceCondition: lanes, range and free space.

Ego drives at 20 m/s from x = 100 in lane -1.
"""

from __future__ import annotations

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from recorded_scene import RunScene, first_start
from storyboard_xml import by_entity_xml
from street_scene import NOTHING
from traffic_scene import definition, source, traffic
from whole_run import Run


@pytest.mark.element("RelativeClearanceCondition")
@pytest.mark.parametrize(
    ("other", "opposite", "clear"),
    [
        ((-2, 120, 20), "false", False),
        ((-2, 140, 20), "false", True),
        ((-2, 85, 20), "false", False),
        ((-2, 75, 20), "false", True),
        ((-1, 110, 20), "false", True),
        ((1, 110, 20), "true", True),
    ],
)
def test_clearance_in_the_right_lane_depends_on_the_range(
    scene: RunScene, other: tuple[int, float, float], opposite: str, clear: bool
) -> None:
    """The range is 30 m ahead and 20 m behind in the lane to the right."""
    condition = by_entity_xml(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="false" '
        f'oppositeLanes="{opposite}"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first_start(scene(0.2, ("Ego", NOTHING, condition), other=other)) == (0.0 if clear else None)


@pytest.mark.element("RelativeClearanceCondition")
@pytest.mark.parametrize(
    ("s", "free_space", "clear"),
    [(130.5, "false", True), (130.5, "true", False), (131.5, "true", True), (77, "true", False), (75, "true", True)],
)
def test_clearance_with_free_space_counts_the_whole_box(
    scene: RunScene, s: float, free_space: str, clear: bool
) -> None:
    """The box of Other extends from 1 m behind its reference point to 4 m ahead of it."""
    condition = by_entity_xml(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first_start(scene(0.2, ("Ego", NOTHING, condition), other=(-2, s, 20))) == (0.0 if clear else None)


@pytest.mark.parametrize(("free_space", "time"), [("true", 0.1), ("false", None)])
def test_clearance_with_free_space_counts_a_side_in_the_lane(
    scene: RunScene, free_space: str, time: float | None
) -> None:
    """From 0.1 s Other is 1.5 m beside the center of a 4 m lane; its side is 0.5 m inside the lane to the right."""
    condition = by_entity_xml(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    aside = """<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
      <LaneOffsetActionDynamics dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="-1.5"/>
      </LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""
    played = scene(0.3, ("Ego", NOTHING, condition), ("Other", aside), other=(-1, 110, 20), edge="falling")
    assert first_start(played) == (None if time is None else pytest.approx(time))


def test_clearance_without_the_lane_is_false(scene: RunScene) -> None:
    condition = by_entity_xml(
        '<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="false" '
        'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first_start(scene(0.2, ("Ego", NOTHING, condition), ego=(-2, 100, 20))) is None


@pytest.mark.parametrize(("s", "clear"), [(127.0, False), (128.0, True)])
def test_clearance_in_a_bend_is_measured_along_the_lane(scene: RunScene, s: float, clear: bool) -> None:
    """The radius of lane -3 is 110 m: 30 m along its center are 27.3 m along the reference line."""
    condition = by_entity_xml(
        '<RelativeClearanceCondition distanceForward="30" distanceBackward="0" freeSpace="false" '
        'oppositeLanes="false"><RelativeLaneRange from="0" to="0"/></RelativeClearanceCondition>'
    )
    street = map_xml(road_xml(length=600.0, curvature=0.01, lanes=lanes_xml(1, 3, 4)))
    played = scene(0.2, ("Ego", NOTHING, condition), ego=(-3, 100, 20), other=(-3, s, 20), street=street)
    assert first_start(played) == (0.0 if clear else None)


@pytest.mark.parametrize("free_space", ["true", "false"])
def test_clearance_counts_background_traffic(run: Run, free_space: str) -> None:
    """Ego stands at 400 m. The range is 20 m behind in both lanes; boxes of traffic extend ahead of their positions."""
    condition = by_entity_xml(
        f'<RelativeClearanceCondition distanceForward="0" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="0"/></RelativeClearanceCondition>'
    )
    cars = traffic(source(0.2, 300, more=definition()))
    played = run(
        8.0, ("Ego", NOTHING, condition), ego=(-1, 400.0, 0.0), driven=False, globally=cars, edge="falling", seed=1
    )
    fronts = [
        (box[0] + 0.5 * box[3] if free_space == "true" else point[0], frame.view.time)
        for frame in played.frames
        for name, box, point in zip(frame.view.names, frame.view.boxes, frame.view.position, strict=True)
        if name.startswith("crowd.")
    ]
    assert played.begun("event 0") == [pytest.approx(min(time for front, time in fronts if front >= 380.0))]
