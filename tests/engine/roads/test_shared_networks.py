"""Tests of the sharing of road networks between loads of an unchanged file."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.errors import RoadError
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork


@pytest.fixture
def road_file(tmp_path: Path) -> Path:
    copy = tmp_path / "roads.xodr"
    copy.write_bytes(min((library_path() / "roads").glob("*.xodr"), key=lambda path: path.stat().st_size).read_bytes())
    return copy


def test_load_of_unchanged_file_returns_the_same_network(road_file: Path) -> None:
    first, second = RoadNetwork.load(road_file), RoadNetwork.load(str(road_file))
    assert first is second
    assert first.graph is second.graph


def test_load_of_changed_file_returns_a_new_network(road_file: Path) -> None:
    first = RoadNetwork.load(road_file)
    road_file.write_bytes(road_file.read_bytes() + b"<!-- changed -->")
    second = RoadNetwork.load(road_file)
    assert second is not first
    assert second.roads.keys() == first.roads.keys()
    road_file.write_text("<OpenDRIVE/>")
    with pytest.raises(RoadError):
        RoadNetwork.load(road_file)
    road_file.unlink()
    with pytest.raises(RoadError, match="cannot read"):
        RoadNetwork.load(road_file)


def test_diagnostics_have_the_path_of_the_loaded_file(road_file: Path) -> None:
    other = road_file.with_name("other.xodr")
    other.write_bytes(road_file.read_bytes())
    assert RoadNetwork.load(road_file).source == str(road_file)
    assert RoadNetwork.load(other).source == str(other)
