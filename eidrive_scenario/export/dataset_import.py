"""Scenarios from recorded datasets: a file per recording of a folder of OPV2V or DAIR-V2X-C."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.export.opv2v.reading import read_scene, scenario_folders
from eidrive_scenario.export.opv2v.writer import OPV2V_LIDAR, RATE
from eidrive_scenario.export.traffic_recording.dair_v2x import is_dair_v2x, read_scenes
from eidrive_scenario.export.traffic_recording.scenario_file import scenario_text
from eidrive_scenario.export.traffic_recording.scene import TrafficScene, at_ground, roll_warnings
from eidrive_scenario.extensions.library import SCENARIO_SUFFIX
from eidrive_scenario.files.atomic import write_atomically


def import_recordings(folder: Path, out: Path) -> Iterator[tuple[Path, list[str]]]:
    """Write OUT/NAME.xosc for each recording of a folder; yield its path and warnings.

    Road users follow their recorded trajectories. Vehicles with a lidar and roadside units are stations that detect by
    a lidar at the recorded pose, send and receive. Raise SettingError with file and line for damaged files.
    """
    for scene in _scenes(folder):
        level = at_ground(scene)
        path = out / f"{scene.name}{SCENARIO_SUFFIX}"
        lidar = {**OPV2V_LIDAR.model_dump(exclude_unset=True), "rate": RATE}
        with write_atomically(path) as stream:
            stream.write(scenario_text(level, lidar))
        yield path, [*level.warnings, *roll_warnings(level)]


def _scenes(folder: Path) -> Iterator[TrafficScene]:
    try:
        if is_dair_v2x(folder):
            yield from read_scenes(folder)
            return
        folders = scenario_folders(folder)
    except OSError as error:
        raise SettingError(Diagnostic(f"cannot read: {error.strerror}", "give a folder", str(folder))) from error
    if not folders:
        hint = "expected SCENARIO/ID/NUMBER.yaml (OPV2V) or cooperative/data_info.json (DAIR-V2X-C)"
        raise SettingError(Diagnostic("the folder contains no recording", hint, str(folder)))
    yield from map(read_scene, folders)
