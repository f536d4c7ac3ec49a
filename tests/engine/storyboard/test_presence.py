"""Who is in the world, at the instant at which somebody is deleted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.motion import Place
from eidrive_scenario.storyboard.stage import Absent


def with_car(view: Any, name: str) -> Any:
    """The view with one car at its origin."""
    point, zero = np.zeros((1, 3)), np.zeros(1)
    vectors = dict.fromkeys(("position", "velocity", "acceleration", "size", "offset"), point)
    scalars = dict.fromkeys(("yaw", "pitch", "roll", "yaw_rate", "speed"), zero)
    return replace(view, names=(name,), categories=("car",), **vectors, **scalars)


def test_who_is_deleted_is_there_until_the_end_of_the_step(stage: Any) -> None:
    """Conditions judge the view, and that still shows it, whatever was decided in its step."""
    stage.enter("A", Place(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    nobody = stage.view
    stage.begin(replace(with_car(nobody, "A"), tick=0), 0.1)
    stage.leave("A")
    assert stage.pose("A").x == 0.0
    assert stage.location("A") is None
    stage.begin(replace(nobody, tick=1), 0.1)
    with pytest.raises(Absent):
        stage.pose("A")


def test_who_is_deleted_and_added_is_both_removed_and_added(stage: Any) -> None:
    stage.enter("A", Place(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    stage.begin(replace(with_car(stage.view, "A"), tick=0), 0.1)
    stage.leave("A")
    stage.enter("A", Place(Pose(5.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert stage.commands.removals == {"A"}
    assert stage.commands.additions["A"].x == 5.0


def test_who_is_added_and_deleted_in_one_step_never_was_there(stage: Any) -> None:
    stage.begin(replace(stage.view, tick=0), 0.1)
    stage.enter("A", Place(Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    stage.leave("A")
    assert (stage.commands.removals, stage.commands.additions) == (set(), {})
