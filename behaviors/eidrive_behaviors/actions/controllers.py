"""Actions on controllers: assign, activate, and hold pedals and wheel against their will."""

from __future__ import annotations

import math

import numpy as np
from py_trees.common import Status

from eidrive_scenario.api.actions import (
    ActionBehaviour,
    Actor,
    Goal,
    Override,
    RuntimeContext,
    is_agent_controller,
    model,
)
from eidrive_scenario.api.common import Pose, Route

POINTS_APART = 2.0
"""Of a route that a controller takes over [m]."""
GEARS = {"n": 0.0, "p": 0.0, "r": -1.0, "d": 1.0}


class ActivateControllerAction(ActionBehaviour):
    """Turns the actor's controller on or off per domain; a domain that is left out stays as it is.

    An eidrive controller drives where both domains are on. Where it lets go, the actor keeps lane and speed; where it
    takes over, it goes on from there. Controllers of other tools leave the actor to the scripted motion: to activate
    one by its name takes the domain from ours, to deactivate it changes nothing.
    """

    action: model.ActivateControllerAction

    def update(self) -> Status:
        """Switch."""
        lateral, longitudinal = self.action.lateral, self.action.longitudinal
        if self._means_another() and any(is_agent_controller(controller) for controller in self.actor.controllers):
            lateral, longitudinal = _left_to_ours(lateral, longitudinal)
        switch(self, lateral, longitudinal)
        return Status.SUCCESS

    def _means_another(self) -> bool:
        """Whether the action names a controller of the actor that is none of ours."""
        name = self.action.object_controller_ref or self.action.controller_ref
        if name is None:
            return False
        entities = self.context.scenario.document.entities
        objects = entities.scenario_object if entities is not None else ()
        held = next((one.object_controller for one in objects if one.name == self.actor.name), ())
        named = {one.name: controller for one, controller in zip(held, self.actor.controllers, strict=False)}
        named |= {controller.name: controller for controller in self.actor.controllers}
        return name in named and not is_agent_controller(named[name])

    def describe(self) -> str:
        """Which domains."""
        words = {True: "on", False: "off"}
        domains = (("lateral", self.action.lateral), ("longitudinal", self.action.longitudinal))
        named = [f"{name} {words[value]}" for name, value in domains if value is not None]
        return f"controller {', '.join(named) or 'unchanged'}"


class AssignControllerAction(ActionBehaviour):
    """Gives the actor a controller of another tool, which here means the scripted motion.

    Raises ScenarioError for one of our own: a station is built before the run, from the entity's ObjectController.
    """

    action: model.AssignControllerAction

    def __init__(
        self,
        action: model.AssignControllerAction,
        context: RuntimeContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, context, actor=actor, parent=parent)
        self._controller = self._found()
        if self._controller is not None and is_agent_controller(self._controller):
            raise self.error(
                "assigns an eidrive controller during the run",
                "give it to the entity in ObjectController, and switch it by ActivateControllerAction",
            )

    def update(self) -> Status:
        """Assign it; domains in which it is activated are no longer those of a controller of ours."""
        if self._controller is not None and self._controller not in self.actor.controllers:
            self.actor.assign(self._controller)
        switch(self, *_left_to_ours(self.action.activate_lateral, self.action.activate_longitudinal))
        return Status.SUCCESS

    def _found(self) -> model.Controller | None:
        holder = self.action if self.action.object_controller is None else self.action.object_controller
        if holder.controller is not None:
            return holder.controller
        if holder.catalog_reference is not None:
            return self.context.catalog_entry(holder.catalog_reference, model.Controller, self.action)
        return None

    def describe(self) -> str:
        """Which one."""
        return f"assign controller {self._controller.name if self._controller is not None else 'none'}"


