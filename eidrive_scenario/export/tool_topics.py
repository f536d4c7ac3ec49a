"""Topics for other tools in a recording: one MCAP file for this package, Foxglove and tools of ASAM OSI."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.export.foxglove.schemas import Foxglove
from eidrive_scenario.export.foxglove.writer import FoxgloveTopics
from eidrive_scenario.export.mcap_topics import ToolTopics, protobuf_registration
from eidrive_scenario.export.osi.schemas import Osi
from eidrive_scenario.export.osi.trace import OsiTopics
from eidrive_scenario.export.recorded_run import RecordedRun, open_run
from eidrive_scenario.files.atomic import atomic_output
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.recording.recorder import Recorder

_TOPICS: Mapping[str, tuple[Callable[[], object], type[ToolTopics]]] = {
    "foxglove": (Foxglove, FoxgloveTopics),
    "osi": (Osi, OsiTopics),
}
"""Message classes, which import the libraries, and topics of a file, by name."""
ALL_TOPICS = tuple(_TOPICS)
"""Names of the topics for other tools."""


def check_topics(names: Iterable[str]) -> tuple[str, ...]:
    """Return these names of topics, each once. Raise SettingError if one is unknown, or if its library is missing."""
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise SettingError(Diagnostic(f"topics is {quoted(names)}", f"give a list of {' and '.join(_TOPICS)}"))
    topics = tuple(dict.fromkeys(names))
    for name in topics:
        if name not in _TOPICS:
            raise SettingError(Diagnostic(f"there are no topics {name!r}", f"give {' or '.join(_TOPICS)}"))
        _TOPICS[name][0]()
        protobuf_registration()
    return topics


def add_topics(recording: str | os.PathLike[str], topics: Iterable[str] = ALL_TOPICS) -> tuple[str, ...]:
    """Add topics for other tools to a recording, given as its file or as the folder of a run.

    topics  `foxglove` and `osi`, all by default; former topics are replaced

    The file is replaced when it is complete, and remains a recording. Return the damage of the recording, and what
    could not be written because of it. Raise InputError if the recording cannot be read, and SettingError for unknown
    topics, a missing library, and a file that cannot be written.
    """
    chosen = check_topics(topics)
    run = open_run(path_argument(recording, "recording"))
    write_with_topics(run, run.recording.path, chosen)
    return tuple(dict.fromkeys(run.warnings))


def write_with_topics(run: RecordedRun, path: Path, topics: Iterable[str] = ALL_TOPICS) -> None:
    """Write a recording with topics for other tools as one MCAP file, which is a recording, too.

    The copy of a damaged recording contains its readable frames, and has no seal. Raise SettingError as `add_topics`.
    """
    source = run.recording
    with atomic_output(path) as partial:
        recorder = Recorder(partial, metadata=source.metadata, attachments=source.attachments)
        try:
            written = [_TOPICS[name][1](recorder.writer, run) for name in topics]
            for frame in run.frames():
                recorder.observe(frame)
                for tool_topics in written:
                    tool_topics.add(frame)
            for tool_topics in written:
                tool_topics.finish()
        finally:
            recorder.close(sealed=not source.damage)
