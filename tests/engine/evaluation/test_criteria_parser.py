"""Criteria of scenario files in the formats of this project, of ScenarioRunner and of scenario_simulator_v2."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.errors import InvalidResult, SettingError
from eidrive_scenario.evaluation import criteria_parser
from eidrive_scenario.evaluation.criteria_parser import (
    CriteriaContext,
    build_criteria,
    exit_verdict,
    parse_criteria,
)
from eidrive_scenario.evaluation.criterion import Criterion, Verdict, evaluate_criteria
from eidrive_scenario.extensions.registry import Registry
from eidrive_scenario.files.yaml_text import load_yaml_text
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.storyboard.state.commands import CustomCommand

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


def diagnostics(text: str, **given: object) -> list[str]:
    with pytest.raises(SettingError) as caught:
        parse_criteria(text, CriteriaContext(**given), source="a.xosc", line=10)  # type: ignore[arg-type]
    return [str(diagnostic) for diagnostic in caught.value.diagnostics]


def parse(text: str, taken: list[str] | None = None, **given: object) -> list[Criterion]:
    return build_criteria(parse_criteria(text, CriteriaContext(**given)), taken or [])  # type: ignore[arg-type]


def test_parse_criteria_of_one_entry_returns_its_settings() -> None:
    (criterion,) = parse("min_distance: {of: Ego, to: Incoming, at_least: 3.5}")
    assert criterion.name == "min_distance"
    assert criterion.subjects == ("Ego", "Incoming")
    assert criterion.verdict().limit == 3.5
    assert not criterion.fatal


class Unnamed(Criterion):
    """Criterion without a name."""

    def observe(self, frame: Frame) -> None:
        pass

    def verdict(self) -> Verdict:
        return Verdict(self.name, True, None, None, "", None, "")


def load_unnamed(self: Registry, name: str, base: type | None = None) -> type[Criterion]:
    assert name == "collision"
    return Unnamed


def test_criterion_without_name_has_name_of_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Registry, "load", load_unnamed)
    (criterion,) = parse("collision: {}")
    assert criterion.verdict().name == "collision"


def test_criterion_with_numeric_name_raises_invalid_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Registry, "load", load_unnamed)
    monkeypatch.setattr(Unnamed, "name", 5, raising=False)
    with pytest.raises(InvalidResult, match=r"name is 5 \(expected a text\)"):
        parse_criteria("collision: {}")


def test_criteria_of_equal_kind_get_numbered_names() -> None:
    text = "[collision: {of: A}, collision: {of: B}, collision: {of: C, name: third, fatal: true}]"
    criteria = parse(text, taken=["collision"])
    assert [criterion.name for criterion in criteria] == ["collision_2", "collision_3", "third"]
    assert criteria[2].fatal


def test_build_criteria_of_one_declaration_twice_returns_independent_criteria() -> None:
    """A command that is executed twice adds two criteria with their own state."""
    declarations = parse_criteria("collision: {of: Ego}")
    first, second = (build_criteria(declarations) for _ in range(2))
    assert first[0] is not second[0]
    assert [criterion.name for criterion in (*first, *second)] == ["collision", "collision"]


def test_run_parses_each_criterion_command_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The library scenario declares its criteria in commands of Init, which are executed before the first tick."""
    texts: list[str] = []

    def counted(text: str, **given: object) -> object:
        texts.append(text)
        return load_yaml_text(text, **given)  # type: ignore[arg-type]

    monkeypatch.setattr(criteria_parser, "load_yaml_text", counted)
    with Simulation("coop/scenario_1") as simulation:
        simulation.tick()
        assert {criterion.name for criterion in simulation.criteria} >= {"collision", "min_distance"}
    assert len(texts) == len(set(texts)) > 0


def test_parse_criteria_reports_every_error_with_its_line() -> None:
    text = "\n  colision: {of: Ego}\n  min_distance:\n    of: Ego\n    too: Incoming\n  time_limit: {within: 0}\n"
    assert diagnostics(text) == [
        "a.xosc:11: unknown criterion 'colision'; did you mean 'collision'?",
        "a.xosc:12: criterion 'min_distance': setting 'to' is missing; add it",
        "a.xosc:14: criterion 'min_distance': unknown setting 'too'; did you mean 'to'?",
        "a.xosc:15: criterion 'time_limit': setting 'within' is 0; input should be greater than 0",
    ]


@pytest.mark.parametrize(("key", "value"), [("off", "False"), ("1", "1")])
def test_key_that_yaml_reads_as_a_value_is_an_error(key: str, value: str) -> None:
    """YAML 1.1 reads off, on, yes and no as Booleans."""
    assert (
        f"a.xosc:10: criterion 'driven_distance': the name of a setting is {value}; put it in quotes: YAML reads on, "
        "off, yes, no and numbers as values"
    ) in diagnostics(f"driven_distance: {{of: Ego, {key}: 5}}")


def test_criterion_that_requires_roads_is_an_error_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Registry, "load", load_unnamed)
    monkeypatch.setattr(Unnamed, "needs_roads", True)
    assert diagnostics("collision: {}", has_roads=False) == [
        "a.xosc:10: criterion 'collision' requires roads, and the scenario has none; add a LogicFile to its RoadNetwork"
    ]
    (criterion,) = parse("collision: {}")
    with pytest.raises(SettingError, match="requires roads, and there are none"):
        evaluate_criteria([], [criterion])


