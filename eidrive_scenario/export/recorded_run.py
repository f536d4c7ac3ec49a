"""Recorded run as the source of exports: frames, roads, and identification of the run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from msgspec import structs

from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.files.bounded import load_json
from eidrive_scenario.recording.frame import Frame, MessagesInFlight
from eidrive_scenario.recording.recording import Recording, open_recording
from eidrive_scenario.recording.run_files import ROAD_FILE, recording_in
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation.recorded_outcome import (
    AxleCenters,
    Body,
    RecordedOutcome,
    recorded_axles,
    recorded_bodies,
    recorded_external_objects,
    recorded_outcome,
    recorded_roles,
    recorded_trailers,
)
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import ABSENT
from eidrive_scenario.world.weather import Weather

Part = TypeVar("Part")


@dataclass
class RecordedRun:
    """Recording with its roads.

    warnings  damage of the recording, and frames that cannot be read; complete after a pass over all frames
    """

    recording: Recording
    roads: RoadNetwork | None
    warnings: list[str] = field(default_factory=list)

    @property
    def title(self) -> str:
        """Scenario and seed in one line."""
        return f"{self.recording.scenario or self.recording.path.stem}, seed {self.recording.seed}"

    @cached_property
    def towed(self) -> Mapping[str, str]:
        """Vehicle categories of the trailers and semitrailers of the scenario, by name."""
        return recorded_trailers(self.recording)

    @cached_property
    def axles(self) -> Mapping[str, AxleCenters]:
        """Axles of the vehicles of the scenario, by name."""
        return recorded_axles(self.recording)

    @cached_property
    def roles(self) -> Mapping[str, str]:
        """Roles of the vehicles of the scenario that have one, by name."""
        return recorded_roles(self.recording)

    @cached_property
    def bodies(self) -> Mapping[str, Body]:
        """Bodies of the actors of the scenario, by name."""
        return recorded_bodies(self.recording)

    @cached_property
    def external_objects(self) -> frozenset[str]:
        """Ids of the objects of the map that are entities of the scenario."""
        return frozenset(recorded_external_objects(self.recording).values())

    @cached_property
    def weather(self) -> Weather | None:
        """Weather of an option that replaces that of the scenario; None without one, and if it cannot be read."""
        try:
            settings = load_json(self.recording.metadata["settings"].encode(), max_depth=30)
            return Weather.model_validate(settings["weather_profile"])
        except (LookupError, TypeError, ValueError):
            return None

    def frames(self) -> Iterator[Frame]:
        """Yield the readable frames. Raise SettingError if there is none."""
        count = 0
        for frame in self.recording.frames(self._skip):
            count += 1
            yield frame
        if not count:
            hint = "; ".join(self.warnings) or "record the run again"
            raise SettingError(Diagnostic("the recording contains no readable frame", hint, str(self.recording.path)))

    @cached_property
    def _lost_in_flight(self) -> frozenset[LinkEvent]:
        in_flight = MessagesInFlight()
        return frozenset(event for frame in self.frames() for event in in_flight.observe(frame))

    def with_losses(self, frame: Frame) -> Frame:
        """Return the frame with losses in place of the messages that are in flight to a station when it leaves."""
        events = (
            event
            if event not in self._lost_in_flight
            else structs.replace(event, outcome="lost", arrives=None, reason=ABSENT)
            for event in frame.links
        )
        return structs.replace(frame, links=tuple(events))

    def outcome(self) -> RecordedOutcome | None:
        """Return the outcome of the run, None if it did not end. One that cannot be read is damage, or InputError."""
        try:
            return recorded_outcome(self.recording)
        except InputError as error:
            if not self.recording.damage:
                raise
            self._skip(f"the outcome of the run is omitted: {error.diagnostics[0]}")
            return None

    def converted(self, frame: Frame, convert: Callable[[Frame], Iterable[Part]]) -> list[Part]:
        """Return the parts of a file for a frame.

        Inconsistent content of a damaged recording gives no part and a warning. Raise InputError for such content of
        an undamaged recording.
        """
        try:
            return list(convert(frame))
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            reason = f"frame {frame.view.tick} cannot be exported: {type(error).__name__}: {error}"[:300]
            if not self.recording.damage:
                raise InputError(Diagnostic(reason, "record the run again", str(self.recording.path))) from error
            self._skip(reason)
            return []

    def _skip(self, reason: str) -> None:
        if reason not in self.warnings:
            self.warnings.append(reason)


def open_run(location: str | os.PathLike[str]) -> RecordedRun:
    """Open a recording, given as its file or as the folder of a run. Raise InputError if it cannot be read.

    Invalid roads of a damaged recording are omitted with a warning.
    """
    recording = open_recording(recording_in(Path(location)))
    warnings = [f"the recording is damaged: {line}" for line in recording.damage]
    text = recording.attachments.get(ROAD_FILE)
    roads = None
    if text is not None:
        try:
            roads = RoadNetwork.parse(text, ROAD_FILE)
        except InputError as error:
            warnings.append(f"the roads are omitted: {error.diagnostics[0]}")
    return RecordedRun(recording, roads, warnings)
