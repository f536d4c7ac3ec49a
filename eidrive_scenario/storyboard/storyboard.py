"""The storyboard of one run: ticks the tree, moves what is scripted, and says what the world shall do."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.registry import Registry, registry
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.context.controller_model import build_controller_models, unassigned_controller_warnings
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.external import ExternalObjects
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.trailers import check_acyclic, declared_trailer, pairs, pose_behind
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.storyboard.state.external_inputs import NONE, ExternalPose
from eidrive_scenario.storyboard.state.states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.builder import Builder
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.view import WorldView

STOPPED = "stop trigger"
COMPLETE = "storyboard complete"


class Storyboard:
    """The standard's storyboard over one scenario.

    Raises ScenarioError, with all findings at once, for what the scenario asks and nobody can execute.
    """

    def __init__(
        self,
        scenario: Scenario,
        roads: RoadNetwork | None,
        *,
        dt: float,
        seed: int = 0,
        actions: Registry | None = None,
        conditions: Registry | None = None,
        controllers: Mapping[str, str] | None = None,
    ) -> None:
        self.scenario = scenario
        self.dt = dt
        self.context = RuntimeContext(scenario, roads, dt=dt, seed=seed, empty_view=_empty_view())
        builder = Builder(scenario, self.context, actions or registry("actions"), conditions or registry("conditions"))
        self.init, self.root = builder.build()
        for name, actor in self.context.actors.items():
            actor.set_trailer(declared_trailer(scenario.entities[name]))
        check_acyclic(self.context.actors)
        self._external = ExternalObjects(scenario, roads)
        self.context.warnings += self._external.warnings
        self._controller_models = build_controller_models(
            self.context.actors, self.context, controllers or {}, registry("controllers")
        )
        self.context.warnings += unassigned_controller_warnings(self.context.actors, controllers or {})
        self.ended: str | None = None
        """Why the run is over, as far as the storyboard has a say; None while it goes on."""

    @property
    def road_objects(self) -> frozenset[str]:
        """The ids of the road network's objects that are entities of the scenario."""
        return frozenset(placed.object.id for placed in self._external.places().values())

    @property
    def changes(self) -> tuple[StateChange, ...]:
        """What changed its state in the last tick."""
        return tuple(self.context.progress.changes)

    def check_accepts_external_poses(self, name: str) -> None:
        """Raise SettingError if no controller model of the entity accepts poses from outside."""
        if not any(model.accepts_external_poses and model.actor.name == name for model in self._controller_models):
            message = f"entity {name!r} has no controller model that accepts poses"
            hint = "assign the model `external` to its controller (--controller NAME=external)"
            raise SettingError(Diagnostic(message, hint, "set_pose"))

    def initial(self) -> Commands:
        """What holds before the first view: who is where, what was commanded in Init. To be asked once."""
        self.context.signals.advance(0.0)
        self.init.start()
        for name, placed in self._external.places().items():
            if not self.context.actors[name].present:
                self.context.add_actor(name, ResolvedPosition(placed.pose))
        self._bring_trailers()
        for actor in self.context.actors.values():
            actor.motion.initialize()
        self._refresh(self.context.commands)
        return self._finished(self.context.commands)

    def tick(
        self,
        view: WorldView,
        *,
        user_values: Mapping[str, str] = NONE,
        external_poses: Mapping[str, ExternalPose] = NONE,
    ) -> Commands:
        """Evaluate the triggers on this view, update the actions, and move scripted actors to their next poses.

        user_values     values of UserDefinedValueConditions, by name
        external_poses  poses that were set since the last tick, by entity; each is kept until its entity moves there
        """
        self.context.begin_tick(view, self.dt, user_values, external_poses)
        self.context.signals.advance(view.time)
        self.root.tick_tree(self.init)
        if self.root.state is ElementState.COMPLETE and self.ended is None:
            self.ended = STOPPED if self.root.record.transitions[-1][1] is ElementTransition.STOP else COMPLETE
        commands = self.context.commands
        trains = self._bring_trailers()
        self._refresh(commands)
        for controller_model in self._controller_models:
            if controller_model.actor.present and not controller_model.actor.driven:
                controller_model.step()
        drawn = {back.name for _, back in trains}
        for name, actor in self.context.actors.items():
            if not actor.present or name in drawn:
                continue
            if not actor.driven:
                commands.placements[name] = actor.motion.step(self.dt)
            elif actor.motion.teleported:
                commands.placements[name] = actor.motion.placement()
        _check_placements(commands.placements)
        for front, back in trains:
            if front.present and back.present:
                back.motion.set_towed_state(pose_behind(front, back, straight=front.motion.teleported), front.motion)
                commands.placements[back.name] = replace(back.motion.placement(), teleport=front.motion.teleported)
        passed_over = [name for name, look in self.context.appearances.items() if not look.visibility.traffic]
        self.context.traffic.step(view.without(passed_over), self.dt, commands)
        return self._finished(commands)

    def _bring_trailers(self) -> list[tuple[Actor, Actor]]:
        """Trailers enter with what draws them, in line; in Init they are put there wherever they were placed.

        Who draws whom, from the front of each train to its end.
        """
        trains = list(pairs(self.context.actors))
        for front, back in trains:
            if front.present and (not back.present or self.context.view.tick < 0):
                back.motion.set_speed(front.motion.speed)
                self.context.add_actor(back.name, ResolvedPosition(pose_behind(front, back, straight=True)))
        return trains

    def _refresh(self, commands: Commands) -> None:
        """Who enters has the speed that later actions of the same tick gave it."""
        for name in commands.spawns:
            body = self._external.body(name)
            if body is not None:
                commands.actor_specs[name] = body
            commands.spawns[name] = self.context.actors[name].motion.placement()

    def _finished(self, commands: Commands) -> Commands:
        context = self.context
        driven = [name for name, actor in context.actors.items() if actor.present and actor.driven]
        commands.driven = frozenset(driven)
        commands.goals = {name: goal for name in driven if (goal := context.actors[name].goal) is not None}
        commands.overrides = {name: dict(held) for name, held in context.overrides.items() if held}
        commands.signals, commands.appearances = context.signals.states, context.appearances
        commands.monitors = context.monitors
        return commands


def _check_placements(placements: Mapping[str, Placement]) -> None:
    """Raise SimulationError for the first placement that is not finite; pybullet would take it as it is."""
    total = 0.0
    for place in placements.values():
        total += place.x + place.y + place.z + place.yaw + place.speed
    if total - total == 0.0:  # neither NaN nor infinite
        return
    for name, placement in placements.items():
        if not all(map(math.isfinite, (placement.x, placement.y, placement.z, placement.yaw, placement.speed))):
            raise SimulationError(f"actor {name!r} would be placed at {placement} (expected finite numbers)")


def _empty_view() -> WorldView:
    none = np.empty(0)
    points = np.empty((0, 3))
    return WorldView(
        time=0.0,
        tick=-1,
        names=(),
        categories=(),
        position=points,
        yaw=none,
        pitch=none,
        roll=none,
        velocity=points,
        acceleration=points,
        yaw_rate=none,
        speed=none,
        size=points,
        offset=points,
    )
