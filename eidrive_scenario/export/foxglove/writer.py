"""Topics of Foxglove in an MCAP file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

from eidrive_scenario.export.foxglove.log_messages import ACTOR, STATION, json_schema
from eidrive_scenario.export.foxglove.schemas import Foxglove
from eidrive_scenario.export.foxglove.topics import Entry, Topics
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.optional_imports import optional_import
from eidrive_scenario.recording.frame import Frame

_JSON = {"/metrics/actors/": ("eidrive.ActorMetrics", ACTOR), "/metrics/stations/": ("eidrive.StationMetrics", STATION)}
"""Name and fields of the schemas of JSON messages, by the start of the topic."""
_METADATA = ("scenario", "seed", "command", "eidrive-scenario")
"""Entries of the metadata of the run that are copied."""


def write_foxglove(run: RecordedRun, path: Path) -> None:
    """Write a run as an MCAP file with the schemas of Foxglove.

    Raise SettingError if a library is missing, or if the file cannot be written.
    """
    check_foxglove()
    with atomic_output(path) as partial, create(partial) as stream:
        _write(run, stream)


def check_foxglove() -> None:
    """Raise SettingError if a library is missing."""
    Foxglove()
    _register_function()


def _register_function() -> Any:
    return optional_import("mcap_protobuf.schema", "export").register_schema


def _write(run: RecordedRun, stream: BinaryIO) -> None:
    from mcap.writer import CompressionType, Writer

    writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library="eidrive-scenario")
    metadata = run.recording.metadata
    writer.add_metadata("run", {name: metadata[name] for name in _METADATA if name in metadata})
    topics = FoxgloveTopics(writer, run)
    for frame in run.frames():
        topics.add(frame)
    topics.finish()
    writer.finish()  # type: ignore[no-untyped-call]


class FoxgloveTopics:
    """Topics of Foxglove in a file, each registered with its first message.

    writer  writer of an MCAP file
    run     run whose frames are added in order

    Raise SettingError if a library is missing.
    """

    def __init__(self, writer: Any, run: RecordedRun) -> None:
        self._writer = writer
        self._run = run
        self._register = _register_function()
        self._topics = Topics(Foxglove(), run)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._time = 0.0

    def add(self, frame: Frame) -> None:
        """Add the messages of a frame."""
        self._time = frame.view.time
        for entry in self._run.converted(frame, self._topics.of_frame):
            self._add(entry)

    def finish(self) -> None:
        """Add the messages after the last frame."""
        for entry in self._topics.at_end():
            self._add(entry)

    def _add(self, entry: Entry) -> None:
        data = entry.message if isinstance(entry.message, bytes) else entry.message.SerializeToString()
        if entry.topic not in self._channels:
            self._channels[entry.topic] = self._channel(entry)
        instant = max(round(self._time * 1e9), 0)
        self._writer.add_message(self._channels[entry.topic], instant, data, instant)

    def _channel(self, entry: Entry) -> int:
        encoding = "json" if isinstance(entry.message, bytes) else "protobuf"
        number: int = self._writer.register_channel(entry.topic, encoding, self._schema(entry))
        return number

    def _schema(self, entry: Entry) -> int:
        if isinstance(entry.message, bytes):
            name, fields = next(schema for start, schema in _JSON.items() if entry.topic.startswith(start))
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_schema(name, "jsonschema", json_schema(name, fields))
            return self._schemas[name]
        kind = type(entry.message)
        name = kind.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = self._register(self._writer, kind)
        return self._schemas[name]
