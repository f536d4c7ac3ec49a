"""Search for the road file of a scenario."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from eidrive_scenario.errors import shortened, suggestion
from eidrive_scenario.files.bounded import is_folder, is_regular_file
from eidrive_scenario.library import ROADS_SUFFIX, resolve_path
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import File, RoadNetwork

MAPS = "EIDRIVE_MAPS"
"""Environment variable with the folders in which a road file is searched by its name."""


def find_road_file(network: RoadNetwork | None, folder: Path, collector: DiagnosticCollector) -> Path | None:
    """Return the road file of a scenario; None if it has none.

    The file is searched relative to the scenario, then by its name in the folders of EIDRIVE_MAPS. A name without a
    suffix, such as Town01, is completed to Town01.xodr.
    """
    logic = network.logic_file if network else None
    if logic is None or not isinstance(logic.filepath, str) or not logic.filepath.strip():
        return None
    for candidate in _candidates(logic, folder):
        if is_regular_file(candidate):
            return candidate
    collector.error(
        f"road file '{shortened(logic.filepath, 300)}' is neither {_location(folder)} nor in the folders of {MAPS}",
        _hint(logic, folder),
        source=logic.source,
        line=logic.line,
    )
    return None


def _location(folder: Path) -> str:
    """Describe the base of relative paths; for a scenario without a file it is the current folder."""
    return "in the current folder" if folder == Path() else "in the folder of the scenario"


def _candidates(logic: File, folder: Path) -> Iterator[Path]:
    named = PurePosixPath(logic.filepath.strip().replace("\\", "/"))
    for name in (named, named.with_name(named.name + ROADS_SUFFIX)) if named.name else ():
        yield resolve_path(str(name), folder)
        for maps in _map_folders():
            yield maps / name.name


def _map_folders() -> list[Path]:
    return [Path(entry) for entry in os.environ.get(MAPS, "").split(os.pathsep) if entry]


def _hint(logic: File, folder: Path) -> str:
    named = PurePosixPath(logic.filepath.strip().replace("\\", "/"))
    places = [(folder / named).parent, *_map_folders()]
    known = {file.stem for place in places if is_folder(place) for file in place.glob(f"*{ROADS_SUFFIX}")}
    if known:
        return suggestion(named.name.removesuffix(ROADS_SUFFIX), known)
    return f"check LogicFile, or set {MAPS} to the folders of the maps"
