"""Page of the demo: tables with published values, distances over time, and top views of key frames."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
from markupsafe import Markup
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich import box as boxes
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table as Grid
from rich.text import Text

from eidrive_reports.key_frames import Moment, Story
from eidrive_reports.paper import (
    ARMS,
    LINKS,
    SCENARIOS,
    Cell,
    ExperimentArm,
    PublishedClaim,
    Table,
    difference,
    evaluate_claims,
)
from eidrive_scenario.api.common import Array
from eidrive_scenario.api.experiments import cores
from eidrive_scenario.api.pages import (
    ChartSeries,
    ImageCanvas,
    LegendEntries,
    ReportedRun,
    RoadDrawing,
    Window,
    draw_snapshot,
    line_chart,
    png_address,
    write_run_report,
)

HEADINGS = (
    "arm",
    "centers [m]\nmean ± sd",
    "\nmin",
    "boxes\nmean",
    "[m]\nmin",
    "collision-free\nk/n       95 %",
    "paper [m]\nmean ± sd",
)


def row(cell: Cell) -> tuple[str, ...]:
    """Return one row of the table in the order of HEADINGS, with the population standard deviation of the paper."""
    center, box, free = cell.center, cell.box, cell.collision_free
    return (
        cell.arm.title,
        f"{center.mean:.2f} ± {center.population_sd:.2f}",
        f"{center.smallest:.2f}",
        f"{box.mean:.2f}",
        f"{box.smallest:.2f}",
        f"{free.successes}/{free.trials} {free.low:.2f}-{free.high:.2f}",
        f"{cell.published.mean:.2f} ± {cell.published.sd:.2f}",
    )


def render(table: Table, claims: Sequence[PublishedClaim] = ()) -> RenderableType:
    """Return one grid per scenario, followed by the checks of the published order."""
    parts: list[RenderableType] = [Text(f"Table II, oracle; {table.variant.title}", style="bold"), Text("")]
    for scenario in table.scenarios:
        grid = Grid(
            title=SCENARIOS.get(scenario, scenario),
            title_justify="left",
            title_style="bold",
            box=boxes.SIMPLE_HEAD,
            show_edge=False,
            padding=(0, 1, 0, 0),
        )
        for index, heading in enumerate(HEADINGS):
            grid.add_column(heading, justify="left" if index == 0 else "right", no_wrap=True)
        for cell in (cell for cell in table.cells if cell.scenario == scenario):
            grid.add_row(*row(cell))
        parts.append(grid)
        parts.extend(_lines(claim) for claim in claims if claim.scenario == scenario)
        parts.append(Text(""))
    return Group(*parts)


def _lines(claim: PublishedClaim) -> RenderableType:
    verdict = ("holds: ", "green") if claim.holds else ("does not hold: ", "red")
    return Group(Text.assemble(verdict, claim.statement), Padding(Text(claim.evidence, style="dim"), (0, 0, 0, 4)))


COLORS = {"none": "#64748b", "cooperation": "#059669", "latency": "#d97706", "error": "#7c3aed"}
DASHED = {"none", "error"}
PICTURE = (480, 480)
"""Width and height of a key frame [pixels]."""
QUALITY = (cv2.IMWRITE_WEBP_QUALITY, 85)
"""Quality of key frames, which take a ninth of the size of PNG images."""
HORIZON = 12.0
"""Maximum distance between the cars in the chart [m]."""


@dataclass(frozen=True)
class PageImage:
    """Image of a run as PNG."""

    title: str
    caption: str
    png: bytes


@dataclass(frozen=True)
class DemoSite:
    """Roads, conflict areas and camera images that the figures of all arms of a scenario share."""

    roads: RoadDrawing
    conflict_areas: tuple[Array, ...]
    views: tuple[PageImage, ...] = ()


def write_demo(
    out: Path,
    runs: Sequence[ReportedRun],
    links: Table,
    own: Table,
    stories: Mapping[tuple[str, str], Story],
    sites: Mapping[str, DemoSite],
    *,
    watched: int,
    footer: str = "",
) -> Path:
    """Write the report about `runs` with tables and figures above it, and return `out`.

    `stories` are those of the seed `watched`, by scenario and channel.
    """
    windows = {scenario: _window(scenario, stories) for scenario in links.scenarios}
    pictures = _pictures(stories, sites, windows)
    values = {
        table.variant.name: {
            "title": table.variant.title,
            "scenarios": [_scenario(table, name, stories, pictures, sites[name], watched) for name in links.scenarios],
        }
        for table in (links, own)
    }
    return write_run_report(
        runs,
        out,
        template=Path(__file__).with_name("demo.html.jinja"),
        title="Cooperative perception of an occluded car",
        colors=COLORS,
        seeds=len(links.cells[0].seeds),
        watched=watched,
        legend=_legend(stories, sites, windows),
        links=values[links.variant.name],
        own=values[own.variant.name],
        sentence=difference(links, own),
        footer=footer,
    )


def _scenario(
    table: Table,
    scenario: str,
    stories: Mapping[tuple[str, str], Story],
    pictures: Mapping[tuple[str, str], Sequence[str]],
    site: DemoSite,
    watched: int,
) -> dict[str, Any]:
    keys = {arm.name: (scenario, arm.channel(table.variant)) for arm in ARMS}
    mine = {name: stories[key] for name, key in keys.items()}
    return {
        "title": SCENARIOS.get(scenario, scenario),
        "cells": [cell for cell in table.cells if cell.scenario == scenario],
        "checks": [claim for claim in evaluate_claims(table) if claim.scenario == scenario],
        "chart": Markup(_chart(mine)),
        "views": [
            {"title": view.title, "caption": view.caption, "address": png_address(view.png)} for view in site.views
        ]
        if table.variant == LINKS
        else [],
        "arms": [
            {
                "title": arm.title,
                "color": COLORS[arm.name],
                "summary": _summary(table.cell(scenario, arm.name), mine[arm.name], watched),
                "images": [
                    _figure(moment, mine[arm.name], arm, picture)
                    for moment, picture in zip(mine[arm.name].moments, pictures[keys[arm.name]], strict=True)
                ],
            }
            for arm in ARMS
        ],
    }


def _speed(speed: float) -> str:
    """Return a speed as text. A vehicle may move backwards after a collision."""
    rounded = round(3.6 * speed)
    return f"at {rounded} km/h" if rounded >= 0 else f"moving backwards at {-rounded} km/h"


def _pictures(
    stories: Mapping[tuple[str, str], Story], sites: Mapping[str, DemoSite], windows: Mapping[str, Window]
) -> dict[tuple[str, str], list[str]]:
    """Return the addresses of the key frames of each story, empty without a snapshot."""

    def address(scenario: str, moment: Moment) -> str:
        if moment.snapshot is None:
            return ""
        canvas = ImageCanvas(windows[scenario], PICTURE)
        draw_snapshot(canvas, moment.snapshot, sites[scenario].roads, sites[scenario].conflict_areas)
        _, image = cv2.imencode(".webp", canvas.image, QUALITY)
        return "data:image/webp;base64," + b64encode(image.tobytes()).decode()

    with ThreadPoolExecutor(cores()) as pool:  # encoding takes most of the time, and releases the lock of Python
        return {key: list(pool.map(partial(address, key[0]), story.moments)) for key, story in stories.items()}


def _figure(moment: Moment, story: Story, arm: ExperimentArm, picture: str) -> dict[str, Any]:
    snapshot = moment.snapshot
    if snapshot is None:
        return {"title": moment.title, "caption": "", "address": ""}
    row = story.times.index(snapshot.time)
    lost = sum(event.outcome == "lost" for event in snapshot.links)
    caption = (
        f"at {snapshot.time:.2f} s, {story.centers[row]:.1f} m between centers, "
        f"{story.ego} {_speed(story.speeds[row])}" + (", last message lost" if lost else "")
    )
    return {
        "title": moment.title,
        "caption": caption,
        "address": picture,
        "description": f"{arm.title}: {moment.title} {caption}",
    }


def _legend(
    stories: Mapping[tuple[str, str], Story], sites: Mapping[str, DemoSite], windows: Mapping[str, Window]
) -> list[dict[str, Any]]:
    """Return color and text of each entry of the legend of all key frames; lines are dashed or not."""
    entries: dict[str, Patch | Line2D] = {}
    for (scenario, _), story in stories.items():
        canvas = LegendEntries(windows[scenario], PICTURE)
        for moment in story.moments:
            if moment.snapshot is not None:
                draw_snapshot(canvas, moment.snapshot, sites[scenario].roads, sites[scenario].conflict_areas)
        entries |= canvas.entries
    return [
        {
            "text": text,
            "color": to_hex(entry.get_facecolor() if isinstance(entry, Patch) else entry.get_color(), keep_alpha=True),
            "edge": to_hex(entry.get_edgecolor()) if isinstance(entry, Patch) else "",
            "is_dashed": isinstance(entry, Line2D) and entry.get_linestyle() != "-",
        }
        for text, entry in entries.items()
    ]


def _summary(cell: Cell, story: Story, watched: int) -> str:
    nearest = min(story.boxes) if story.boxes else float("nan")
    outcome = "collision" if story.touched else f"minimum distance {nearest:.2f} m"
    free = cell.collision_free
    return f"seed {watched}: {outcome}; all seeds: {free.successes} of {free.trials} without a collision"


def _chart(stories: Mapping[str, Story]) -> str:
    lines, start, end = [], float("inf"), 0.0
    for arm in ARMS:
        story = stories[arm.name]
        if not story.times:
            continue
        nearest = min(range(len(story.times)), key=lambda row: (story.boxes[row], story.centers[row]))
        lines.append(ChartSeries(arm.title, COLORS[arm.name], story.times, story.boxes, arm.name in DASHED, nearest))
        near = [row for row, gap in enumerate(story.boxes) if gap <= HORIZON]
        if near:
            start, end = min(start, story.times[near[0]]), max(end, story.times[near[-1]])
    return line_chart(
        lines,
        x_title="time [s]",
        y_title="distance between bodies [m]",
        x_range=(start, end) if start < end else None,
        y_range=(0.0, HORIZON),
    )


def _window(scenario: str, stories: Mapping[tuple[str, str], Story]) -> Window:
    """Return the window of all figures of a scenario, which contains all actors in all key frames."""
    points = [
        tuple(center)
        for (name, _), story in stories.items()
        if name == scenario
        for moment in story.moments
        if moment.snapshot is not None
        for center in moment.snapshot.view.centers.tolist()
    ]
    width, height = PICTURE
    return Window.enclosing(points or [(0.0, 0.0)], margin=7.0).widened(width / height, 0.0)
