"""Trial: one run of a scenario in which receivers under all conditions measure the same frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from lxml import etree

from eidrive_reports.cooperative_perception.receivers import (
    LEAST_EXISTENCE,
    SCAN_RATE,
    Condition,
    Crew,
    Receiver,
    Senders,
    world_points,
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
from eidrive_scenario.api.driving import AgentStep, StackContext, StackInputs, Stations
from eidrive_scenario.api.experiments import resolve_scenario
from eidrive_scenario.api.perception import Readings
from eidrive_scenario.api.run import RunResult, RunSettings, World, run_file

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
    """Receivers under all conditions, and their detections in the measured frames."""

    def __init__(self, crew: Crew, conditions: Sequence[Condition]) -> None:
        self.crew = crew
        self._conditions = conditions
        self._senders: dict[object, Senders] = {}
        self._receivers: dict[str, Receiver] = {}
        self._samples: dict[str, list[tuple[Codes, Codes, Integers]]] = {one.name: [] for one in conditions}
        self._truths: list[Truth] = []
        self._now = 0.0

    def scan(self, view: WorldView, readings: Mapping[str, Readings]) -> None:
        now = self._now = view.time
        if not self._receivers:
            self._senders = {one.senders: Senders(self.crew, *one.senders) for one in self._conditions}
            self._receivers = {one.name: Receiver(self.crew, one) for one in self._conditions}
        sampled = now > FIRST_SAMPLE - TIME_TOLERANCE and _is_multiple(now, SAMPLE_INTERVAL)
        merged = sampled or _is_multiple(now + EARLIER_SCAN, SAMPLE_INTERVAL)
        ego = self.crew.ego
        truth = None
        if sampled:
            truth = true_objects(view, ego, {name: world_points(reading) for name, reading in readings.items()})
            self._truths.append(truth)
        center = view.boxes[view.row(ego), :2]
        messages = {key: senders.messages(readings, now) for key, senders in self._senders.items()}
        for one in self._conditions:
            found = self._receivers[one.name].scan(readings[ego], messages[one.senders], merged=merged)
            if truth is not None:
                self._samples[one.name].append(sample_codes(found, truth, center))

    def record(self) -> PerceptionRecord:
        """Return the measurement of the run up to now."""
        places = [truth.place[truth.counted] for truth in self._truths]
        hit = [truth.place[truth.counted & truth.hit] for truth in self._truths]
        hidden = [truth.place[truth.counted & truth.hidden] for truth in self._truths]
        return PerceptionRecord(
            len(self._truths),
            _by_range(places),
            _by_range(hit),
            _by_range(hidden),
            {one.name: self._tally(one) for one in self._conditions},
        )

    def _tally(self, condition: Condition) -> Tally:
        samples = self._samples[condition.name]
        scores, codes, hidden = zip(*samples, strict=True) if samples else ((), (), ())
        receiver = self._receivers.get(condition.name)
        return Tally(
            b"".join(part.astype("<u2").tobytes() for part in scores),
            b"".join(part.astype("<u2").tobytes() for part in codes),
            tuple(map(tuple, np.sum(hidden, axis=0).tolist())) if samples else (),
            0.0 if receiver is None else receiver.megabytes_per_second(self._now),
        )


class MeasuredStations(Stations):
    """Driving stack of a run whose sensor readings the receivers share. The receivers do not drive."""

    def __init__(self, context: StackContext, ego: str, conditions: Sequence[Condition]) -> None:
        super().__init__(context)
        self.measurement = Measurement(Crew(context, self.settings, ego), conditions)

    def add(self, spec: ActorSpec) -> None:
        super().add(spec)
        if spec.name in self.settings:
            self.measurement.crew.add(spec, self._agents[spec.name].perception.detector)

    def act(self, world: World, view: WorldView, inputs: StackInputs) -> dict[str, AgentStep]:
        """Let the stations act, and all receivers if this is the time of a scan."""
        steps, readings = super().act(world, view, inputs), self.readings
        if readings and all(reading.lidars for reading in readings.values()):
            for name, known in self.measurement.crew.known.items():
                known.update(steps[name].detections, readings[name].ego)
            self.measurement.scan(view, readings)
        return steps


def _is_multiple(time: float, step: float) -> bool:
    return abs(time / step - round(time / step)) * step < TIME_TOLERANCE


def _by_range(places: Sequence[Integers]) -> tuple[int, ...]:
    counts = np.bincount(np.concatenate(places) if places else [], minlength=len(RANGES))
    return tuple(int(count) for count in counts)


def run_trial(
    scenario: str, seed: int, settings: RunSettings, ego: str, conditions: Sequence[Condition]
) -> tuple[RunResult, PerceptionRecord]:
    """Run a scenario of the library with lidars at all stations; return its result and the measurement."""
    stacks: list[MeasuredStations] = []

    def build(context: StackContext) -> MeasuredStations:
        stacks.append(MeasuredStations(context, ego, conditions))
        return stacks[-1]

    assert settings.detector is not None
    properties = {"detector": settings.detector, **PROPERTIES, **DETECTOR_PROPERTIES[settings.detector]}
    result = run_file(with_properties(scenario, properties), seed=seed, settings=settings, stack=build)
    return result, stacks[-1].measurement.record()


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
