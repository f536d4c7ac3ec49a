"""The seam of stand-ins: who drives a scripted actor in place of a controller of another tool."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, SupportsFloat

from eidrive_scenario.errors import Diagnostic, InvalidResult, RegistryError, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.registry import Registry, construct
from eidrive_scenario.storyboard.context.protocols import ControllerContext
from eidrive_scenario.storyboard.kinematics.actor import Actor, is_agent_controller


class ControllerModel(ABC):
    """Plays the longitudinal part of a Controller that names no module of ours, where the caller asks for it.

    It decides while the controller is active in the longitudinal domain; speed actions of that time set the speed that
    it aims at.
    """

    accepts_external_poses: ClassVar[bool] = False
    """True for one that moves the actor to poses from outside (`Simulation.set_pose`)."""

    def __init__(self, controller: model.Controller, context: ControllerContext, actor: Actor) -> None:
        properties = controller.properties.property if controller.properties is not None else ()
        self.properties: Mapping[str, str] = {entry.name: entry.value for entry in properties}
        self.context = context
        self.actor = actor
        self._active = False

    def step(self) -> None:
        """Set the actor's speed for the step that begins now, if it is for the controller to decide."""
        if not self.actor.longitudinal:
            self._active = False
            return
        if not self._active:
            self._active = True
            self.on_activate()
        speed = self.compute_speed()
        if not isinstance(speed, SupportsFloat) or not math.isfinite(speed):
            raise InvalidResult(self, "speed", f"returned {speed!r} (expected a finite number)")
        self.actor.motion.set_speed(speed)

    @abstractmethod
    def on_activate(self) -> None:
        """The controller has just been activated."""

    @abstractmethod
    def compute_speed(self) -> float:
        """The speed of the step that begins now [m/s]."""


def build_controller_models(
    actors: Mapping[str, Actor], context: ControllerContext, wanted: Mapping[str, str], known: Registry
) -> list[ControllerModel]:
    """One per actor whose controller's name is `wanted`; the values name stand-ins.

    Raises SettingError for a stand-in that nobody registers, RegistryError for one that is none.
    """
    found = []
    kinds = {name: known.load(controller_model, ControllerModel) for name, controller_model in wanted.items()}
    for actor in actors.values():
        for controller in actor.controllers:
            if controller.name in kinds:
                made = construct(kinds[controller.name], controller, context, actor)
                if not isinstance(made, ControllerModel):
                    raise RegistryError(f"controllers {wanted[controller.name]!r} is not a subclass of ControllerModel")
                found.append(made)
    return found


def unassigned_controller_warnings(actors: Mapping[str, Actor], wanted: Mapping[str, str]) -> list[Diagnostic]:
    """Warnings of controllers that name no module of ours and for which nothing stands in."""
    names = {controller.name for actor in actors.values() for controller in actor.controllers}
    astray = sorted(name for name in wanted if name not in names)
    hint = "give it the property module=eidrive, or let something stand in for it"
    if astray:
        hint += f"; the stand-in for {', '.join(map(repr, astray))} found no controller of that name"
    alone = [
        Diagnostic(
            f"the controller {controller.name!r} of {actor.name} is not known: {actor.name} keeps lane and speed",
            hint,
            controller.source,
            controller.line,
        )
        for actor in actors.values()
        for controller in actor.controllers
        if not is_agent_controller(controller) and controller.name not in wanted
    ]
    ours = {
        controller.name
        for actor in actors.values()
        for controller in actor.controllers
        if is_agent_controller(controller)
    }
    odd = [
        Diagnostic(f"nothing stands in for {name!r}, which is a controller of ours") for name in wanted if name in ours
    ]
    if not alone:
        known = names - ours
        message = "the stand-in for {!r} found no controller of that name"
        odd += [Diagnostic(message.format(name), suggestion(name, known)) for name in astray]
    return [*odd, *alone]
