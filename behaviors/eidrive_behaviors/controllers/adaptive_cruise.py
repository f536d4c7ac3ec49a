"""Adaptive cruise control: a set speed, and a time gap to the lead vehicle."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TypeVar

from eidrive_scenario.api.actions import (
    Actor,
    ControllerContext,
    ControllerModel,
    distance,
    entity_box,
    facing,
    model,
    property_entries,
    same_way,
)
from eidrive_scenario.api.common import Diagnostic, ScenarioError, suggestion

Default = TypeVar("Default", float, float | None)

_FLAGS: Mapping[str, bool] = {"true": True, "1": True, "false": False, "0": False}
"""Truth values of the type boolean of the schema, without case."""


def number(controller: model.Controller, name: str, default: Default, *, least: float = -math.inf) -> float | Default:
    """Return a property as a finite number of at least `least`; `default` if the controller does not have it.

    Raise ScenarioError for another text.
    """
    declared = _last_property(controller, name)
    if declared is None:
        return default
    try:
        value = float(declared.value)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and value >= least:
        return value
    expected = "a finite number" if least == -math.inf else f"a number of at least {least:g}"
    raise _invalid(controller, declared, f"expected {expected}")


def flag(controller: model.Controller, name: str, default: bool) -> bool:
    """Return a property as a truth value; `default` if the controller does not have it.

    Raise ScenarioError for another text.
    """
    declared = _last_property(controller, name)
    if declared is None:
        return default
    value = _FLAGS.get(declared.value.strip().lower())
    if value is None:
        raise _invalid(controller, declared, "expected true or false")
    return value


def choice(controller: model.Controller, name: str, choices: Collection[str], default: str) -> str:
    """Return a property that is one of `choices`; `default` if the controller does not have it.

    Raise ScenarioError for another text.
    """
    declared = _last_property(controller, name)
    if declared is None:
        return default
    if declared.value not in choices:
        raise _invalid(controller, declared, suggestion(declared.value, choices))
    return declared.value


def _last_property(controller: model.Controller, name: str) -> model.Property | None:
    """Return the last property of this name; None without one."""
    return next((declared for declared in reversed(property_entries(controller)) if declared.name == name), None)


def _invalid(controller: model.Controller, declared: model.Property, expected: str) -> ScenarioError:
    message = f"controller {controller.name!r}: invalid property {declared.name} (got {declared.value!r}; {expected})"
    return ScenarioError(Diagnostic.at(declared, message))


CLOSEST = 3.0
"""Gap to a standing vehicle [m]."""
STOP = 1.0
"""Gap below which the vehicle stops at once [m]."""
LOOKOUT = 50.0
"""Minimum range [m]."""
ACCELERATION_SHARE = 0.7
"""Share of the vehicle's maximum acceleration that is used on a free road."""
GAIN = 2.5
"""Acceleration at a large gap [m/s²]."""
SPEED_CHANGE = 1e-3
"""Speed difference above which another action has set the speed [m/s]."""


