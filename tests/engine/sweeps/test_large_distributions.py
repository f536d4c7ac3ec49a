"""Distributions that a sweep cannot run: too many runs, or a distribution of a distribution."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.errors import ScenarioError, SettingError
from eidrive_scenario.experiments.sweeps.jobs import plan_of
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.simulation import RunSettings

RANGE = """<DeterministicSingleParameterDistribution parameterName="{name}"><DistributionRange stepWidth="0.029">
<Range lowerLimit="1" upperLimit="30"/></DistributionRange></DeterministicSingleParameterDistribution>"""


def test_distribution_of_a_billion_runs_raises_without_a_list_of_them(distribution: Path) -> None:
    """Three ranges of 1001 values have 1001³ runs; a list of them would not fit into the memory."""
    ranges = "".join(RANGE.format(name=name) for name in ("Speed", "Gap", "Delay"))
    text = distribution.read_text()
    start, end = text.index("<Deterministic>"), text.index("</ParameterValueDistribution>")
    distribution.write_text(f"{text[:start]}<Deterministic>{ranges}</Deterministic>{text[end:]}")
    with pytest.raises(SettingError, match="the sweep has 1003003001 runs; expected 1 to 10000000"):
        plan_of(distribution, [{}], RunSettings(), runs=100, is_distribution=True)


def test_number_of_runs_beyond_all_seeds_raises() -> None:
    with pytest.raises(SettingError, match="the sweep has 100000000000000000000 runs; expected 1 to 10000000"):
        plan_of(resolve_scenario("coop/scenario_1"), [{}], RunSettings(), runs=10**20)


def test_distribution_of_a_distribution_names_the_kind_of_file(distribution: Path) -> None:
    outer = distribution.with_name("outer.xosc")
    outer.write_text(distribution.read_text().replace("car.xosc", distribution.name))
    with pytest.raises(ScenarioError, match=r"speeds\.xosc:4: the file is a parameter value distribution, not a scen"):
        plan_of(outer, [{}], RunSettings(), is_distribution=True)
