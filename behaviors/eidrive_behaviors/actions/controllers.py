"""Actions on controllers: assignment, activation, and override of pedals, steering wheel and gear."""

from __future__ import annotations

import math

import numpy as np
from py_trees.common import Status

from eidrive_behaviors.actions.routing import POINTS_APART
from eidrive_scenario.api.actions import (
    ActionBehaviour,
    Actor,
    Goal,
    Override,
    is_agent_controller,
    model,
)
from eidrive_scenario.api.common import Pose, Route

GEARS = {"n": 0.0, "p": 0.0, "r": -1.0, "d": 1.0}


class ActivateControllerAction(ActionBehaviour):
    """Activation of the actor's controller per domain. A domain that is omitted keeps its state.

    An eidrive controller drives while both domains are active. On deactivation the actor keeps lane and speed. On
    activation the controller continues from the current state. A controller of another tool leaves the actor to the
    scripted motion: its activation by name deactivates the domain of the eidrive controller, its deactivation has no
    effect.
    """

    action: model.ActivateControllerAction

    def update(self) -> Status:
        """Switch the domains, unless the settings of the run determine the controller."""
        if self.actor.keeps_controller:
            return _without_effect(self)
        lateral, longitudinal = self.action.lateral, self.action.longitudinal
        if self._names_other_controller() and any(
            is_agent_controller(controller) for controller in self.actor.controllers
        ):
            lateral, longitudinal = _yielded_domains(lateral, longitudinal)
        switch(self, lateral, longitudinal)
        return Status.SUCCESS

    def _names_other_controller(self) -> bool:
        """True if the action names a controller of the actor that belongs to another tool."""
        name = self.action.object_controller_ref or self.action.controller_ref
        if name is None:
            return False
        entities = self.context.scenario.document.entities
        objects = entities.scenario_object if entities is not None else ()
        held = next((declared.object_controller for declared in objects if declared.name == self.actor.name), ())
        named = {declared.name: controller for declared, controller in zip(held, self.actor.controllers, strict=False)}
        named |= {controller.name: controller for controller in self.actor.controllers}
        return name in named and not is_agent_controller(named[name])

    def describe(self) -> str:
        """Describe the domains and their states."""
        words = {True: "on", False: "off"}
        domains = (("lateral", self.action.lateral), ("longitudinal", self.action.longitudinal))
        named = [f"{name} {words[value]}" for name, value in domains if value is not None]
        return f"controller {', '.join(named) or 'unchanged'}"


class AssignControllerAction(ActionBehaviour):
    """Assignment of a controller of another tool, which has the effect of the scripted motion.

    Raise ScenarioError for an eidrive controller: a station is built before the run, from the ObjectController of the
    entity.
    """

    action: model.AssignControllerAction

    def configure(self) -> None:
        """Resolve the controller."""
        self._controller = self._resolve_controller()
        if self._controller is not None and is_agent_controller(self._controller):
            raise self.error(
                "an eidrive controller cannot be assigned during the run",
                "assign it in the entity's ObjectController and switch it by ActivateControllerAction",
            )

    def update(self) -> Status:
        """Assign the controller. Its activation in a domain deactivates the eidrive controller there."""
        if self.actor.keeps_controller:
            return _without_effect(self)
        if self._controller is not None and self._controller not in self.actor.controllers:
            self.actor.assign(self._controller)
        switch(self, *_yielded_domains(self.action.activate_lateral, self.action.activate_longitudinal))
        return Status.SUCCESS

    def _resolve_controller(self) -> model.Controller | None:
        holder = self.action.object_controller or self.action
        if holder.controller is None and holder.catalog_reference is not None:
            return self.context.catalog_entry(holder.catalog_reference, model.Controller, self.action)
        return holder.controller

    def describe(self) -> str:
        """Describe the controller."""
        return f"assign controller {self._controller.name if self._controller is not None else 'none'}"