class AdaptiveCruise(ControllerModel):
    """Control of the set speed on a free road, and of 3 m plus a time gap behind the lead vehicle.

    The law is that of esmini's ACC and ALKS controllers, so that scenarios for them can be run. With the gap g, the
    speed v_lead of the lead, negative if it is oncoming, the wanted gap w = 3 m + `timeGap` · max(v, v_lead) and
    f = min(1, g / w - 1) the acceleration is 2.5 f - f (v - v_set) - (1 - f) (v - min(v_set, v_lead)), within the
    vehicle's Performance and up to the set speed. The set speed is the speed at activation, or that of SpeedActions.
    With the property `mode=override` it is `setSpeed` [m/s], and SpeedActions have no effect. Further properties:
    `timeGap` [s, 1.5], `lateralDist` [m, 5].
    """

    def __init__(self, controller: model.Controller, context: ControllerContext, actor: Actor) -> None:
        super().__init__(controller, context, actor)
        self.time_gap = number(controller, "timeGap", 1.5, least=0.0)
        self.lateral_range = number(controller, "lateralDist", 5.0, least=0.0)
        self._ignores_speed_actions = self.properties.get("mode") == "override"
        self._set_speed_property = number(controller, "setSpeed", None)

    def on_activate(self) -> None:
        """Start from the current speed."""
        self._last = self.actor.motion.speed
        self._set = self._last
        if self._set_speed_property is not None and self._ignores_speed_actions:
            self._set = self._set_speed_property

    def compute_speed(self) -> float:
        """Return the speed by the control law [m/s]."""
        now = self.actor.motion.speed
        if not self._ignores_speed_actions and abs(now - self._last) > SPEED_CHANGE:
            self._set = self._last = now
        ahead = self._find_lead()
        self._last = self._free_road_speed() if ahead is None else self._following_speed(*ahead)
        return self._last

    def _free_road_speed(self) -> float:
        _, faster, slower = self.actor.limits()
        now, dt = self._last, self.context.dt
        acceleration = min(max((self._set - now) * ACCELERATION_SHARE * faster, -slower), ACCELERATION_SHARE * faster)
        then = now + acceleration * dt
        return self._set if abs(then - self._set) > abs(now - self._set) else then

    def _following_speed(self, gap: float, lead: float) -> float:
        if gap < STOP:
            return 0.0
        _, faster, slower = self.actor.limits()
        now = self._last
        wanted = CLOSEST + self.time_gap * abs(max(now, lead))
        open_by = min(1.0, gap / wanted - 1.0)
        acceleration = GAIN * open_by - open_by * (now - self._set) - (1.0 - open_by) * (now - min(self._set, lead))
        then = now + min(max(acceleration, -slower), faster) * self.context.dt
        return max(0.0, min(then, max(now, self._set)))

    def _find_lead(self) -> tuple[float, float] | None:
        """Return gap [m] and speed [m/s] of the nearest vehicle in the path; None if there is none."""
        leads = [
            (gap, self._speed_of(name))
            for name, other in self.context.actors.items()
            if other is not self.actor and other.present and (gap := self._gap(name)) is not None
        ]
        return min(leads, default=None)

    def _speed_of(self, name: str) -> float:
        """Return the speed of a vehicle [m/s], negative for an oncoming one."""
        return same_way(self.context, self.actor.name, name, "lane") * self.context.speed(name)

    def _gap(self, name: str) -> float | None:
        context, me = self.context, self.actor.name
        here, there, roads = context.location(me), context.location(name), context.roads
        if roads is not None and here is not None and there is not None:
            along, across = roads.distance(here, there) or (0.0, 0.0)
            ahead = along * facing(context, me, here)
            slower = self.actor.limits()[2]
            reach = max(LOOKOUT, 2.0 * CLOSEST + self._last**2 / slower) if slower > 0.0 else math.inf
            if 0.0 < ahead < reach and abs(across) < self.lateral_range:
                same = (
                    roads.lanes_between(here, there) == 0
                    if here.road == there.road
                    else self._is_beside_lane(across) is False
                )
                gap = ahead - self._overhang(name)
                if same and gap > 0.0:
                    return gap
        return self._bumper_gap(name)

    def _is_beside_lane(self, across: float) -> bool:
        """Return True if a lateral distance [m] exceeds half the lane width."""
        here, roads = self.context.location(self.actor.name), self.context.roads
        return here is None or roads is None or abs(across) > 0.5 * roads.lane_width(here.road, here.lane, here.s)

    def _bumper_gap(self, name: str) -> float | None:
        """Return the gap to a vehicle just ahead of the bumper in any lane [m].

        The lateral tolerance is larger to the right than to the left.
        """
        me = self.actor.name
        along, lateral = (
            distance(self.context, me, name, frame="entity", kind=kind, freespace=True)
            for kind in ("longitudinal", "lateral")
        )
        faster_by = max(0.0, self._last - self._speed_of(name))
        length = entity_box(self.context, name)[3]
        return along if 0.0 < along < 1.0 + length + 0.5 * faster_by and -0.5 < lateral < 0.2 else None

    def _overhang(self, name: str) -> float:
        """Return the distance between the reference points minus the gap between the boxes [m]."""
        mine, theirs = self.actor.entity.bounding_box, self.context.actors[name].entity.bounding_box
        way = same_way(self.context, self.actor.name, name, "road")
        rear = 0.5 * theirs.dimensions.length - way * theirs.center.x
        return 0.5 * mine.dimensions.length + mine.center.x + rear
