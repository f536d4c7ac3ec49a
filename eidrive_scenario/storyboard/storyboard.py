"""Scenario as a tree of behaviours, its external objects and requested routes: the storyboard of one run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError
from eidrive_scenario.extensions.registry import Registry, registry
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.roads import PlacedObject, RoadNetwork, Route, placed_objects
from eidrive_scenario.storyboard.context.controller_model import build_controller_models, unassigned_controller_warnings
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.trailers import (
    Coupling,
    check_acyclic,
    couplings,
    declared_trailer,
    next_displacement,
)
from eidrive_scenario.storyboard.state.commands import NONE, Commands, ExternalPose
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.builder import Builder
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.specs import actor_spec
from eidrive_scenario.world.view import WorldView

STOPPED = "stop trigger"
COMPLETE = "storyboard complete"


def _road_object(name: str, roads: RoadNetwork | None) -> PlacedObject | None:
    """Return the object of the road network with this id, otherwise with this name; None without one."""
    placed = list(placed_objects(roads)) if name and roads is not None else []
    return next((entry for key in ("id", "name") for entry in placed if getattr(entry.object, key) == name), None)


class Storyboard:
    """Storyboard of one scenario.

    Raise ScenarioError with all diagnostics if the scenario has elements that are not executable.
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
        self.context = RuntimeContext(scenario, roads, dt=dt, seed=seed)
        builder = Builder(scenario, self.context, actions or registry("actions"), conditions or registry("conditions"))
        self.init, self.root = builder.build()
        self.extensions = frozenset(builder.extensions)
        """Group and name of each action and condition."""
        for name, actor in self.context.actors.items():
            actor.set_trailer(declared_trailer(scenario.entities[name]))
        check_acyclic(self.context.actors)
        self._road_objects: dict[str, PlacedObject] = {}
        """Objects of the road network that are entities, by entity."""
        for name, reference in scenario.external.items():
            placed = _road_object(reference.name, roads)
            if placed is not None:
                self._road_objects[name] = placed
            else:
                box = f"entity {name!r} is represented by a box of 0.5 m"
                message = f"{box}: the external object {reference.name!r} is unknown"
                hint = "define a Vehicle, Pedestrian or MiscObject"
                self.context.warnings.append(Diagnostic.at(reference, message, hint))
        self._controller_models = build_controller_models(
            self.context.actors, self.context, controllers or {}, registry("controllers")
        )
        self.context.warnings += unassigned_controller_warnings(self.context.actors, controllers or {})
        self._routes = RequestedRoutes()
        self._couplings: tuple[Coupling, ...] = ()
        self._trailers: Mapping[str, str] = {}
        """Trailer of each towing vehicle, by name."""
        self._declared_trailers: list[str | None] = []
        """Trailer of each actor, by which the connections were made."""
        self.ended: str | None = None
        """Reason for the end of the run by the storyboard; None while it continues."""

    @property
    def road_objects(self) -> frozenset[str]:
        """Ids of the objects of the road network that are entities of the scenario."""
        return frozenset(placed.object.id for placed in self._road_objects.values())

    @property
    def changes(self) -> tuple[StateChange, ...]:
        """State changes of the last tick."""
        return tuple(self.context.progress.changes)

    def check_accepts_external_poses(self, name: str) -> None:
        """Raise SettingError if no controller model of the entity accepts poses from outside."""
        if not any(model.accepts_external_poses and model.actor.name == name for model in self._controller_models):
            message = f"entity {name!r} has no controller model that accepts poses"
            hint = "assign the model `external` to its controller (RunSettings.controllers NAME=external)"
            raise SettingError(Diagnostic(message, hint, "set_pose"))

    def initial(self) -> Commands:
        """Execute Init and return its commands, before the first view. Call once."""
        self.context.signals.advance(0.0)
        self.init.start()
        for name, placed in self._road_objects.items():
            if not self.context.actors[name].present:
                self.context.add_actor(name, ResolvedPosition(placed.pose))
        self._add_trailers()
        for coupling in self._couplings:
            self.context.let_tow(coupling.front.name, coupling.back.name)
        for actor in self.context.actors.values():
            actor.motion.initialize()
        self._update_spawns(self.context.commands)
        driven = [actor for actor in self.context.actors.values() if actor.present and actor.driven]
        return self._completed_commands(self.context.commands, driven)

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
        self._add_trailers()
        if commands.spawns:
            self._update_spawns(commands)
        awake = [actor for actor in self.context.actors.values() if not actor.motion.rests or actor.driven]
        commands.routes = self._routes.changes(awake)
        for controller_model in self._controller_models:
            if controller_model.actor.present and not controller_model.actor.driven:
                controller_model.step()
        towed, placements, driven = self._trailers.values(), commands.placements, []
        for actor in self.context.actors.values() if self._controller_models else awake:
            if not actor.present:
                continue
            name, is_driven = actor.name, actor.driven
            if is_driven:
                driven.append(actor)
            if name in towed:
                continue
            if not is_driven:
                placements[name] = actor.motion.step(self.dt)
            elif actor.motion.teleported:
                placements[name] = actor.motion.placement()
        _check_placements(placements)
        for coupling in self._couplings:
            front, back = coupling.front, coupling.back
            if front.present and back.present:
                teleports = front.motion.teleported or back.motion.teleported
                pose = coupling.next_pose(next_displacement(front, view, self.dt), straight=teleports)
                back.motion.set_towed_state(pose, front.motion)
                placements[back.name] = back.motion.placement(teleport=teleports)
        self.context.step_traffic()
        return self._completed_commands(commands, driven)

    def _add_trailers(self) -> None:
        """Place trailers that are absent or elsewhere behind their towing vehicles, aligned with them."""
        actors = self.context.actors
        trailers = [actor.trailer for actor in actors.values()]
        if trailers != self._declared_trailers:
            self._declared_trailers = trailers
            self._couplings = tuple(couplings(actors))
            self._trailers = {coupling.front.name: coupling.back.name for coupling in self._couplings}
        self.context.commands.trailers = self._trailers
        for coupling in self._couplings:
            front, back = coupling.front, coupling.back
            if front.present and (not back.present or coupling.is_apart or self.context.view.tick < 0):
                back.motion.set_speed(front.motion.speed_along_heading)
                self.context.add_actor(back.name, ResolvedPosition(coupling.next_pose(straight=True)))

    def _update_spawns(self, commands: Commands) -> None:
        """Update the spawns of this tick, whose speeds later actions of the tick may have set."""
        for name in commands.spawns:
            if (placed := self._road_objects.get(name)) is not None:
                default = actor_spec(name, self.scenario.entities[name])
                length, width, height = default.size
                size = (placed.length or length, placed.width or width, placed.height or height)
                commands.actor_specs[name] = replace(default, size=size, offset=(0.0, 0.0, size[2] / 2.0))
            commands.spawns[name] = self.context.actors[name].motion.placement()

    def _completed_commands(self, commands: Commands, driven: Sequence[Actor]) -> Commands:
        context = self.context
        if driven:
            commands.driven = frozenset([actor.name for actor in driven])
            commands.goals = {actor.name: goal for actor in driven if (goal := actor.goal) is not None}
        if context.overrides:
            commands.overrides = {name: dict(overrides) for name, overrides in context.overrides.items() if overrides}
        commands.signals, commands.appearances = context.signals.states, context.appearances
        commands.monitors = context.monitors
        return commands


