"""One time step, and what its first half shows to those who decide from outside."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from eidrive_scenario.driving.stack import DrivingStack
from eidrive_scenario.driving.step import StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.storyboard.state.commands import Commands, ExternalPose
from eidrive_scenario.world.view import WorldView


class TickStart(msgspec.Struct, frozen=True):
    """State of a run after the first half of a tick.

    view       ground truth
    perceived  what each present station perceives, by name; empty if the driving stack does not state it
    ends       whether the run ends with this tick, whatever the stations decide; a fatal criterion may end it as well
    """

    view: WorldView
    perceived: Mapping[str, StationPerception]
    ends: bool


class Tick(TickStart, frozen=True):
    """Time step after its first half.

    commands  of the storyboard, which has judged the view
    """

    commands: Commands


class OutsideInputs(msgspec.Struct):
    """Values that are set from outside of a run, between its ticks.

    user_values  of the UserDefinedValueConditions, by name
    poses        poses of the next view, by entity
    actions      decisions of stations in the next tick
    """

    user_values: dict[str, str]
    poses: dict[str, ExternalPose] = msgspec.field(default_factory=dict)
    actions: dict[str, StationAction] = msgspec.field(default_factory=dict)

    def take_poses(self) -> Mapping[str, ExternalPose]:
        """Return the poses, which apply to one tick."""
        poses, self.poses = self.poses, {}
        return poses

    def take_actions(self) -> Mapping[str, StationAction]:
        """Return the decisions, which apply to one tick."""
        actions, self.actions = self.actions, {}
        return actions


def check_action(name: str, action: object, stack: DrivingStack) -> None:
    """Raise SettingError unless the stack has a station of this name that can execute the action."""
    if not isinstance(action, StationAction):
        raise SettingError(Diagnostic(f"the action of {name!r} is {quoted(action)}", "give a StationAction"))
    if name not in stack.controllable:
        hint = suggestion(name, stack.controllable) if stack.controllable else "the scenario has no station"
        raise SettingError(Diagnostic(f"{quoted(name)} is not a station that accepts actions", hint))
    if action.drives and name not in stack.possible_drivers:
        message = f"the action of {name!r} drives, and the station does not"
        raise SettingError(Diagnostic(message, "set send or share"))
