"""Colors of the page of a replay in light and dark mode.

Planned path, braking, delivered and lost messages differ by at least 20 in CIE L*a*b* (1976) in each mode, also as seen
with protanopia, deuteranopia and tritanopia (Machado et al., 2009); `tests/engine/reporting/test_replay_colors.py`
computes it. In light mode, the colors that pictures have are those of pictures.
"""

from __future__ import annotations

from typing import Any

from eidrive_scenario.reporting.drawing.canvas import HOUSE
from eidrive_scenario.reporting.drawing.top_view import (
    BRAKING,
    FUSED,
    GROUND,
    LANE,
    LANES,
    LINK,
    LOST,
    OWN,
    PAINT,
    PLAN,
    RECEIVED,
    STATION,
    TRUTH,
    WHITE,
)

COLORS: dict[str, dict[str, Any]] = {
    "light": {
        "own": OWN,
        "fused": FUSED,
        "plan": PLAN,
        "braking": BRAKING,
        "link": LINK,
        "lost": LOST,
        "senders": [RECEIVED, "#c026d3", "#a16207", "#4d7c0f", "#be123c", "#92400e"],
        "ground": GROUND,
        "house": HOUSE,
        "lane": LANE,
        "lanes": LANES,
        "mark": WHITE,
        "marks": PAINT,
        "ink": TRUTH,
        "self": STATION,
        "paper": WHITE,
    },
    "dark": {
        "own": "#60a5fa",
        "fused": "#c4b5fd",
        "plan": "#0ea5e9",
        "braking": "#f9a8d4",
        "link": "#86efac",
        "lost": "#ef4444",
        "senders": ["#fb923c", "#e879f9", "#fde047", "#bef264", "#fda4af", "#d6a577"],
        "ground": "#161d29",
        "house": "#5a544b",
        "lane": "#39434f",
        "lanes": {
            "sidewalk": "#41413d",
            "median": "#2c3a2f",
            "shoulder": "#2e3641",
            "border": "#2e3641",
            "parking": "#333c48",
            "bidirectional": "#35404c",
            "none": "#232c2a",
        },
        "mark": "#aab3c0",
        "marks": {"yellow": "#b38f2e"},
        "ink": "#cbd5e1",
        "self": "#f8fafc",
        "paper": "#0f1623",
    },
}
"""Colors by mode and meaning: boxes of a station (`own`, `fused`, by sender `senders`), lines, roads by type of lane
and color of the mark, outlines of actors (`ink`), the shown station (`self`), and the halo of labels (`paper`)."""
