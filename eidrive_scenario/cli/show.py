"""Commands that display data: `list`, `tree`, `draw`, `view`, `report`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from eidrive_scenario.cli.options import check_output_paths
from eidrive_scenario.cli.output import echo, echo_path, print_warning, print_warnings
from eidrive_scenario.errors import Diagnostic, SettingError, in_one_line

PictureSize = Annotated[
    str | None, typer.Option(metavar="WxH", help="Width and height of the picture in mm.", show_default="160x90")
]


Names = Literal[
    "scenarios", "catalogs", "channels", "weather", "detectors", "fusion", "planners", "sensors", "trackers",
    "vehicle_controllers", "controllers", "criteria", "actions", "conditions", "commands", "rules", "roads",
    "properties",
]  # fmt: skip
"""Kinds of names that `eidrive list` prints."""


def list_names(what: Annotated[Names, typer.Argument(help="Kind of the names.")] = "scenarios") -> None:
    """List names of the library or of installed extensions.

    Example: eidrive list channels
    """
    from eidrive_scenario.extensions import library
    from eidrive_scenario.extensions.registry import registry

    match what:
        case "scenarios":
            lines = _columns([(each.name, each.family, each.description) for each in library.describe_scenarios()])
        case "channels":
            lines = [*library.names("channels"), "none"]
        case "weather":
            lines = library.names("weather")
        case "catalogs":
            lines = _catalog_lines()
        case "rules":
            from eidrive_scenario.checks.scenario_checks import ALL_RULES

            lines = _columns([(rule.name, rule.level.value, rule.summary) for rule in ALL_RULES])
        case "roads":
            lines = _road_lines()
        case "properties":
            from eidrive_scenario.cli.property_list import Property, properties

            warnings: list[str] = []
            lines = _columns([[name.upper() for name in Property._fields], *properties(warnings.append)])
            print_warnings(warnings)
        case "criteria":
            from eidrive_scenario.evaluation.criterion import describe_criteria

            lines = _columns([(name, unit, f"{text} {settings}") for name, unit, settings, text in describe_criteria()])
        case _:
            extensions = registry(what)
            lines = _columns([(name, extensions.value(name)) for name in extensions])
    for line in lines:
        echo(line)


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _road_lines() -> list[str]:
    """Return one line per road network of the library: name, length, lanes of a cross section, and file."""
    from eidrive_scenario.extensions.library import ROADS_SUFFIX, library_path
    from eidrive_scenario.roads import RoadNetwork

    rows = [("NAME", "LENGTH", "ROADS", "DRIVING LANES", "FILE")]
    for path in sorted(library_path().rglob(f"*{ROADS_SUFFIX}")):
        roads = RoadNetwork.load(path).roads.values()
        counts = [
            sum(lane.drivable and lane.id != 0 for lane in section.lanes.values())
            for road in roads
            if road.junction_id is None
            for section in road.sections
        ]
        lanes = " to ".join(map(str, dict.fromkeys((min(counts, default=0), max(counts, default=0)))))
        length = f"{sum(road.length for road in roads):.0f} m"
        rows.append((path.stem, length, str(len(roads)), lanes, str(path)))
    return _columns(rows)


def _catalog_lines() -> list[str]:
    """Return one line per entry, and two lines about references from scenarios."""
    from eidrive_scenario.extensions.library import CATALOGS, LIBRARY_FOLDER, library_path
    from eidrive_scenario.openscenario.library_catalogs import library_catalog_entries

    rows = [("CATALOG", "ENTRY", "KIND", "LENGTH x WIDTH x HEIGHT", "MASS")]
    for entry in library_catalog_entries():
        kind = f"{entry.kind} {entry.category}".strip()
        size = " x ".join(f"{value:.2f}" for value in entry.size) + " m" if entry.size is not None else ""
        rows.append((entry.catalog, entry.name, kind, size, f"{entry.mass:g} kg" if entry.mass is not None else ""))
    folder = f"{LIBRARY_FOLDER}/{CATALOGS}"
    return [
        *_columns(rows),
        f'From any folder: <VehicleCatalog><Directory path="{folder}"/></VehicleCatalog>',
        f"For other engines, copy {library_path() / CATALOGS} to {folder} beside the scenario.",
    ]


def tree(
    scenario: Annotated[str, typer.Argument(help="An .xosc file, or a library name.")],
    svg: Annotated[Path | None, typer.Option(metavar="FILE", help="SVG file for a diagram instead of text.")] = None,
) -> None:
    """Print the storyboard of a scenario as a tree with triggers, or draw it as a diagram.

    Example: eidrive tree coop/scenario_1 --svg storyboard.svg
    """
    from eidrive_scenario.cli.console import console, storyboard_tree
    from eidrive_scenario.extensions.library import resolve_scenario
    from eidrive_scenario.openscenario import load_scenario
    from eidrive_scenario.reporting.storyboard_diagram.diagram import write_storyboard_diagram
    from eidrive_scenario.roads import RoadNetwork
    from eidrive_scenario.storyboard.storyboard import Storyboard

    path = resolve_scenario(scenario)
    loaded = load_scenario(path)
    check_output_paths({"--svg": svg}, [path, loaded.road_file, *loaded.catalogs])
    roads = RoadNetwork.load(loaded.road_file) if loaded.road_file else None
    storyboard = Storyboard(loaded, roads, dt=0.05, seed=0)
    if svg is not None:
        echo_path(write_storyboard_diagram(storyboard, svg))
    else:
        console().print(storyboard_tree(storyboard))


def draw(
    file: Annotated[str, typer.Argument(help="An .xosc or .xodr file, or a library name.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="PICTURE", help="A .svg, .pdf or .png file.", show_default="NAME.svg"),
    ] = None,
    size: PictureSize = None,
    station: Annotated[
        str | None, typer.Option(help="Station whose view is shaded.", show_default="the first that drives")
    ] = None,
) -> None:
    """Draw a scenario before its run, or roads, from above.

    Example: eidrive draw coop/scenario_1 --out scenario.svg

    The picture has ids of roads and lanes, marks of s, starts, paths, trigger zones and the ranges of sensors.
    """
    from eidrive_scenario.extensions.library import resolve_scenario
    from eidrive_scenario.reporting.drawing.scenario_picture import is_road_file, source_figure
    from eidrive_scenario.reporting.drawing.vector_canvas import check_format, parse_size, write_figure

    path = Path(file) if is_road_file(Path(file)) else resolve_scenario(file)
    picture = out or Path(f"{path.stem}.svg")
    check_output_paths({"--out": picture}, [path])
    check_format("--out", picture)
    write_figure(source_figure(path, parse_size(size), station), picture)
    echo_path(picture)


def view(
    recording: Annotated[Path, typer.Argument(help="A recording.mcap, or the folder of a run.")],
    other: Annotated[
        Path | None, typer.Argument(help="A second one on the same roads, which the page shows over the first.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File of the page.", show_default="beside the recording")
    ] = None,
    browser: Annotated[bool, typer.Option("--browser", help="Open the page in the browser.")] = False,
    png: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture of one instant.")] = None,
    svg: Annotated[Path | None, typer.Option(metavar="FILE", help="Write it as a vector figure.")] = None,
    pdf: Annotated[Path | None, typer.Option(metavar="FILE", help="Write it as a vector figure.")] = None,
    at: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Instant of the picture.", show_default="the decisive one")
    ] = None,
    size: PictureSize = None,
    gif: Annotated[Path | None, typer.Option(metavar="FILE", help="Write an animated picture.")] = None,
    mp4: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a film.")] = None,
    station: Annotated[
        str | None, typer.Option(help="Station of pictures and films.", show_default="the first that drives")
    ] = None,
) -> None:
    """Write one or two recorded runs as an HTML replay, or the top view of one as pictures.

    Example: eidrive view reports/scenario_1 --browser
    """
    from eidrive_scenario.recording.recording import open_recording
    from eidrive_scenario.recording.run_files import RESULT, is_partial, recording_in

    path = recording_in(recording)
    stills = {"--png": png, "--svg": svg, "--pdf": pdf}
    has_stills = any(path is not None for path in stills.values())
    has_pictures = has_stills or gif is not None or mp4 is not None
    page = out or (None if has_pictures and not browser else path.with_name(TWO_RUNS if other else f"{path.stem}.html"))
    for option, value in (("--at", at), ("--size", size)):
        if value is not None and not has_stills:
            message = f"{option} without a picture has no effect"
            raise SettingError(Diagnostic(message, "add --png, --svg or --pdf FILE"))
    if station is not None and not has_pictures:
        raise SettingError(Diagnostic("--station has no effect on the page", "add --png, --svg, --pdf, --gif or --mp4"))
    if other is not None and has_pictures:
        raise SettingError(Diagnostic("pictures and films show one recording (got two)", "omit the second one"))
    second = None if other is None else recording_in(other)
    outputs = {"--out": page, **stills, "--gif": gif, "--mp4": mp4}
    check_output_paths(outputs, [file for run in (path, second) if run for file in (run, run.with_name(RESULT))])
    opened = open_recording(path)
    if has_pictures:
        from eidrive_scenario.recording.integrity import DamageReport
        from eidrive_scenario.reporting.drawing.vector_canvas import check_format, parse_size, write_figure
        from eidrive_scenario.reporting.replay import film
        from eidrive_scenario.reporting.run_report.reported_runs import run_of_recording

        for option, file in {**stills, "--gif": gif, "--mp4": mp4}.items():
            check_format(option, file, (option.replace("--", "."),))
        of_result = DamageReport()
        recorded = film.RecordedStation(opened, station, result=run_of_recording(path, of_result))
        damage = (*recorded.damage, *of_result.lines())
        if has_stills:
            figure = recorded.figure(at, parse_size(size))
            for file in filter(None, stills.values()):
                write_figure(figure, file)
        if gif is not None:
            film.write_gif(recorded, gif)
        if mp4 is not None:
            film.write_mp4(recorded, mp4)
    if page is not None:
        from eidrive_scenario.reporting.replay.page import make_replay

        damage = make_replay(opened, page, other=None if second is None else open_recording(second))
    print_warnings(f"{in_one_line(path)}: {line}" for line in damage)
    partials = filter(is_partial, [path, *([second] if second else [])])
    reason = "the run did not end, the recording is incomplete"
    print_warnings(f"{in_one_line(partial)}: {reason}" for partial in partials)
    for written in (*stills.values(), gif, mp4, page):
        if written is not None:
            echo_path(written)
    if browser and page is not None:
        typer.launch(page.resolve().as_uri())


TWO_RUNS = "two-runs.html"
"""File of the page of two recordings beside the first."""


def report(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Folders written by run --out, or their parents; stores of sweeps."),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder of report.html, or a file.", show_default="the first folder of runs"),
    ] = None,
    replays: Annotated[
        bool, typer.Option("--replays/--no-replays", help="Write the replay of each run with a recording, too.")
    ] = True,
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write curves and heat maps as SVG and PDF, too.")
    ] = None,
    size: PictureSize = None,
) -> None:
    """Write an HTML report of many runs or of sweeps, with a replay of each recorded run.

    Example: eidrive report reports --out reports/report.html

    Below folders, damaged results and runs that did not end are omitted with a warning; the page lists them.
    """
    from eidrive_scenario.reporting.drawing.vector_canvas import parse_size
    from eidrive_scenario.reporting.report_files import report_files

    if size is not None and figures is None:
        raise SettingError(Diagnostic("--size without --figures has no effect", "add --figures DIR"))
    if out is None:
        out = runs[0] if os.path.isdir(runs[0]) else runs[0].parent
    check_output_paths({"--out": out, "--figures": figures}, runs)
    page = report_files(
        runs,
        out,
        replays=replays,
        warn=print_warning,
        figures=figures,
        size=parse_size(size),
    )
    echo_path(page)
