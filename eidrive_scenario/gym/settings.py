"""Settings of an environment: actions, observations and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, TypeAlias, get_args

from pydantic import BeforeValidator, Field, model_validator

from eidrive_scenario.driving.planning.path import SPACING
from eidrive_scenario.driving.planning.route_planner import HORIZON
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.extensions.settings import Settings, parse_settings

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
    action.model_fields["kind"].default: action for action in get_args(ActionSettings)
}
DRIVING = frozenset({"target_speed", "meta_speed", "pedals"})
"""Kinds of actions that drive the vehicle; the others concern its messages."""


def parse_actions(given: Any) -> tuple[ActionSettings, ...]:
    """Return the actions of a station: one, or one that drives and one that concerns messages.

    given  a kind, a mapping with the key `kind`, settings, or a sequence of these

    Raise SettingError for any other value.
    """
    several = isinstance(given, Iterable) and not isinstance(given, str | Mapping | Settings)
    actions = tuple(_parse(action) for action in (given if several else [given]))
    driving = [action.kind for action in actions if action.kind in DRIVING]
    if not actions or len(driving) > 1 or len(actions) - len(driving) > 1:
        message = f"action has the kinds {', '.join(action.kind for action in actions) or 'none'}"
        raise SettingError(Diagnostic(message, "give at most one that drives, and one of send and share"))
    return actions


def _parse(given: Any) -> ActionSettings:
    if isinstance(given, ActionSettings):
        return given
    data = {"kind": given} if isinstance(given, str) else given
    if not isinstance(data, Mapping):
        raise SettingError(Diagnostic(f"action is {quoted(given)}", f"give one of {', '.join(_KINDS)}, or a mapping"))
    kind: Any = data.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise SettingError(Diagnostic(f"action has the kind {quoted(kind)}", suggestion(str(kind), _KINDS)))
    return parse_settings(_KINDS[kind], data, source="action")


LONGEST_ROUTE = (HORIZON - 1) * SPACING
"""Maximum distance of a point of the route [m]: the length of a plan of the route planner."""


class TableSettings(Settings):
    """Table of the nearest objects: `count` rows; objects farther than `range` [m] are omitted."""

    count: Annotated[int, Field(ge=1, le=256)] = 16
    range: Annotated[float, Field(gt=0.0, le=1e4)] = 100.0


class RouteSettings(Settings):
    """Points on the route ahead of the vehicle, `spacing` apart [m]."""

    points: Annotated[int, Field(ge=1, le=59)] = 10
    spacing: Annotated[float, Field(gt=0.0, le=LONGEST_ROUTE)] = 5.0

    @model_validator(mode="after")
    def _within_the_plan(self) -> Self:
        if self.length > LONGEST_ROUTE:
            raise ValueError(f"points x spacing is above {LONGEST_ROUTE:g} m (got {self.length:g} m)")
        return self

    @property
    def length(self) -> float:
        """Distance of the last point along the route [m]."""
        return self.points * self.spacing


class GridSettings(Settings):
    """Occupancy grid in the frame of the vehicle.

    length, width  numbers of cells along and across the vehicle
    resolution     edge length of a cell [m]
    behind         distance of the rear edge of the grid behind the reference point [m]
    """

    length: Annotated[int, Field(ge=4, le=1024)] = 64
    width: Annotated[int, Field(ge=4, le=1024)] = 64
    resolution: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    behind: Annotated[float, Field(ge=0.0, le=1e4)] = 16.0


def _part(value: Any) -> Any:
    """Return the settings of a part; True selects the defaults, False omits the part."""
    if value is True:
        return {}
    return None if value is False else value


class ObservationSettings(Settings):
    """Parts of an observation, each a key of a `Dict` space.

    ego         motion of the vehicle, request of the scenario, last control
    route       points on the route ahead
    tracks      fused objects
    own         objects that the own sensors detect
    senders     age of the newest message of each other station
    grid        occupancy grid of fused objects and route
    normalized  whether values are divided by their bounds; else they are in SI units
    flat        whether the observation is one vector: all parts in alphabetical order
    """

    ego: bool = True
    route: Annotated[RouteSettings | None, BeforeValidator(_part)] = RouteSettings()
    tracks: Annotated[TableSettings | None, BeforeValidator(_part)] = TableSettings()
    own: Annotated[TableSettings | None, BeforeValidator(_part)] = None
    senders: bool = False
    grid: Annotated[GridSettings | None, BeforeValidator(_part)] = None
    normalized: bool = True
    flat: bool = False

    @model_validator(mode="after")
    def _has_a_part(self) -> Self:
        if not (self.ego or self.senders or self.route or self.tracks or self.own or self.grid):
            raise ValueError("the observation has no part; select one of ego, route, tracks, own, senders, grid")
        return self


RENDER_MODES = ("rgb_array",)
"""Render modes. `gymnasium.make` derives `rgb_array_list` and `human` from it by wrappers."""
METADATA: dict[str, Any] = {"render_modes": [*RENDER_MODES], "render_fps": 20.0}
"""Metadata of an environment with the default time step, one tick per step."""


class RenderSettings(Settings):
    """Size of pictures.

    width, height  [pixels]
    extent         width of the section that is shown [m]
    """

    width: Annotated[int, Field(ge=64, le=4096)] = 640
    height: Annotated[int, Field(ge=64, le=4096)] = 360
    extent: Annotated[float, Field(ge=1.0, le=1e4)] = 90.0
