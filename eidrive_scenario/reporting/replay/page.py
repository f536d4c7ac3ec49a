"""Page of a recorded run: views of the street with the information of a selectable station, and charts."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pydantic import ValidationError

from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import Diagnostic, InputError, counted
from eidrive_scenario.experiments.reported_run import ReportedRun
from eidrive_scenario.files.bounded import load_json, path_argument
from eidrive_scenario.recording.camera_images import pictures_in
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.recording.recording import Recording, open_recording
from eidrive_scenario.recording.run_files import IMAGES, RECORDING, is_partial
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.reporting.drawing.road_drawing import network_drawing, recorded_network
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, is_broken
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.replay.colors import COLORS
from eidrive_scenario.reporting.replay.frame_data import UNDRAWABLE, Data, describe_error, overlay, packed, replay_data
from eidrive_scenario.reporting.replay.light import LightChanges, parse_weather
from eidrive_scenario.reporting.replay.models import ActorModels, street_models, three_library
from eidrive_scenario.reporting.replay.series import closest_approach
from eidrive_scenario.reporting.run_report.reported_runs import run_of_recording
from eidrive_scenario.reporting.run_report.run_groups import run_key
from eidrive_scenario.reporting.run_report.settings_text import run_facts, shorten
from eidrive_scenario.reporting.snapshot import DEFAULT_SETTINGS
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation.recorded_outcome import (
    BODIES,
    CONTEXT,
    PARAMETER_TYPES,
    TRAILERS,
    recorded_bodies,
    recorded_outcome,
)
from eidrive_scenario.v2x.messages.message import LinkEvent


def camera_files(run: Path, page: Path) -> dict[str, dict[str, Any]]:
    """Return the images in the folder of a run, by station and camera: their ticks in order, and the part of their
    address before the tick, relative to the folder `page` of the page.

    The result is empty without images.
    """
    files: dict[str, dict[str, Any]] = {}
    for station, camera, tick, path in pictures_in(run / IMAGES):
        of_station = files.setdefault(station, {})
        if camera not in of_station:
            address = quote(os.fsencode(Path(os.path.relpath(path, page)).as_posix()))
            of_station[camera] = {"address": f"{address.rpartition('-')[0]}-", "ticks": []}
        of_station[camera]["ticks"].append(tick)
    return files


TEMPLATE = "replay/page.html.jinja"


@dataclass(frozen=True)
class RunOfPage:
    """Run as a page shows it.

    facts     facts about the run that the page lists
    settings  resolved settings of the run; empty if they are unknown
    data      of all frames, see `replay_data`; of no frame for a live page
    complete  whether the run has ended, or is still in progress
    folder    name of the folder of its recording
    """

    title: str
    facts: Mapping[str, str]
    settings: Mapping[str, Any]
    command: str
    data: Data
    result: ReportedRun | None
    complete: bool = True
    folder: str = ""


def page_values(
    run: RunOfPage,
    *,
    roads: RoadDrawing,
    street: Data,
    images: Mapping[str, Any],
    notices: Sequence[str] = (),
    live: bool = False,
    other: RunOfPage | None = None,
    library: str = "",
) -> dict[str, Any]:
    """Return the values of the template `TEMPLATE`.

    street    see `street_models`
    images    see `camera_files`
    notices   damage of a recording, or what a live page does not show
    live      whether the page receives the data of the frames from a server
    other     run that the page shows over this one
    library   address of a file with three.js; "" if the page contains it
    """
    shown = {**packed(run.data), "roads": _roads(roads), "street": street, "colors": COLORS, "images": images}
    if other is not None:
        shown["other"] = packed(overlay(other.data))
    return {
        "title": run.title,
        "result": run.result,
        "facts": run.facts,
        "settings": json.dumps(run.settings, indent=1, ensure_ascii=False) if run.settings else "",
        "command": run.command,
        "notices": notices,
        "complete": run.complete and (other is None or other.complete),
        "live": live,
        "data": shown,
        "three": [] if library else three_library(),
        "library": library,
        "other": other,
        "differences": [] if other is None else _differences(run.facts, other.facts),
        "labels": ("", "") if other is None else _labels(run, other),
    }


def run_title(scenario: str, seed: int) -> str:
    """Return the title of a run in a page."""
    return f"{shorten(scenario, 200)}, seed {seed}"


def _differences(facts: Mapping[str, str], others: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Return the facts in which two runs differ: name, and value of each run."""
    names = dict.fromkeys([*facts, *others])
    return [
        (name, facts.get(name, "absent"), others.get(name, "absent"))
        for name in names
        if facts.get(name) != others.get(name)
    ]


