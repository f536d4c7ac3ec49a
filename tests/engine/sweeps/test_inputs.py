"""Keys of the runs of a sweep: a change of a file that only some runs read changes their keys."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, Point, parse_axes, points_of
from eidrive_scenario.experiments.sweeps.jobs import SweepPlan, plan_of
from eidrive_scenario.simulation import RunSettings

ROADS = """<DeterministicSingleParameterDistribution parameterName="Road"><DistributionSet>
      <Element value="a.xodr"/><Element value="b.xodr"/>
    </DistributionSet></DeterministicSingleParameterDistribution>
    <DeterministicSingleParameterDistribution parameterName="Speed">"""


def write_road(scenario: Path, name: str, length: float) -> None:
    scenario.with_name(name).write_text(map_xml(road_xml(length=length)))


@pytest.fixture
def on_roads(scenario: Path) -> Path:
    """Return the scenario with a parameter `Road` that names its road file, a.xodr or b.xodr."""
    text = scenario.read_text().replace("<RoadNetwork/>", '<RoadNetwork><LogicFile filepath="$Road"/></RoadNetwork>')
    declared = '<ParameterDeclaration name="Road" parameterType="string" value="a.xodr"/></ParameterDeclarations>'
    scenario.write_text(text.replace("</ParameterDeclarations>", declared))
    for name in ("a.xodr", "b.xodr"):
        write_road(scenario, name, 100.0)
    return scenario


def grid(*axes: str) -> list[Point]:
    return points_of(parse_axes(list(axes)), "grid", None, 1)


def keys_of(plan: SweepPlan) -> list[str]:
    return [job.key for job in plan]


def test_keys_depend_on_files_that_parameters_name(on_roads: Path) -> None:
    points = grid("Road=a.xodr,b.xodr", "Speed=5,10")
    first = keys_of(plan_of(on_roads, points, RunSettings()))
    assert keys_of(plan_of(on_roads, points, RunSettings())) == first
    write_road(on_roads, "b.xodr", 120.0)
    changed = keys_of(plan_of(on_roads, points, RunSettings()))
    assert [one == other for one, other in zip(first, changed, strict=True)] == [True, True, False, False]


def test_keys_depend_on_files_that_a_distribution_names(on_roads: Path, distribution: Path) -> None:
    """The runs 0 to 2 have a.xodr, 3 to 5 b.xodr; constraints exclude the speed 50 of the runs 2 and 5."""
    text = distribution.read_text()
    distribution.write_text(text.replace('<DeterministicSingleParameterDistribution parameterName="Speed">', ROADS))
    first = keys_of(plan_of(distribution, [{}], RunSettings(), is_distribution=True))
    write_road(on_roads, "b.xodr", 120.0)
    changed = keys_of(plan_of(distribution, [{}], RunSettings(), is_distribution=True))
    assert [one == other for one, other in zip(first, changed, strict=True)] == [True] * 3 + [False] * 3


def test_keys_depend_on_setting_files_if_the_default_is_excluded(scenario: Path) -> None:
    """Each run has a speed that the constraints permit; the default of the scenario is none of them."""
    scenario.write_text(scenario.read_text().replace('value="5">', 'value="45">'))
    files = [scenario.with_name(name) for name in ("one.yaml", "two.yaml")]
    for file in files:
        file.write_text("delay: {kind: constant, seconds: 0.1}")
    points = grid("Speed=5,10", f"channel={files[0]},{files[1]}")
    first = keys_of(plan_of(scenario, points, RunSettings()))
    files[1].write_text("delay: {kind: constant, seconds: 0.2}")
    changed = keys_of(plan_of(scenario, points, RunSettings()))
    assert [one == other for one, other in zip(first, changed, strict=True)] == [True, False, True, False]


def test_keys_of_a_search_depend_on_files_of_its_space(scenario: Path) -> None:
    file = scenario.with_name("setting.yaml")
    space = (Axis("Speed", low=0.0, high=30.0), Axis("channel", ("none", str(file))))
    keys = []
    for seconds in (0.1, 0.2):
        file.write_text(f"delay: {{kind: constant, seconds: {seconds}}}")
        plan = plan_of(scenario, [{}], RunSettings(), space=space)
        keys.append([plan.job(0, {"Speed": 7.0, "channel": one}, 1).key for one in ("none", str(file))])
    assert keys[0][0] == keys[1][0]
    assert keys[0][1] != keys[1][1]


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        (("run=1,2",), "'run' is the number of a run"),
        (("Speed=5,6",), "the distribution varies parameter 'Speed'"),
        (("param.Speed=5,6",), "the distribution varies parameter 'Speed'"),
    ],
)
def test_axes_of_a_distribution_that_it_varies_itself_raise(
    distribution: Path, axes: tuple[str, ...], expected: str
) -> None:
    with pytest.raises(SettingError, match=expected):
        plan_of(distribution, grid(*axes), RunSettings(), is_distribution=True)


def test_parameter_of_all_runs_that_the_distribution_varies_raises(distribution: Path) -> None:
    with pytest.raises(SettingError, match=r"RunSettings\.parameters: the distribution varies parameter 'Speed'"):
        plan_of(distribution, [{}], RunSettings(parameters={"Speed": "8"}), is_distribution=True)


@pytest.mark.parametrize("is_searched", [False, True])
def test_parameter_of_all_runs_that_an_axis_varies_raises(scenario: Path, is_searched: bool) -> None:
    settings = RunSettings(parameters={"Speed": "8"})
    points = grid() if is_searched else grid("param.Speed=5,6")
    with pytest.raises(SettingError, match=r"RunSettings\.parameters: --vary varies parameter 'Speed'"):
        plan_of(scenario, points, settings, space=(Axis("Speed", (5, 6)),) if is_searched else ())


def test_unknown_axis_of_a_search_raises_before_its_runs(scenario: Path) -> None:
    with pytest.raises(SettingError, match="did you mean 'Speed'"):
        plan_of(scenario, [{}], RunSettings(), space=(Axis("Sped", low=0.0, high=1.0),))


def test_combinations_of_equal_settings_raise(scenario: Path, distribution: Path) -> None:
    """They have one key, so that the store has one row for both."""
    points, settings = grid("cooperate=Ego,Ego+Ego", "dt=0.05,0.1"), RunSettings(drive="Ego")
    message = r"^--vary: cooperate=Ego, dt=0\.05 and cooperate=Ego\+Ego, dt=0\.05 are the same run"
    for path in (scenario, distribution):
        with pytest.raises(SettingError, match=message):
            plan_of(path, points, settings, is_distribution=path == distribution)


def test_invalid_text_of_axis_is_error_of_vary(scenario: Path) -> None:
    with pytest.raises(InputError, match=r"^RunSettings\.weather: "):
        plan_of(scenario, [{}], RunSettings(weather="hail"))
    with pytest.raises(InputError, match=r"^--vary: weather: no weather preset 'hail'"):
        plan_of(scenario, grid("weather=sunny,hail"), RunSettings())
