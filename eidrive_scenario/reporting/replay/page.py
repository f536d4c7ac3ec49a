"""Page of a recorded run: views of the street with the information of a selectable station, and charts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.bounded_json import load_json
from eidrive_scenario.recording.damage import DamageReport
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import Recording
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.reporting.drawing.road_drawing import recorded_roads
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.replay.camera_files import camera_files
from eidrive_scenario.reporting.replay.frame_data import describe_error, replay_data
from eidrive_scenario.reporting.replay.page_values import TEMPLATE, decisive_instant, page_values
from eidrive_scenario.reporting.run_report.reported_run import parse_run
from eidrive_scenario.reporting.run_report.settings_text import run_facts, shorten
from eidrive_scenario.reporting.snapshot import DEFAULT_SETTINGS
from eidrive_scenario.simulation.recorded_outcome import CONTEXT, TRAILERS, recorded_outcome
from eidrive_scenario.v2x.messages.message import LinkEvent


@dataclass(frozen=True)
class Replay:
    """Written page, and one line for each kind of damage of its recording."""

    page: Path
    damage: tuple[str, ...]


def make_replay(
    recording: Recording,
    out: Path,
    result: Mapping[str, Any] | None = None,
    *,
    result_file: str | Path = "",
    complete: bool = True,
) -> Replay:
    """Write the replay of a recording to the file `out`, with the verdicts of an optional `result`.

    result_file  file of the result for error messages
    complete     whether the run has ended; the page states that an unfinished run is incomplete

    The readable part of a damaged recording is shown, and the page lists the damage. Raise InputError if no frame can
    be read, or the result is invalid.
    """
    report = DamageReport()
    for line in recording.damage:
        report.add(line)
    trace = TraceHash()
    settings = run_settings(recording, report)
    frames, roads = _drawable(recording, report, trace), readable_roads(recording, report)
    data = replay_data(frames, report, station_settings(settings), _final_links(recording, report))
    if not data["times"]:
        reason = "; ".join(report.lines()) or "record the run again"
        raise InputError(Diagnostic("the recording contains no readable frame", reason, str(recording.path)))
    if result is not None and result.get("trace_hash") != trace.hexdigest():
        report.add("the result in the folder has another trace hash: its verdicts may belong to another run")
    verdicts = None if result is None else parse_run(result, result_file)
    data["decisive"] = decisive_instant(data, verdicts, data["actors"])
    values = page_values(
        recording.scenario or recording.path.stem,
        recording.seed,
        settings,
        facts=_facts(recording, settings),
        command=recording.metadata.get("command", ""),
        result=verdicts,
        notices=report.lines(),
        complete=complete,
        roads=roads,
        data=data,
        images=camera_files(recording.path.parent, out.parent),
    )
    page = write_page(out, TEMPLATE, **values)
    return Replay(page, report.lines())


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


def readable_roads(recording: Recording, report: DamageReport) -> RoadDrawing:
    """Return the roads of a recording, without those that cannot be read, which are added to the report."""
    try:
        return recorded_roads(recording)
    except (InputError, ArithmeticError, LookupError, TypeError, ValueError, MemoryError, RecursionError) as error:
        report.add("roads are not drawn", describe_error(error))
        return RoadDrawing()


def run_settings(recording: Recording, report: DamageReport) -> dict[str, Any]:
    """Return the resolved settings of the metadata."""
    settings = _object(recording.metadata.get("settings", "{}"))
    if settings is None:
        report.add("the settings of the run cannot be decoded")
    return settings or {}


def station_settings(settings: Mapping[str, Any]) -> dict[str, AgentSettings]:
    """Return the settings of stations with a report timeout other than the default."""
    found: dict[str, AgentSettings] = {}
    stations = settings.get("stations")
    for name, station in stations.items() if isinstance(stations, Mapping) else ():
        timeout = station.get("report_timeout") if isinstance(station, Mapping) else None
        if timeout not in (None, DEFAULT_SETTINGS.report_timeout):
            with suppress(ValidationError):  # in a damaged recording
                found[name] = AgentSettings(report_timeout=timeout)
    return found


def _object(text: str) -> dict[str, Any] | None:
    """Parse a JSON object of the metadata. Return None for other texts."""
    try:
        found = load_json(text.encode(), max_depth=30)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _facts(recording: Recording, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the facts about the run that the page lists."""
    if settings:
        return run_facts(settings)
    hidden = ("format", "parameters", "settings", "command", CONTEXT, TRAILERS)
    facts = {name: shorten(text) for name, text in recording.metadata.items() if name not in hidden}
    return facts | run_facts({"parameters": _object(recording.metadata.get("parameters", "{}"))})
