"""Criteria as scenario files state them: in our own words, in ScenarioRunner's, in scenario_simulator_v2's."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.errors import InvalidResult, SettingError
from eidrive_scenario.evaluation.criteria_parser import (
    exit_verdict,
    parse_criteria,
    stop_trigger_criteria,
    unsupported_criteria,
)
from eidrive_scenario.evaluation.criterion import Criterion, Verdict
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.registry import Registry
from eidrive_scenario.storyboard.state.commands import CustomCommand

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


def diagnostics(text: str, **given: object) -> list[str]:
    with pytest.raises(SettingError) as caught:
        parse_criteria(text, source="a.xosc", line=10, **given)  # type: ignore[arg-type]
    return [str(diagnostic) for diagnostic in caught.value.diagnostics]


def test_one_criterion() -> None:
    (criterion,) = parse_criteria("min_distance: {of: Ego, to: Incoming, at_least: 3.5}")
    assert criterion.name == "min_distance"
    assert criterion.subjects == ("Ego", "Incoming")
    assert criterion.verdict().limit == 3.5
    assert not criterion.fatal


class Unnamed(Criterion):
    """States no name."""

    def observe(self, frame: Frame) -> None:
        pass

    def verdict(self) -> Verdict:
        return Verdict(self.name, True, None, None, "", None, "")


def load_unnamed(self: Registry, name: str, base: type | None = None) -> type[Criterion]:
    assert name == "collision"
    return Unnamed


def test_criterion_without_a_name_has_that_of_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Registry, "load", load_unnamed)
    (criterion,) = parse_criteria("collision: {}")
    assert criterion.verdict().name == "collision"


def test_criterion_with_a_number_for_a_name_is_an_invalid_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Registry, "load", load_unnamed)
    monkeypatch.setattr(Unnamed, "name", 5, raising=False)
    with pytest.raises(InvalidResult, match=r"name is 5 \(expected a text\)"):
        parse_criteria("collision: {}")


def test_several_of_one_kind_get_numbers() -> None:
    text = "[collision: {of: A}, collision: {of: B}, collision: {of: C, name: third, fatal: true}]"
    criteria = parse_criteria(text, taken=["collision"])
    assert [criterion.name for criterion in criteria] == ["collision_2", "collision_3", "third"]
    assert criteria[2].fatal


def test_every_mistake_is_named_where_it_stands() -> None:
    text = "\n  colision: {of: Ego}\n  min_distance:\n    of: Ego\n    too: Incoming\n  time_limit: {within: 0}\n"
    assert diagnostics(text) == [
        "a.xosc:11: unknown criterion 'colision'; did you mean 'collision'?",
        "a.xosc:12: setting 'to' is missing; add it",
        "a.xosc:14: unknown setting 'too'; did you mean 'to'?",
        "a.xosc:15: setting 'within' is 0; input should be greater than 0",
    ]


def test_what_is_looked_at_has_to_be_there() -> None:
    known = {"entities": ["Ego", "Incoming"], "monitors": ["CutIn"]}
    assert diagnostics("monitor: {of: CutInn}", **known) == [
        "a.xosc:10: monitor looks at 'CutInn', which is no monitor of this scenario; did you mean 'CutIn'?"
    ]
    assert diagnostics("monitor: {of: CutIn}", monitors=[]) == [
        "a.xosc:10: monitor looks at 'CutIn', which is no monitor of this scenario; it declares none"
    ]
    assert len(parse_criteria("monitor: {of: CutIn}", entities=[], monitors=["CutIn"])) == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("min_distance: {of: Ego, to: Ego}", "of and to are both 'Ego': name two actors"),
        ("collision: {of: Ego, with: Ego}", "'Ego' cannot hit itself: name another actor in 'with'"),
        ("collision: {of: Ego, with: [Incoming, Ego]}", "'Ego' cannot hit itself: name another actor in 'with'"),
        ("max_speed: {of: Ego, at_most: 3, name: ''}", "setting 'name' is ''; string should have at least 1 character"),
    ],
)
def test_settings_without_meaning(text: str, told: str) -> None:
    (diagnostic,) = diagnostics(text)
    assert diagnostic.startswith("a.xosc:10: ")
    assert told in diagnostic


def test_in_a_list_each_has_its_own_lines() -> None:
    text = "[collision: {off_: A},\n collision: {of: B},\n collision: {\n of: C, with: 3}]"
    assert [diagnostic.split(": ")[0] for diagnostic in diagnostics(text)] == [
        "a.xosc:10",
        "a.xosc:10",
        "a.xosc:13",
        "a.xosc:13",
    ]


def test_an_actor_that_the_scenario_does_not_have() -> None:
    assert diagnostics("min_distance: {of: Ego, to: Incomming}", entities=["Ego", "Incoming"]) == [
        "a.xosc:10: min_distance looks at 'Incomming', which is no entity of this scenario; did you mean 'Incoming'?"
    ]


@pytest.mark.parametrize("text", ["", "collision", "3", "[1, 2]", "[]"])
def test_what_declares_nothing(text: str) -> None:
    (diagnostic,) = diagnostics(text)
    assert "declares no criterion; write min_distance: {of: Ego" in diagnostic


def test_settings_that_are_no_mapping() -> None:
    (diagnostic,) = diagnostics("max_speed: 13")
    assert (
        diagnostic
        == "a.xosc:10: max_speed is given 13; write max_speed: {…} with the settings name, fatal, of, at_most"
    )


def test_broken_yaml() -> None:
    (diagnostic,) = diagnostics("collision: {of: Ego")
    assert diagnostic.startswith("a.xosc:10: not valid YAML")


def test_a_criterion_that_would_get_lost() -> None:
    (diagnostic,) = diagnostics("collision: {of: A}\ncollision: {of: B}")
    assert diagnostic.startswith("a.xosc:11: not valid YAML: 'collision' stands here twice")


@pytest.mark.parametrize(("kind", "passed"), [("exitSuccess", True), ("exitFailure", False)])
def test_exit_commands(kind: str, passed: bool) -> None:
    verdict = exit_verdict(CustomCommand(kind, " gave way ", 7, "a.xosc"), 3.0)
    assert verdict.passed is passed
    assert verdict.fatal
    assert verdict.reason == f"the scenario called {kind} at 3.00 s: gave way"


CONDITION = """
<Condition name="{name}" delay="0" conditionEdge="rising">
  <ByValueCondition><ParameterCondition parameterRef="{parameter}" value="{value}" rule="lessThan"/></ByValueCondition>
