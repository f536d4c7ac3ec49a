import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from openscenario_xml import parameters_xml, scenario_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import Scenario, load_scenario, model


def speed_of(scenario: Scenario) -> float:
    return next(one.value for one in scenario.document.walk() if isinstance(one, model.AbsoluteTargetSpeed))


@pytest.mark.element("$parameter")
def test_parameter_reference_is_substituted() -> None:
    xml = scenario_xml(declarations=parameters_xml(Speed=("double", "12.5")), story=story_xml(speed="$Speed"))
    assert speed_of(load_scenario(xml)) == 12.5
    assert load_scenario(xml).parameters == {"Speed": "12.5"}


@pytest.mark.element("${expression}")
def test_assigned_value_takes_precedence_over_default() -> None:
    declared = parameters_xml(Kmh=("double", "36"), Speed=("double", "${$Kmh / 3.6}"))
    xml = scenario_xml(declarations=declared, story=story_xml(speed="${$Speed + 1}"))
    assert speed_of(load_scenario(xml)) == pytest.approx(11)
    assert speed_of(load_scenario(xml, {"Kmh": "72"})) == pytest.approx(21)
    assert load_scenario(xml, {"Kmh": "72"}).parameters["Kmh"] == "72"


def test_invalid_assignments_are_errors() -> None:
    xml = scenario_xml(declarations=parameters_xml(Speed=("double", "10")))
    with pytest.raises(ScenarioError, match=r"unknown parameter 'Sped'; did you mean 'Speed'\?"):
        load_scenario(xml, {"Sped": "3"})
    with pytest.raises(ScenarioError, match="parameter 'Speed' is 'fast', which is not a number"):
        load_scenario(xml, {"Speed": "fast"})
    with pytest.raises(ScenarioError, match="unknown parameter 'Speed'"):
        load_scenario(scenario_xml(), {"Speed": "3"})


@pytest.mark.element("$parameter")
def test_inner_scope_hides_outer_parameter() -> None:
    inner = parameters_xml(Speed=("double", "${$Speed * 2}"))
    story = story_xml(speed="$Speed").replace('<Story name="story">', f'<Story name="story">{inner}')
    xml = scenario_xml(declarations=parameters_xml(Speed=("double", "4")), story=story)
    assert speed_of(load_scenario(xml)) == 8


@pytest.mark.element("ConstraintGroup")
@pytest.mark.parametrize(
    ("kind", "value", "rule", "limit", "fits"),
    [
        ("double", "10", "lessThan", "10.5", True),
        ("double", "10", "lessThan", "10", False),
        ("double", str(3 * 0.1), "lessOrEqual", "0.3", True),
        ("double", str(3 * 0.1), "equalTo", "0.3", True),
        ("int", "3", "greaterOrEqual", "3", True),
        ("string", "car", "notEqualTo", "car", False),
        ("string", "-4", "greaterOrEqual", "-5", True),
        ("string", "-12", "lessThan", "-2", True),
        ("string", "10", "lessThan", "9", False),
        ("string", "van", "greaterThan", "car", True),
        ("dateTime", "2026-01-31T12:00:00", "greaterThan", "2026-01-31T11:00:00Z", True),
    ],
)
def test_parameter_constraints_are_checked(kind: str, value: str, rule: str, limit: str, fits: bool) -> None:
    declared = f"""<ParameterDeclarations><ParameterDeclaration name="P" parameterType="{kind}" value="{value}">
    <ConstraintGroup><ValueConstraint rule="{rule}" value="{limit}"/></ConstraintGroup>
    </ParameterDeclaration></ParameterDeclarations>"""
    if fits:
        assert load_scenario(scenario_xml(declarations=declared)).parameters == {"P": value}
    else:
        with pytest.raises(ScenarioError, match="outside its constraints"):
            load_scenario(scenario_xml(declarations=declared))


