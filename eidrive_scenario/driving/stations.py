"""All stations of a run, and the radio between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent, build_detector, build_rig
from eidrive_scenario.driving.communication.radio_line_of_sight import antenna_position, line_of_sight_states
from eidrive_scenario.driving.control.overrides import ControlOverrides
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.station_declarations import declared_detectors, declared_encoders, declared_settings
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.library import library_path
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.registry import is_built_in
from eidrive_scenario.requests import Goal, Overrides
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.signals import SIGNAL_KINDS, SignalSensor
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.channel_checks import check_delivered, check_events, check_interval, check_statistics
from eidrive_scenario.v2x.messages.message import LinkEvent, ReceivedMessage
from eidrive_scenario.v2x.profile import NO_COOPERATION, ChannelProfile, build_channel, load_profile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.view import WorldView


class Stations:
    """Every actor whose controller is ours, the sensors on it, and the channel that joins them.

    channel    profile that wins over what the file says; None leaves it to the file
    detector   for all stations; None leaves it to their controllers
    cooperate  the senders whom listening stations hear; None leaves it to their controllers
    load_weights       whether detectors load their weights, which `eidrive check` does not
    allow_torchscript  whether weights may be TorchScript, which can execute any code

    Raises SettingError if a controller's properties, the channel or one of these options is wrong.
    """

    def __init__(
        self,
        scenario: Scenario,
        roads: RoadNetwork | None,
        *,
        seed: int,
        dt: float,
        channel: str | Path | None = None,
        detector: str | None = None,
        cooperate: tuple[str, ...] | None = None,
        load_weights: bool = True,
        allow_torchscript: bool = False,
    ) -> None:
        self._scenario = scenario
        self._roads = roads
        self._seed = seed
        self._dt = dt
        self._fixed_channel = channel is not None
        self._channel: Channel | None = None
        self._checked_channel: Channel | None = None
        """The channel, if its results are checked: that of a third party."""
        self._retired_channel: Channel | None = None
        """The channel before, where there is none any more: its books still count."""
        self._books: tuple[float, Mapping[tuple[str, str], LinkStatistics]] | None = None
        """When the books of the channel were last read, and what they said: those of many links take a while."""
        self.channel_name = NO_COOPERATION
        self.goals: Mapping[str, Goal] = {}
        self.signals: Mapping[str, str] = {}
        """What the traffic lights show, by their ids."""
        self.links: Sequence[LinkEvent] = ()
        """What became of the messages that were said in the last tick."""
        self.readings: Mapping[str, Readings] = {}
        """What the sensors of each station gave in the last tick."""
        self.min_existence: dict[str, float] = {}
        """Of the stations with a planner, the probability of existence from which on it reacts to objects."""
        self._agents: dict[str, Agent] = {}
        self._rigs: dict[str, Rig] = {}
        self._lookouts: dict[str, SignalSensor] = {}
        self._held: dict[str, ControlOverrides] = {}
        self._settings = declared_settings(scenario, detector, cooperate)
        self.channel_profile: ChannelProfile | None = None
        """The profile of the channel; None where there is none."""
        self._load_weights = load_weights
        self._allow_torchscript = allow_torchscript
        self._detectors = declared_detectors(
            scenario, self._settings, detector, load_weights=load_weights, allow_torchscript=allow_torchscript
        )
        """Built beforehand, as what they cannot work with shall be told before the run."""
        self.library_versions: Mapping[str, str] = {
            name: version
            for detector in self._detectors.values()
            for name, version in sorted(detector.library_versions.items())
        }
        """Versions of the libraries that compute the detections of any station, by name."""
        self._encoders = declared_encoders(scenario, self._settings)
        if channel is not None:
            self._set_channel(channel, origin="--channel", line=None, scope=scenario.scope)

    @property
    def settings(self) -> Mapping[str, AgentSettings]:
        """The settings of every station of the scenario, options applied, whether it is in the world or not."""
        return self._settings

    @property
    def drivers(self) -> frozenset[str]:
        """The stations that move by their own pedals and steering."""
        return frozenset(name for name, agent in self._agents.items() if agent.controller is not None)

    def detector(self, name: str) -> Detector:
        """Of a station. Raises KeyError if it is not in the world."""
        return self._agents[name].perception.detector

    def add(self, spec: ActorSpec) -> None:
        """An actor has entered the world; it becomes a station if it has a controller of ours."""
        settings = self._settings.get(spec.name)
        if settings is None:
            return
        self._rigs[spec.name] = build_rig(settings, spec, seed=self._seed)
        detector = self._detectors.pop(spec.name, None) or build_detector(settings)
        if self._load_weights:
            detector.load_weights(allow_torchscript=self._allow_torchscript)
        self._agents[spec.name] = build_agent(
            settings,
            spec,
            self._roads,
            seed=self._seed,
            dt=self._dt,
            own_perception=self._own_perception,
            detector=detector,
            encoder=self._encoders.get(spec.name),
        )
        if self._agents[spec.name].planner is not None:
            self.min_existence[spec.name] = settings.min_existence
        unseen = SIGNAL_KINDS - self._agents[spec.name].perception.detector.detectable_signals
        if settings.obey_signals and unseen:
            self._lookouts[spec.name] = SignalSensor(spec, self._roads, unseen)
        if self._agents[spec.name].controller is not None:
            self._held[spec.name] = ControlOverrides(spec, self._dt)

    def remove(self, name: str) -> None:
        """An actor has left the world."""
        self._agents.pop(name, None)
        self.min_existence.pop(name, None)
        self._rigs.pop(name, None)
        self._lookouts.pop(name, None)
        self._held.pop(name, None)

    def request_channel(self, profile: str, *, source: str, line: int, scope: Scope | None = None) -> None:
        """The file asks for a channel, at the start or on a trigger; an option given by the caller wins."""
        if not self._fixed_channel:
            self._set_channel(profile, origin=source, line=line, scope=scope)

    def step(self, world: World, view: WorldView) -> dict[str, AgentStep]:
        """Sensors read, messages that have arrived are heard, every agent acts."""
        self.readings = {}
        if not self._agents:
            return {}
        if self._channel is not None:
            self._books = None
            self._channel.update_environment(self._surroundings(world, view))
        readings = read_all(list(self._rigs.values()), world, view)
        for name, lookout in self._lookouts.items():
            seen = lookout.read(world, view, view.row(name), self.signals)
            readings[name] = replace(readings[name], signals=seen)
        self.readings = readings
        now = view.time
        for name, agent in self._agents.items():
            agent.message_interval = 0.0 if self._channel is None else self._channel.min_message_interval(name)
            if self._checked_channel is not None:
                check_interval(self._checked_channel, agent.message_interval)
        return {
            name: agent.act(readings[name], self._deliver(name, now), now, self.goals.get(name))
            for name, agent in self._agents.items()
        }

    def controls(
        self, steps: Mapping[str, AgentStep], overrides: Mapping[str, Overrides] | None = None
    ) -> dict[str, Control]:
        """The pedals and steering that the agents chose, but for those that the scenario holds.

        Who has left the world in this step has none any more.
        """
        held = overrides or {}
        return {
            name: self._held[name].apply(step.control, held.get(name, {}))
            for name, step in steps.items()
            if step.control is not None and name in self._held
        }

    def send(self, steps: Mapping[str, AgentStep], now: float) -> None:
        """What the agents said goes on the air, each message on the link to each station that listens.

        A message that nobody listens to takes its time on the air all the same.
        """
        if self._channel is None:
            self.links = ()
            return
        outbox = []
        for sender, step in steps.items():
            receivers = self._receivers(sender)
            outbox += [(message, receivers) for message in step.outbox]
        told = self._channel.transmit(outbox, now)
        if self._checked_channel is not None:
            check_events(self._checked_channel, told)
        self._books = None
        self.links = told if isinstance(told, LinkEvents) else tuple(told)

    def metrics(self, now: float) -> dict[str, float]:
        """Counts of messages over all links."""
        if self._channel is None and self._retired_channel is None:
            return {}
        books = self.link_statistics(now).values()
        return {
            "messages.sent": sum(book.sent for book in books),
            "messages.received": sum(book.received for book in books),
            "messages.lost": sum(book.lost for book in books),
            "messages.bytes": sum(book.bytes_sent for book in books),
        }

    def link_statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        """The books of every link, by (sender, receiver); empty where there never was a channel."""
        channel = self._channel or self._retired_channel
        if channel is None:
            return {}
        if self._books is None or self._books[0] != now:
            self._books = now, channel.statistics(now)
            if not is_built_in(type(channel)):
                check_statistics(channel, self._books[1])
        return self._books[1]

    def _surroundings(self, world: World, view: WorldView) -> RadioEnvironment:
        places = {
            name: antenna_position(view, agent.spec, agent.settings.antenna_height)
            for name, agent in self._agents.items()
        }
        return RadioEnvironment(places, partial(line_of_sight_states, world, places))

    def _deliver(self, receiver: str, now: float) -> Sequence[ReceivedMessage]:
        if self._channel is None:
            return ()
        delivered = self._channel.deliver(receiver, now)
        if self._checked_channel is not None:
            check_delivered(self._checked_channel, delivered, now)
        return delivered

    def _receivers(self, sender: str) -> list[str]:
        """Who hears `sender`: listening stations that count it; itself too where the channel carries own perception."""
        found = []
        for name, agent in self._agents.items():
            if not agent.receives_messages:
                continue
            heard = agent.settings.cooperates_with
            if self._own_perception if name == sender else heard is None or sender in heard:
                found.append(name)
        return found

    @property
    def _own_perception(self) -> bool:
        return self._channel is not None and self._channel.own_perception

    def _set_channel(self, source: str | Path, *, origin: str, line: int | None, scope: Scope | None) -> None:
        profile = load_profile(source, [library_path() / "channels"], origin=origin, line=line, scope=scope)
        before = self._channel or self._retired_channel
        self._channel = build_channel(profile, self._seed, previous=before)
        third_party = self._channel is not None and not is_built_in(type(self._channel))
        self._checked_channel = self._channel if third_party else None
        self._retired_channel = before if self._channel is None else None
        self._books = None
        self.channel_profile = profile
        self.channel_name = profile.name if profile is not None else NO_COOPERATION
        for agent in self._agents.values():
            agent.own_perception = self._own_perception and agent.receives_messages
