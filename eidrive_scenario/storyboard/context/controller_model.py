"""Interface of controller models, which replace controllers of other tools."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, SupportsFloat

from eidrive_scenario.errors import Diagnostic, InvalidResult, RegistryError, suggestion
from eidrive_scenario.extensions.registry import Registry, construct
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.storyboard.context.contexts import ControllerContext
from eidrive_scenario.storyboard.kinematics.actor import Actor


class ControllerModel(ABC):
    """Longitudinal model of a Controller without the property `module=eidrive`, assigned by the caller.

    It sets the speed of its actor while the controller is active in the longitudinal domain. Speed actions of that time
    set its desired speed.
    """

    accepts_external_poses: ClassVar[bool] = False
    """Whether it moves the actor to poses from outside (`Simulation.set_pose`)."""

    def __init__(self, controller: model.Controller, context: ControllerContext, actor: Actor) -> None:
        self.properties: Mapping[str, str] = {entry.name: entry.value for entry in property_entries(controller)}
        self.context = context
        self.actor = actor
        self._active = False

    @property
    def error_subject(self) -> str:
        """Actor that errors of the model name."""
        return f"actor {self.actor.name!r}"

    def step(self) -> None:
        """Set the speed of the actor in the current step, if the controller is active."""
        if not self.actor.longitudinal:
            self._active = False
            return
        if not self._active:
            self._active = True
            self.on_activate()
        speed = self.compute_speed()
        if not isinstance(speed, SupportsFloat) or not math.isfinite(speed):
            raise InvalidResult(self, "compute_speed", f"returned {speed!r} (expected a finite number)")
        self.actor.motion.set_speed(speed)

    @abstractmethod
    def on_activate(self) -> None:
        """Prepare the model when the controller is activated."""

    @abstractmethod
    def compute_speed(self) -> float:
        """Return the speed in the current step [m/s]."""


def build_controller_models(
    actors: Mapping[str, Actor], context: ControllerContext, assignments: Mapping[str, str], registry: Registry
) -> list[ControllerModel]:
    """Build one model per actor whose controller is a key of `assignments`; the values are registered names.

    Raise SettingError if a model is not registered, RegistryError if it is not a ControllerModel.
    """
    built = []
    models = {name: registry.load(controller_model, ControllerModel) for name, controller_model in assignments.items()}
    for actor in actors.values():
        for controller in actor.controllers:
            if controller.name in models:
                instance = construct(models[controller.name], controller, context, actor)
                if not isinstance(instance, ControllerModel):
                    described = registry.describe(assignments[controller.name])
                    raise RegistryError(f"{described} is not a subclass of ControllerModel")
                built.append(instance)
    return built


def unassigned_controller_warnings(actors: Mapping[str, Actor], assignments: Mapping[str, str]) -> list[Diagnostic]:
    """Return warnings of controllers of other tools without a model, and of assignments without effect."""
    assigned = [(actor, controller) for actor in actors.values() for controller in actor.controllers]
    names = {controller.name for _, controller in assigned}
    ours = {controller.name for _, controller in assigned if is_agent_controller(controller)}
    unmatched = sorted(name for name in assignments if name not in names)
    hint = "add the property module=eidrive, or assign a controller model (RunSettings.controllers NAME=MODEL)"
    if unmatched:
        hint += f"; no controller is named {' or '.join(map(repr, unmatched))}"
    unassigned = [
        Diagnostic.at(
            controller,
            f"actor {actor.name!r} keeps lane and speed: its controller {controller.name!r} is not executed",
            hint,
        )
        for actor, controller in assigned
        if not is_agent_controller(controller) and controller.name not in assignments
    ]
    diagnostics = [
        Diagnostic(
            f"RunSettings.controllers: controller {name!r} belongs to a station",
            "got a controller with module=eidrive; expected a controller of another tool",
        )
        for name in assignments
        if name in ours
    ]
    if not unassigned:
        assignable = names - ours
        message = "RunSettings.controllers: no controller is named {!r}"
        diagnostics += [Diagnostic(message.format(name), suggestion(name, assignable)) for name in unmatched]
    return [*diagnostics, *unassigned]
