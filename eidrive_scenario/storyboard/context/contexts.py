"""Contexts of a run for conditions, actions and controller models; `RuntimeContext` is all three.

A condition reads the state of the run. An action also requests changes: those of its actor by methods of `Actor` and
`Motion`, all others by methods of `ActionContext`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, TypeVar

import numpy as np

from eidrive_scenario.base.requests import Override
from eidrive_scenario.errors import Diagnostic, ScenarioError, SimulationError
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.values.parameters import Parameter, Scope
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.trailers import towing_vehicle
from eidrive_scenario.storyboard.state.commands import Commands, CustomCommand, ExternalPose
from eidrive_scenario.storyboard.state.element_states import ElementStateObserver, ElementStates
from eidrive_scenario.storyboard.state.signals import Signals
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView

if TYPE_CHECKING:
    from eidrive_scenario.traffic.spawning.generators import BackgroundTraffic, TrafficGenerator
    from eidrive_scenario.traffic.spawning.population import CentralObject
    from eidrive_scenario.traffic.sumo.files import SumoFiles
    from eidrive_scenario.traffic.sumo.traffic import SumoTraffic


E = TypeVar("E", bound=model.Element)


MotionChange = str | tuple[str, str]
"""Change of the state of an entity, by its name, or of its speed, by its name and `speed`."""


def _referenced_parameter(element: model.ParameterCondition | model.ParameterAction) -> Parameter | None:
    """Return the parameter to which an element refers, the innermost one of its name; None if it is unknown."""
    scope: Scope | None = element.scope
    return None if scope is None else scope.declared(element.parameter_ref)


def speed_change(name: str) -> MotionChange:
    """Return the change of the speed of an entity."""
    return name, "speed"


class EntityUnavailableError(LookupError):
    """The state of an entity, by its name, does not allow an action.

    state  clause that follows the name
    hint   proposal for the user
    """

    state: ClassVar[str]
    hint: ClassVar[str]

    def __str__(self) -> str:
        return f"{super().__str__()} {self.state}"


class EntityAbsentError(EntityUnavailableError):
    """The position of an entity is required, and the entity is absent."""

    state = "is absent"
    hint = "start it after the entity is added"


class EntityTowedError(EntityUnavailableError):
    """An action moves an entity that a towing vehicle moves."""

    state = "is a connected trailer, which its towing vehicle moves"
    hint = "disconnect the trailer first"


@dataclass
class PositionCache:
    """State of `resolve_position`: resolved static positions, and the nesting of the position that is resolved now."""

    static: dict[int, tuple[model.Position, ResolvedPosition]] = field(default_factory=dict)
    """Resolved static positions, by `id` of the position."""
    depth: int = 0
    """Number of positions along curves that are being resolved within each other."""
    nested: int = 0
    """Number of positions along curves within the outermost one so far."""


class ConditionContext:
    """State of the run at one instant: what conditions and the functions on positions read. They do not change it.

    view         ground truth at this instant; it has no actors in Init
    scenario     the scenario of the run
    roads        the road network; None without one
    seed         seed of the run
    dt           length of the step that begins now [s]; 0 in Init
    step         time step of the run [s]
    actors       all entities of the scenario by name, present or absent
    variables    values by name, as text; `parameter` returns those of parameters
    user_values  user-defined values that are set, by name
    environment  time of day, weather and road condition
    signals      traffic signals and their controllers
    position_cache  state of `resolve_position`; only that function uses it
    progress     states of the storyboard elements; `observe_element` returns those of one
    warnings     warnings of the scenario; `warn` adds to them
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, *, dt: float, seed: int) -> None:
        self.scenario = scenario
        self.roads = roads
        self.step = dt
        self.dt = 0.0
        self.seed = seed
        self.view = _empty_view()
        self.progress = ElementStates()
        self.assigned_parameters: Mapping[int, str] = {}
        """Values that actions have set, by the identity of the parameter."""
        self.variables: Mapping[str, str] = scenario.variables
        network = scenario.document.road_network
        self.signals = Signals(network.traffic_signals if network is not None else None, roads)
        self.warnings: list[Diagnostic] = list(self.signals.warnings)
        self.environment = Environment()
        self.user_values: Mapping[str, str] = {}
        self.requested_user_values: dict[str, model.Element] = {}
        """First condition that requests each user-defined value, by the name of the value."""
        self.actors: Mapping[str, Actor] = {
            name: Actor(
                name, entity, scenario.controllers.get(name, ()), roads, keeps_controller=name in scenario.driven
            )
            for name, entity in scenario.entities.items()
        }
        self.traffic: BackgroundTraffic | None = None
        """Background traffic; None before its first instance starts."""
        self.sumo: SumoTraffic | None = None
        """Traffic of SUMO; None before it starts."""
        self.position_cache = PositionCache()
        self.parting: set[frozenset[str]] = set()
        """Former pairs of a vehicle and its trailer that still overlap."""

    def are_coupled(self, name: str, other: str) -> bool:
        """Whether an entity is the trailer of another one, or was and still overlaps it: they do not collide."""
        actors = self.actors
        return actors[name].trailer == other or actors[other].trailer == name or {name, other} in self.parting

    def parameter(self, element: model.ParameterCondition | model.ParameterAction) -> str | None:
        """Return the value of the parameter to which an element refers: that which an action has set, otherwise that of
        the scenario, story or maneuver that declares it. None if it is unknown.
        """
        parameter = _referenced_parameter(element)
        return None if parameter is None else self.assigned_parameters.get(id(parameter), parameter.text)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.view.time

    @property
    def traffic_names(self) -> tuple[str, ...]:
        """Names of the vehicles of background traffic."""
        return tuple(name for traffic in (self.traffic, self.sumo) if traffic is not None for name in traffic.names)

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

    def observe_element(self, kind: str, name: str) -> ElementStateObserver | None:
        """Return an observer of a storyboard element; None if there is no element of this type and name."""
        return self.progress.observe_element(kind, name)

    def element_names(self, kind: str) -> list[str]:
        """Return the names of all storyboard elements of a type."""
        return self.progress.names(kind)

    def request_user_value(self, element: model.UserDefinedValueCondition) -> None:
        """Declare that a condition reads a user-defined value."""
        self.requested_user_values.setdefault(element.name, element)

    def warn(self, *diagnostics: Diagnostic) -> None:
        """Add warnings to the result of the run, each once."""
        self.warnings += [diagnostic for diagnostic in diagnostics if diagnostic not in self.warnings]