def _labels(run: RunOfPage, other: RunOfPage) -> tuple[str, str]:
    """Return the first short facts in which two runs differ, or the names of their folders without one."""
    differences = [
        (name, *values) for name, *values in _differences(run.facts, other.facts) if max(map(len, values)) <= 40
    ]
    shown = [entry for entry in differences if entry[0] not in ("scenario", "seed")][:2]
    if not shown:
        return run.folder, other.folder
    first, second = (", ".join(f"{name} {values[side]}" for name, *values in shown) for side in (0, 1))
    return first, second


def decisive_instant(data: Data, result: ReportedRun | None, names: Collection[str]) -> dict[str, Any] | None:
    """Return the decisive instant of a run: its first contact, the smallest distance that a criterion measured, or the
    smallest gap of a driven vehicle; None without any of them.

    names  names of the actors
    """
    if result is not None and data["contact"] is None:
        approach = closest_approach(result.metrics, result.criteria, names)
        if approach is not None:
            return approach
    decisive: dict[str, Any] | None = data["decisive"]
    return decisive


def _roads(roads: RoadDrawing) -> dict[str, Any]:
    return {
        "levels": [
            {
                "lanes": [[kind, polygon.round(2).tolist()] for kind, polygon in level.lanes],
                "lines": [[is_broken(kind), color, line.round(2).tolist()] for kind, color, line in level.markings],
            }
            for level in roads.levels
        ],
        "houses": [[round(height, 2), outline.round(2).tolist()] for outline, height in roads.houses],
    }


def make_replay(
    recording: Recording, out: Path, *, other: Recording | None = None, library: str = ""
) -> tuple[str, ...]:
    """Write the replay of a recording to the file `out`, with the verdicts of the result in its folder.

    Return one line for each kind of damage.

    other    recording that the page shows over this one, with the verdicts of the result in its folder
    library  address of a file with three.js, see `write_replays`; "" if the page contains it

    The readable part of a damaged recording is shown, without verdicts if the result is invalid, and the page lists the
    damage. Raise InputError if no frame can be read, or the roads of the recordings differ.
    """
    report, others_report = DamageReport(), DamageReport()
    network = partial(recorded_network, recording)
    roads = drawn_roads(network, report)
    second = None
    if other is not None:
        others_roads = drawn_roads(partial(recorded_network, other), others_report)
        if _roads(others_roads)["levels"] != _roads(roads)["levels"]:
            reason = f"the roads differ from those of {recording.path}"
            hint = "give two recordings on the same roads, or write a page of each"
            raise InputError(Diagnostic(reason, hint, str(other.path)))
        second = _read_run(other, others_report)
    run = _read_run(recording, report)
    damage = (*report.lines(), *(f"{other.path}: {line}" for line in others_report.lines() if other is not None))
    values = page_values(
        run,
        roads=roads,
        street=street_of(network),
        images=camera_files(recording.path.parent, out.parent),
        notices=damage,
        other=second,
        library=library,
    )
    write_page(out, TEMPLATE, **values)
    return damage


def _read_run(recording: Recording, report: DamageReport) -> RunOfPage:
    """Read a recorded run. Raise InputError if no frame can be read."""
    for line in recording.damage:
        report.add(line)
    trace = TraceHash()
    settings = run_settings(recording, report)
    frames = _drawable(recording, report, trace)
    models = ActorModels(recorded_bodies(recording), settings.get("stations"))
    light = LightChanges(parse_weather(settings.get("weather_profile")))
    data = replay_data(
        frames, report, station_settings(settings), _final_links(recording, report), models=models, light=light
    )
    if not data["times"]:
        reason = "; ".join(report.lines()) or "record the run again"
        raise InputError(Diagnostic("the recording contains no readable frame", reason, str(recording.path)))
    result = run_of_recording(recording.path, report)
    if result is not None and result.trace_hash != trace.hexdigest():
        report.add("the result in the folder has another trace hash: its verdicts may belong to another run")
    data["decisive"] = decisive_instant(data, result, data["actors"])
    return RunOfPage(
        run_title(recording.scenario or recording.path.stem, recording.seed),
        _facts(recording, settings),
        settings,
        recording.metadata.get("command", ""),
        data,
        result,
        not is_partial(recording.path),
        shorten(recording.path.parent.name, 100),
    )


def _drawable(recording: Recording, report: DamageReport, trace: TraceHash) -> Iterator[Frame]:
    """Yield the frames, and add each frame to the trace hash."""
    for frame in recording.frames(lambda reason: report.add("frames cannot be decoded", shorten(reason, 200))):
        try:
            trace.observe(frame)
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            report.add("frames are inconsistent", f"tick {frame.view.tick}: {describe_error(error)}")
        yield frame


