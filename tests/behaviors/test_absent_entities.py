"""Entities that are deleted while somebody acts with them, and actions of those that are not there."""

from __future__ import annotations

from typing import Any

import pytest
from street_scene import after, everywhere, private

DELETE = everywhere('<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>')
TO_OTHER_S_LANE = private(
    '<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="time" '
    'value="1"/><LaneChangeTarget><RelativeTargetLane entityRef="Other" value="0"/></LaneChangeTarget>'
    "</LaneChangeAction></LateralAction>"
)
BESIDE_OTHER = private(
    '<LateralAction><LaneOffsetAction continuous="true"><LaneOffsetActionDynamics dynamicsShape="step"/>'
    '<LaneOffsetTarget><RelativeTargetLaneOffset entityRef="Other" value="1"/></LaneOffsetTarget>'
    "</LaneOffsetAction></LateralAction>"
)
BEHIND_EGO = private(
    '<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="20" continuous="false" '
    'freespace="false"/></LongitudinalAction>'
)
DRIVE_TO = private(
    '<RoutingAction><AcquirePositionAction><Position><LanePosition roadId="1" laneId="-1" s="300"/></Position>'
    "</AcquirePositionAction></RoutingAction>"
)


def transitions(played: Any, element: str) -> list[tuple[float, str]]:
    return [
        (round(change.time, 3), change.transition.name)
        for change in played.changes
        if change.element == element and change.transition is not None
    ]


@pytest.mark.parametrize(
    ("actor", "action"),
    [("Ego", TO_OTHER_S_LANE), ("Ego", BESIDE_OTHER), ("Other", BEHIND_EGO), ("Other", DRIVE_TO)],
    ids=["lane of", "beside", "behind", "to"],
)
def test_an_action_with_somebody_who_is_gone_is_stopped_as_it_starts(scene: Any, actor: str, action: str) -> None:
    played = scene(2, ("Ego", DELETE, after(0.45)), (actor, action, after(0.95)))
    assert transitions(played, "action 1") == [(1.0, "START"), (1.0, "STOP")]
    assert transitions(played, "event 1") == [(1.0, "START"), (1.0, "END")]
    assert played.at(2.0).x == pytest.approx(140.0)


@pytest.mark.element("DeleteEntityAction")
def test_an_action_stops_when_the_entity_that_it_follows_is_deleted(scene: Any) -> None:
    played = scene(2, ("Ego", BESIDE_OTHER), ("Ego", DELETE, after(0.95)))
    assert transitions(played, "action 0") == [(0.0, "START"), (1.1, "STOP")]
    assert next(c.why for c in played.changes if c.element == "action 0" and c.why) == "Other is not in the world"


def test_what_is_not_performed_is_said_at_the_end(run: Any) -> None:
    others = {"Other": (-2, 150.0, 10.0)}
    played = run(2, ("Ego", DELETE, after(0.45)), ("Other", DRIVE_TO, after(0.95)), others=others, driven=False)
    (warning,) = [told for told in played.result.warnings if "AcquirePosition" in told]
    assert "is not performed: Other is not in the world" in warning


@pytest.mark.element("AddEntityAction", "DeleteEntityAction")
def test_who_is_deleted_and_added_at_one_instant_is_moved(run: Any) -> None:
    """Deleted and added in one event, Other is where it was added in the next view, as after a teleport."""
    back = everywhere(
        '<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="300"/>'
        "</Position></AddEntityAction></EntityAction>"
    )
    others = {"Other": (-2, 150.0, 10.0)}
    both = (("Ego", DELETE, after(0.475)), ("Ego", back, after(0.475)))
    x = run(1, *both, others=others, driven=False).x("Other")
    assert x[10:13] == pytest.approx([155.0, 300.0, 300.5])
