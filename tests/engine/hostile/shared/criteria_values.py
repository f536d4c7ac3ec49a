"""Valid settings of criteria, whose values the tests of hostile settings replace."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CRITERIA: Mapping[str, Mapping[str, Any]] = {
    "actor_blocked": {"of": "Ego", "at_most": 60.0, "below": 0.2},
    "average_speed": {"of": "Ego", "at_least": 2.0, "at_most": 10.0},
    "collision": {"of": "Ego", "with": "B", "fatal": True, "name": "crash", "only_at_fault": True},
    "comfort": {
        "of": "Ego",
        "max_acceleration": 2.4,
        "max_deceleration": 4.05,
        "lateral_acceleration": 4.89,
        "longitudinal_jerk": 4.13,
        "jerk": 8.37,
        "yaw_rate": 0.95,
        "yaw_acceleration": 1.93,
    },
    "deceleration_to_avoid_crash": {"of": "Ego", "to": "B", "at_most": 3.35},
    "detection_count": {
        "of": "Ego",
        "source": "own",
        "within": 3.0,
        "min_confidence": 0.3,
        "classes": ["car", "pedestrian"],
        "measure": "total",
        "after": 1.0,
        "at_least": 1.0,
        "at_most": 5.0,
    },
    "driven_distance": {"of": "Ego", "at_least": 10.0, "by": 20.0},
    "end_of_road": {"of": "Ego", "at_most": 1.0, "within": 2.0},
    "keep_lane": {"of": "Ego", "at_most": 1.0},
    "max_speed": {"of": "Ego", "at_most": 10.0},
    "min_distance": {"of": "Ego", "to": "B", "at_least": 1.5, "measure": "box"},
    "min_speed": {"of": "Ego", "at_least": 2.0, "after": 3.0},
    "off_road": {"of": "Ego", "at_most": 1.0},
    "on_sidewalk": {"of": "Ego", "at_most": 1.0},
    "post_encroachment_time": {"of": "Ego", "to": "B", "at_least": 1.5},
    "reach_position": {"of": "Ego", "x": 1.0, "y": 2.0, "within": 3.0, "by": 10.0},
    "reached_region": {"of": "Ego", "region": [[0.0, -2.0], [10.0, 2.0]], "by": 10.0},
    "rss_violation": {
        "of": "Ego",
        "to": "B",
        "share": 0.1,
        "reaction_time": 1.0,
        "max_acceleration": 3.5,
        "min_braking": 4.0,
        "max_braking": 8.0,
        "min_braking_correct": 3.0,
        "lateral_acceleration": 0.2,
        "lateral_braking": 0.8,
        "lateral_margin": 0.1,
    },
    "running_stop_sign": {"of": "Ego", "within": 4.0, "below": 0.1, "duration": 0.5},
    "time_headway": {"of": "Ego", "to": "B", "at_least": 1.0},
    "time_limit": {"within": 10.0},
    "time_to_collision": {"of": "Ego", "to": "B", "at_least": 1.5},
    "wrong_lane": {"of": "Ego", "at_most": 1.0},
}
"""Settings of criteria that are right."""
