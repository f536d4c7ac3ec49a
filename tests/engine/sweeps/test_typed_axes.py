"""Values of the types of parameters: whole numbers in intervals of integers, and texts of strings as written."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, parse_axis, points_of, settings_at, with_types
from eidrive_scenario.experiments.sweeps.comparison import compare_values
from eidrive_scenario.experiments.sweeps.results import stored_runs, values_of
from eidrive_scenario.reporting.run_report.reported_runs import read_sweeps
from eidrive_scenario.reporting.run_report.run_groups import group_runs
from eidrive_scenario.simulation import RunSettings

__all__ = ["eidrive"]

COUNT = Axis("Count", low=0.5, high=4.5)


@pytest.fixture
def counted(scenario: Path) -> Path:
    declared = (
        '<ParameterDeclaration name="Count" parameterType="unsignedShort" value="2"/>'
        '<ParameterDeclaration name="Model" parameterType="string" value="van"/>'
    )
    scenario.write_text(scenario.read_text().replace("<ParameterDeclarations>", f"<ParameterDeclarations>{declared}"))
    return scenario


def test_latin_hypercube_of_whole_numbers_has_each_equally_often(counted: Path) -> None:
    """The strata of a Latin hypercube divide the four numbers evenly."""
    axes = with_types([COUNT, Axis("Speed", low=1.0, high=9.0)], counted)
    points = points_of(axes, "lhs", 40, 1)
    assert Counter(point["Count"] for point in points) == dict.fromkeys((1, 2, 3, 4), 10)
    assert {type(point["Count"]) for point in points} == {int}
    assert all(isinstance(point["Speed"], float) for point in points)


def test_values_of_a_distribution_have_the_types_of_its_scenario(counted: Path, distribution: Path) -> None:
    distribution.with_name("car.xosc").write_text(counted.read_text())
    (axis,) = with_types([parse_axis("param.Count=1:3")], distribution, is_distribution=True)
    assert [axis.nearest(value) for value in (1.0, 1.4, 2.6, 3.0)] == [1, 1, 3, 3]
    assert axis.ends == (1, 3)


def test_interval_without_two_whole_numbers_raises(counted: Path) -> None:
    with pytest.raises(SettingError, match=r"Count is a whole number, and 1\.2:2\.7 has fewer than two of them"):
        with_types([Axis("Count", low=1.2, high=2.7)], counted)


@pytest.mark.parametrize("given", ["1.10,1.1", "1.10", "+5,5", "1e3,2"])
def test_values_of_a_string_keep_their_texts(counted: Path, given: str) -> None:
    points = points_of(with_types([parse_axis(f"Model={given}")], counted), "grid", None, 1)
    assert [settings_at(point, RunSettings(), None).parameters["Model"] for point in points] == given.split(",")


@pytest.mark.parametrize(
    ("axis", "values"), [("Model=1,2.5", (1, 2.5)), ("Model=a,1", ("a", 1)), ("Speed=1.10,2", (1.1, 2))]
)
def test_other_numbers_remain_numbers(counted: Path, axis: str, values: tuple[object, ...]) -> None:
    (typed_axis,) = with_types([parse_axis(axis)], counted)
    assert typed_axis.values == values
    assert [type(value) for value in typed_axis.values] == [type(value) for value in values]


@pytest.fixture
def models(counted: Path) -> Path:
    """Return a distribution over two texts of a string, and over a number in two forms."""
    path = counted.with_name("models.xosc")
    varied = "".join(
        f'<DeterministicSingleParameterDistribution parameterName="{name}"><DistributionSet>{elements}'
        "</DistributionSet></DeterministicSingleParameterDistribution>"
        for name in ("Model", "Speed")
        for elements in ["".join(f'<Element value="{text}"/>' for text in ("1.10", "1.1"))]
    )
    path.write_text(
        '<?xml version="1.0"?><OpenSCENARIO>'
        '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="test" description="models"/>'
        f'<ParameterValueDistribution><ScenarioFile filepath="car.xosc"/><Deterministic>{varied}</Deterministic>'
        "</ParameterValueDistribution></OpenSCENARIO>"
    )
    return path


def test_texts_of_a_distribution_remain_apart_and_numbers_do_not(eidrive: Eidrive, models: Path) -> None:
    store, runs = models.with_name("s.db"), models.with_name("runs")
    eidrive("sweep", models, "--store", store, "--workers", "1")
    eidrive("run", models, "--seed", "2", "--no-record", "--out", runs)
    for stores in ([store], [runs], [store, runs]):
        values = values_of(stored_runs(stores))
        assert (values["Model"], values["Speed"]) == (["1.10", "1.1"], [1.1])
    groups = [
        json.loads(line)["point"] for line in eidrive("results", store, "--by", "Model", "--json").stdout.splitlines()
    ]
    assert groups == [{"Model": "1.10"}, {"Model": "1.1"}]
    (compared,) = compare_values([store, runs], "Model", ["1.10", "1.1"])
    assert (compared.first, compared.second) == ("1.10", "1.1")
    (group,) = group_runs(read_sweeps([store])[0])
    assert {run.value_of("Model") for run in group.runs} == {"1.10", "1.1"}


def test_numbers_of_a_string_are_texts_in_results(eidrive: Eidrive, counted: Path) -> None:
    store, runs = counted.with_name("s.db"), counted.with_name("runs")
    eidrive("sweep", counted, "--vary", "Model=1,2.5", "--store", store, "--workers", "1")
    eidrive("run", counted, "--param", "Model=1", "--seed", "2", "--no-record", "--out", runs)
    assert values_of(stored_runs([store, runs]))["Model"] == ["1", "2.5"]
    assert all(run.result["parameter.Model"] == run.point["Model"] for run in stored_runs([store, runs]))


def test_one_number_in_two_forms_is_given_twice(counted: Path) -> None:
    with pytest.raises(SettingError, match="a value is given twice"):
        with_types([parse_axis("Speed=1.1,1.10")], counted)
