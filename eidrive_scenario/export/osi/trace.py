"""ASAM OSI trace files: multi-channel (MCAP) and single-channel (.osi)."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.export.mcap_topics import ToolTopics, write_topics
from eidrive_scenario.export.osi.ground_truth import GroundTruthBuilder
from eidrive_scenario.export.osi.schemas import Identifiers, Osi
from eidrive_scenario.export.osi.sensor_data import SensorDataBuilder
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import TRACE_METADATA

MULTI_CHANNEL, SINGLE_CHANNEL = ".mcap", ".osi"
"""Suffixes of the two formats of the standard."""
GROUND_TRUTH = "ground_truth"
"""Topic of the GroundTruth messages."""
_FIRST_SENSOR = 2**32 + 1
"""First identifier of sensors. Identifiers of the ground truth are below it, equal in both formats."""
_CHANNEL = f"{TRACE_METADATA}.channel"
_LISTS: Mapping[str, str] = {"detections": "own detections", "fused": "objects after fusion"}
"""Object lists of a station, with their descriptions."""
_CONVENTIONS = (
    "lanes, boundaries, signs and stationary objects are in the first GroundTruth only; "
    "bbcenter_to_rear of vehicles of background traffic points to the ground below the rear axle"
)


def write_osi(run: RecordedRun, path: Path) -> None:
    """Write a run as an OSI trace: `.mcap` with ground truth and sensor data, `.osi` with ground truth only.

    Raise SettingError for another suffix, if osi-python is missing, or if the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in (MULTI_CHANNEL, SINGLE_CHANNEL):
        message = f"an OSI trace has no suffix {path.suffix!r}"
        hint = f"give a file *{MULTI_CHANNEL} (multi-channel) or *{SINGLE_CHANNEL} (single-channel)"
        raise SettingError(Diagnostic(message, hint, str(path)))
    if suffix == MULTI_CHANNEL:
        write_topics(run, path, OsiTopics)
        return
    builder = GroundTruthBuilder(Osi(), run)
    with atomic_output(path) as partial, create(partial) as stream:
        for frame in run.frames():
            for data in run.converted(frame, lambda frame: [builder.build(frame).SerializeToString()]):
                stream.write(struct.pack("<I", len(data)) + data)


class OsiTopics(ToolTopics):
    """Topics of OSI's multi-channel format in a file, which gets the metadata of a trace."""

    def __init__(self, writer: Any, run: RecordedRun) -> None:
        super().__init__(writer, run)
        self._osi = osi = Osi()
        self._truth = GroundTruthBuilder(osi, run)
        self._sensors = Identifiers(_FIRST_SENSOR)
        self._stations: dict[tuple[str, str], SensorDataBuilder] = {}
        protobuf = optional_import("google.protobuf", "export").__version__
        self._versions = {"osi_version": osi.version, "protobuf_version": protobuf}
        limits = {f"{edge}_{name}": version for edge in ("min", "max") for name, version in self._versions.items()}
        source = f"eidrive-scenario {run.recording.metadata.get('eidrive-scenario', 'unknown')}"
        description = {"description": f"{run.title}; {_CONVENTIONS}", "data_sources": source}
        writer.add_metadata(TRACE_METADATA, {"version": osi.version, **limits, **description})

    def add(self, frame: Frame) -> None:
        """Add the messages of a frame."""
        for topic, description, message in self._run.converted(frame, self._messages):
            about = {f"{_CHANNEL}.{key}": text for key, text in (*self._versions.items(), ("description", description))}
            self.write(topic, message, frame.view.time, about)

    def _messages(self, frame: Frame) -> Iterator[tuple[str, str, Any]]:
        """Yield topic, description and message of a frame."""
        yield GROUND_TRUTH, f"ground truth of {self._run.title}", self._truth.build(frame)
        for station in frame.steps:
            for name, text in _LISTS.items():
                if (station, name) not in self._stations:
                    axles = self._run.axles.get(station)
                    builder = SensorDataBuilder(self._osi, self._sensors, station, name, axles)
                    self._stations[station, name] = builder
                message = self._stations[station, name].build(frame)
                if message is not None:
                    yield sensor_data_topic(station, name), f"{text} of {station}", message


def sensor_data_topic(station: str, list_name: str) -> str:
    """Return the topic of a station; characters that separate parts of a topic are escaped as in an URL."""
    return f"sensor_data/{quote(station, safe=' ')}/{list_name}"
