"""Runs whose scripted bodies move in common arrays have the traces of those whose bodies move one by one."""

from __future__ import annotations

import pytest

from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.world.physics import body_group

pytestmark = pytest.mark.exhaustive


@pytest.mark.parametrize("name", ["coop/scenario_1", "coop/scenario_5", "coop/scenario_7"])
def test_trace_is_independent_of_the_number_from_which_bodies_move_together(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hashes = []
    for many in (1, 10**9):
        monkeypatch.setattr(body_group, "MANY", many)
        hashes.append(run_file(resolve_scenario(name), settings=RunSettings(time_limit=10.0)).trace_hash)
    assert hashes[0] == hashes[1]
