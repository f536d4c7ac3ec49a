"""The seam of actions: an ActionBehaviour does one action of the standard for one actor."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np
import py_trees
from py_trees.common import Status

from eidrive_scenario.errors import Diagnostic, InvalidResult, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.registry import is_built_in
from eidrive_scenario.storyboard.context.protocols import ActionContext, EntityAbsentError
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.state.domains import Domain

MOTION = Domain.LONGITUDINAL | Domain.LATERAL


class ActionBehaviour(py_trees.behaviour.Behaviour):
    """One action for one actor (none for global actions).

    Configured in the constructor, which raises ScenarioError for what cannot be done; reset in `initialise`, which
    runs when the action starts; one decision for the step of `context.dt` seconds in `update`, which answers SUCCESS in
    the step that brings the action to its goal: it ends at the end of that step. In Init the step is 0 s long.
    """

    third_party: ClassVar[bool] = False
    """Whether it is no part of this project: what it decides is then checked."""
    domains: ClassVar[Domain] = Domain.NONE
    immediate: ClassVar[bool] = False
    """True for an action that moves nothing, as it sets a value: it acts as soon as it starts, and it ends at the
    instant at which `update` answers SUCCESS."""

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
        """The element around the action, where attributes of older or shared types stand (EntityAction)."""

    @property
    def controls(self) -> Domain:
        """The domains of this action as it is configured."""
        return self.domains

    @property
    def at_once(self) -> bool:
        """Whether it is over as soon as it has started, so that it may stand beside an action that lasts."""
        return False

    @property
    def is_actor_missing(self) -> bool:
        """Whether it would move an actor that is not in the world."""
        return bool(self.controls & MOTION) and self.actor_name is not None and not self.actor.present

    @property
    def resource(self) -> str:
        """What of a domain it controls, where not all of it: the name of a light. Others do not get in its way."""
        return ""

    @property
    def actor(self) -> Actor:
        """The actor that the action is about."""
        if self.actor_name is None:
            raise self.error("has no actor", "put it into a ManeuverGroup with Actors")
        return self.context.actors[self.actor_name]

    def settle(self) -> None:
        """Finish the start in Init, once all its actions have started: places and speeds are known."""

    @abstractmethod
    def update(self) -> Status:
        """Decide on the step that begins now."""

    def tick_once(self) -> None:
        """Tick as py_trees does; while the action runs, without a generator, as that happens in every step of a run."""
        if self.status is not Status.RUNNING or self.third_party:
            super().tick_once()
            return
        status: object = self.update()
        new = status if isinstance(status, Status) else Status.INVALID
        if new is not Status.RUNNING:
            self.stop(new)
        self.status = new

    def describe(self) -> str:
        """The action in words."""
        return type(self.action).__name__

    def abort(self, who: EntityAbsentError) -> str:
        """Stop, as somebody whom the action is about is not in the world; why, in words. The run warns of it."""
        self.stop(Status.INVALID)
        why = f"{who} is not in the world"
        self.context.warn(*self.error(f"is not performed: {why}", "let it wait for the entity").diagnostics)
        return why

    def check_decision(self) -> None:
        """Raise InvalidResult if `update` returned no status, or left its actor with numbers that are not finite."""
        if self.status is Status.INVALID:
            raise InvalidResult(self, "update", "returned no Status (expected RUNNING, SUCCESS or FAILURE)")
        names = self.context.actors if self.actor_name is None else (self.actor_name,)
        for actor in [self.context.actors[name] for name in names if name in self.context.actors]:
            left: dict[str, object] = {"motion.pose": actor.motion.pose, "motion.speed": actor.motion.speed}
            if actor.goal is not None:
                left |= {f"goal.{name}": value for name, value in vars(actor.goal).items() if value is not None}
            for name, value in left.items():
                if not _is_finite(value):
                    text = f"left actor {actor.name!r} with {name} = {value!r} (expected finite numbers)"
                    raise InvalidResult(self, "update", text)

    def error(self, message: str, hint: str = "") -> ScenarioError:
        """An error at the place of this action in the file."""
        where = self.action
        return ScenarioError(Diagnostic(f"{type(where).__name__}: {message}", hint, where.source, where.line))


def _is_finite(value: object) -> bool:
    try:
        return bool(np.isfinite(np.asarray(value, dtype=float)).all())
    except (TypeError, ValueError):
        return False
