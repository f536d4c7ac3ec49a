"""Values of the template of a replay, of a recorded run or of a run in progress."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from eidrive_scenario.reporting.drawing.canvas import HOUSE
from eidrive_scenario.reporting.drawing.top_view import (
    AREA,
    FUSED,
    GROUND,
    LANE,
    LANES,
    LINK,
    LOST,
    OWN,
    PAINT,
    RECEIVED,
    WHITE,
    RoadDrawing,
    is_broken,
)
from eidrive_scenario.reporting.replay.frame_data import Data, packed
from eidrive_scenario.reporting.replay.series import closest_approach
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun
from eidrive_scenario.reporting.run_report.settings_text import shorten

TEMPLATE = "replay/page.html.jinja"
COLORS = {
    "own": OWN,
    "received": RECEIVED,
    "link": LINK,
    "lost": LOST,
    "area": AREA,
    "fused": FUSED,
    "house": HOUSE,
    "ground": GROUND,
}


def page_values(
    scenario: str,
    seed: int,
    settings: Mapping[str, Any],
    *,
    facts: Mapping[str, str],
    command: str,
    result: ReportedRun | None,
    roads: RoadDrawing,
    data: Data,
    images: Mapping[str, Any],
    notices: Sequence[str] = (),
    complete: bool = True,
    live: bool = False,
) -> dict[str, Any]:
    """Return the values of the template `TEMPLATE`.

    settings  resolved settings of the run; empty if they are unknown
    facts     facts about the run that the page lists
    data      of all frames, see `replay_data`; of no frame for a live page
    images    see `camera_files`
    notices   damage of a recording, or what a live page does not show
    complete  whether the run has ended, or is still in progress
    live      whether the page receives the data of the frames from a server
    """
    return {
        "title": f"{shorten(scenario, 200)}, seed {seed}",
        "result": result,
        "facts": facts,
        "settings": json.dumps(settings, indent=1, ensure_ascii=False) if settings else "",
        "command": command,
        "notices": notices,
        "complete": complete,
        "live": live,
        "data": {**packed(data), "roads": _roads(roads), "colors": COLORS, "images": images},
    }


def decisive_instant(data: Data, result: ReportedRun | None, names: Collection[str]) -> dict[str, Any] | None:
    """Return the decisive instant of a run: its first contact, the smallest distance that a criterion measured, or the
    smallest gap of a driven vehicle; None without any of them.

    names  names of the actors
    """
    if result is not None and data["contact"] is None:
        approach = closest_approach(result.metrics, [verdict.value for verdict in result.criteria], names)
        if approach is not None:
            return approach
    found: dict[str, Any] | None = data["decisive"]
    return found


def _roads(roads: RoadDrawing) -> dict[str, Any]:
    return {
        "levels": [_level(level) for level in roads.levels],
        "houses": [[round(height, 2), outline.round(2).tolist()] for outline, height in roads.houses],
    }


def _level(roads: RoadDrawing) -> dict[str, Any]:
    """Return lanes and road marks of one level."""
    return {
        "lanes": [[LANES.get(kind, LANE), polygon.round(2).tolist()] for kind, polygon in roads.lanes],
        "lines": [
            [is_broken(kind), PAINT.get(color, WHITE), line.round(2).tolist()] for kind, color, line in roads.markings
        ],
    }
