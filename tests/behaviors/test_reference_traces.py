"""Scenarios of third parties against what esmini 3.6.0 does with them, where EIDRIVE_CORPORA says where they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from reference_player import comparable, compare, source_of

CORPORA = os.environ.get("EIDRIVE_CORPORA", "")
pytestmark = pytest.mark.skipif(not CORPORA, reason="EIDRIVE_CORPORA does not say where the third-party scenarios are")

DEVIATIONS = {
    "esmini__alks_r157_cut_in_quick_brake": "a controller of esmini brakes Ego; without it it collides",
    "esmini__auto_light": "names a folder of catalogs that is not there",
    "esmini__cut-in_cr": "esmini ends LaneOffsetActions that are continuous; by the standard they go on",
    "esmini__cut-in_simple": "waits for an acceleration of exactly 0, which a sinusoidal lane change has half way",
    "esmini__cut-in_visibility": "free space along the road in a bend: one or two steps of 0.01 s",
    "esmini__keep_lateral_distance": "the standard leaves the course of a LateralDistanceAction open",
    "esmini__light_state": "a flashing light: esmini's action never ends, here it ends with its transition time",
    "esmini__ltap-od-relative-speed": "a position beyond the end of its road",
    "esmini__parking_demo": "the speed along trajectories whose times are to be followed",
    "esmini__routing-test": "esmini drives faster than its speed where a lane slants to its road; 0.34 m",
    "esmini__trailers": "esmini drives faster than its speed where a lane slants to its road; 0.33 m",
    "esmini__trajectory-test": "the speed along trajectories whose times are to be followed",
    "ALKS__alks_scenario_4_2_3_crossing_pedestrian_template": "esmini turns a crossing pedestrian along the road",
    "ASAM-1.3.1__EndofTrafficJamNeighboringLaneOccupied": "a lane change over a distance while braking: 0.17 m",
}
"""Where we differ, and why."""


def names() -> list[str]:
    return [name for name in comparable(Path(CORPORA)) if name not in DEVIATIONS] if CORPORA else ["none"]


@pytest.mark.timeout(240)
@pytest.mark.parametrize("name", names())
def test_a_scenario_agrees_within_10_cm_and_50_ms(name: str) -> None:
    found = compare(source_of(Path(CORPORA), name), Path(CORPORA) / "reference", name)
    assert found.missing == ()
    assert found.late == ()
    assert found.rms < 0.1


@pytest.mark.parametrize("name", ["esmini__cut-in", "ASAM-1.3.1__CutIn"])
def test_the_cut_ins_end_at_their_stop_trigger_within_5_cm_and_20_ms(name: str) -> None:
    found = compare(source_of(Path(CORPORA), name), Path(CORPORA) / "reference", name)
    assert found.run.ended == "stop trigger"
    assert found.rms < 0.05
    assert max(worst for _, worst in found.position.values()) < 0.2
    assert found.events < 0.0201


def test_every_deviation_is_of_a_scenario_that_can_be_compared() -> None:
    assert set(DEVIATIONS) <= set(comparable(Path(CORPORA)))