class OverrideControllerValueAction(ActionBehaviour):
    """Holds pedals, steering wheel or gear at a value, or gives them back. It counts for who drives itself."""

    action: model.OverrideControllerValueAction

    def update(self) -> Status:
        """Hold or give back."""
        held = self.context.overrides.setdefault(self.actor.name, {})
        for override in self._overrides():
            if override.active:
                held[override.control] = override
            else:
                held.pop(override.control, None)
        return Status.SUCCESS

    def _overrides(self) -> list[Override]:
        action, found = self.action, []
        simple = (("throttle", action.throttle), ("clutch", action.clutch), ("steeringWheel", action.steering_wheel))
        for control, entry in simple:
            if entry is not None:
                found.append(Override(control, entry.value, entry.active, max_rate=entry.max_rate))
        for control, brake in (("brake", action.brake), ("parkingBrake", action.parking_brake)):
            if brake is not None:
                share = brake.brake_percent or brake.brake_force
                found.append(
                    Override(
                        control,
                        share.value if share is not None else brake.value or 0.0,
                        brake.active,
                        max_rate=share.max_rate if share is not None else None,
                        newton=brake.brake_force is not None,
                    )
                )
        if action.gear is not None:
            found.append(self._gear(action.gear))
        return found

    @staticmethod
    def _gear(gear: model.OverrideGearAction) -> Override:
        if gear.manual_gear is not None:
            return Override("gear", float(gear.manual_gear.number), gear.active)
        if gear.automatic_gear is not None:
            position = gear.automatic_gear.gear.value
            return Override("gear", GEARS[position], gear.active, parked=position == "p")
        return Override("gear", gear.number or 0.0, gear.active)

    def describe(self) -> str:
        """Which controls."""
        words = [f"{o.control} {o.value:g}" if o.active else f"{o.control} free" for o in self._overrides()]
        return f"override {', '.join(words)}"


def switch(behaviour: ActionBehaviour, lateral: bool | None, longitudinal: bool | None) -> None:
    """Turn the domains of an actor's own controller on or off; None leaves one as it is."""
    actor = behaviour.actor
    before = actor.driven
    if lateral is not None:
        actor.lateral = lateral
    if longitudinal is not None:
        actor.longitudinal = longitudinal
    if before is not actor.driven and actor.present:
        _join_lap(actor)
    if before and not actor.driven and actor.present:
        actor.motion.snap_to_lane()
    if actor.driven and not before and actor.present:
        onward = actor.motion.route.onward if actor.motion.route is not None else None
        lap = None if onward is None else onward.polyline(POINTS_APART)
        rest = _rest_of_route(actor)
        actor.goal = Goal(speed=actor.motion.speed, path=lap if rest is None else rest, lap=lap)


def _left_to_ours(lateral: bool | None, longitudinal: bool | None) -> tuple[bool | None, bool | None]:
    """What the switching of another tool's controller means for ours: what that one takes, ours lose."""
    return False if lateral else None, False if longitudinal else None


def _join_lap(actor: Actor) -> None:
    """Who changes hands on the lap of its route has left the way there behind."""
    route, pose = actor.motion.route, actor.motion.pose
    if route is not None and route.lap is not None and _gap(route.lap, pose) <= _gap(route, pose):
        actor.motion.route = route.lap


def _gap(route: Route, pose: Pose) -> float:
    done, _ = route.project(pose.x, pose.y)
    x, y, _ = route.points_at(np.array([done]))[0].tolist()
    return math.hypot(x - pose.x, y - pose.y)


def _rest_of_route(actor: Actor) -> np.ndarray[tuple[int, int], np.dtype[np.float64]] | None:
    """The points (M, 3) of the actor's route from where it is [m]; None without one, or at its end."""
    route, pose = actor.motion.route, actor.motion.pose
    if route is None:
        return None
    done, _ = route.project(pose.x, pose.y)
    count = math.ceil((route.length - done) / POINTS_APART) + 1
    return np.asarray(route.points_at(np.linspace(done, route.length, count))) if count > 2 else None
