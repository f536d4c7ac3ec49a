"""Conditions on parameters and user-defined values, and comparisons by rules."""

from __future__ import annotations

from pathlib import Path

import pytest
from eidrive_behaviors.conditions.values import satisfies
from openscenario_xml import catalog_xml, parameters_xml, scenario_xml
from recorded_scene import RunScene, first_start
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    event_xml,
    global_xml,
    group_xml,
    maneuver_xml,
    time_xml,
    trigger_xml,
)
from street_scene import NOTHING
from whole_run import RecordedRun

from eidrive_scenario.api.actions import model, satisfies_rule
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation


@pytest.mark.element("ParameterCondition")
def test_parameter_and_user_defined_value_conditions(scene: RunScene) -> None:
    value = "<ByValueCondition>{}</ByValueCondition>"
    level = value.format('<ParameterCondition parameterRef="Level" rule="greaterThan" value="1.5"/>')
    outside = value.format('<UserDefinedValueCondition name="button" rule="equalTo" value="pressed"/>')
    assert first_start(scene(0.2, ("Ego", NOTHING, level))) == 0.0
    assert first_start(scene(0.2, ("Ego", NOTHING, outside))) is None


def when_parameter_is(value: str) -> str:
    condition = f'<ParameterCondition parameterRef="Level" rule="equalTo" value="{value}"/>'
    return trigger_xml(condition_xml(f"<ByValueCondition>{condition}</ByValueCondition>"))


@pytest.mark.element("ParameterCondition")
def test_parameter_condition_refers_to_the_innermost_declaration(tmp_path: Path) -> None:
    """A parameter is visible in the element that declares it, and hides those of the same name outside of it."""
    own = maneuver_xml("".join(event_xml(f"own {value}", NOTHING, when_parameter_is(value)) for value in "1237"))
    entry = maneuver_xml(
        f"{parameters_xml(Level=('double', '9'))}{event_xml('entry', NOTHING, when_parameter_is('3'))}"
    )
    add = """<ParameterAction parameterRef="Level"><ModifyAction><Rule><AddValue value="5"/></Rule></ModifyAction>
      </ParameterAction>"""
    later = maneuver_xml(event_xml("add", global_xml(add), trigger_xml(condition_xml(time_xml(0.5)))), "later")
    assigned = """<CatalogReference catalogName="c" entryName="maneuver"><ParameterAssignments>
      <ParameterAssignment parameterRef="Level" value="3"/></ParameterAssignments></CatalogReference>"""
    groups = group_xml(own, name="own") + group_xml(later, name="later") + group_xml(assigned, name="of catalog")
    story = f'<Story name="story">{parameters_xml(Level=("double", "2"))}{act_xml(groups)}</Story>'
    (tmp_path / "c.xosc").write_bytes(catalog_xml("c", entry))
    path = tmp_path / "s.xosc"
    places = '<ManeuverCatalog><Directory path="."/></ManeuverCatalog>'
    path.write_bytes(scenario_xml(declarations=parameters_xml(Level=("double", "1")), catalogs=places, story=story))
    record = RecordedRun()
    Simulation(load_scenario(path), settings=RunSettings(time_limit=1.0), observers=[record]).run()
    begun = {name: record.begun(name) for name in ("own 1", "own 2", "own 3", "own 7", "entry")}
    assert begun == {"own 1": [], "own 2": [0.0], "own 3": [], "own 7": [pytest.approx(0.55)], "entry": [0.0]}


@pytest.mark.element("ParameterSetAction")
def test_parameter_action_sets_the_innermost_declaration_only(tmp_path: Path) -> None:
    """The parameter of the scenario, and that of another story, keep their values."""

    def story(name: str, declarations: str, *values: str) -> str:
        events = "".join(event_xml(f"{name} {value}", NOTHING, when_parameter_is(value)) for value in values)
        changed = {"own": "7", "outer": "8"}.get(name)
        if changed is not None:
            action = f'<ParameterAction parameterRef="Level"><SetAction value="{changed}"/></ParameterAction>'
            events += event_xml(f"set {name}", global_xml(action), trigger_xml(condition_xml(time_xml(0.5))))
        return f'<Story name="{name}">{declarations}{act_xml(group_xml(maneuver_xml(events)))}</Story>'

    declared = {value: parameters_xml(Level=("double", value)) for value in "123"}
    stories = (
        story("own", declared["2"], "7", "8") + story("outer", "", "7", "8") + story("other", declared["3"], "7", "8")
    )
    path = tmp_path / "s.xosc"
    path.write_bytes(scenario_xml(declarations=declared["1"], story=stories))
    record = RecordedRun()
    Simulation(load_scenario(path), settings=RunSettings(time_limit=1.0), observers=[record]).run()
    begun = {name for name in ("own 7", "own 8", "outer 7", "outer 8", "other 7", "other 8") if record.begun(name)}
    assert begun == {"own 7", "outer 8"}


