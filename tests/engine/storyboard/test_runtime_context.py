"""Requests of actions: the methods of the context that write the storyboard's state and its commands."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eidrive_scenario.base.requests import Override
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.context.contexts import ActionContext, ConditionContext, ControllerContext
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion import Motion
from eidrive_scenario.storyboard.state.commands import ExternalPose
from eidrive_scenario.world.environment import Environment


def test_contexts_of_extensions_lack_requests_of_others_and_of_the_tree() -> None:
    tree = {"acquire_domain", "release_domains", "begin_tick", "step_traffic"}
    requests = {"add_actor", "remove_actor", "set_variable", "set_signal_state", "request_command"}
    poses = {"take_external_pose"}
    assert tree | requests | poses <= set(dir(RuntimeContext))
    assert requests <= set(dir(ActionContext))
    assert poses <= set(dir(ControllerContext))
    assert not (tree | requests | poses) & set(dir(ConditionContext))
    assert not (tree | poses) & set(dir(ActionContext))
    assert not (tree | requests) & set(dir(ControllerContext))


@pytest.mark.parametrize("name", ["pose", "location", "heading", "speed", "route", "end_of_road", "teleported"])
def test_motion_state_cannot_be_assigned(name: str) -> None:
    with pytest.raises(AttributeError, match="no setter"):
        setattr(Motion(None), name, None)


def test_override_released_is_no_longer_held(context: RuntimeContext) -> None:
    throttle, brake = Override("throttle", 0.3), Override("brake", 1.0)
    context.set_override("A", throttle)
    context.set_override("A", brake)
    assert context.overrides == {"A": {"throttle": throttle, "brake": brake}}
    context.set_override("A", replace(throttle, active=False))
    assert context.overrides == {"A": {"brake": brake}}


def test_environment_set_is_kept_and_commanded_once(context: RuntimeContext) -> None:
    """The state lasts; the command holds for the tick of the action only."""
    environment = Environment(friction=0.4)
    context.set_environment(environment)
    assert context.environment is context.commands.environment is environment
    context.begin_tick(context.view, 0.1)
    assert context.environment is environment
    assert context.commands.environment is None


def test_warning_given_twice_is_reported_once(context: RuntimeContext) -> None:
    warning = Diagnostic("unknown signal", "", "scene.xosc", 3)
    context.warn(warning)
    context.warn(warning, Diagnostic("unknown signal", "", "scene.xosc", 4))
    assert [diagnostic.line for diagnostic in context.warnings] == [3, 4]


def test_external_pose_is_taken_once_and_kept_until_then(context: RuntimeContext) -> None:
    pose = ExternalPose(Pose(1.0, 2.0, 0.0, 0.0, 0.0, 0.0), 3.0)
    context.begin_tick(context.view, 0.1, external_poses={"A": pose})
    context.begin_tick(context.view, 0.1)
    assert context.take_external_pose("A") == pose
    assert context.take_external_pose("A") is None


def test_user_values_are_those_of_the_tick(context: RuntimeContext) -> None:
    context.begin_tick(context.view, 0.1, user_values={"mood": "3"})
    assert context.user_values == {"mood": "3"}
    context.begin_tick(context.view, 0.1)
    assert not context.user_values


def test_first_condition_that_requests_a_user_value_is_recorded(context: RuntimeContext) -> None:
    first, second = (
        model.UserDefinedValueCondition(name="mood", rule=model.Rule.EQUAL_TO, value=value) for value in "12"
    )
    context.request_user_value(first)
    context.request_user_value(second)
    assert context.requested_user_values == {"mood": first}
