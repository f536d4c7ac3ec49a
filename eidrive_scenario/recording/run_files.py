"""Finding and reading what runs have left: results and recordings."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.atomic import PARTIAL, partial_path
from eidrive_scenario.files.bounded import read_regular_file
from eidrive_scenario.files.bounded_json import load_json

RECORDING, RESULT, IMAGES = "recording.mcap", "result.json", "images"
"""Names of the files in a run's folder."""
_LARGEST = 256 * 2**20
"""Maximum size of a result [bytes]."""
_DEEPEST = 40
"""Maximum nesting of a result."""


def recording_in(place: Path) -> Path:
    """The recording in a run's folder, or the only one below it; a file as it is.

    Where a run did not end, it is the partial recording. Raises InputError if there is none, or more than one.
    """
    if not os.path.isdir(place):
        return place
    for found in ([place / RECORDING, partial_path(place / RECORDING)], _recordings_below(place)):
        paths = [path for path in found if path.is_file()]
        if len(paths) == 1 or (paths and paths[0].parent == place):
            return paths[0]
        if paths:
            listed = ", ".join(str(path.parent.relative_to(place)) for path in paths[:5])
            more = f" and {len(paths) - 5} more" if len(paths) > 5 else ""
            what = f"{len(paths)} recordings are below this folder"
            raise InputError(Diagnostic(what, f"give one of its folders: {listed}{more}", str(place)))
    raise InputError(Diagnostic(f"no {RECORDING} in this folder", "eidrive run … --out DIR records", str(place)))


def _recordings_below(place: Path) -> list[Path]:
    """The recording of each folder; a partial one where there is no other."""
    found: dict[Path, Path] = {}
    for path in sorted([*place.rglob(partial_path(Path(RECORDING)).name), *place.rglob(RECORDING)]):
        if path.name == RECORDING or path.parent not in found:
            found[path.parent] = path
    return list(found.values())


def is_partial(recording: Path) -> bool:
    """Whether a recording's name says that its run did not end."""
    return recording.stem.endswith(PARTIAL)


def result_of(recording: Path) -> dict[str, Any] | None:
    """The result of the run whose recording this is, or None if there is none beside it.

    Raises InputError for a file that is not a result.
    """
    beside = recording.with_name(RESULT)
    return read_result(beside) if recording.name == RECORDING and beside.exists() else None


def read_results(places: Sequence[Path]) -> list[dict[str, Any]]:
    """The results in these files and folders, and in folders below, in order of their paths; each file once.

    Raises InputError for a file that is not a result.
    """
    return [read_result(path) for path in result_paths(places)]


def result_paths(places: Sequence[Path]) -> Iterator[Path]:
    """The files of the results in these files and folders, and in folders below; each file once."""
    taken = set()
    for place in places:
        for path in sorted(place.rglob(RESULT)) if os.path.isdir(place) else [place]:
            real = os.path.realpath(path)
            if real not in taken:
                taken.add(real)
                yield path


def unfinished_runs(places: Sequence[Path]) -> Iterator[Path]:
    """The partial recordings in these folders, and in folders below, that have no result beside them."""
    for place in places:
        for path in sorted(place.rglob(partial_path(Path(RECORDING)).name)) if os.path.isdir(place) else ():
            if not path.with_name(RESULT).exists():
                yield path


def read_result(path: Path) -> dict[str, Any]:
    """A result, as JSON values. Raises InputError if the file is not one."""
    try:
        data = read_regular_file(path, _LARGEST)
        result = load_json(data, max_depth=_DEEPEST)
    except OSError as error:
        raise InputError(Diagnostic(f"cannot read: {error.strerror}", f"give a {RESULT}", str(path))) from error
    except ValueError as error:
        raise InputError(Diagnostic(f"not JSON: {error}", f"give a {RESULT}", str(path))) from error
    if not isinstance(result, dict) or "trace_hash" not in result:
        raise InputError(Diagnostic("not the result of a run", "give a file that eidrive run --out wrote", str(path)))
    return result
