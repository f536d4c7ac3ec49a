"""Presence of actors in the step in which an actor is deleted or added."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.context.contexts import EntityAbsentError
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition


def with_car(view: Any, name: str) -> Any:
    """Return the view with one car at the origin."""
    point, zero = np.zeros((1, 3)), np.zeros(1)
    vectors = dict.fromkeys(("position", "velocity", "acceleration", "size", "offset"), point)
    scalars = dict.fromkeys(("yaw", "pitch", "roll", "yaw_rate", "speed"), zero)
    return replace(view, names=(name,), categories=("car",), **vectors, **scalars)


def test_deleted_actor_is_present_until_the_end_of_the_step(context: Any) -> None:
    """Conditions are evaluated on the view, which contains the actor until the end of the step."""
    context.add_actor("A", ResolvedPosition(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    empty = context.view
    context.begin_tick(replace(with_car(empty, "A"), tick=0), 0.1)
    context.remove_actor("A")
    assert context.pose("A").x == 0.0
    assert context.location("A") is None
    context.begin_tick(replace(empty, tick=1), 0.1)
    with pytest.raises(EntityAbsentError):
        context.pose("A")


def test_actor_deleted_and_added_is_removed_and_spawned(context: Any) -> None:
    context.add_actor("A", ResolvedPosition(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    context.begin_tick(replace(with_car(context.view, "A"), tick=0), 0.1)
    context.remove_actor("A")
    context.add_actor("A", ResolvedPosition(Pose(5.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert context.commands.removals == {"A"}
    assert context.commands.spawns["A"].x == 5.0


def test_actor_added_and_deleted_in_one_step_has_no_commands(context: Any) -> None:
    context.begin_tick(replace(context.view, tick=0), 0.1)
    context.add_actor("A", ResolvedPosition(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    context.remove_actor("A")
    assert (context.commands.removals, context.commands.spawns) == (set(), {})
