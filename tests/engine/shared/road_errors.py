"""Errors of the OpenDRIVE reader."""

from __future__ import annotations

import pytest

from eidrive_scenario.errors import RoadError
from eidrive_scenario.roads import RoadNetwork


def road_diagnostics(text: str) -> list[str]:
    """Return the diagnostics of a map `town.xodr` that is rejected."""
    with pytest.raises(RoadError) as caught:
        RoadNetwork.parse(text, "town.xodr")
    return [str(diagnostic) for diagnostic in caught.value.diagnostics]