@pytest.mark.element("ParameterSetAction", "CatalogReference")
def test_parameter_action_sets_the_parameter_of_one_use_of_a_catalog_maneuver(tmp_path: Path) -> None:
    """The first use starts at once and sets its parameter at 0.5 s; the second one starts then and has its own."""
    action = global_xml('<ParameterAction parameterRef="Level"><SetAction value="7"/></ParameterAction>')
    at_first = f"{condition_xml(time_xml(0.45))}{condition_xml(time_xml(0.55, 'lessThan'))}"
    events = event_xml("set", action, trigger_xml(at_first)) + event_xml("follow", NOTHING, when_parameter_is("7"))
    (tmp_path / "c.xosc").write_bytes(
        catalog_xml("c", maneuver_xml(f"{parameters_xml(Level=('double', '2'))}{events}"))
    )
    use = group_xml('<CatalogReference catalogName="c" entryName="maneuver"/>')
    acts = acts_xml(act_xml(use, name="first"), act_xml(use, trigger_xml(condition_xml(time_xml(0.6))), name="second"))
    path = tmp_path / "s.xosc"
    path.write_bytes(scenario_xml(catalogs='<ManeuverCatalog><Directory path="."/></ManeuverCatalog>', story=acts))
    record = RecordedRun()
    Simulation(load_scenario(path), settings=RunSettings(time_limit=1.0), observers=[record]).run()
    assert record.begun("follow") == [pytest.approx(0.5)]


@pytest.mark.element("ParameterSetAction", "CatalogReference")
@pytest.mark.parametrize("own", ["", parameters_xml(Speed=("double", "2"))])
def test_parameter_action_of_a_catalog_maneuver_sets_the_parameter_of_the_scenario(tmp_path: Path, own: str) -> None:
    action = global_xml('<ParameterAction parameterRef="Level"><SetAction value="7"/></ParameterAction>')
    setting = event_xml("set", action, trigger_xml(condition_xml(time_xml(0.45))))
    (tmp_path / "c.xosc").write_bytes(catalog_xml("c", maneuver_xml(own + setting)))
    follow = maneuver_xml(event_xml("follow", NOTHING, when_parameter_is("7")))
    text = scenario_xml(
        catalogs='<ManeuverCatalog><Directory path="."/></ManeuverCatalog>',
        declarations=parameters_xml(Level=("double", "2")),
        story=acts_xml(
            act_xml(
                group_xml('<CatalogReference catalogName="c" entryName="maneuver"/>', name="1")
                + group_xml(follow, name="2")
            )
        ),
    )
    path = tmp_path / "s.xosc"
    path.write_bytes(text)
    record = RecordedRun()
    Simulation(load_scenario(path), settings=RunSettings(time_limit=1.0), observers=[record]).run()
    assert record.begun("follow") == [pytest.approx(0.5)]


@pytest.mark.parametrize(
    ("text", "rule", "limit", "expected"),
    [
        ("10", "greaterThan", "9", True),
        ("b", "greaterThan", "a", True),
        ("true", "equalTo", "1", True),
        ("2.0", "equalTo", "2", True),
        ("two", "notEqualTo", "2", True),
        (" 1e1 ", "equalTo", "+10.", True),
        ("1_0", "equalTo", "10", False),
        ("nan", "equalTo", "nan", True),
        ("INF", "greaterThan", "1e300", True),
        ("a", "lessOrEqual", "a", True),
        (None, "notEqualTo", "a", False),
        ("2026-01-01T12:00:00+10:00", "lessThan", "2026-01-01T03:00:00Z", True),
        ("2026-01-01T12:00:00Z", "equalTo", "2026-01-01T13:00:00.0+01:00", True),
        ("2026-01-01T12:00:00", "equalTo", "2026-01-01T12:00:00.000", True),
        ("2026-13-01T12:00:00", "greaterThan", "2026-01-01T12:00:00", True),
    ],
)
def test_satisfies_compares_numbers_and_instants_if_both_texts_are_such(
    text: str | None, rule: str, limit: str, expected: bool
) -> None:
    assert satisfies(text, model.Rule(rule), limit) is expected


@pytest.mark.parametrize(
    ("rule", "below", "same", "above"),
    [
        ("greaterThan", False, False, True),
        ("greaterOrEqual", False, True, True),
        ("lessThan", True, False, False),
        ("lessOrEqual", True, True, False),
        ("equalTo", False, True, False),
        ("notEqualTo", True, False, True),
    ],
)
def test_satisfies_rule_has_a_small_tolerance(rule: str, below: bool, same: bool, above: bool) -> None:
    answers = [satisfies_rule(value, model.Rule(rule), 3.0) for value in (2.9, 3.0 + 1e-9, 3.1)]
    assert answers == [below, same, above]
    assert not satisfies_rule(float("nan"), model.Rule(rule), 3.0)
