"""Generation of the messages of a station (CAM, CPM)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame
from eidrive_scenario.v2x.messages.generation import (
    CHECK,
    EQUAL,
    LONGEST,
    SHORTEST,
    CamGenerationRules,
    CpmGenerationRules,
    ObjectIdAssigner,
    cam_size,
    cpm_size,
    earlier_state,
    objects_that_fit,
)
from eidrive_scenario.v2x.messages.message import Message, Payload, StationState, shift_timestamps, station_id
from eidrive_scenario.v2x.messages.point_cloud import PointCloud
from eidrive_scenario.world.actor import ActorSpec


class MessageGenerator:
    """Generator of the messages of one station, by the rules that its settings select.

    view     sectors of the sensors with which the station perceives objects, for the sensor information of its CPMs
    encoder  encodes messages to measure their size; None uses the size model
    seed     of the phase of the messages. Stations are not synchronized, so that their phases are random and uniform
    dt       time step [s]: messages are generated in the time step after their phase, and passed to the radio with an
             offset, the remainder of the phase, so that the messages of stations spread over the time step
    number   sequence number of the first message
    next_id  object id of the first object without a track number
    """

    def __init__(
        self,
        spec: ActorSpec,
        settings: AgentSettings,
        *,
        view: tuple[ViewSector, ...] = (),
        encoder: Asn1Encoder | None = None,
        seed: int = 0,
        dt: float = math.inf,
        number: int = 0,
        next_id: int = 0,
    ) -> None:
        self._spec = spec
        self._settings = settings
        self._view = view
        self._encoder = encoder
        self._clock = settings.clock
        self.number = number
        """Sequence number of the next message."""
        self._sent: tuple[Payload, ...] = ()
        """Sensor data of the last CPM."""
        self._periods = -1
        start, elapsed = generator(seed, "message phase", spec.name).uniform(size=2).tolist()
        self._phase, fixed = 0.0, settings.message_phase
        if settings.message_rate is not None:
            self._phase = start / settings.message_rate if fixed is None else fixed
        elif settings.generation == "etsi":
            self._phase = start * CHECK if fixed is None else fixed
        self._dt = 0.0 if math.isinf(dt) else dt
        self._offset = 0.0 if math.isinf(dt) else max(0.0, self._phase - math.floor(self._phase / dt + EQUAL) * dt)
        """Time from the time step of a message until it is passed to the radio [s]."""
        self._first = math.inf
        """Earliest time of the first evaluation [s]."""
        self._origin = math.inf
        """Time of the first evaluation [s]."""
        self._cam_rules = CamGenerationRules(elapsed if fixed is None else None)
        self._cpm_rules = CpmGenerationRules()
        self.numbering = ObjectIdAssigner(next_id)
        self._last_generated = dict.fromkeys(settings.messages, -math.inf)
        """Time of the last message of each kind [s]."""

    def generate(
        self,
        state: StationState,
        detections: Detections,
        now: float,
        payloads: tuple[Payload, ...] = (),
        *,
        interval: float = 0.0,
        measured: float = math.inf,
    ) -> tuple[Message, ...]:
        """Return the messages of this tick.

        payloads  sensor data, which are sent once: the first CPM carries points; frames of features follow it, each in
                  its own message
        interval  minimum time between two messages under congestion control [s], respected by the ETSI rules. With two
                  kinds of messages only the less recent kind is generated in a tick
        measured  time of the last readings in the detections [s]: before the first ones, CPMs do not list sensors,
                  whose sectors would count as perceived
        """
        if self._first == math.inf:
            self._first = now + self._phase
        if now < self._first - EQUAL:
            return ()
        etsi = self._settings.generation == "etsi"
        evaluated = self._evaluation_time(now) if etsi else now
        has_measured = measured > -math.inf
        if not etsi and not self._is_due_by_rate(now):
            return ()
        interval = min(interval, LONGEST)
        generated: list[Message] = []
        kinds = self._settings.messages
        if len(kinds) > 1:
            kinds = tuple(sorted(kinds, key=lambda kind: (self._last_generated[kind], kind)))
        # Also while no message is due: without velocities, ids are kept from one list of detections to the next
        numbers = self.numbering.assign_ids(detections) if etsi and "cpm" in kinds else ()
        for kind in kinds:
            if etsi and interval > 0.0 and now - max(self._last_generated.values()) < interval - EQUAL:
                break
            shortest = max(interval, SHORTEST)
            messages: list[Message] = []
            if kind == "cpm":
                if etsi and not has_measured:
                    continue
                if etsi:
                    messages = self._triggered_cpms(state, detections, numbers, now, evaluated, shortest)
                else:  # an empty CPM states that no object is in sight
                    messages = [self._message(state, detections, now, lists_sensors=has_measured)]
            elif not etsi or self._cam_rules.is_due(earlier_state(state, now - evaluated), evaluated, shortest):
                low = self._cam_rules.low_frequency(evaluated)
                messages = [self._message(state, own_body(self._spec, state), now, "cam", low_frequency=low)]
            if not messages:
                continue
            if kind == "cpm" and has_measured and measured < detections.time:
                messages = [replace(message, measured=measured) for message in messages]
            if kind == "cpm" and payloads is not self._sent:
                self._sent = payloads
                messages += self._feature_messages(state, now, payloads)
                for points in payloads:
                    if isinstance(points, PointCloud):
                        messages[0] = replace(messages[0], points=points, size=messages[0].size + points.size)
            self._last_generated[kind] = now
            generated += messages
        if self._offset > 0.0:
            generated = [replace(message, offset=self._offset) for message in generated]
        error = self._clock.error(now)
        return tuple([shift_timestamps(message, error) for message in generated])

    def _feature_messages(self, state: StationState, now: float, payloads: tuple[Payload, ...]) -> list[Message]:
        """Return a message for each frame of a map."""
        name, messages = self._spec.name, list[Message]()
        for frame in payloads:
            if isinstance(frame, FeatureFrame):
                stamped = dataclasses.replace(frame, station=station_id(name))
                size = frame.size + self._settings.security_bytes
                messages.append(
                    Message(
                        name, self.number, now, state, Detections(frame.time), size, kind="features", features=stamped
                    )
                )
                self.number += 1
        return messages

    def _is_due_by_rate(self, now: float) -> bool:
        """Return True if a message is due in this tick, in each tick or at a rate."""
        rate = self._settings.message_rate
        if rate is None:
            return True
        period = math.floor((now - self._first) * rate + 1e-6)
        if period <= self._periods:
            return False
        self._periods = period
        return True

    def _evaluation_time(self, now: float) -> float:
        """Return the time of this tick for the ETSI rules.

        In the first tick after a multiple of their period it is that multiple, as their intervals would otherwise be
        rounded up to time steps.
        """
        self._origin = min(self._origin, now)
        multiple = self._origin + CHECK * math.floor((now - self._origin + EQUAL) / CHECK)
        return multiple if EQUAL < now - multiple < self._dt - EQUAL else now

    def _triggered_cpms(
        self,
        state: StationState,
        detections: Detections,
        numbers: Sequence[int],
        now: float,
        evaluated: float,
        shortest: float,
    ) -> list[Message]:
        """Return the CPMs with the objects that the ETSI rules select, segmented by the MTU."""
        contents = self._cpm_rules.contents(detections, numbers, evaluated, shortest)
        if contents is None:
            return []
        lists_sensors, rows = contents.sensors and bool(self._view), list(contents.rows)
        generated: list[Message] = []
        while rows or not generated:
            sensors = len(self._view) if lists_sensors else 0
            room = objects_that_fit(self._settings.mtu, sensors, self._settings.security_bytes)
            part, rows = rows[:room], rows[room:]
            objects = tuple(numbers[row] for row in part)
            generated.append(
                self._message(state, detections.subset(part), now, objects=objects, lists_sensors=lists_sensors)
            )
            lists_sensors = False
        return generated

    def _message(
        self,
        state: StationState,
        detections: Detections,
        now: float,
        kind: Literal["cpm", "cam"] = "cpm",
        *,
        objects: tuple[int, ...] | None = None,
        lists_sensors: bool = False,
        low_frequency: bool = False,
    ) -> Message:
        """Return the next message, with the size of its encoding if there is an encoder.

        lists_sensors  whether a CPM has sensor information;  low_frequency  whether a CAM has that container
        """
        sensors, security = len(self._view) if lists_sensors else 0, self._settings.security_bytes
        size = cam_size(low_frequency) if kind == "cam" else cpm_size(len(detections), sensors, security)
        view = self._view if lists_sensors else None
        message = Message(
            self._spec.name, self.number, now, state, detections.freeze(), size, kind, objects, sensors=view
        )
        self.number += 1
        if self._encoder is None:
            return message
        encoded = self._encoder.encode(message, low_frequency=low_frequency)
        return replace(message, size=len(encoded) + security)


def own_body(spec: ActorSpec, state: StationState) -> Detections:
    """Return the detection of a station at its transmitted state."""
    cos, sin = math.cos(state.yaw), math.sin(state.yaw)
    ahead, aside, up = spec.offset
    x, y = state.x + cos * ahead - sin * aside, state.y + sin * ahead + cos * aside
    return Detections(
        state.time,
        np.array([[x, y, state.z + up, *spec.size, state.yaw]]),
        np.ones(1),
        (spec.category,),
        np.array([[state.speed * cos, state.speed * sin]]),
        np.full((1, 2, 2), np.nan),
    )
