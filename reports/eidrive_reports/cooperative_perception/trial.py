"""Trial: one run of a scenario in which receivers under all conditions measure the same frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from lxml import etree

from eidrive_reports.cooperative_perception.receivers import (
    LEAST_EXISTENCE,
    SCAN_RATE,
    AgentFactory,
    Condition,
    Receiver,
    Reception,
    SenderSettings,
)
from eidrive_reports.cooperative_perception.scores import (
    RANGES,
    Codes,
    PerceptionRecord,
    Tally,
    Truth,
    sample_codes,
    true_objects,
)
from eidrive_scenario.api.common import TIME_TOLERANCE, ActorSpec, Integers, WorldView
from eidrive_scenario.api.driving import Agent, AgentStep, StackContext, StackInputs, Stations
from eidrive_scenario.api.experiments import resolve_scenario
from eidrive_scenario.api.perception import Readings
from eidrive_scenario.api.run import RunResult, RunSettings, World, run_file
from eidrive_scenario.api.v2x import Message

FIRST_SAMPLE = 1.0
"""Time of the first measured frame [s]: messages with the largest latency have arrived."""
SAMPLE_INTERVAL = 0.5
"""Time between measured frames [s]."""
EARLIER_SCAN = 0.2
"""Time before a measured frame of the other scan that a detector uses in addition [s]."""
PROPERTIES = {
    "tracker": "none",
    "sensors": f"{{lidar: {{rate: {SCAN_RATE:g}, rotation: {SCAN_RATE:g}, range: 100}}}}",
}
"""Properties of all stations: detections of single scans, as the field measures them."""
DETECTOR_PROPERTIES: Mapping[str, Mapping[str, str]] = {
    "lidar": {},
    "pillars": {"detector_settings": f"{{confidence: {LEAST_EXISTENCE:g}}}"},
}
"""Further properties by detector: unlikely objects are part of the curve."""


class Measurement:
    """Receivers under all conditions, and their detections in the measured frames.

    truths      road users in the measured frames
    view        true state at the last scan; None before the first one
    receptions  those of the last scan, by condition
    """

    def __init__(self, factory: AgentFactory, conditions: Sequence[Condition]) -> None:
        self.factory = factory
        self.truths: list[Truth] = []
        self.view: WorldView | None = None
        self.receptions: dict[Condition, Reception] = {}
        self._conditions = conditions
        self._senders: dict[SenderSettings, dict[str, Agent]] = {}
        self._receivers: dict[Condition, Receiver] = {}
        self._samples: dict[Condition, list[tuple[Codes, Codes, Integers]]] = {
            condition: [] for condition in conditions
        }

    def scan(self, view: WorldView, readings: Mapping[str, Readings]) -> None:
        self.view, now = view, view.time
        if not self._receivers:
            self._receivers = {condition: Receiver(self.factory, condition) for condition in self._conditions}
            sending = dict.fromkeys(condition.senders for condition in self._conditions)
            self._senders = {settings: self.factory.sending_agents(settings) for settings in sending}
        sampled = now > FIRST_SAMPLE - TIME_TOLERANCE and _is_multiple(now, SAMPLE_INTERVAL)
        merged = sampled or _is_multiple(now + EARLIER_SCAN, SAMPLE_INTERVAL)
        ego = self.factory.ego
        truth = None
        if sampled:
            clouds = {
                name: np.concatenate([lidar.world_points for lidar in reading.lidars.values()])
                for name, reading in readings.items()
            }
            truth = true_objects(view, ego, clouds)
            self.truths.append(truth)
        center = view.boxes[view.row(ego), :2]
        messages: dict[SenderSettings, list[Message]] = {}
        for settings, agents in self._senders.items():
            steps = [agent.act(readings[name], (), now, None) for name, agent in agents.items()]
            messages[settings] = [message for step in steps for message in step.outbox]
        for condition, receiver in self._receivers.items():
            reception = receiver.scan(readings[ego], messages[condition.senders], merged=merged)
            self.receptions[condition] = reception
            if truth is not None:
                self._samples[condition].append(sample_codes(reception.objects, truth, center))

    def record(self) -> PerceptionRecord:
        """Return the measurement of the run up to now."""
        truths = self.truths
        return PerceptionRecord(
            len(truths),
            _by_range([truth.range_classes[truth.counted] for truth in truths]),
            _by_range([truth.range_classes[truth.counted & truth.hit] for truth in truths]),
            _by_range([truth.range_classes[truth.counted & truth.hidden] for truth in truths]),
            {condition.name: self._tally(condition) for condition in self._conditions},
        )

    def _tally(self, condition: Condition) -> Tally:
        samples = self._samples[condition]
        scores, codes, hidden = zip(*samples, strict=True) if samples else ((), (), ())
        receiver = self._receivers.get(condition)
        return Tally(
            b"".join(part.astype("<u2").tobytes() for part in scores),
            b"".join(part.astype("<u2").tobytes() for part in codes),
            tuple(map(tuple, np.sum(hidden, axis=0).tolist())) if samples else (),
            0.0 if receiver is None or self.view is None else receiver.megabytes_per_second(self.view.time),
        )


class MeasuredStations(Stations):
    """Driving stack of a run whose sensor readings the receivers share. The receivers do not drive."""

    def __init__(self, context: StackContext, ego: str, conditions: Sequence[Condition]) -> None:
        super().__init__(context)
        self.measurement = Measurement(AgentFactory(context, self.settings, ego), conditions)

    def add(self, spec: ActorSpec) -> None:
        super().add(spec)
        if spec.name in self.settings:
            self.measurement.factory.add(spec, self._agents[spec.name].perception.detector)

    def act(self, world: World, view: WorldView, inputs: StackInputs) -> dict[str, AgentStep]:
        """Let the stations act, and all receivers if this is the time of a scan."""
        steps, readings = super().act(world, view, inputs), self.readings
        if readings and all(reading.lidars for reading in readings.values()):
            for name, detector in self.measurement.factory.detectors.items():
                detector.update(steps[name].detections, readings[name].ego)
            self.measurement.scan(view, readings)
        return steps


def _is_multiple(time: float, step: float) -> bool:
    return abs(time / step - round(time / step)) * step < TIME_TOLERANCE


def _by_range(classes: Sequence[Integers]) -> tuple[int, ...]:
    counts = np.bincount(np.concatenate(classes) if classes else [], minlength=len(RANGES))
    return tuple(int(count) for count in counts)


def run_trial(
    scenario: str, seed: int, settings: RunSettings, ego: str, conditions: Sequence[Condition]
) -> tuple[RunResult, Measurement]:
    """Run a scenario of the library with lidars at all stations; return its result and the measurement."""
    stacks: list[MeasuredStations] = []

    def build(context: StackContext) -> MeasuredStations:
        stacks.append(MeasuredStations(context, ego, conditions))
        return stacks[-1]

    assert settings.detector is not None
    properties = {"detector": settings.detector, **PROPERTIES, **DETECTOR_PROPERTIES[settings.detector]}
    result = run_file(with_properties(scenario, properties), seed=seed, settings=settings, stack=build)
    return result, stacks[-1].measurement


def with_properties(scenario: str, properties: Mapping[str, str]) -> bytes:
    """Return a scenario of the library as XML, with these properties of all its stations."""
    root = etree.fromstring(resolve_scenario(scenario).read_bytes())
    for tag, attribute in (("Directory", "path"), ("LogicFile", "filepath")):
        for element in root.iter(tag):
            element.set(attribute, element.get(attribute, "").replace("../", "eidrive_library/", 1))
    for controller in root.iter("Properties"):
        held = {entry.get("name"): entry for entry in controller.iter("Property")}
        if "module" not in held or held["module"].get("value") != "eidrive":
            continue
        for name, value in properties.items():
            if name in held:
                controller.remove(held[name])
            etree.SubElement(controller, "Property", name=name, value=value)
    return etree.tostring(root)
