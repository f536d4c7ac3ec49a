"""Settings of actions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.settings import Settings, parse_settings

Speed: TypeAlias = Annotated[float, Field(ge=0.0, le=1e4)]


class TargetSpeed(Settings):
    """Target speed that planner and controller of the stack follow: `Box(-1, 1, (1,))`, from 0 to `max_speed` [m/s].

    planner  planner of the station; None keeps the one of the scenario
    """

    kind: Literal["target_speed"] = "target_speed"
    max_speed: Annotated[float, Field(gt=0.0, le=1e4)] = 15.0
    planner: str | None = "route"


class MetaSpeed(Settings):
    """Target speed out of a list [m/s]: `Discrete(3)`, slower, keep and faster, or the index of a speed.

    relative  whether the action moves along the list; else it is an index of it
    planner   planner of the station; None keeps the one of the scenario
    """

    kind: Literal["meta_speed"] = "meta_speed"
    speeds: Annotated[tuple[Speed, ...], Field(min_length=2)] = (0.0, 2.5, 5.0, 7.5, 10.0, 12.5, 15.0)
    relative: bool = True
    planner: str | None = "route"

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        if not all(low < high for low, high in pairwise(self.speeds)):
            raise ValueError("speeds are not ascending")
        return self


class Pedals(Settings):
    """Pedals and steering: `Box(-1, 1, (2,))`.

    The first number is throttle (positive) or brake (negative), the second the steering angle as a share of the maximum
    of the vehicle, left positive.
    """

    kind: Literal["pedals"] = "pedals"


class SendMessages(Settings):
    """Whether messages that are due are sent in this step: `Discrete(2)`."""

    kind: Literal["send"] = "send"


class ShareObjects(Settings):
    """Selection of the `count` nearest own detections that messages contain: `MultiBinary(count)`.

    The order is that of the part `own` of the observation. Nothing is sent if no entry is 1.
    """

    kind: Literal["share"] = "share"
    count: Annotated[int, Field(ge=1, le=256)] = 8


ActionSettings: TypeAlias = TargetSpeed | MetaSpeed | Pedals | SendMessages | ShareObjects

_KINDS: Mapping[str, type[ActionSettings]] = {
    "target_speed": TargetSpeed,
    "meta_speed": MetaSpeed,
    "pedals": Pedals,
    "send": SendMessages,
    "share": ShareObjects,
}
DRIVING = frozenset({"target_speed", "meta_speed", "pedals"})
"""Kinds of actions that drive the vehicle; the others concern its messages."""


def parse_actions(given: Any) -> tuple[ActionSettings, ...]:
    """Return the actions of a station: one, or one that drives and one that concerns messages.

    given  a kind, a mapping with the key `kind`, settings, or a sequence of these

    Raise SettingError for any other value.
    """
    several = isinstance(given, Iterable) and not isinstance(given, str | Mapping | Settings)
    actions = tuple(_parse(one) for one in (given if several else [given]))
    driving = [one.kind for one in actions if one.kind in DRIVING]
    if not actions or len(driving) > 1 or len(actions) - len(driving) > 1:
        message = f"action has the kinds {', '.join(one.kind for one in actions) or 'none'}"
        raise SettingError(Diagnostic(message, "give at most one that drives, and one of send and share"))
    return actions


def _parse(given: Any) -> ActionSettings:
    if isinstance(given, TargetSpeed | MetaSpeed | Pedals | SendMessages | ShareObjects):
        return given
    data = {"kind": given} if isinstance(given, str) else given
    if not isinstance(data, Mapping):
        raise SettingError(Diagnostic(f"action is {quoted(given)}", f"give one of {', '.join(_KINDS)}, or a mapping"))
    kind: Any = data.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise SettingError(Diagnostic(f"action has the kind {quoted(kind)}", suggestion(str(kind), _KINDS)))
    return parse_settings(_KINDS[kind], data, source="action")