def _check_placements(placements: Mapping[str, Placement]) -> None:
    """Raise SimulationError for the first placement that is not finite, which pybullet does not check."""
    total = 0.0
    for placement in placements.values():
        total += placement.x + placement.y + placement.z + placement.yaw + placement.speed
    if total - total == 0.0:  # neither NaN nor infinite
        return
    for name, placement in placements.items():
        if not all(map(math.isfinite, (placement.x, placement.y, placement.z, placement.yaw, placement.speed))):
            raise SimulationError(f"actor {name!r}: invalid placement (got {placement}; expected finite numbers)")


POINTS_APART = 2.0
"""Maximum spacing of the points of a route [m]."""


class RequestedRoutes:
    """Routes by AssignRouteAction and AcquirePositionAction: over lanes, or through waypoints without roads."""

    def __init__(self) -> None:
        self._last: dict[str, object] = {}
        """Last route, or waypoints, of each actor."""

    def changes(self, actors: Iterable[Actor]) -> Mapping[str, Array]:
        """Return the points (M, 3) of the routes of actors that were requested since the last call, by actor [m].

        The lap that follows a closed route is no new route.
        """
        routes: dict[str, Array] = {}
        for actor in actors:
            name = actor.name
            request: object = actor.motion.route
            if request is None:
                goal = actor.goal
                if goal is None or goal.waypoints is None:
                    continue
                request = goal.waypoints
            last = self._last.get(name)
            if request is last:
                continue
            self._last[name] = request
            if isinstance(request, Route):
                if not isinstance(last, Route) or last.lap is not request:
                    routes[name] = request.polyline(POINTS_APART)
            else:
                routes[name] = np.concatenate([np.array([actor.motion.pose[:3]]), request])
        return routes or NONE