class OverrideControllerValueAction(ActionBehaviour):
    """Override of pedals, steering wheel or gear at a value, and its end. It applies to vehicles with an active
    controller.

    The unit of a BrakePercent is % (1.3.1, Brake). A value up to 1 is a share of the full brake, as in esmini, which is
    a warning.
    """

    action: model.OverrideControllerValueAction

    def update(self) -> Status:
        """Set or release the overrides."""
        for brake in (self.action.brake, self.action.parking_brake):
            percent = None if brake is None else brake.brake_percent
            if percent is not None and percent.value > 0.0 and _full_brake(percent) == 1.0:
                share = f"{100.0 * percent.value:g}"
                what = f"BrakePercent {percent.value:g} is read as {share} %"
                self.warn(what, f"write {share}, as its unit is %")
        for override in self._overrides():
            self.context.set_override(self.actor.name, override)
        return Status.SUCCESS

    def _overrides(self) -> list[Override]:
        action, overrides = self.action, []
        simple = (("throttle", action.throttle), ("clutch", action.clutch), ("steeringWheel", action.steering_wheel))
        for control, entry in simple:
            if entry is not None:
                overrides.append(Override(control, entry.value, entry.active, max_rate=entry.max_rate))
        for control, brake in (("brake", action.brake), ("parkingBrake", action.parking_brake)):
            if brake is not None:
                overrides.append(self._brake(control, brake))
        if action.gear is not None:
            overrides.append(self._gear(action.gear))
        return overrides

    @staticmethod
    def _brake(control: str, brake: model.OverrideBrakeAction | model.OverrideParkingBrakeAction) -> Override:
        force = brake.brake_force
        if force is not None:
            return Override(control, force.value, brake.active, max_rate=force.max_rate, newton=True)
        percent = brake.brake_percent
        if percent is None:
            return Override(control, brake.value or 0.0, brake.active)
        full, rate = _full_brake(percent), percent.max_rate
        return Override(control, percent.value / full, brake.active, max_rate=None if rate is None else rate / full)

    @staticmethod
    def _gear(gear: model.OverrideGearAction) -> Override:
        if gear.manual_gear is not None:
            return Override("gear", float(gear.manual_gear.number), gear.active)
        if gear.automatic_gear is not None:
            position = gear.automatic_gear.gear.value
            return Override("gear", GEARS[position], gear.active, parked=position == "p")
        return Override("gear", gear.number or 0.0, gear.active)

    def describe(self) -> str:
        """Describe the controls and their values."""
        words = [f"{o.control} {o.value:g}" if o.active else f"{o.control} free" for o in self._overrides()]
        return f"override {', '.join(words)}"


def _full_brake(percent: model.Brake) -> float:
    """Return the value of the full brake in the unit of a BrakePercent, its rate if the value is 0: 100, or 1."""
    return 100.0 if (percent.value or percent.max_rate or 0.0) > 1.0 else 1.0


def _without_effect(behaviour: ActionBehaviour) -> Status:
    """Warn that the settings of the run determine the controller of the actor."""
    what = f"no effect: the driving stack of the run drives {behaviour.actor.name!r} from its start to its end"
    behaviour.warn(what, "remove --drive for it, if the scenario shall drive it")
    return Status.SUCCESS


def switch(behaviour: ActionBehaviour, lateral: bool | None, longitudinal: bool | None) -> None:
    """Switch the domains of an actor's eidrive controller on or off; None keeps the state of a domain."""
    if lateral or longitudinal:
        behaviour.check_not_towed()
    actor = behaviour.actor
    before = actor.driven
    actor.activate_controller(lateral, longitudinal)
    if before is not actor.driven and actor.present:
        _join_lap(actor)
    if before and not actor.driven and actor.present:
        actor.motion.snap_to_lane()
    if actor.driven and not before and actor.present:
        onward = actor.motion.route.onward if actor.motion.route is not None else None
        lap = None if onward is None else onward.polyline(POINTS_APART)
        rest = _rest_of_route(actor)
        path = lap if rest is None else rest
        actor.set_goal(Goal(speed=actor.motion.speed, path=path, lap=lap, is_route=True))


def _yielded_domains(lateral: bool | None, longitudinal: bool | None) -> tuple[bool | None, bool | None]:
    """Return the new domain states of the eidrive controller after another tool's controller was switched.

    Domains that the other controller acquires are deactivated; all others keep their state.
    """
    return False if lateral else None, False if longitudinal else None


def _join_lap(actor: Actor) -> None:
    """Drop the approach to a closed route if the actor is already on its lap as the control changes."""
    route, pose = actor.motion.route, actor.motion.pose
    if route is not None and route.lap is not None and _gap(route.lap, pose) <= _gap(route, pose):
        actor.motion.set_route(route.lap)


def _gap(route: Route, pose: Pose) -> float:
    done, _ = route.project(pose.x, pose.y)
    x, y, _ = route.points_at(np.array([done]))[0].tolist()
    return math.hypot(x - pose.x, y - pose.y)


def _rest_of_route(actor: Actor) -> np.ndarray[tuple[int, int], np.dtype[np.float64]] | None:
    """Return the points (M, 3) of the remaining route [m]; None without a route, or at its end."""
    route, pose = actor.motion.route, actor.motion.pose
    if route is None:
        return None
    done, _ = route.project(pose.x, pose.y)
    count = math.ceil((route.length - done) / POINTS_APART) + 1
    return np.asarray(route.points_at(np.linspace(done, route.length, count))) if count > 2 else None
