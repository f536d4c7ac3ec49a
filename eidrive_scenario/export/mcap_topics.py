"""Topics for another tool in an MCAP file, each registered with its first message."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.recording.frame import Frame


class ToolTopics(ABC):
    """Topics of one tool in a file.

    writer  writer of an MCAP file
    run     run whose frames are added in order

    Raise SettingError if a library is missing.
    """

    def __init__(self, writer: Any, run: RecordedRun) -> None:
        self._writer = writer
        self._run = run
        self._register = protobuf_registration()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    @abstractmethod
    def add(self, frame: Frame) -> None:
        """Add the messages of a frame."""

    def finish(self) -> None:  # noqa: B027 - a tool without messages after the last frame inherits this
        """Add the messages after the last frame."""

    def write(self, topic: str, message: Any, time: float, about: Mapping[str, str] = MappingProxyType({})) -> None:
        """Write a message of protobuf, or the bytes of a JSON text, at a time [s].

        about  metadata of the topic
        """
        encoding = "json" if isinstance(message, bytes) else "protobuf"
        if topic not in self._channels:
            schema = self._schema(topic, message)
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema, dict(about))
        instant = nanoseconds(time)
        data = message if isinstance(message, bytes) else message.SerializeToString()
        self._writer.add_message(self._channels[topic], instant, data, instant)

    def _schema(self, topic: str, message: Any) -> int:
        """Return the number of the schema of a message, which is registered once."""
        name = type(message).DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = self._register(self._writer, type(message))
        return self._schemas[name]


def protobuf_registration() -> Any:
    """Return the function that registers the schema of a message. Raise SettingError if its library is missing."""
    return optional_import("mcap_protobuf.schema", "export").register_schema


def nanoseconds(time: float) -> int:
    """Return a time [s] in nanoseconds, at least 0."""
    return max(round(time * 1e9), 0)


def write_topics(
    run: RecordedRun,
    path: Path,
    topics: Callable[[Any, RecordedRun], ToolTopics],
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write the topics of one tool as an MCAP file. Raise SettingError if it cannot be written.

    metadata  record about the run
    """
    from mcap.writer import CompressionType, Writer

    with atomic_output(path) as partial, create(partial) as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile="", library="eidrive-scenario")
        if metadata is not None:
            writer.add_metadata("run", dict(metadata))
        tool_topics = topics(writer, run)
        for frame in run.frames():
            tool_topics.add(frame)
        tool_topics.finish()
        writer.finish()  # type: ignore[no-untyped-call]
