"""Scenes `driving/*` of the library: `behavior` reaches its goal without own fault, the lane follower does not."""

from __future__ import annotations

from pathlib import Path

import mirrored_scenario
import pytest
from corpora import corpora_folder
from lxml import etree

from eidrive_scenario.api.run import RunSettings, check_scenario, run_file

FOLDER = Path(__file__).parents[4] / "xosc" / "driving"
SCENES = sorted(path.stem for path in FOLDER.glob("*.xosc"))


def test_library_has_the_scenes() -> None:
    assert len(SCENES) == 25


@pytest.mark.exhaustive
@pytest.mark.parametrize("scene", sorted({*SCENES} - {*mirrored_scenario.SCENES}))
def test_behavior_arrives_without_collision_by_own_fault(scene: str) -> None:
    """Other scenes are driven and judged with traffic on both sides, by test_left_hand_traffic."""
    result = run_file(f"driving/{scene}", seed=1)
    assert {verdict.name for verdict in result.criteria} >= {"collision", "reach_position"}
    assert all(verdict.passed for verdict in result.criteria)
    assert result.metrics["collision.count"] == 0.0
    assert not result.warnings


@pytest.mark.exhaustive
@pytest.mark.parametrize("scene", [scene for scene in SCENES if scene != "parked_cars"])
def test_lane_follower_collides(scene: str) -> None:
    """Each scene contains a conflict: without a reaction there is a contact. Beside parked cars none is needed."""
    contact = {"collision": {"of": "Ego", "name": "contact", "fatal": True}}
    settings = RunSettings(parameters={"Planner": "route"}, criteria=contact)
    result = run_file(f"driving/{scene}", seed=1, settings=settings)
    assert result.metrics["contact.count"] > 0.0


@pytest.mark.parametrize("scene", SCENES)
def test_file_has_no_diagnostics(scene: str) -> None:
    report = check_scenario(FOLDER / f"{scene}.xosc")
    assert not [*report.errors, *report.warnings, *report.notes]


def test_files_are_valid_by_the_schema() -> None:
    schema = etree.XMLSchema(etree.parse(corpora_folder() / "schema" / "OpenSCENARIOv1.2.xsd"))
    for scene in SCENES:
        schema.assertValid(etree.parse(FOLDER / f"{scene}.xosc"))
