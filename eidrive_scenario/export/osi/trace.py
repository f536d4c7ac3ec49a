"""ASAM OSI trace files: multi-channel (MCAP) and single-channel (.osi)."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.export.osi.ground_truth import GroundTruthBuilder, host_vehicle
from eidrive_scenario.export.osi.schemas import Identifiers, Osi, nanoseconds
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
    "lanes and boundaries are in the first GroundTruth only; "
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
    osi = Osi()
    with atomic_output(path) as partial, create(partial) as stream:
        if suffix == SINGLE_CHANNEL:
            _write_single_channel(osi, run, stream)
        else:
            _write_multi_channel(osi, run, stream)


def check_osi() -> None:
    """Raise SettingError if a library is missing."""
    Osi()
    optional_import("mcap_protobuf.schema", "export")


def _write_single_channel(osi: Osi, run: RecordedRun, stream: BinaryIO) -> None:
    builder = GroundTruthBuilder(osi, run.roads, Identifiers(), host_vehicle(run), run.towed, run.axles, run.weather)
    for frame in run.frames():
        for data in run.converted(frame, lambda frame: [builder.build(frame).SerializeToString()]):
            stream.write(struct.pack("<I", len(data)) + data)


def _write_multi_channel(osi: Osi, run: RecordedRun, stream: BinaryIO) -> None:
    from mcap.writer import CompressionType, Writer

    writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library="eidrive-scenario")
    topics = OsiTopics(writer, run, osi)
    for frame in run.frames():
        topics.add(frame)
    writer.finish()  # type: ignore[no-untyped-call]


class OsiTopics:
    """Topics of OSI's multi-channel format in a file, each registered with its first message.

    writer  writer of an MCAP file, which gets the metadata of a trace
    run     run whose frames are added in order

    Raise SettingError if a library is missing.
    """

    def __init__(self, writer: Any, run: RecordedRun, osi: Osi | None = None) -> None:
        self._writer = writer
        self._run = run
        self._osi = osi = osi or Osi()
        self._register = optional_import("mcap_protobuf.schema", "export").register_schema
        self._protobuf = optional_import("google.protobuf", "export").__version__
        self._traces = _Traces(osi, run)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        source = f"eidrive-scenario {run.recording.metadata.get('eidrive-scenario', 'unknown')}"
        metadata = {
            f"{edge}_{name}_version": version
            for edge in ("min", "max")
            for name, version in (("osi", osi.version), ("protobuf", self._protobuf))
        }
        description = {"description": f"{run.title}; {_CONVENTIONS}", "data_sources": source}
        writer.add_metadata(TRACE_METADATA, {"version": osi.version, **metadata, **description})

    def add(self, frame: Frame) -> None:
        """Add the messages of a frame."""
        instant = nanoseconds(frame.view.time)
        for topic, text, message in self._run.converted(frame, self._traces.messages):
            if topic not in self._channels:
                self._channels[topic] = self._channel(topic, text, type(message))
            self._writer.add_message(self._channels[topic], instant, message.SerializeToString(), instant)

    def finish(self) -> None:
        """Do nothing: a trace has no messages after the last frame."""

    def _channel(self, topic: str, text: str, kind: Any) -> int:
        name = kind.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = self._register(self._writer, kind)
        entries = {"osi_version": self._osi.version, "protobuf_version": self._protobuf, "description": text}
        about = {f"{_CHANNEL}.{key}": value for key, value in entries.items()}
        number: int = self._writer.register_channel(topic, "protobuf", self._schemas[name], about)
        return number


class _Traces:
    """All messages of a run with their topics and descriptions."""

    def __init__(self, osi: Osi, run: RecordedRun) -> None:
        self._osi = osi
        self._sensors = Identifiers(_FIRST_SENSOR)
        self._axles = run.axles
        self._truth = GroundTruthBuilder(
            osi, run.roads, Identifiers(), host_vehicle(run), run.towed, self._axles, run.weather
        )
        self._title = run.title
        self._stations: dict[tuple[str, str], SensorDataBuilder] = {}

    def messages(self, frame: Frame) -> Iterator[tuple[str, str, Any]]:
        """Yield topic, description and message of a frame."""
        yield GROUND_TRUTH, f"ground truth of {self._title}", self._truth.build(frame)
        for station in frame.steps:
            for name, text in _LISTS.items():
                key = station, name
                if key not in self._stations:
                    self._stations[key] = SensorDataBuilder(
                        self._osi, self._sensors, station, name, self._axles.get(station)
                    )
                message = self._stations[key].build(frame)
                if message is not None:
                    yield sensor_data_topic(station, name), f"{text} of {station}", message


def sensor_data_topic(station: str, list_name: str) -> str:
    """Return the topic of a station; characters that separate parts of a topic are escaped as in an URL."""
    return f"sensor_data/{quote(station, safe=' ')}/{list_name}"