</Condition>"""


def written_for_scenario_runner(*conditions: tuple[str, str, str], ego: bool = True) -> Scenario:
    text = PASSING_BY.read_text(encoding="utf-8")
    written = "".join(CONDITION.format(name=n, parameter=p, value=v) for n, p, v in conditions)
    text = text.replace("<ConditionGroup>", f"<ConditionGroup>{written}", 1)
    if ego:
        text = text.replace("<Properties/>", '<Properties><Property name="type" value="ego_vehicle"/></Properties>', 1)
    else:
        text = text.replace('"Ego"', '"Car"')
    return load_scenario(text.encode())


def test_conditions_of_scenario_runner() -> None:
    scenario = written_for_scenario_runner(
        ("criteria_CollisionTest", "", ""),
        ("criteria_DrivenDistanceTest", "distance_success", "100"),
        ("criteria_MaxVelocityTest", "max_velocity", "13.5"),
        ("criteria_KeepLaneTest", "", ""),
    )
    criteria = stop_trigger_criteria(scenario)
    assert [criterion.name for criterion in criteria] == ["collision", "driven_distance", "max_speed"]
    assert [criterion.verdict().limit for criterion in criteria] == [0.0, 100.0, 13.5]
    assert {criterion.subjects for criterion in criteria} == {("Ego",)}
    (warning,) = unsupported_criteria(scenario)
    assert warning.message == "criterion 'KeepLaneTest' is not judged"
    assert warning.line is not None


def test_the_other_conditions_of_the_trigger_are_no_criteria() -> None:
    scenario = load_scenario(PASSING_BY)
    assert stop_trigger_criteria(scenario) == []
    assert unsupported_criteria(scenario) == []


def test_a_value_that_is_no_number() -> None:
    scenario = written_for_scenario_runner(("criteria_DrivenDistanceTest", "distance_success", "far"))
    with pytest.raises(SettingError, match="setting 'at_least' is 'far'"):
        stop_trigger_criteria(scenario)


def test_no_ego() -> None:
    scenario = written_for_scenario_runner(("criteria_CollisionTest", "", ""), ego=False)
    with pytest.raises(SettingError, match="no entity is one; give a Vehicle the property"):
        stop_trigger_criteria(scenario)