@pytest.mark.parametrize("kind", ["in_route", "route_completion"])
def test_criterion_on_a_route_is_an_error_without_any(kind: str) -> None:
    (error,) = diagnostics(f"{kind}: {{of: Ego}}", has_routes=False)
    assert error == (
        f"a.xosc:10: criterion '{kind}' evaluates a route, and the scenario requests none; add an AssignRouteAction or "
        "an AcquirePositionAction, or give the points of the setting 'route'"
    )
    assert parse(f"{kind}: {{of: Ego, route: [[0, 0], [9, 0]]}}", has_routes=False)
    assert parse(f"{kind}: {{of: Ego}}")


def test_criterion_of_unknown_monitor_is_reported() -> None:
    known = {"entities": ["Ego", "Incoming"], "monitors": ["CutIn"]}
    assert diagnostics("monitor: {of: CutInn}", **known) == [
        "a.xosc:10: criterion 'monitor': unknown monitor 'CutInn'; did you mean 'CutIn'?"
    ]
    assert diagnostics("monitor: {of: CutIn}", monitors=()) == [
        "a.xosc:10: criterion 'monitor': unknown monitor 'CutIn'; the scenario declares no monitor"
    ]
    assert len(parse("monitor: {of: CutIn}", entities=(), monitors=("CutIn",))) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("min_distance: {of: Ego, to: Ego}", "'of' and 'to' are equal (got 'Ego'; expected two actors)"),
        ("collision: {of: Ego, with: Ego}", "'with' contains the actor itself (got 'Ego'; expected another actor)"),
        (
            "collision: {of: Ego, with: [Incoming, Ego]}",
            "'with' contains the actor itself (got 'Ego'; expected another actor)",
        ),
        ("collision: {of: Ego, with: []}", "'with' lists no actor (expected actors, or no 'with' for contact with any"),
        ("in_route: {of: Ego, route: [[3, 4], [3, 4]]}", "'route' has no length (got (3.0, 4.0) only; expected diff"),
        ("detection_recall: {of: Ego, at_least: 80}", "setting 'at_least' is 80; input should be less than or equal"),
        ("min_distance: {of: Ego, to: Incoming, at_least: true}", "setting 'at_least' is True; give a number"),
        ("position_error: {of: Ego, to: Ego}", "'of' and 'to' are equal (got 'Ego'; expected two actors)"),
        ("max_speed: {of: Ego, at_most: 3, name: ''}", "setting 'name' is ''; string should have at least 1 character"),
    ],
)
def test_contradictory_settings_are_reported(text: str, message: str) -> None:
    (diagnostic,) = diagnostics(text)
    assert diagnostic.startswith(f"a.xosc:10: criterion {text.split(':')[0]!r}: ")
    assert message in diagnostic


def test_invalid_value_of_a_list_is_one_error() -> None:
    with pytest.raises(SettingError) as caught:
        parse_criteria("detection_count: {of: Ego, classes: [cars]}")
    (diagnostic,) = caught.value.diagnostics
    assert "'classes.0' is 'cars'" in diagnostic.message


def test_diagnostics_of_listed_criteria_have_their_own_lines() -> None:
    text = "[collision: {off_: A},\n collision: {of: B},\n collision: {\n of: C, with: 3}]"
    assert [diagnostic.split(": ")[0] for diagnostic in diagnostics(text)] == [
        "a.xosc:10",
        "a.xosc:10",
        "a.xosc:13",
        "a.xosc:13",
    ]


def test_criterion_of_unknown_entity_is_reported() -> None:
    assert diagnostics("min_distance: {of: Ego, to: Incomming}", entities=("Ego", "Incoming")) == [
        "a.xosc:10: criterion 'min_distance': unknown entity 'Incomming'; did you mean 'Incoming'?"
    ]


@pytest.mark.parametrize("text", ["", "collision", "3", "[1, 2]", "[]"])
def test_text_without_criterion_is_reported(text: str) -> None:
    (diagnostic,) = diagnostics(text)
    assert diagnostic.startswith(
        f"a.xosc:10: eidrive.criterion: no criterion is declared (got {text!r}); write min_dis"
    )


def test_settings_other_than_a_mapping_are_reported() -> None:
    (diagnostic,) = diagnostics("max_speed: 13")
    assert diagnostic == (
        "a.xosc:10: criterion 'max_speed': settings are not a mapping (got 13); "
        "write max_speed: {…} with the settings name, fatal, of, at_most"
    )


def test_invalid_yaml_is_reported() -> None:
    (diagnostic,) = diagnostics("collision: {of: Ego")
    assert diagnostic.startswith("a.xosc:10: not valid YAML")


def test_duplicate_yaml_key_is_reported() -> None:
    (diagnostic,) = diagnostics("collision: {of: A}\ncollision: {of: B}")
    assert diagnostic.startswith("a.xosc:11: not valid YAML: duplicate key 'collision'")


@pytest.mark.parametrize(("kind", "passed"), [("exitSuccess", True), ("exitFailure", False)])
def test_exit_verdict_has_outcome_and_text_of_command(kind: str, passed: bool) -> None:
    verdict = exit_verdict(CustomCommand(kind, " gave way ", 7, "a.xosc"), 3.0)
    assert verdict.passed is passed
    assert verdict.fatal
    assert verdict.reason == f"the scenario executed {kind} at 3.00 s: gave way"
