"""MCAP file with the topics of Foxglove."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

from eidrive_scenario.export.foxglove.metrics import ACTOR, STATION, json_schema
from eidrive_scenario.export.foxglove.schemas import Foxglove
from eidrive_scenario.export.foxglove.topics import Entry, Topics
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.optional_imports import optional_import

_JSON = {"/metrics/actors/": ("eidrive.ActorMetrics", ACTOR), "/metrics/stations/": ("eidrive.StationMetrics", STATION)}
"""Name and fields of the schemas of JSON messages, by the start of the topic."""
_METADATA = ("scenario", "seed", "command", "eidrive-scenario")
"""Entries of the metadata of the run that are copied."""


def write_foxglove(run: RecordedRun, path: Path) -> None:
    """Write a run as an MCAP file with the schemas of Foxglove.

    Raise SettingError if a library is missing, or if the file cannot be written.
    """
    foxglove = Foxglove()
    register = optional_import("mcap_protobuf.schema", "export").register_schema
    with atomic_output(path) as partial, create(partial) as stream:
        _write(foxglove, run, stream, register)


def _write(foxglove: Foxglove, run: RecordedRun, stream: BinaryIO, register: Any) -> None:
    from mcap.writer import CompressionType, Writer

    writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library="eidrive-scenario")
    metadata = run.recording.metadata
    writer.add_metadata("run", {name: metadata[name] for name in _METADATA if name in metadata})
    file = _Channels(writer, register)
    topics = Topics(foxglove, run)
    time = 0.0
    for frame in run.frames():
        time = frame.view.time
        for entry in run.converted(frame, topics.of_frame):
            file.add(entry, time)
    for entry in topics.at_end():
        file.add(entry, time)
    writer.finish()  # type: ignore[no-untyped-call]


class _Channels:
    """Channels of a file, each registered with its first message."""

    def __init__(self, writer: Any, register: Any) -> None:
        self._writer = writer
        self._register = register
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def add(self, entry: Entry, time: float) -> None:
        """Add a message at a time [s]."""
        data = entry.message if isinstance(entry.message, bytes) else entry.message.SerializeToString()
        if entry.topic not in self._channels:
            self._channels[entry.topic] = self._channel(entry)
        instant = max(round(time * 1e9), 0)
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