@pytest.mark.element("ConstraintGroup")
@pytest.mark.parametrize(
    ("value", "rule", "limit", "fits"),
    [
        ("-5.0", "equalTo", "-5", True),
        ("-5", "equalTo", "-5.0", True),
        ("-5.0", "equalTo", "-5.0", True),
        ("5e0", "lessThan", "6.0", True),
        ("-5.0", "equalTo", "5", False),
    ],
)
def test_integer_parameter_with_zero_fraction_satisfies_constraints(
    value: str, rule: str, limit: str, fits: bool
) -> None:
    declared = f"""<ParameterDeclarations><ParameterDeclaration name="P" parameterType="int" value="{{}}">
    <ConstraintGroup><ValueConstraint rule="{rule}" value="{limit}"/></ConstraintGroup>
    </ParameterDeclaration></ParameterDeclarations>"""
    xml = scenario_xml(declarations=declared.format(value))
    as_default: tuple[bytes, dict[str, str]] = (xml, {})
    assigned = (xml, {"P": value})
    for text, values in (as_default, assigned):
        if fits:
            scenario = load_scenario(text, values)
            assert float(scenario.parameters["P"]) == float(value)
            assert not any("declared as" in diagnostic.message for diagnostic in scenario.warnings)
        else:
            with pytest.raises(ScenarioError, match="outside its constraints"):
                load_scenario(text, values)


def test_integer_parameter_with_nonzero_fraction_is_an_error() -> None:
    xml = scenario_xml(declarations=parameters_xml(Lane=("int", "-1")))
    with pytest.raises(ScenarioError, match=r"parameter 'Lane' is '-1\.5', which is not a whole number"):
        load_scenario(xml, {"Lane": "-1.5"})


@pytest.mark.element("ConstraintGroup")
def test_constraint_groups_are_alternatives() -> None:
    group = '<ConstraintGroup><ValueConstraint rule="equalTo" value="{}"/></ConstraintGroup>'
    declared = f"""<ParameterDeclarations><ParameterDeclaration name="P" parameterType="int" value="2">
    {group.format(1)}{group.format(2)}</ParameterDeclaration></ParameterDeclarations>"""
    xml = scenario_xml(declarations=declared)
    assert load_scenario(xml).parameters == {"P": "2"}
    with pytest.raises(ScenarioError, match="expected equalTo 1 or equalTo 2"):
        load_scenario(xml, {"P": "3"})


def test_integers_have_no_fraction_in_texts() -> None:
    position = '<LanePosition roadId="1" laneId="${$Lane - 1}" s="${$S * 2}"/>'
    teleport = f"<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"
    xml = scenario_xml(
        declarations=parameters_xml(Lane=("double", "-1"), S=("int", "7")),
        init=f'<Private entityRef="Ego">{teleport}</Private>',
    )
    lane = next(one for one in load_scenario(xml).document.walk() if isinstance(one, model.LanePosition))
    assert (lane.lane_id, lane.s) == ("-2", 14.0)


def test_invalid_declaration_is_reported_once() -> None:
    xml = scenario_xml(declarations=parameters_xml(Speed=("double", "${1 / 0}")), story=story_xml(speed="$Speed"))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(xml)
    assert len(caught.value.diagnostics) == 1
    assert "has no value" in str(caught.value)


@pytest.mark.parametrize("kmh", ["1", "$Speed", "${2 * $Speed}"], ids=["order", "cycle", "cycle of expressions"])
def test_use_before_the_declaration_is_reported_as_that(kmh: str) -> None:
    declared = parameters_xml(Speed=("double", "${$Kmh / 3.6}"), Kmh=("double", kmh))
    with pytest.raises(ScenarioError, match=r"parameter \$Kmh is used before its declaration; declare it above"):
        load_scenario(scenario_xml(declarations=declared))


def test_parameter_reference_attribute_may_be_a_parameter() -> None:
    condition = '<ParameterCondition parameterRef="$Speed" rule="equalTo" value="3"/>'
    stop = f"""<ConditionGroup><Condition name="c" delay="0" conditionEdge="none">
    <ByValueCondition>{condition}</ByValueCondition></Condition></ConditionGroup>"""
    scenario = load_scenario(scenario_xml(declarations=parameters_xml(Speed=("double", "10")), stop=stop))
    found = next(one for one in scenario.document.walk() if isinstance(one, model.ParameterCondition))
    assert found.parameter_ref == "Speed"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=150)
@given(
    kind=st.sampled_from(["double", "int", "string", "boolean", "dateTime", "unsignedShort"]),
    value=st.text(alphabet="0123456789.+-*/%(),$abePstruefalsi {}", max_size=30),
    speed=st.text(alphabet="0123456789.+-*/%(),$aPsqrtminmax {}", max_size=30),
)
def test_random_references_raise_only_scenario_errors(kind: str, value: str, speed: str) -> None:
    declared = parameters_xml(P=(kind, value), a=("double", "1"))
    try:
        scenario = load_scenario(scenario_xml(declarations=declared, story=story_xml(speed=speed)))
    except ScenarioError:
        return
    assert isinstance(speed_of(scenario), float)
