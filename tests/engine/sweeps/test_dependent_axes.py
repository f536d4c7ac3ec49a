"""Axes whose values require those of another axis."""

from __future__ import annotations

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.sweeps.jobs import contents_of
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.simulation import RunSettings


def test_fusion_of_features_is_valid_with_a_detector_of_another_axis() -> None:
    points = [{"detector": "pillars", "fusion": "max"}, {"detector": "pillars", "fusion": "average"}]
    contents = contents_of(resolve_scenario("coop/scenario_1"), points, RunSettings())
    assert set(contents) == {("detector", "pillars"), ("fusion", "max"), ("fusion", "average")}


def test_fusion_of_features_without_a_suitable_detector_is_an_error() -> None:
    with pytest.raises(InputError, match="which detector 'oracle' does not compute"):
        contents_of(resolve_scenario("coop/scenario_1"), [{"detector": "oracle", "fusion": "max"}], RunSettings())
