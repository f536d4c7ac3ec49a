"""Search and reading of the files of earlier runs: results and recordings."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.atomic import PARTIAL, partial_path
from eidrive_scenario.files.bounded import load_json, read_regular_file

RECORDING, RESULT, IMAGES = "recording.mcap", "result.json", "images"
"""Names of the files in the folder of a run."""
SCENARIO_FILE, ROAD_FILE = "scenario.xosc", "road.xodr"
"""Names of the scenario and its road in the attachments of a recording."""
_LARGEST = 256 * 2**20
"""Maximum size of a result [bytes]."""
MAX_DEPTH = 40
"""Maximum nesting depth of a result and of settings."""


class RecordMode(StrEnum):
    """Runs whose recording and camera images are kept."""

    ALWAYS = "always"
    ON_FAILURE = "on-failure"
    NEVER = "never"


def recording_in(location: Path) -> Path:
    """Return the recording of a run folder, or the only recording below it; a file is returned unchanged.

    If a run did not end, its partial recording is returned. Raise InputError if there is no recording, or several.
    """
    path, *others = paths = recordings_in(location)
    if others:
        listed = ", ".join(str(path.parent.relative_to(location)) for path in paths[:5])
        more = f" and {len(paths) - 5} more" if len(paths) > 5 else ""
        message = f"{len(paths)} recordings are below this folder"
        raise InputError(Diagnostic(message, f"give one of its folders: {listed}{more}", str(location)))
    return path


def recordings_in(location: Path) -> list[Path]:
    """Return the recording of a run folder, or all recordings below it, as `recording_in`, at least one."""
    if not os.path.isdir(location):
        return [location]
    for path in (location / RECORDING, partial_path(location / RECORDING)):
        if path.is_file():
            return [path]
    if paths := [path for path in _recordings_below(location) if path.is_file()]:
        return paths
    message = f"no {RECORDING} in this folder"
    raise InputError(Diagnostic(message, "eidrive run … --out DIR writes a recording", str(location)))


def _recordings_below(folder: Path) -> list[Path]:
    """Return the recording of each folder; a partial one only without a complete one."""
    by_folder: dict[Path, Path] = {}
    for path in sorted([*folder.rglob(partial_path(Path(RECORDING)).name), *folder.rglob(RECORDING)]):
        if path.name == RECORDING or path.parent not in by_folder:
            by_folder[path.parent] = path
    return list(by_folder.values())


def is_partial(recording: Path) -> bool:
    """True if the name of the recording marks a run that did not end."""
    return recording.stem.endswith(PARTIAL)


def result_of(recording: Path) -> dict[str, Any] | None:
    """Return the result of the run of this recording, or None without a result in its folder.

    Raise InputError for a file that is not a result.
    """
    beside = recording.with_name(RESULT)
    return read_result(beside) if recording.name == RECORDING and beside.exists() else None


def result_paths(locations: Sequence[Path]) -> Iterator[Path]:
    """Yield the result files in these files and folders, including subfolders, each file once."""
    taken = set()
    for location in locations:
        for path in sorted(location.rglob(RESULT)) if os.path.isdir(location) else [location]:
            real = os.path.realpath(path)
            if real not in taken:
                taken.add(real)
                yield path


def unfinished_runs(locations: Sequence[Path]) -> Iterator[Path]:
    """Yield the partial recordings without a result in these folders, including subfolders."""
    for location in locations:
        for path in sorted(location.rglob(partial_path(Path(RECORDING)).name)) if os.path.isdir(location) else ():
            if not path.with_name(RESULT).exists():
                yield path


def read_result(path: Path) -> dict[str, Any]:
    """Read a result as JSON values. Raise InputError if the file is not a result."""
    try:
        data = read_regular_file(path, _LARGEST)
        result = load_json(data, max_depth=MAX_DEPTH)
    except OSError as error:
        raise InputError(Diagnostic(f"cannot read: {error.strerror}", f"give a {RESULT}", str(path))) from error
    except ValueError as error:
        raise InputError(Diagnostic(f"not JSON: {error}", f"give a {RESULT}", str(path))) from error
    if not isinstance(result, dict) or "trace_hash" not in result:
        raise InputError(Diagnostic("not the result of a run", "give a file that eidrive run --out wrote", str(path)))
    return result
