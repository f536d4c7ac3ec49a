"""State of the storyboard at run time, which conditions read and actions request changes of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.requests import Override
from eidrive_scenario.errors import Diagnostic, ScenarioError, SimulationError
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.protocols import (
    E,
    EntityAbsentError,
    MotionChange,
    PositionCache,
    speed_change,
)
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.trailers import disconnect
from eidrive_scenario.storyboard.state.commands import NONE, Commands, CustomCommand, ExternalPose
from eidrive_scenario.storyboard.state.element_states import Domain, ElementStateObserver, ElementStates
from eidrive_scenario.storyboard.state.signals import Signals
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView

if TYPE_CHECKING:
    from eidrive_scenario.traffic.spawning.generators import BackgroundTraffic, TrafficGenerator
    from eidrive_scenario.traffic.spawning.population import CentralObject


class PreemptableAction(Protocol):
    """Element whose behaviours hold domains that a later action can acquire."""

    def linked_behaviours(self, behaviour: ActionBehaviour) -> Sequence[ActionBehaviour]:
        """Return the behaviours that lose their domains together with this one, including it."""

    def preempt(self, behaviour: ActionBehaviour, why: str) -> None:
        """Stop a behaviour whose domain another action has acquired."""


class RuntimeContext:
    """State of the run at one instant; implements the contexts in `protocols`.

    The other members are for the storyboard and its tree: element states, holders of control domains, pending actions.

    view         ground truth of this tick; it has no actors before the first view (Init)
    moved        entities whose state, and whose speed, differs from that in the last view; all if actors enter or leave
    dt           length of the current step [s]; 0 in Init
    parameters, variables  values by name, as text
    monitors     values by name
    signals      traffic signals and their controllers
    appearances  appearances of the actors that differ from the default
    environment  time of day, weather and road condition
    traffic      background traffic
    warnings     warnings of the scenario
    commands     commands of this tick
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, *, dt: float, seed: int) -> None:
        self.scenario = scenario
        self.roads = roads
        self.step = dt
        """Time step of the run [s]."""
        self.dt = 0.0
        self.seed = seed
        self.view = _empty_view()
        self.moved: set[MotionChange] = set()
        self.progress = ElementStates()
        self.parameters: dict[str, str] = dict(scenario.parameters)
        self.variables: dict[str, str] = dict(scenario.variables)
        self.warnings: list[Diagnostic] = []
        network = scenario.document.road_network
        self.signals = Signals(network.traffic_signals if network is not None else None, roads)
        self.warnings += self.signals.warnings
        declarations = scenario.document.monitor_declarations
        monitors = declarations.monitor_declaration if declarations is not None else ()
        self.monitors: Mapping[str, bool] = {monitor.name: monitor.value for monitor in monitors}
        self.appearances: Mapping[str, Appearance] = {}
        self.overrides: dict[str, dict[str, Override]] = {}
        self.environment = Environment()
        self.user_values: Mapping[str, str] = {}
        """Values of UserDefinedValueConditions, by name."""
        self.external_poses: dict[str, ExternalPose] = {}
        """Poses that were set from outside and not applied so far, by entity."""
        self.requested_user_values: dict[str, model.Element] = {}
        """First condition that requests each user-defined value, by the name of the value."""
        self.commands = Commands()
        self.actors: dict[str, Actor] = {
            name: Actor(
                name, entity, scenario.controllers.get(name, ()), roads, keeps_controller=name in scenario.driven
            )
            for name, entity in scenario.entities.items()
        }
        self.traffic: BackgroundTraffic | None = None
        """Background traffic; None before its first instance starts."""
        self.completes_this_step = False
        """Whether an action reaches its goal in the current step."""
        self.pending_actions: list[Callable[[], None]] = []
        """Functions that stop actions that have started at this instant if their entity is still absent."""
        self.position_cache = PositionCache()
        self._holders: list[tuple[str, Domain, PreemptableAction, ActionBehaviour]] = []
        """Control domains with their actors, and the element and the behaviour that hold them."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.view.time

    def begin_tick(
        self,
        view: WorldView,
        dt: float,
        user_values: Mapping[str, str] = NONE,
        external_poses: Mapping[str, ExternalPose] = NONE,
    ) -> None:
        """Start a tick with a new view and empty commands; histories are continued."""
        last_names = self.view.names
        self.view = view
        self.dt = dt
        self.user_values = user_values
        if external_poses:
            self.external_poses.update(external_poses)
        self.commands = Commands()
        self.progress.begin(view.tick, view.time)
        moved: set[MotionChange] = set()
        rows, states = view.rows, view.states
        for name, actor in self.actors.items():
            row = rows.get(name)
            if row is not None:
                last = actor.last_state
                if states[row] is last and actor.motion.rests and not actor.tracks_off_road:
                    continue
                if actor.observe(view, row):
                    moved.add(name)
                    if last is None or last.speed != states[row].speed:
                        moved.add(speed_change(name))
                if actor.tracks_off_road:
                    actor.update_off_road(self.roads, view)
                if actor.tracks_end_of_road and actor.driven:
                    actor.update_end_of_road(self.roads, view)
        self.moved = moved if view.names is last_names else {*self.actors, *map(speed_change, self.actors)}

    def pose(self, name: str) -> Pose:
        """Return the current pose of an actor. Raise EntityAbsentError if it is absent."""
        return self._present_actor(name).motion.pose

    def location(self, name: str) -> LaneLocation | None:
        """Return the lane location of an actor, None without a road nearby. Raise EntityAbsentError if it is absent."""
        actor = self._present_actor(name)
        return None if self.roads is None else actor.location(self.roads, self.view.tick)

    def _present_actor(self, name: str) -> Actor:
        """Return a present actor; an actor that is removed in this step is present until the end of the step."""
        actor = self.actors[name]
        if not actor.present and name not in self.view:
            raise EntityAbsentError(name)
        return actor

    def speed(self, name: str) -> float:
        """Return the speed along the heading in this view [m/s]; of an actor outside of the view, its set speed."""
        row = self.view.rows.get(name)
        return self.view.states[row].speed if row is not None else self.actors[name].motion.speed_along_heading

    def _center(self, name: str) -> CentralObject | None:
        """Return pose and speed of an entity for the traffic around it; None while it is absent."""
        actor = self.actors.get(name)
        if actor is None or not actor.present:
            return None
        from eidrive_scenario.traffic.spawning.population import CentralObject

        row = self.view.rows.get(name)
        if row is None:
            pose = actor.motion.pose
            return CentralObject(pose.x, pose.y, pose.h, actor.motion.speed_along_heading)
        state = self.view.states[row]
        return CentralObject(state.x, state.y, state.yaw, state.speed)

    def add_actor(self, name: str, place: ResolvedPosition) -> None:
        """Teleport an actor to a position; an absent actor enters the world."""
        actor = self.actors[name]
        actor.motion.teleport(place)
        actor.invalidate_location()
        if not actor.present:
            actor.enter_world()
            self.commands.spawns[name] = actor.motion.placement()

    def remove_actor(self, name: str) -> None:
        """Remove an actor from the world, disconnected from trailers, and end the actions that control it."""
        actor = self.actors[name]
        disconnect(self.actors, name)
        if actor.present:
            actor.leave_world()
            if self.commands.spawns.pop(name, None) is None:
                self.commands.removals.add(name)
        for holder_actor, _, occupant, holder in list(self._holders):
            if holder_actor == name:
                occupant.preempt(holder, f"{name} is removed")
                self.release_domains(holder)

    def catalog_entry(self, reference: model.CatalogReference | None, kind: type[E], within: model.Element) -> E:
        """Return the catalog entry that `within` refers to, with its parameters.

        Raise ScenarioError if it is missing or not of type `kind`.
        """
        if reference is None:
            message = f"{type(within).__name__}: {kind.__name__} is missing"
            raise ScenarioError(Diagnostic.at(within, message, "define it in place or by a CatalogReference"))
        entry = self.scenario.resolved(reference)
        if not isinstance(entry, kind):
            raise ScenarioError(
                Diagnostic.at(
                    reference,
                    f"CatalogReference {reference.catalog_name}/{reference.entry_name} has the wrong type",
                    f"got {type(entry).__name__}; expected {kind.__name__}",
                )
            )
        return entry

    @property
    def traffic_names(self) -> tuple[str, ...]:
        """Names of the vehicles of background traffic."""
        return () if self.traffic is None else self.traffic.names

    @property
    def background_traffic(self) -> BackgroundTraffic:
        """Background traffic of the run, built on first access. Raise SimulationError without a road network."""
        if self.traffic is not None:
            return self.traffic
        if self.roads is None:
            raise SimulationError("background traffic: the scenario has no road network")
        from eidrive_scenario.traffic.spawning.generators import BackgroundTraffic
        from eidrive_scenario.traffic.spawning.population import Population

        population = Population(
            self.roads,
            seed=self.seed,
            center=self._center,
            taken=frozenset(self.actors),
            must_stop=self.signals.must_stop,
        )
        self.traffic = BackgroundTraffic(population)
        return self.traffic

    def start_traffic(self, instance: TrafficGenerator) -> None:
        """Start an instance. Its first vehicles enter in this tick; in the first tick if it starts in Init."""
        self.background_traffic.start(instance)

    def stop_traffic(self, name: str | None) -> None:
        """Stop all instances of background traffic of this name; all instances without a name."""
        if self.traffic is not None:
            self.traffic.stop(name)

    def step_traffic(self) -> None:
        """Add spawns, removals and placements of background traffic in the current step to the commands."""
        if self.traffic is None:
            return
        invisible = [name for name, appearance in self.appearances.items() if not appearance.visibility.traffic]
        changes, commands = self.traffic.step(self.view.without(invisible), self.dt), self.commands
        for name, (spec, placement) in changes.additions.items():
            commands.spawns[name] = placement
            commands.actor_specs[name] = spec
        commands.removals |= changes.removals
        commands.placements.update(changes.placements)
        for name in changes.additions:
            if name not in changes.placements:
                commands.placements[name] = replace(commands.spawns[name], teleport=True)

    def observe_element(self, kind: str, name: str) -> ElementStateObserver | None:
        """Return an observer of a storyboard element; None if there is no element of this type and name."""
        return self.progress.observe_element(kind, name)

    def element_names(self, kind: str) -> list[str]:
        """Return the names of all storyboard elements of a type."""
        return self.progress.names(kind)

    def request_user_value(self, element: model.UserDefinedValueCondition) -> None:
        """Declare that a condition reads a user-defined value."""
        self.requested_user_values.setdefault(element.name, element)

    def take_external_pose(self, name: str) -> ExternalPose | None:
        """Return and discard the pose that was set from outside for an entity; None without one."""
        return self.external_poses.pop(name, None)

    def warn(self, *diagnostics: Diagnostic) -> None:
        """Add warnings to the result of the run, each once."""
        self.warnings += [diagnostic for diagnostic in diagnostics if diagnostic not in self.warnings]

    def request_command(self, command: CustomCommand) -> None:
        """Request the execution of a custom command."""
        self.commands.custom.append(command)

    def set_parameter(self, name: str, value: str) -> None:
        """Set the value of a parameter."""
        self.parameters[name] = value

    def set_variable(self, name: str, value: str) -> None:
        """Set the value of a variable."""
        self.variables[name] = value

    def set_monitor(self, name: str, value: bool) -> None:
        """Set the value of a monitor."""
        self.monitors = {**self.monitors, name: value}

    def set_environment(self, environment: Environment) -> None:
        """Set time of day, weather and road condition."""
        self.environment = self.commands.environment = environment

    def set_signal_state(self, name: str, state: str) -> None:
        """Set the state of a traffic signal."""
        self.signals.set_state(name, state)

    def set_signal_phase(self, controller: str, phase: str) -> None:
        """Start a phase of a signal controller now."""
        self.signals.set_phase(controller, phase, max(self.time, 0.0))

    def set_override(self, name: str, override: Override) -> None:
        """Hold a control of a driven actor at a value, or release it."""
        held = self.overrides.setdefault(name, {})
        if override.active:
            held[override.control] = override
        else:
            held.pop(override.control, None)

    def appearance(self, name: str) -> Appearance:
        """Return the appearance of an actor."""
        return self.appearances.get(name) or Appearance()

    def set_appearance(self, name: str, appearance: Appearance) -> None:
        """Set the appearance of an actor."""
        self.appearances = {**self.appearances, name: appearance}

    def acquire_domain(
        self, actor: str | None, domains: Domain, occupant: PreemptableAction, holder: ActionBehaviour
    ) -> None:
        """Let a behaviour acquire domains of an actor; the previous holders of these domains are preempted.

        A holder that acts on an entity selection is preempted for all members (ASAM OpenSCENARIO XML 1.3.1, 7.5.1).
        """
        if actor is None or not domains:
            return
        for holder_actor, other_domains, other, behaviour in list(self._holders):
            if holder_actor == actor and other_domains & domains and behaviour.resource == holder.resource:
                for preempted in other.linked_behaviours(behaviour):
                    self.release_domains(preempted)
                    other.preempt(preempted, f"{holder.name} acquired its domain")
        self._holders.append((actor, domains, occupant, holder))

    def release_domains(self, holder: ActionBehaviour) -> None:
        """Release all domains of a behaviour."""
        self._holders = [entry for entry in self._holders if entry[3] is not holder]


def _empty_view() -> WorldView:
    """Return a view without actors, before the first tick."""
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
