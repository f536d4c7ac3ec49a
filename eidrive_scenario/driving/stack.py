"""Interface between a run and a driving stack: everything that `Simulation` and the recording call."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import msgspec

from eidrive_scenario.base.requests import Goal, Overrides
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep, StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.profile import NO_COOPERATION
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.view import WorldView


@dataclass(frozen=True)
class StackContext:
    """Arguments of a stack: the scenario, its roads, and the settings of the run that concern stations.

    dt         time step [s]
    channel    profile that overrides the scenario file; None uses the value of the file
    detector, fusion   of all stations; None uses the values of the file
    cooperate  senders whose messages the receiving stations use; None uses the values of the file
    load_weights       whether detectors load their weights; `eidrive check` does not
    allow_torchscript  whether weights may be TorchScript, which can execute any code
    """

    scenario: Scenario
    roads: RoadNetwork | None
    seed: int
    dt: float
    channel: str | os.PathLike[str] | Mapping[str, Any] | None = None
    detector: str | None = None
    fusion: str | None = None
    cooperate: tuple[str, ...] | None = None
    load_weights: bool = True
    allow_torchscript: bool = False


class StackInputs(msgspec.Struct, frozen=True):
    """Requests and states of the scenario that a stack receives in one tick.

    goals    requests to driven vehicles, by name; a vehicle without an entry uses its own settings
    signals  states of the traffic signals, by id
    actions  decisions from outside, by station
    """

    goals: Mapping[str, Goal] = msgspec.field(default_factory=dict)
    signals: Mapping[str, str] = msgspec.field(default_factory=dict)
    actions: Mapping[str, StationAction] = msgspec.field(default_factory=dict)


class StackSettings(msgspec.Struct, frozen=True):
    """Settings of a stack as the result of a run states them. All values are JSON types.

    channel          name of the channel profile
    channel_profile  content of the profile; None without a channel
    stations         settings of each station, by name
    traffic_stations  share and settings of the stations of background traffic, of each command
    extensions       distributions of the third-party extensions in use, by `group.name`
    versions         versions of the libraries that compute the results of the stack, by name
    """

    channel: str = NO_COOPERATION
    channel_profile: dict[str, Any] | None = None
    stations: Mapping[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    traffic_stations: Sequence[dict[str, Any]] = ()
    extensions: Mapping[str, str] = msgspec.field(default_factory=dict)
    versions: Mapping[str, str] = msgspec.field(default_factory=dict)


class DrivingStack(ABC):
    """Perception, communication and driving of all stations of one run.

    `Simulation` calls `add` and `remove` when actors enter and leave the world. In each tick it calls `act`, then
    `send` and `controls` unless the run ends with this tick. A stack reads the true state through `world` and `view`
    only to simulate sensors and radio propagation. The defaults of methods are those of a stack without messages.
    """

    @abstractmethod
    def add(self, spec: ActorSpec) -> None:
        """Add an actor that enters the world. Actors that the stack does not operate are ignored."""

    @abstractmethod
    def remove(self, name: str) -> None:
        """Remove an actor that leaves the world, if the stack operates it."""

    @property
    @abstractmethod
    def drivers(self) -> frozenset[str]:
        """Present actors that the stack drives while their controller is active."""

    def perceive(self, world: World, view: WorldView, inputs: StackInputs) -> Mapping[str, StationPerception]:
        """Return what each present station perceives at the time of the view, by name, before it acts.

        It may be called before `act` with the same view, and must not change what `act` returns.
        """
        return {}

    @abstractmethod
    def act(self, world: World, view: WorldView, inputs: StackInputs) -> Mapping[str, AgentStep]:
        """Return the step of each present station at the time of the view, by name."""

    @abstractmethod
    def controls(
        self, steps: Mapping[str, AgentStep], overrides: Mapping[str, Overrides] = MappingProxyType({})
    ) -> Mapping[str, Control]:
        """Return the controls of the present drivers after `act`, with the overrides of the scenario applied."""

    def send(self, steps: Mapping[str, AgentStep], now: float) -> Sequence[LinkEvent]:
        """Transmit the messages of these steps at `now` [s]; return the events of messages whose outcome is known.

        A message is never delivered in the tick in which it is sent.
        """
        return ()

    def final_links(self) -> Sequence[LinkEvent]:
        """Return the events of messages whose outcome became known in the last tick of a run, after the last `send`."""
        return ()

    def request_channel(
        self, profile: str, *, source: str, line: int, scope: Scope | None = None
    ) -> Iterable[Diagnostic]:
        """Select the channel that a command of the scenario file requests, and return warnings about it.

        Raise SettingError if the profile is invalid.
        """
        return (Diagnostic("the driving stack has no channel", "remove the command", source, line),)

    def request_traffic_stations(
        self, content: str, *, source: str, line: int, scope: Scope | None = None
    ) -> Iterable[Diagnostic]:
        """Make a share of the vehicles of background traffic that enter from now on stations; return warnings about it.

        Raise SettingError if the settings are invalid.
        """
        return (Diagnostic("the driving stack has no stations of traffic", "remove the command", source, line),)

    def metrics(self, now: float) -> Mapping[str, float]:
        """Return the metrics of the stack at the end of a run, at `now` [s]."""
        return {}

    def link_statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        """Return the statistics of all links, by (sender, receiver)."""
        return {}

    def warnings(self) -> Iterable[Diagnostic]:
        """Return the warnings that are known before the run."""
        return ()

    def resolved_settings(self) -> StackSettings:
        """Return the settings of all stations and of the channel at the start of the run."""
        return StackSettings()

    @property
    def settings(self) -> Mapping[str, AgentSettings]:
        """Settings of the stations of the scenario, present or not; empty for a stack with other settings."""
        return MappingProxyType({})

    @property
    def possible_drivers(self) -> Collection[str]:
        """Entities that the stack drives once they are present and their controller is active."""
        return ()

    @property
    def controllable(self) -> Collection[str]:
        """Stations of the scenario, present or not, that accept actions from outside."""
        return ()

    @property
    def undirected(self) -> Collection[str]:
        """Possible drivers that stand until the scenario gives them a speed: their settings determine none."""
        return ()

    @property
    def min_existence(self) -> Mapping[str, float]:
        """Existence probability from which on the planner of a present station reacts to an object, by station."""
        return MappingProxyType({})

    @property
    def channel_name(self) -> str:
        """Name of the current channel profile."""
        return NO_COOPERATION

    @property
    def readings(self) -> Mapping[str, Readings]:
        """Sensor readings of the last `act`, by station."""
        return MappingProxyType({})

    def image_detections(self, station: str) -> Mapping[str, ImageDetections]:
        """Return what the detector of a station found in its last camera images, by camera."""
        return {}


class EmptyStack(DrivingStack):
    """A stack without stations: all actors are moved by the scenario."""

    def __init__(self, context: StackContext) -> None:
        """Accept the arguments of every stack; none is used."""

    def add(self, spec: ActorSpec) -> None:
        pass

    def remove(self, name: str) -> None:
        pass

    @property
    def drivers(self) -> frozenset[str]:
        return frozenset()

    def act(self, world: World, view: WorldView, inputs: StackInputs) -> Mapping[str, AgentStep]:
        return {}

    def controls(
        self, steps: Mapping[str, AgentStep], overrides: Mapping[str, Overrides] = MappingProxyType({})
    ) -> Mapping[str, Control]:
        return {}


StackFactory = Callable[[StackContext], DrivingStack]
"""Builds the stack of a run. Raise InputError if the scenario or a setting is invalid."""


def build_stack(factory: StackFactory, context: StackContext) -> DrivingStack:
    """Return the stack of a factory. Raise SettingError if the factory is not one or returns something else."""
    if not callable(factory):
        raise SettingError(Diagnostic(f"stack: a factory is expected (got {quoted(factory)})"))
    stack: object = factory(context)
    if not isinstance(stack, DrivingStack):
        raise SettingError(Diagnostic(f"stack: the factory returned no DrivingStack (got {quoted(stack)})"))
    return stack
