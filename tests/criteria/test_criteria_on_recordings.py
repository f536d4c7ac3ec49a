"""Every criterion on a hand-made recording for which its value is known, with limits that pass and that fail."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import known_recording
import pytest

from eidrive_scenario.api.common import RoadNetwork
from eidrive_scenario.api.criteria import Frame, Verdict, evaluate_criteria
from eidrive_scenario.evaluation.criteria_parser import CriteriaContext, build_criteria, parse_criteria
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import read_recording

ROAD = Path(__file__).parents[2] / "xosc" / "roads" / "coop_1.xodr"
SIGN = 'dynamic="no" orientation="+" zOffset="2.4" country="DE" type="206"'
FUSED, OWN, TRUE = 2 * 31, 21, 9 * 41 - 2
"""Known and true actors, summed over the frames: two from frame 10 on; one from frame 20 on; nine, of which Last is
farther than 200 m in the first two frames."""


class Known(NamedTuple):
    """Settings of both uses, those that pass, those that fail, and the value."""

    settings: str
    passing: str
    failing: str
    value: float


TO_LEAD = "of: Ego, to: Lead"
RECALL = "of: Ego, range: 200"
RECORDED = {
    "actor_blocked": Known("of: Lead", "at_most: 4.01", "at_most: 3.9", 4.0),
    "age_of_information": Known("receiver: Ego, measure: peak", "at_most: 1.71", "at_most: 1.69", (1.2 + 2.2) / 2),
    "average_speed": Known("of: Ego", "at_least: 7.99", "at_least: 8.01", 8.0),
    "channel_busy_ratio": Known("of: Ego", "at_most: 0.31", "at_most: 0.29", 0.3),
    "collision": Known("of: Runner", "with: Lead", "with: Wreck", 1.0),
    "comfort": Known("of: Braker", "max_deceleration: 4.05", "max_deceleration: 1.99", 2.0 / 4.05),
    "cooperation_gain": Known(RECALL, "at_least: 0.11", "at_least: 0.12", (FUSED - OWN) / TRUE),
    "deceleration_to_avoid_crash": Known(TO_LEAD, "at_most: 2.67", "at_most: 2.66", 64 / 24),
    "detection_count": Known("of: Ego, measure: max", "at_least: 2", "at_least: 3", 2.0),
    "detection_recall": Known(RECALL, "at_least: 0.16", "at_least: 0.17", FUSED / TRUE),
    "driven_distance": Known("of: Ego", "at_least: 31.9", "at_least: 32.1", 32.0),
    "end_of_road": Known("of: Last, within: 1.6", "at_most: 4.01", "at_most: 3.9", 4.0),
    "false_braking": Known("of: Ego", "at_most: 1", "at_most: 0", 1.0),
    "first_detection": Known(TO_LEAD, "by: 1.0", "by: 0.9", 1.0),
    "in_route": Known("of: Ego, route: [[-70, 6], [10, 6]]", "at_most: 6.1", "at_most: 5.9", 6.0),
    "keep_lane": Known("of: Changer", "at_most: 1", "at_most: 0", 1.0),
    "latency": Known("receiver: Ego", "at_most: 0.21", "at_most: 0.19", 0.2),
    "max_speed": Known("of: Braker", "at_most: 10.1", "at_most: 9.9", 10.0),
    "min_distance": Known(TO_LEAD, "at_least: 11.9", "at_least: 12.1", 12.0),
    "min_speed": Known("of: Braker", "at_least: 1.9", "at_least: 2.1", 2.0),
    "monitor": Known("of: Seen", "expected: true", "expected: false", 1.0),
    "off_road": Known("of: Walker", "at_most: 4.01", "at_most: 3.9", 4.0),
    "on_sidewalk": Known("of: Walker", "at_most: 4.01", "at_most: 3.9", 4.0),
    "outside_route_lanes": Known("of: Wrong", "at_most: 1", "at_most: 0.99", 1.0),
    "packet_reception_ratio": Known("receiver: Ego", "at_least: 0.75", "at_least: 0.76", 0.75),
    "position_error": Known(TO_LEAD, "at_most: 0.51", "at_most: 0.49", 0.5),
    "post_encroachment_time": Known("of: Ego, to: Crosser", "at_least: 2.02", "at_least: 2.03", 3.4 - 11 / 8),
    "reach_position": Known("of: Ego, x: -38, y: 3", "within: 3.01", "within: 2.99", 3.0),
    "reached_region": Known("of: Ego, region: [[-46, -2], [-30, 2]]", "by: 3.01", "by: 2.9", 3.0),
    "route_completion": Known("of: Ego, route: [[-70, 0], [10, 0]]", "at_least: 0.39", "at_least: 0.41", 0.4),
    # The minimum distance is 8 + 3.5 / 2 + 11.5² / 8 = 26.28 m, that at t 44 m - 8 m/s t: too short from 2.3 s on
    "rss_violation": Known(TO_LEAD, "share: 0.44", "share: 0.43", 18 / 41),
    "running_red_light": Known("of: Runner", "part: rear", "part: front", 1.0),
    "running_stop_sign": Known("of: Runner", "below: 7", "below: 0.1", 1.0),
    "time_headway": Known(TO_LEAD, "at_least: 1.49", "at_least: 1.51", 1.5),
    "time_limit": Known("fatal: false", "within: 4.0", "within: 3.9", 4.0),
    "time_to_collision": Known(TO_LEAD, "at_least: 1.49", "at_least: 1.51", 1.5),
    "wrong_lane": Known("of: Wrong", "at_most: 20.1", "at_most: 19.9", 20.0),
    "yield_to_emergency_vehicle": Known("of: Walker, to: Ego", "at_most: 2.2", "at_most: 2.0", 2.1),
}
OF_FAILURE = {"collision", "running_red_light", "running_stop_sign"}
"""Criteria that count: their value is that of the failing settings, and 0 for the passing ones."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    """Return the frames of the recording, read from its file."""
    path = tmp_path_factory.mktemp("known") / "recording.mcap"
    recorder = Recorder(path, metadata={})
    for frame in known_recording.frames():
        recorder.observe(frame)
    recorder.close()
    return list(read_recording(path).frames())


@pytest.fixture(scope="module")
def both_roads() -> dict[str, RoadNetwork]:
    """Return the roads with the stop sign, and with a traffic light in its place."""
    text = ROAD.read_text(encoding="utf-8")
    assert text.count(SIGN) >= 1
    light = text.replace(SIGN, SIGN.replace('"no"', '"yes"').replace("206", "1000001"))
    return {"sign": RoadNetwork.parse(text.encode()), "light": RoadNetwork.parse(light.encode())}


def test_every_criterion_has_a_known_value() -> None:
    assert set(RECORDED) == set(registry("criteria"))


@pytest.mark.parametrize("kind", sorted(RECORDED))
def test_criterion_has_the_known_value_and_both_verdicts(
    recorded: list[Frame], both_roads: dict[str, RoadNetwork], kind: str
) -> None:
    known = RECORDED[kind]
    roads = both_roads["light" if kind == "running_red_light" else "sign"]
    passed, failed = (
        _verdict(f"{kind}: {{{known.settings}, {limit}}}", recorded, roads) for limit in (known.passing, known.failing)
    )
    assert (passed.passed, failed.passed) == (True, False), (passed.reason, failed.reason)
    assert (failed if kind in OF_FAILURE else passed).value == pytest.approx(known.value)
    assert passed.value == 0.0 or kind not in OF_FAILURE


def _verdict(text: str, frames: list[Frame], roads: RoadNetwork) -> Verdict:
    (criterion,) = build_criteria(parse_criteria(text, CriteriaContext(tuple(known_recording.ACTORS), ("Seen",))))
    (verdict,) = evaluate_criteria(frames, [criterion], roads, known_recording.LINKS)
    return verdict
