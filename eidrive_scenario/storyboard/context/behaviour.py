"""Interface of actions: an ActionBehaviour executes one action of the standard for one actor."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import msgspec
import numpy as np
import py_trees
from py_trees.common import Status

from eidrive_scenario.errors import Diagnostic, InvalidResult, ScenarioError
from eidrive_scenario.extensions.registry import is_built_in
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.context.contexts import (
    ActionContext,
    EntityAbsentError,
    EntityTowedError,
    EntityUnavailableError,
)
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.trailers import towing_vehicle
from eidrive_scenario.storyboard.state.element_states import MOTION, Domain


class ActionBehaviour(py_trees.behaviour.Behaviour):
    """Base class of actions, for one actor (none for global actions).

    - `configure` prepares the action once. It raises ScenarioError if the action is not executable.
    - `initialise` resets the action when it starts.
    - `update` decides on one step of `context.dt` [s]. It returns SUCCESS in the step that reaches the goal: the action
      ends at the end of that step. In Init the step is 0 s long.
    """

    third_party: ClassVar[bool] = False
    """Whether it is a third-party action, whose results are checked."""
    domains: ClassVar[Domain] = Domain.NONE
    immediate: ClassVar[bool] = False
    """True for an action that sets a value and moves nothing: it is executed when it starts, and it ends at the instant
    at which `update` returns SUCCESS."""

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        cls.third_party = not is_built_in(cls)

    def __init__(
        self,
        action: model.Element,
        context: ActionContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(type(action).__name__ if actor is None else f"{type(action).__name__} {actor}")
        self.action = action
        self.context = context
        self.actor_name = actor
        self.parent_element = parent
        """Parent element of the action, which has attributes of older or shared types (EntityAction)."""
        self.configure()

    def configure(self) -> None:
        """Prepare the action before the run, as the last step of the constructor."""

    @property
    def error_subject(self) -> str:
        """Actor, and location of the element, which errors of the action name."""
        where = f"{self.action.source}:{self.action.line}"
        return where if self.actor_name is None else f"actor {self.actor_name!r}, {where}"

    @property
    def controls(self) -> Domain:
        """Domains that this action controls as it is configured."""
        return self.domains

    @property
    def at_once(self) -> bool:
        """Whether it ends at its start, and thus does not conflict with an action that takes time."""
        return False

    @property
    def moves_over_time(self) -> bool:
        """Whether it moves the actor sideways or beyond its start. In Init it starts from the state that others set."""
        return bool(self.controls & (Domain.LATERAL if self.at_once else MOTION))

    @property
    def speed_reference(self) -> str | None:
        """Other entity whose speed it reads at its start; None without one."""
        return None

    @property
    def is_actor_missing(self) -> bool:
        """Whether it moves an actor that is absent."""
        return bool(self.controls & MOTION) and self.actor_name is not None and not self.actor.present

    def check_actor(self) -> None:
        """Raise EntityUnavailableError if it moves an actor that is absent or towed."""
        if self.actor_name is not None and self.controls & MOTION:
            if self.is_actor_missing:
                raise EntityAbsentError(self.actor_name)
            self.check_not_towed()

    def check_not_towed(self) -> None:
        """Raise EntityTowedError if a towing vehicle moves the actor during the run."""
        if self.context.dt > 0.0 and towing_vehicle(self.context.actors, self.actor.name) is not None:
            raise EntityTowedError(self.actor.name)

    @property
    def resources(self) -> tuple[str, ...]:
        """Parts of a domain that it controls, such as names of lights; an empty name for the whole domain."""
        return ("",)

    @property
    def actor(self) -> Actor:
        """Actor of the action. Raise ScenarioError without one."""
        if self.actor_name is None:
            raise self.error("has no actor", "add it to a ManeuverGroup with Actors")
        return self.context.actors[self.actor_name]

    def finish_init(self) -> None:
        """Finish the start in Init after all actions of Init have started: positions and speeds are known."""

    @abstractmethod
    def update(self) -> Status:
        """Decide on the current step."""

    def tick_checked(self) -> None:
        """Tick once. Raise InvalidResult for an invalid decision."""
        if self.status is Status.RUNNING and not self.third_party:
            # A running action is updated without py_trees' generator, as this happens in every step.
            status: object = self.update()
            if status is Status.RUNNING:
                return
            new = status if isinstance(status, Status) else Status.INVALID
            self.stop(new)
            self.status = new
        else:
            self.tick_once()
            if self.status is Status.SUCCESS and self.controls & Domain.LATERAL and self.at_once:
                self.actor.motion.apply_lateral_step()
                self.actor.invalidate_location()
        if self.third_party or self.status is Status.INVALID:
            self.check_decision()

    def describe(self) -> str:
        """Describe the action."""
        return type(self.action).__name__

    def abort(self, unavailable: EntityUnavailableError) -> str:
        """Stop the action, as an entity that it requires is absent or towed. Add a warning and return the reason."""
        self.stop(Status.INVALID)
        self.warn(f"not executed, as {unavailable}", unavailable.hint)
        return str(unavailable)

    def check_decision(self) -> None:
        """Raise InvalidResult if `update` returned no status, or set values of its actor that are not finite."""
        if self.status is Status.INVALID:
            raise InvalidResult(self, "update", "returned no Status (expected RUNNING, SUCCESS or FAILURE)")
        names = self.context.actors if self.actor_name is None else (self.actor_name,)
        for actor in [self.context.actors[name] for name in names if name in self.context.actors]:
            values: dict[str, object] = {"motion.pose": actor.motion.pose, "motion.speed": actor.motion.speed}
            if actor.goal is not None:
                requested = msgspec.structs.asdict(actor.goal)
                values |= {f"goal.{name}": value for name, value in requested.items() if value is not None}
            for name, value in values.items():
                if not _is_finite(value):
                    text = f"left actor {actor.name!r} with {name} = {value!r} (expected finite numbers)"
                    raise InvalidResult(self, "update", text)

    def require_roads(self) -> RoadNetwork:
        """Return the road network. Raise ScenarioError if the scenario has none."""
        if self.context.roads is None:
            raise self.error("the scenario has no road network", "specify one in RoadNetwork/LogicFile")
        return self.context.roads

    def warn(self, message: str, hint: str = "") -> None:
        """Add a warning with file and line of this action to the result of the run."""
        self.context.warn(*self.error(message, hint).diagnostics)

    def error(self, message: str, hint: str = "") -> ScenarioError:
        """Return an error with file and line of this action."""
        return ScenarioError(Diagnostic.at(self.action, f"{type(self.action).__name__}: {message}", hint))


def _is_finite(value: object) -> bool:
    try:
        return bool(np.isfinite(np.asarray(value, dtype=float)).all())
    except (TypeError, ValueError):
        return False
