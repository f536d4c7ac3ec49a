"""Outcome of a run in its recording: verdicts, metrics and link statistics, without loss."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from eidrive_scenario.base.content_digest import canonical_json
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.evaluation.criteria_parser import CriteriaContext
from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.files.bounded import load_json
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import Axles, MiscObject, ParameterType, Pedestrian, Vehicle
from eidrive_scenario.openscenario.model.entity_enumerations import VehicleCategory
from eidrive_scenario.openscenario.values.parameters import TYPES, Parameter, Scope, fits_type
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import CHUNK_SIZE, Recorder
from eidrive_scenario.recording.run_files import ROAD_FILE
from eidrive_scenario.simulation.commands import criteria_context
from eidrive_scenario.simulation.result import RunResult
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics
from eidrive_scenario.world.actor import ExtraAxle, Vector3
from eidrive_scenario.world.specs import actor_spec

if TYPE_CHECKING:
    from eidrive_scenario.recording.recording import Recording

_Entry = TypeVar("_Entry")

OUTCOME = "outcome.json"
"""Name of the attachment with the outcome."""
CONTEXT = "criteria_context"
"""Entry of the metadata with the names of the scenario to which criteria refer."""
PARAMETER_TYPES = "parameter_types"
"""Entry of the metadata with the types of the parameters of the scenario, by name."""
TRAILERS = "trailers"
"""Entry of the metadata with the vehicle categories of trailers and semitrailers, by name."""
ROLES = "roles"
"""Entry of the metadata with the roles of the vehicles that have one in the scenario, by name."""
AXLES = "axles"
"""Entry of the metadata with the axles of the vehicles of the scenario, by name."""
EXTERNAL_OBJECTS = "external_objects"
"""Entry of the metadata with the ids of the road objects that are entities of the scenario, by the entity."""

BODIES = "bodies"
"""Entry of the metadata with the bodies of the actors of the scenario, by name."""


@dataclass(frozen=True)
class Body:
    """Part of the specification of an actor (`ActorSpec`) on which its model in pictures depends beside its box."""

    shape: str
    color: Vector3 | None = None
    wheelbase: float = 0.0
    wheel_radius: float = 0.3
    extra_axles: tuple[ExtraAxle, ...] = ()


@dataclass(frozen=True)
class AxleWheels:
    """Wheels of an axle: x and z from the reference point, track width, and diameter [m]."""

    x: float
    z: float
    track: float
    diameter: float


@dataclass(frozen=True)
class AxleCenters:
    """Centers of the axles of a vehicle: x and z from the reference point [m].

    front   None without a front axle, as of trailers
    wheels  of all axles from the front to the rear; empty in recordings that lack them
    """

    rear: tuple[float, float]
    front: tuple[float, float] | None
    wheels: tuple[AxleWheels, ...] = ()


@dataclass(frozen=True)
class RecordedLink:
    """Statistics of the link between two stations."""

    sender: str
    receiver: str
    statistics: LinkStatistics


@dataclass(frozen=True)
class RecordedOutcome:
    """Part of the result of a run that equal runs share; the metadata of the recording contain its settings."""

    passed: bool
    end_reason: str
    exit_code: int
    criteria: tuple[Verdict, ...]
    metrics: Mapping[str, float]
    links: tuple[RecordedLink, ...]
    final_state: tuple[str, ...]
    warnings: tuple[str, ...]
    trace_hash: str
    simulated_s: float
    final_links: tuple[LinkEvent, ...] = ()


class RunRecorder(Recorder):
    """Recorder of a run in progress, which attaches the outcome of a completed run.

    Frames are written several at a time, after at most a second of simulated time or about one chunk of the file. This
    takes less time than to encode each frame in its tick, and a killed process loses no more than with `Recorder`.

    at_once  write each frame in its tick, as necessary if code of others may change the arrays of a frame later
    """

    def __init__(
        self,
        path: str | Path,
        *,
        metadata: Mapping[str, str],
        attachments: Mapping[str, bytes] | None = None,
        at_once: bool = False,
    ) -> None:
        super().__init__(path, metadata=metadata, attachments=attachments)
        self._at_once = at_once
        self._waiting: deque[Frame] = deque()
        self._most = 1

    def observe(self, frame: Frame) -> None:
        """Append one frame. Raise SimulationError if the file is closed: each run needs its own recorder."""
        self.check_open()
        self._waiting.append(frame)
        if self._at_once or len(self._waiting) >= self._most or self.is_due(frame):
            self._write_waiting()

    def _write_waiting(self) -> None:
        size, count = 0, len(self._waiting)
        # One by one: an interruption loses one frame, and the others are written at the end
        while self._waiting:
            size += self.write(self._waiting.popleft())
        if size:
            self._most = max(CHUNK_SIZE * count // size, 1)

    def conclude(self, result: RunResult) -> None:
        """Attach the outcome."""
        self._write_waiting()
        links = (RecordedLink(*stations, statistics) for stations, statistics in result.links.items())
        outcome = RecordedOutcome(
            bool(result.passed),
            result.end_reason,
            result.exit_code,
            tuple(map(plain_verdict, result.criteria)),
            {name: float(value) for name, value in result.metrics.items()},
            tuple(links),
            result.final_state,
            result.warnings,
            result.trace_hash,
            result.simulated_s,
            result.final_links,
        )
        text = json.dumps(codec(RecordedOutcome).encode(outcome), ensure_ascii=False, allow_nan=False)
        self.attach(OUTCOME, text.encode())

    def close(self, *, sealed: bool = True) -> None:
        """Write the last frames, and finish the file. A second call has no effect."""
        try:
            self._write_waiting()
        finally:
            super().close(sealed=sealed)


def plain_verdict(verdict: Verdict) -> Verdict:
    """Return a verdict with numbers of Python instead of those of numpy, which some criteria return."""
    numbers = {name: getattr(verdict, name) for name in ("value", "limit", "first_violation")}
    plain: dict[str, Any] = {name: None if number is None else float(number) for name, number in numbers.items()}
    return replace(verdict, passed=bool(verdict.passed), fatal=bool(verdict.fatal), **plain)


def scenario_metadata(scenario: Scenario) -> dict[str, str]:
    """Return the entries of the metadata of a run about its scenario.

    They are `CONTEXT`, `PARAMETER_TYPES` if there are parameters, `TRAILERS` and `ROLES` if a vehicle has one, `AXLES`
    if there are vehicles, `EXTERNAL_OBJECTS` if there are any, and `BODIES`.
    """
    metadata = {CONTEXT: canonical_json(codec(CriteriaContext).encode(criteria_context(scenario)))}
    if types := {name: kind.value for name, kind in scenario.parameter_types.items()}:
        metadata[PARAMETER_TYPES] = canonical_json(types)
    vehicles = {name: entity for name, entity in scenario.entities.items() if isinstance(entity, Vehicle)}
    towed = (VehicleCategory.TRAILER, VehicleCategory.SEMITRAILER)
    trailers = {
        name: vehicle.vehicle_category.value for name, vehicle in vehicles.items() if vehicle.vehicle_category in towed
    }
    if trailers:
        metadata[TRAILERS] = canonical_json(trailers)
    if roles := {name: role.value for name, car in vehicles.items() if (role := car.role or car.vehicle_role)}:
        metadata[ROLES] = canonical_json(roles)
    if vehicles:
        centers = {name: _axle_centers(vehicle.axles) for name, vehicle in vehicles.items()}
        metadata[AXLES] = canonical_json(codec(Mapping[str, AxleCenters]).encode(centers))
    if scenario.external:
        metadata[EXTERNAL_OBJECTS] = canonical_json({name: entity.name for name, entity in scenario.external.items()})
    return metadata | {BODIES: canonical_json(codec(Mapping[str, Body]).encode(bodies(scenario)))}


def bodies(scenario: Scenario) -> dict[str, Body]:
    """Return the bodies of the vehicles, pedestrians and other objects of a scenario, by name."""
    specs = {
        name: actor_spec(name, entity)
        for name, entity in scenario.entities.items()
        if isinstance(entity, Vehicle | Pedestrian | MiscObject)
    }
    return {
        name: Body(spec.shape, spec.color, spec.wheelbase, spec.wheel_radius, spec.extra_axles)
        for name, spec in specs.items()
    }


def _axle_centers(axles: Axles) -> AxleCenters:
    rear, front = axles.rear_axle, axles.front_axle
    every = (rear, *axles.additional_axle) if front is None else (front, rear, *axles.additional_axle)
    wheels = (AxleWheels(axle.position_x, axle.position_z, axle.track_width, axle.wheel_diameter) for axle in every)
    return AxleCenters(
        (rear.position_x, rear.position_z),
        None if front is None else (front.position_x, front.position_z),
        tuple(sorted(wheels, key=lambda axle: -axle.x)),
    )


def recorded_axles(recording: Recording) -> Mapping[str, AxleCenters]:
    """Return the axles of vehicles by name. Those of an older or damaged recording are unknown."""
    return _metadata(recording, AXLES, Mapping[str, AxleCenters], {})


def recorded_bodies(recording: Recording) -> Mapping[str, Body]:
    """Return the bodies of actors by name. Those of an older or damaged recording are unknown."""
    return _metadata(recording, BODIES, Mapping[str, Body], {})


def recorded_trailers(recording: Recording) -> Mapping[str, str]:
    """Return the vehicle categories of trailers by name. Those of an older or damaged recording are unknown."""
    return _metadata(recording, TRAILERS, Mapping[str, str], {})


def recorded_roles(recording: Recording) -> Mapping[str, str]:
    """Return the roles of vehicles by name. Those of an older or damaged recording are unknown."""
    return _metadata(recording, ROLES, Mapping[str, str], {})


def recorded_external_objects(recording: Recording) -> Mapping[str, str]:
    """Return the ids of road objects that are entities, by the entity; unknown in an older or damaged recording."""
    return _metadata(recording, EXTERNAL_OBJECTS, Mapping[str, str], {})


def recorded_context(recording: Recording) -> CriteriaContext:
    """Return the names to which criteria on a recording refer. Those of an older or damaged recording are unknown."""
    context = _metadata(recording, CONTEXT, CriteriaContext, CriteriaContext())
    return replace(context, has_roads=ROAD_FILE in recording.attachments)


def recorded_scope(recording: Recording) -> Scope:
    """Return the parameters of the run to which criteria on a recording refer. Those of a damaged one are unknown.

    Older recordings lack their types, and all are texts.
    """
    texts: Mapping[str, str] = _metadata(recording, "parameters", Mapping[str, str], {})
    types: Mapping[str, ParameterType] = _metadata(recording, PARAMETER_TYPES, Mapping[str, ParameterType], {})
    parameters = {}
    for name, text in texts.items():
        scalar = TYPES[types.get(name, ParameterType.STRING)]
        # As in the run, where a default of another type makes the parameter a text
        value = scalar.convert(text) if fits_type(text, scalar) else text
        parameters[name] = Parameter(name, text, value, text)
    return Scope(parameters=parameters)


def _metadata(recording: Recording, name: str, kind: Any, unknown: _Entry) -> _Entry:
    """Return a decoded entry of the metadata, or what stands for that of an older or damaged recording."""
    try:
        entry: _Entry = codec(kind).decode(load_json(recording.metadata[name].encode()))
    except (AttributeError, LookupError, TypeError, ValueError):
        return unknown
    return entry


def recorded_outcome(recording: Recording) -> RecordedOutcome | None:
    """Return the outcome of a recorded run, or None if the run did not end or was recorded by an older version.

    Raise InputError if the attachment is not an outcome.
    """
    data = recording.attachments.get(OUTCOME)
    if data is None:
        return None
    try:
        outcome: RecordedOutcome = codec(RecordedOutcome).decode(load_json(data))
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        message = f"{OUTCOME} cannot be decoded: {type(error).__name__}: {error}"[:200]
        hint = f"read it with the version that wrote it ({recording.metadata.get('eidrive-scenario', 'unknown')})"
        raise InputError(Diagnostic(message, hint, str(recording.path))) from error
    return outcome