def _final_links(recording: Recording, report: DamageReport) -> tuple[LinkEvent, ...]:
    """Return the message outcomes of the last tick; of an outcome that cannot be read none."""
    try:
        outcome = recorded_outcome(recording)
    except InputError as error:
        report.add("the messages of the last tick are not shown", describe_error(error))
        return ()
    return () if outcome is None else outcome.final_links


_UNREADABLE = (InputError, *UNDRAWABLE, MemoryError, RecursionError)
# Recordings of a batch often have the same roads
_drawing, _street = lru_cache(maxsize=1)(network_drawing), lru_cache(maxsize=1)(street_models)


def drawn_roads(network: Callable[[], RoadNetwork | None], report: DamageReport) -> RoadDrawing:
    """Return the drawing of a network, without roads if it cannot be read or drawn, which is added to the report."""
    try:
        return _drawing(network())
    except _UNREADABLE as error:
        report.add("roads are not drawn", describe_error(error))
        return RoadDrawing()


def street_of(network: Callable[[], RoadNetwork | None]) -> Data:
    """Return the models of the roads of a network; bare ground for those that `drawn_roads` reports."""
    try:
        return _street(network())
    except _UNREADABLE:
        return street_models(None)


def run_settings(recording: Recording, report: DamageReport) -> dict[str, Any]:
    """Return the resolved settings of the metadata."""
    settings = _object(recording.metadata.get("settings", "{}"))
    if settings is None:
        report.add("the settings of the run cannot be decoded")
    return settings or {}


def station_settings(settings: Mapping[str, Any]) -> dict[str, AgentSettings]:
    """Return the settings of stations with a report timeout other than the default."""
    by_station: dict[str, AgentSettings] = {}
    stations = settings.get("stations")
    for name, station in stations.items() if isinstance(stations, Mapping) else ():
        timeout = station.get("report_timeout") if isinstance(station, Mapping) else None
        if timeout not in (None, DEFAULT_SETTINGS.report_timeout):
            with suppress(ValidationError):  # in a damaged recording
                by_station[name] = AgentSettings(report_timeout=timeout)
    return by_station


def _object(text: str) -> dict[str, Any] | None:
    """Parse a JSON object of the metadata. Return None for other texts."""
    try:
        value = load_json(text.encode(), max_depth=30)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _facts(recording: Recording, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the facts about the run that the page lists."""
    if settings:
        return run_facts(settings)
    hidden = ("format", "parameters", "settings", "command", CONTEXT, PARAMETER_TYPES, TRAILERS, BODIES)
    facts = {name: shorten(text) for name, text in recording.metadata.items() if name not in hidden}
    return facts | run_facts({"parameters": _object(recording.metadata.get("parameters", "{}"))})


FOLDER = "replays"
"""Folder of the replays beside the report."""
LIBRARY = "three.js"
"""File in this folder with three.js, which its replays share: it is most of a replay."""
MOST = 200
"""Maximum number of replays of a report; runs that did not pass come first."""


def write_replays(runs: Sequence[ReportedRun], beside: str | os.PathLike[str]) -> tuple[list[ReportedRun], list[str]]:
    """Write the replay of each run with a recording into a folder `beside` the report, one for all copies of a run.

    Return the runs with the addresses of their replays, and the reasons for which recordings have none.
    """
    folder = path_argument(beside, "beside") / FOLDER
    addresses: dict[object, str] = {}
    omitted: list[str] = []
    taken: set[str] = set()
    left: set[object] = set()
    recordings = [
        (run_key(run, index), run.folder / RECORDING)
        for index, run in sorted(enumerate(runs), key=lambda entry: entry[1].passed)
        if run.folder is not None and (run.folder / RECORDING).is_file()
    ]
    if recordings:
        write_page(folder / LIBRARY, "replay/library.js.jinja", three=three_library())
    for key, recording in recordings:
        if key in addresses:
            continue
        if len(addresses) == MOST:
            left.add(key)
            continue
        name = recording.parent.name
        while name in taken:
            name += "-"
        taken.add(name)
        page = folder / f"{name}.html"
        try:
            make_replay(open_recording(recording), page, library=LIBRARY)
        except InputError as error:
            omitted.append(f"{recording}: {error.diagnostics[0].message}; the run has no replay")
            continue
        addresses[key] = f"{FOLDER}/{quote(os.fsencode(page.name))}"
    if left:
        runs_left = counted(len(left), "passed or later run has", "passed or later runs have")
        omitted.append(f"{runs_left} no replay: `eidrive view` writes it")
    linked = [
        run.model_copy(update={"replay": address}) if (address := addresses.get(run_key(run, index))) else run
        for index, run in enumerate(runs)
    ]
    return linked, omitted
