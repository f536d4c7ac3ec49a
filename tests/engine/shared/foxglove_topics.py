"""Topics of Foxglove in MCAP files, decoded with their published schemas."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from written_recording import write_run

from eidrive_scenario.export.foxglove.writer import write_foxglove
from eidrive_scenario.recording.frame import Frame

Topics = Mapping[str, list[Any]]


def decoded(path: Path) -> tuple[Topics, dict[str, str]]:
    """Return the messages and the schema of each topic. JSON messages are decoded as such."""
    topics: dict[str, list[Any]] = {}
    schemas: dict[str, str] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            schemas[channel.topic] = schema.name
            if channel.message_encoding == "json":
                value = json.loads(message.data)
            else:
                decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
                assert decode is not None
                value = decode(message.data)
            topics.setdefault(channel.topic, []).append(value)
    return topics, schemas


def exported(folder: Path, *frames: Frame, road: Path | None = None) -> Topics:
    write_foxglove(write_run(folder, frames, road=road), folder / "f.mcap")
    return decoded(folder / "f.mcap")[0]


def point(found: Any) -> list[float]:
    return [found.x, found.y, found.z]
