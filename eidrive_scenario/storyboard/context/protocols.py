"""Interfaces of the run for conditions, actions and controller models; `RuntimeContext` implements them.

A condition reads the state of the run. An action also requests changes: those of its actor by methods of `Actor` and
`Motion`, all others by methods of `ActionContext`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TypeVar

from eidrive_scenario.base.requests import Override
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.state.commands import CustomCommand, ExternalPose
from eidrive_scenario.storyboard.state.element_states import ElementStateObserver
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView

if TYPE_CHECKING:
    from eidrive_scenario.traffic.spawning.generators import BackgroundTraffic, TrafficGenerator


E = TypeVar("E", bound=model.Element)


MotionChange = str | tuple[str, str]
"""Change of the state of an entity, by its name, or of its speed, by its name and `speed`."""


def speed_change(name: str) -> MotionChange:
    """Return the change of the speed of an entity."""
    return name, "speed"


class EntityAbsentError(LookupError):
    """The position of an entity is required, and the entity is absent."""


@dataclass
class PositionCache:
    """State of `resolve_position`: resolved static positions, and the nesting of the position that is resolved now."""

    static: dict[int, tuple[model.Position, ResolvedPosition]] = field(default_factory=dict)
    """Resolved static positions, by `id` of the position."""
    depth: int = 0
    """Number of positions along curves that are being resolved within each other."""
    nested: int = 0
    """Number of positions along curves within the outermost one so far."""


class SignalStates(Protocol):
    """States of the traffic signals and of their controllers."""

    def state(self, name: str) -> str | None:
        """Return the state of a signal; None without one."""

    def phase(self, controller: str) -> str | None:
        """Return the name of the current phase of a signal controller; None without one."""

    def unknown(self, name: str, element: model.Element) -> Diagnostic | None:
        """Return a warning if the road network has no signal of this name."""

    def check_phase(self, controller: str, phase: str, element: model.Element) -> None:
        """Raise ScenarioError if the phases of a signal controller are declared without this one."""


class ConditionContext(Protocol):
    """State of the run at one instant: what conditions and the functions on positions read."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""

    @property
    def view(self) -> WorldView:
        """Ground truth at this instant; it has no actors in Init."""

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run."""

    @property
    def roads(self) -> RoadNetwork | None:
        """The road network; None without one."""

    @property
    def seed(self) -> int:
        """Seed of the run."""

    @property
    def actors(self) -> Mapping[str, Actor]:
        """All entities of the scenario by name, present or absent."""

    @property
    def traffic_names(self) -> tuple[str, ...]:
        """Names of the vehicles of background traffic."""

    @property
    def parameters(self) -> Mapping[str, str]:
        """Values of the parameters, by name."""

    @property
    def variables(self) -> Mapping[str, str]:
        """Values of the variables, by name."""

    @property
    def user_values(self) -> Mapping[str, str]:
        """User-defined values that are set, by name."""

    @property
    def environment(self) -> Environment:
        """Time of day, weather and road condition."""

    @property
    def signals(self) -> SignalStates:
        """States of the traffic signals and of their controllers."""

    @property
    def position_cache(self) -> PositionCache:
        """State of `resolve_position`; only that function uses it."""

    def pose(self, name: str) -> Pose:
        """Return the pose of an actor. Raise EntityAbsentError if it is absent."""

    def location(self, name: str) -> LaneLocation | None:
        """Return the lane location of an actor, None without a road nearby. Raise EntityAbsentError if it is absent."""

    def speed(self, name: str) -> float:
        """Return the speed of an actor along its heading [m/s]."""

    def catalog_entry(self, reference: model.CatalogReference | None, kind: type[E], within: model.Element) -> E:
        """Return the catalog entry that `within` refers to. Raise ScenarioError if it is missing or of another type."""

    def observe_element(self, kind: str, name: str) -> ElementStateObserver | None:
        """Return an observer of a storyboard element; None if the storyboard has no element of this type and name."""

    def element_names(self, kind: str) -> Iterable[str]:
        """Return the names of all storyboard elements of a type."""

    def request_user_value(self, element: model.UserDefinedValueCondition) -> None:
        """Declare that a condition reads a user-defined value; the run warns of requested values that are not set."""

    def warn(self, *diagnostics: Diagnostic) -> None:
        """Add warnings to the result of the run."""


class ActionContext(ConditionContext, Protocol):
    """State of the run at one instant, and the changes that actions request."""

    @property
    def dt(self) -> float:
        """Length of the step that begins now [s]; 0 in Init."""

    @property
    def background_traffic(self) -> BackgroundTraffic:
        """Background traffic of the run; requires a road network."""

    def appearance(self, name: str) -> Appearance:
        """Return the appearance of an actor."""

    def add_actor(self, name: str, place: ResolvedPosition) -> None:
        """Teleport an actor to a position; an absent actor enters the world."""

    def remove_actor(self, name: str) -> None:
        """Remove an actor from the world and end the actions that control it."""

    def set_parameter(self, name: str, value: str) -> None:
        """Set the value of a parameter."""

    def set_variable(self, name: str, value: str) -> None:
        """Set the value of a variable."""

    def set_monitor(self, name: str, value: bool) -> None:
        """Set the value of a monitor."""

    def set_appearance(self, name: str, appearance: Appearance) -> None:
        """Set the appearance of an actor."""

    def set_environment(self, environment: Environment) -> None:
        """Set time of day, weather and road condition."""

    def set_signal_state(self, name: str, state: str) -> None:
        """Set the state of a traffic signal."""

    def set_signal_phase(self, controller: str, phase: str) -> None:
        """Start a phase of a signal controller now."""

    def set_override(self, name: str, override: Override) -> None:
        """Hold a control of a driven actor at a value, or release it."""

    def start_traffic(self, instance: TrafficGenerator) -> None:
        """Start an instance of background traffic."""

    def stop_traffic(self, name: str | None) -> None:
        """Stop all instances of background traffic of this name; all instances without a name."""

    def request_command(self, command: CustomCommand) -> None:
        """Request the execution of a custom command."""


class ControllerContext(ConditionContext, Protocol):
    """State of the run at one instant, and the inputs of controller models."""

    @property
    def dt(self) -> float:
        """Length of the step that begins now [s]; 0 in Init."""

    @property
    def step(self) -> float:
        """Time step of the run [s]."""

    def take_external_pose(self, name: str) -> ExternalPose | None:
        """Return and discard the pose that was set from outside for an entity; None without one."""
