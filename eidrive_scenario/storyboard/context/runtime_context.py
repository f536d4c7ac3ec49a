"""The stage: all that an action or a condition may see, and the commands to which actions write."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.requests import Override
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.context.preemption import DomainHolder, PendingAction, PreemptableAction
from eidrive_scenario.storyboard.context.protocols import E, EntityAbsentError, PositionCache
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.state.background import BackgroundTrafficPort
from eidrive_scenario.storyboard.state.commands import Commands, CustomCommand
from eidrive_scenario.storyboard.state.domains import Domain
from eidrive_scenario.storyboard.state.element_states import ElementStateObserver, ElementStates
from eidrive_scenario.storyboard.state.external_inputs import NONE, ExternalPose
from eidrive_scenario.storyboard.state.signals import Signals
from eidrive_scenario.traffic.background import BackgroundTraffic
from eidrive_scenario.traffic.spawning.generators import CentralObject, TrafficGenerator
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView


class RuntimeContext:
    """What actions and conditions see of the run at one instant.

    view        the truth at this tick; before the first view (Init) it holds nobody
    dt          length of the step that begins now [s]; 0 in Init
    parameters, variables  by name, as text
    monitors    by name
    signals     the traffic signals and their controllers
    appearances  of those actors that differ from the usual
    environment  time of day, weather and road
    traffic     background traffic
    warnings    what is odd about the scenario and yet can be done
    commands    to write to
    """

    def __init__(
        self, scenario: Scenario, roads: RoadNetwork | None, *, dt: float, seed: int, empty_view: WorldView
    ) -> None:
        self.scenario = scenario
        self.roads = roads
        self.step = dt
        """The step of the run [s]."""
        self.dt = 0.0
        self.seed = seed
        self.view = empty_view
        self.progress = ElementStates()
        self.parameters: dict[str, str] = dict(scenario.parameters)
        self.variables: dict[str, str] = dict(scenario.variables)
        self.warnings: list[Diagnostic] = []
        network = scenario.document.road_network
        self.signals = Signals(network.traffic_signals if network is not None else None, roads)
        self.warnings += self.signals.warnings
        declared = scenario.document.monitor_declarations
        self.monitors: Mapping[str, bool] = (
            {one.name: one.value for one in declared.monitor_declaration} if declared is not None else {}
        )
        self.appearances: Mapping[str, Appearance] = {}
        self.overrides: dict[str, dict[str, Override]] = {}
        self.environment = Environment()
        self.user_values: Mapping[str, str] = {}
        """Values of UserDefinedValueConditions, by name."""
        self.external_poses: dict[str, ExternalPose] = {}
        """Poses that were set from outside and not applied so far, by entity."""
        self.requested_user_values: dict[str, model.Element] = {}
        """The names of such values, and the first condition that asks for each."""
        self.commands = Commands()
        self.actors: dict[str, Actor] = {
            name: Actor(name, entity, scenario.controllers.get(name, ()), roads)
            for name, entity in scenario.entities.items()
        }
        self.traffic = BackgroundTrafficPort(
            roads,
            seed=seed,
            center=self._center,
            taken=frozenset(self.actors),
            must_stop=self.signals.must_stop,
        )
        self.completes_this_step = False
        """Whether the step that goes on brings an action to its goal."""
        self.pending_actions: list[PendingAction] = []
        """Whose actions have started at this instant for somebody who is not in the world so far."""
        self.position_cache = PositionCache()
        self._holders: list[tuple[str, Domain, PreemptableAction, DomainHolder]] = []

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
        self.view = view
        self.dt = dt
        self.user_values = user_values
        self.external_poses.update(external_poses)
        self.commands = Commands()
        self.progress.begin(view.tick, view.time)
        rows: Mapping[str, int] = view.rows
        for name, actor in self.actors.items():
            row = rows.get(name)
            if row is not None:
                actor.observe(view, row)
                if actor.tracks_off_road:
                    actor.update_off_road(self.roads, view)

    def pose(self, name: str) -> Pose:
        """Where an actor is now. Raises Absent if it is not in the world."""
        return self._there(name).motion.pose

    def location(self, name: str) -> LaneLocation | None:
        """Its place on the road: the lane below it, None where no road is near. Raises Absent."""
        actor = self._there(name)
        return None if self.roads is None else actor.location(self.roads, self.view.tick)

    def _there(self, name: str) -> Actor:
        """An actor in the world; whom an action deletes is there until the end of the step."""
        actor = self.actors[name]
        if not actor.present and name not in self.view:
            raise EntityAbsentError(name)
        return actor

    def speed(self, name: str) -> float:
        """Speed along the heading in this view [m/s]; of what was just placed, the speed that it was given."""
        row = self.view.rows.get(name)
        return self.view.states[row].speed if row is not None else self.actors[name].motion.speed

    def _center(self, name: str) -> CentralObject | None:
        """Where an entity is and moves, for the traffic around it; None while it is not in the world."""
        actor = self.actors.get(name)
        if actor is None or not actor.present:
            return None
        row = self.view.rows.get(name)
        if row is None:
            pose = actor.motion.pose
            return CentralObject(pose.x, pose.y, pose.h, actor.motion.speed)
        state = self.view.states[row]
        return CentralObject(state.x, state.y, state.yaw, state.speed)

    def add_actor(self, name: str, place: ResolvedPosition) -> None:
        """Put an actor at a place; it enters the world if it was not there."""
        actor = self.actors[name]
        actor.motion.teleport(place)
        actor.invalidate_location()
        if not actor.present:
            actor.enter_world()
            self.commands.spawns[name] = actor.motion.placement()

    def remove_actor(self, name: str) -> None:
        """Take an actor out of the world; what it was doing ends."""
        actor = self.actors[name]
        if actor.present:
            actor.present = False
            if self.commands.spawns.pop(name, None) is None:
                self.commands.removals.add(name)
        for held, _, occupant, holder in list(self._holders):
            if held == name:
                occupant.preempt(holder, f"{name} left the world")
                self.release_domains(holder)

    def catalog_entry(self, reference: model.CatalogReference | None, kind: type[E], within: model.Element) -> E:
        """The entry that a catalog reference `within` an element means, with its parameters.

        Raises ScenarioError if it is no `kind`, or if there is none.
        """
        if reference is None:
            message = f"{type(within).__name__} has no {kind.__name__}"
            raise ScenarioError(
                Diagnostic(message, "give it in place or by a CatalogReference", within.source, within.line)
            )
        entry = self.scenario.resolved(reference)
        if not isinstance(entry, kind):
            raise ScenarioError(
                Diagnostic(
                    f"{reference.catalog_name}/{reference.entry_name} is a {type(entry).__name__}",
                    f"a {kind.__name__} belongs here",
                    reference.source,
                    reference.line,
                )
            )
        return entry

    @property
    def traffic_names(self) -> tuple[str, ...]:
        """Names of the vehicles of background traffic."""
        return self.traffic.names

    @property
    def background_traffic(self) -> BackgroundTraffic:
        """Background traffic of the run; requires a road network."""
        return self.traffic.traffic

    def start_traffic(self, instance: TrafficGenerator) -> None:
        """Start an instance of background traffic."""
        self.traffic.start(instance)

    def stop_traffic(self, name: str | None) -> None:
        """Stop all instances of background traffic of this name; all instances without a name."""
        self.traffic.stop(name)

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
        """How an actor looks."""
        return self.appearances.get(name) or Appearance()

    def set_appearance(self, name: str, appearance: Appearance) -> None:
        """Change how an actor looks."""
        self.appearances = {**self.appearances, name: appearance}

    def acquire_domain(
        self, actor: str | None, domains: Domain, occupant: PreemptableAction, holder: DomainHolder
    ) -> None:
        """A behaviour begins to control domains of an actor; older ones on these domains end.

        An older one of a selection of entities ends for all of them (ASAM OpenSCENARIO XML 1.3.1, 7.5.1).
        """
        if actor is None or not domains:
            return
        for held, other_domains, other, behaviour in list(self._holders):
            if held == actor and other_domains & domains and behaviour.resource == holder.resource:
                for loser in other.linked_behaviours(behaviour):
                    self.release_domains(loser)
                    other.preempt(loser, f"{holder.name} took over")
        self._holders.append((actor, domains, occupant, holder))

    def release_domains(self, holder: DomainHolder) -> None:
        """A behaviour controls nothing any more."""
        self._holders = [entry for entry in self._holders if entry[3] is not holder]
