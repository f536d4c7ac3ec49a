"""First half of a time step: the state and the perceptions on which actions from outside depend."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from eidrive_scenario.driving.stack import DrivingStack
from eidrive_scenario.driving.step import StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
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