class ActionContext(ConditionContext):
    """State of the run at one instant, and the changes that actions request.

    commands     commands of this tick; requests write to them
    monitors     values by name
    appearances  appearances of the actors that differ from the default
    overrides    controls that are held, by actor
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, *, dt: float, seed: int) -> None:
        super().__init__(scenario, roads, dt=dt, seed=seed)
        declarations = scenario.document.monitor_declarations
        monitors = declarations.monitor_declaration if declarations is not None else ()
        self.monitors: Mapping[str, bool] = {monitor.name: monitor.value for monitor in monitors}
        self.appearances: Mapping[str, Appearance] = {}
        self.overrides: dict[str, dict[str, Override]] = {}
        self.commands = Commands()

    def add_actor(self, name: str, place: ResolvedPosition) -> None:
        """Teleport an actor to a position; an absent actor enters the world."""
        actor = self.actors[name]
        actor.motion.teleport(place)
        actor.invalidate_location()
        if not actor.present:
            actor.enter_world()
            self.commands.spawns[name] = actor.motion.placement()

    def remove_actor(self, name: str) -> None:
        """Remove an actor from the world, disconnected from trailers; the actions that control it end."""
        actor, towing = self.actors[name], towing_vehicle(self.actors, name)
        if towing is not None:
            self._set_trailer(towing, None)
        self.disconnect_trailer(name)
        if actor.present:
            actor.leave_world()
            if self.commands.spawns.pop(name, None) is None:
                self.commands.removals.add(name)

    def connect_trailer(self, name: str, trailer: str) -> None:
        """Connect a trailer to an actor, in place of its present one; the actions that control the trailer end."""
        if self.actors[name].trailer != trailer:
            self.disconnect_trailer(name)
        towing = towing_vehicle(self.actors, trailer)
        if towing is not None:
            self._set_trailer(towing, None)
        self._set_trailer(name, trailer)

    def disconnect_trailer(self, name: str) -> None:
        """Disconnect the trailer of an actor, which stops at its position."""
        trailer = self.actors.get(self.actors[name].trailer or "")
        self._set_trailer(name, None)
        if trailer is not None and trailer.present:
            trailer.motion.set_speed(0.0)
            trailer.motion.snap_to_lane()

    def _set_trailer(self, name: str, trailer: str | None) -> None:
        actor = self.actors[name]
        if actor.trailer is not None:
            self.parting.add(frozenset((name, actor.trailer)))
        actor.set_trailer(trailer)

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

    def start_traffic(self, instance: TrafficGenerator) -> None:
        """Start an instance. Its first vehicles enter in this tick; in the first tick if it starts in Init."""
        self.background_traffic.start(instance)

    def start_sumo(self, files: SumoFiles) -> None:
        """Start the traffic of SUMO, once in a run. Raise SimulationError if SUMO refuses the files."""
        from eidrive_scenario.traffic.sumo.traffic import SumoTraffic

        assert self.roads is not None
        self.sumo = SumoTraffic(
            files, self.roads, self.signals, step=self.step, seed=self.seed, taken=frozenset(self.actors)
        )

    def close(self) -> None:
        """End the traffic of SUMO."""
        if self.sumo is not None:
            self.sumo.close()

    def stop_traffic(self, name: str | None) -> None:
        """Stop all instances of background traffic of this name; all instances without a name."""
        if self.traffic is not None:
            self.traffic.stop(name)

    def set_parameter(self, element: model.ParameterAction, value: str) -> None:
        """Set the value of the parameter to which an action refers."""
        if (parameter := _referenced_parameter(element)) is not None:
            self.assigned_parameters = {**self.assigned_parameters, id(parameter): value}

    def set_variable(self, name: str, value: str) -> None:
        """Set the value of a variable."""
        self.variables = {**self.variables, name: value}

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

    def request_command(self, command: CustomCommand) -> None:
        """Request the execution of a custom command."""
        self.commands.custom.append(command)


class ControllerContext(ConditionContext):
    """State of the run at one instant, and the inputs of controller models."""

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, *, dt: float, seed: int) -> None:
        super().__init__(scenario, roads, dt=dt, seed=seed)
        self.external_poses: dict[str, ExternalPose] = {}
        """Poses that were set from outside and not applied so far, by entity."""

    def take_external_pose(self, name: str) -> ExternalPose | None:
        """Return and discard the pose that was set from outside for an entity; None without one."""
        return self.external_poses.pop(name, None)


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
