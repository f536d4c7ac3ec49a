"""Who is in the world, at the instant at which somebody is deleted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.context.protocols import EntityAbsentError
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition


def with_car(view: Any, name: str) -> Any:
    """The view with one car at its origin."""
    point, zero = np.zeros((1, 3)), np.zeros(1)
    vectors = dict.fromkeys(("position", "velocity", "acceleration", "size", "offset"), point)
    scalars = dict.fromkeys(("yaw", "pitch", "roll", "yaw_rate", "speed"), zero)
    return replace(view, names=(name,), categories=("car",), **vectors, **scalars)


def test_who_is_deleted_is_there_until_the_end_of_the_step(context: Any) -> None:
    """Conditions judge the view, and that still shows it, whatever was decided in its step."""
    context.add_actor("A", ResolvedPosition(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    nobody = context.view
    context.begin_tick(replace(with_car(nobody, "A"), tick=0), 0.1)
    context.remove_actor("A")
    assert context.pose("A").x == 0.0
    assert context.location("A") is None
    context.begin_tick(replace(nobody, tick=1), 0.1)
    with pytest.raises(EntityAbsentError):
        context.pose("A")


def test_who_is_deleted_and_added_is_both_removed_and_added(context: Any) -> None:
    context.add_actor("A", ResolvedPosition(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    context.begin_tick(replace(with_car(context.view, "A"), tick=0), 0.1)
    context.remove_actor("A")
    context.add_actor("A", ResolvedPosition(Pose(5.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert context.commands.removals == {"A"}
    assert context.commands.spawns["A"].x == 5.0


def test_who_is_added_and_deleted_in_one_step_never_was_there(context: Any) -> None:
    context.begin_tick(replace(context.view, tick=0), 0.1)
    context.add_actor("A", ResolvedPosition(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    context.remove_actor("A")
    assert (context.commands.removals, context.commands.spawns) == (set(), {})
