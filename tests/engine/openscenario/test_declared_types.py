"""Check of variable and parameter values against their declared types."""

import pytest
from openscenario_xml import scenario_xml

from eidrive_scenario.openscenario import load_scenario

VARIABLES = """<VariableDeclarations>
<VariableDeclaration name="speed" variableType="double" value="{speed}"/>
<VariableDeclaration name="count" variableType="int" value="3"/>
<VariableDeclaration name="mood" variableType="string" value="5"/>
<VariableDeclaration name="open" variableType="boolean" value="false"/>
</VariableDeclarations>"""
SET = '<GlobalAction><VariableAction variableRef="{name}"><SetAction value="{value}"/></VariableAction></GlobalAction>'
ADD = """<GlobalAction><VariableAction variableRef="{name}"><ModifyAction><Rule><AddValue value="1"/></Rule>
</ModifyAction></VariableAction></GlobalAction>"""
HALVE = ADD.replace("AddValue", "MultiplyByValue").replace('"1"', '"0.5"')


@pytest.mark.parametrize(
    ("speed", "init", "message"),
    [
        ("fast", "", "variable 'speed' is declared as double, but its value is 'fast'; the value is used as a text"),
        ("1", SET.format(name="speed", value="fast"), "'speed' is declared as double, but set to 'fast'"),
        ("1", SET.format(name="count", value="1.5"), "'count' is declared as int, but set to '1.5'"),
        ("1", HALVE.format(name="count"), "'count' is declared as int, but modified by 0.5; a fraction of the result"),
        ("1", ADD.format(name="mood"), "'mood' is declared as string, but modified as a number; declare it as double"),
    ],
)
def test_values_of_other_types_are_warnings(speed: str, init: str, message: str) -> None:
    (warning,) = load_scenario(scenario_xml(declarations=VARIABLES.format(speed=speed), init=init)).warnings
    assert message in str(warning)
    assert warning.line is not None


def test_values_of_declared_types_are_accepted() -> None:
    """Booleans may be capitalized, as Python writes them."""
    init = "".join(
        (
            SET.format(name="speed", value="1e-3"),
            SET.format(name="open", value="True"),
            SET.format(name="mood", value="calm"),
            ADD.format(name="count"),
            HALVE.format(name="speed"),
        )
    )
    assert load_scenario(scenario_xml(declarations=VARIABLES.format(speed="2.5"), init=init)).warnings == ()
