"""Stations of a run and the channel between them: the driving stack of this project."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType

from msgspec.structs import replace

from eidrive_scenario.base.requests import Overrides
from eidrive_scenario.driving.agent import FIRST_NUMBERS, Agent, NextNumbers
from eidrive_scenario.driving.agent_factory import build_agent, build_detector, station_sensors
from eidrive_scenario.driving.communication.radio_line_of_sight import radio_environment
from eidrive_scenario.driving.communication.run_channel import RunChannel
from eidrive_scenario.driving.control.vehicle_controller import ControlOverrides
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.stack import DrivingStack, StackContext, StackInputs, StackSettings
from eidrive_scenario.driving.station_declarations import (
    build_encoder,
    declared_detectors,
    declared_encoders,
    declared_settings,
    possible_drivers,
    resolved_stations,
    without_speed,
)
from eidrive_scenario.driving.station_warnings import (
    areas_off_road,
    fast_message_rates,
    lights_out_of_view,
    short_channel_delay,
    short_detector_latencies,
    short_views,
)
from eidrive_scenario.driving.step import OWN_DECISIONS, AgentStep, StationPerception
from eidrive_scenario.driving.traffic_stations import COMMAND as TRAFFIC_STATIONS
from eidrive_scenario.driving.traffic_stations import TrafficStations, build_traffic_stations, parse_traffic_stations
from eidrive_scenario.errors import Diagnostic, ErrorSubject, InvalidResult
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.perception.detector import Detector, ImageDetections
from eidrive_scenario.perception.result_checks import describe
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.signals import SIGNAL_KINDS, SignalSensor
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.view import WorldView


def read_stations(
    rigs: Mapping[str, Rig],
    signal_sensors: Mapping[str, SignalSensor],
    world: World,
    view: WorldView,
    signals: Mapping[str, str],
) -> dict[str, Readings]:
    """Return the readings of each station: its sensors, its trailers, and the signals in its sight.

    signals  states of the traffic signals, by id
    """
    readings = read_all(list(rigs.values()), world, view)
    for name, reading in readings.items():
        attached = [view.row(other) for other in world.attached(name)]
        if attached:
            readings[name] = replace(reading, attached=view.boxes[attached])
    for name, sensor in signal_sensors.items():
        visible = sensor.read(world, view, view.row(name), signals)
        readings[name] = replace(readings[name], signals=visible)
    return readings


def prepare_detectors(agents: Mapping[str, Agent], readings: Mapping[str, Readings]) -> None:
    """Let detectors that process batches prepare the readings of all their stations at once."""
    batches: dict[type[Detector], list[str]] = {}
    for name, agent in agents.items():
        detector = agent.perception.detector
        if detector.processes_batches:
            batches.setdefault(type(detector), []).append(name)
    for kind, names in batches.items():
        detectors = [agents[name].perception.detector for name in names]
        _all_of(names).call(kind.prepare_batch, detectors, [readings[name] for name in names])


def _fuses_batches(kind: type[FusionMethod]) -> bool:
    """Return whether the last class that overrides `fuse` has a batch for it, too."""
    return "fuse_batch" in next(vars(base) for base in kind.__mro__ if {"fuse", "fuse_batch"} & vars(base).keys())


def _all_of(stations: Sequence[str]) -> ErrorSubject:
    """Return the stations of a batch, which errors of its extension name."""
    names = ", ".join(map(repr, stations))
    return ErrorSubject(f"station {names}" if len(stations) == 1 else f"stations {names}")


def fuse_reports(
    agents: Mapping[str, Agent], sensed: Mapping[str, StationPerception], now: float
) -> dict[str, StationPerception]:
    """Return what each station perceives with the objects after fusion.

    Methods of one class process the reports of all their stations as one batch, unless the class changes `fuse` only.
    """
    batches: dict[type[FusionMethod], list[str]] = {}
    perceived = dict(sensed)
    for name, agent in agents.items():
        kind = type(agent.fusion)
        if _fuses_batches(kind):
            batches.setdefault(kind, []).append(name)
        else:
            perceived[name] = agent.fuse(sensed[name])
    for kind, names in batches.items():
        methods, reports = [agents[name].fusion for name in names], [agents[name].reports for name in names]
        fused: object = _all_of(names).call(kind.fuse_batch, methods, reports, now)
        if not isinstance(fused, Sequence) or len(fused) != len(names):
            expected = f"a sequence with one Detections for each of {len(names)} stations"
            raise InvalidResult(methods[0], "fuse_batch", f"returned {describe(fused)} (expected {expected})")
        for name, objects in zip(names, fused, strict=True):
            perceived[name] = agents[name].with_fused(sensed[name], objects)
    return perceived


class Stations(DrivingStack):
    """All actors whose controller has `module=eidrive`, their sensors, and the channel between them.

    Raise SettingError if the properties of a controller, the channel or an option is invalid.
    """

    def __init__(self, context: StackContext) -> None:
        self._context = context
        self._channel = RunChannel(context.seed)
        self._readings: Mapping[str, Readings] = {}
        self._perceived_view: WorldView | None = None
        self._perceived: Mapping[str, StationPerception] = {}
        self._min_existence: dict[str, float] = {}
        self._agents: dict[str, Agent] = {}
        self._next_numbers: dict[str, NextNumbers] = {}
        """Numbers that each removed station continues if it returns."""
        self._receivers: dict[str, tuple[str, ...]] = {}
        """Receivers of each sender; empty after each change."""
        self._rigs: dict[str, Rig] = {}
        self._signal_sensors: dict[str, SignalSensor] = {}
        self._overrides: dict[str, ControlOverrides] = {}
        scenario = context.scenario
        selected = {name: value for name in ("detector", "fusion") if (value := getattr(context, name)) is not None}
        self._selected = selected
        self._settings = declared_settings(scenario, selected, context.cooperate)
        self._traffic: TrafficStations | None = None
        """Stations of background traffic that enters from now on."""
        self._traffic_encoders: dict[str, Asn1Encoder] = {}
        """Encoders of these stations by category."""
        declared = [
            self._built_traffic_stations(command.content, command.source, command.line, command.scope)
            for command in scenario.custom_commands
            if command.type == TRAFFIC_STATIONS
        ]
        self._declared_traffic = [stations for stations, _ in declared]
        # Detectors are built here to report unsuitable settings before the run.
        self._detectors = declared_detectors(
            scenario,
            self._settings,
            selected,
            load_weights=context.load_weights,
            allow_torchscript=context.allow_torchscript,
        )
        self._library_versions = {
            name: version
            for built in (*self._detectors.values(), *(detector for _, detector in declared))
            for name, version in sorted(built.library_versions.items())
        }
        """Versions of the libraries that compute the detections of any station, by name."""
        self._encoders = declared_encoders(scenario, self._settings)
        if context.channel is not None:
            self._channel.select(context.channel, origin="RunSettings.channel", line=None, scope=scenario.scope)

    @property
    def settings(self) -> Mapping[str, AgentSettings]:
        """Settings of every station of the scenario, options applied, whether it is present or not."""
        return self._settings

    @property
    def drivers(self) -> frozenset[str]:
        return frozenset(self._overrides)

    @cached_property
    def possible_drivers(self) -> Collection[str]:
        return possible_drivers(self._context.scenario, self._settings)

    @property
    def controllable(self) -> Collection[str]:
        return self._settings.keys()

    @property
    def undirected(self) -> Collection[str]:
        limited = self._context.roads is not None
        return [name for name in self.possible_drivers if without_speed(self._settings[name], limited=limited)]

    @property
    def min_existence(self) -> Mapping[str, float]:
        return self._min_existence

    @property
    def channel_name(self) -> str:
        return self._channel.name

    @property
    def readings(self) -> Mapping[str, Readings]:
        return self._readings

    def image_detections(self, station: str) -> Mapping[str, ImageDetections]:
        return self._agents[station].perception.detector.image_detections

    def resolved_settings(self) -> StackSettings:
        return replace(
            resolved_stations(
                self._settings,
                [(stations.share, stations.settings) for stations in self._declared_traffic],
                self._channel.name,
                self._channel.profile,
            ),
            versions=self._library_versions,
        )

    def warnings(self) -> Iterator[Diagnostic]:
        context = self._context
        yield from areas_off_road(context.scenario, self._settings, context.roads)
        yield from lights_out_of_view(context.scenario, self._settings, context.roads)
        yield from short_detector_latencies(self._settings, context.dt)
        yield from fast_message_rates(self._settings, context.dt)
        yield from short_views({name: self._settings[name] for name in self.possible_drivers}, self._detectors)
        if context.channel is not None:
            yield from short_channel_delay(self._channel.profile, context.dt, "RunSettings.channel")

    def add(self, spec: ActorSpec) -> None:
        settings, encoder = self._settings.get(spec.name), self._encoders.get(spec.name)
        if settings is None:
            if self._traffic is None or not self._is_equipped(spec, self._traffic):
                return
            settings, encoder = self._traffic.settings, self._traffic_encoder(spec.category, self._traffic)
        self._receivers.clear()
        context, station = self._context, ErrorSubject(f"station {spec.name!r}")
        sensors = station.call(station_sensors, settings)
        self._rigs[spec.name] = station.call(Rig, spec, sensors, seed=context.seed)
        detector = self._detectors.pop(spec.name, None) or station.call(build_detector, settings)
        if context.load_weights:
            station.call(detector.load_weights, allow_torchscript=context.allow_torchscript)
        agent = self._agents[spec.name] = station.call(
            build_agent,
            settings,
            spec,
            context.roads,
            seed=context.seed,
            dt=context.dt,
            detector=detector,
            encoder=encoder,
            numbers=self._next_numbers.pop(spec.name, FIRST_NUMBERS),
        )
        if agent.planner is not None:
            self._min_existence[spec.name] = settings.planner_settings.min_existence
        unread = SIGNAL_KINDS - agent.perception.detector.detectable_signals
        if settings.obey_signals and unread:
            self._signal_sensors[spec.name] = SignalSensor(spec, context.roads, unread)
        if agent.controller is not None:
            self._overrides[spec.name] = ControlOverrides(spec, context.dt)

    def remove(self, name: str) -> None:
        self._receivers.clear()
        if name in self._agents:
            self._next_numbers[name] = self._agents[name].next_numbers
        for held in (self._agents, self._min_existence, self._rigs, self._signal_sensors, self._overrides):
            held.pop(name, None)

    def request_channel(
        self, profile: str, *, source: str, line: int, scope: Scope | None = None
    ) -> Iterator[Diagnostic]:
        """Select a channel, unless an option of the run fixes it."""
        if self._context.channel is not None:
            return iter(())
        self._channel.select(profile, origin=source, line=line, scope=scope)
        self._receivers.clear()
        return short_channel_delay(self._channel.profile, self._context.dt, source, line)

    def request_traffic_stations(
        self, content: str, *, source: str, line: int, scope: Scope | None = None
    ) -> Iterator[Diagnostic]:
        self._traffic, _ = self._built_traffic_stations(content, source, line, scope)
        self._traffic_encoders.clear()
        return iter(())

    def _built_traffic_stations(
        self, content: str, source: str, line: int | None, scope: Scope | None
    ) -> tuple[TrafficStations, Detector]:
        declared = parse_traffic_stations(content, source=source, line=line, scope=scope)
        return build_traffic_stations(declared, self._context, self._selected, self._settings)

    def _is_equipped(self, spec: ActorSpec, stations: TrafficStations) -> bool:
        """Return whether an actor is a vehicle of background traffic and becomes one of these stations."""
        is_declared = spec.name in self._context.scenario.entities
        return not is_declared and spec.category != "pedestrian" and stations.includes(spec.name, self._context.seed)

    def _traffic_encoder(self, category: str, stations: TrafficStations) -> Asn1Encoder | None:
        if not stations.settings.asn1_files:
            return None
        if category not in self._traffic_encoders:
            encoder = build_encoder(stations.settings, self._context.scenario, category, stations.located)
            self._traffic_encoders[category] = encoder
        return self._traffic_encoders[category]

    def perceive(self, world: World, view: WorldView, inputs: StackInputs) -> Mapping[str, StationPerception]:
        """Read all sensors, deliver messages, and let every agent perceive: once for each view."""
        if view is self._perceived_view:
            return self._perceived
        self._readings, self._perceived = {}, {}
        if self._channel.has_links:
            antennas = [(agent.spec, agent.settings.antenna_height) for agent in self._agents.values()]
            self._channel.update_environment(radio_environment(world, view, antennas, self._context.roads))
        if not self._agents:
            return {}
        self._readings = readings = read_stations(self._rigs, self._signal_sensors, world, view, inputs.signals)
        prepare_detectors(self._agents, readings)
        now, channel, own_perception = view.time, self._channel, self._channel.own_perception
        intervals = {name: channel.min_message_interval(name) for name in self._agents}
        sensed = {
            name: agent.sense(
                readings[name],
                channel.deliver(name, now),
                now,
                inputs.goals.get(name),
                message_interval=intervals[name],
                own_perception=own_perception,
            )
            for name, agent in self._agents.items()
        }
        for name, perceived in sensed.items():
            for row in perceived.expired:
                channel.count_expired(perceived.inbox[row].message.sender, name)
        self._perceived_view, self._perceived = view, fuse_reports(self._agents, sensed, now)
        return self._perceived

    def act(self, world: World, view: WorldView, inputs: StackInputs) -> dict[str, AgentStep]:
        """Let every agent act on what it perceives, with the actions from outside."""
        perceived, actions = self.perceive(world, view, inputs), inputs.actions
        return {
            name: agent.decide(perceived[name], actions.get(name, OWN_DECISIONS))
            for name, agent in self._agents.items()
        }

    def controls(
        self, steps: Mapping[str, AgentStep], overrides: Mapping[str, Overrides] = MappingProxyType({})
    ) -> dict[str, Control]:
        """Return the controls of the agents with overrides applied. Actors removed after `act` have none."""
        return {
            name: self._overrides[name].apply(step.control, overrides.get(name, {}))
            for name, step in steps.items()
            if step.control is not None and name in self._overrides
        }

    def send(self, steps: Mapping[str, AgentStep], now: float) -> Sequence[LinkEvent]:
        """Transmit the messages of the agents, each on the links to its receivers.

        A message without receivers occupies the medium as well.
        """
        outbox = [(message, self._receivers_of(sender)) for sender, step in steps.items() for message in step.outbox]
        return self._channel.transmit(outbox, now)

    def _receivers_of(self, sender: str) -> tuple[str, ...]:
        """Return the present receivers of a station; they are the same until a station or the channel changes."""
        receivers = self._receivers.get(sender)
        if receivers is None:
            own_perception = self._channel.own_perception
            receivers = self._receivers[sender] = tuple(
                name
                for name, agent in self._agents.items()
                if agent.receives_from(sender, own_perception=own_perception)
            )
        return receivers

    def final_links(self) -> Sequence[LinkEvent]:
        return self._channel.final_links()

    def metrics(self, now: float) -> dict[str, float]:
        """Return the counts of messages over all links."""
        return self._channel.metrics(now)

    def link_statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        return self._channel.link_statistics(now)
