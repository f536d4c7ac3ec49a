"""Values of variables and parameters against the types that are declared."""

from collections.abc import Callable

import pytest

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


@pytest.mark.parametrize(
    ("speed", "init", "message"),
    [
        ("fast", "", "the variable 'speed' is declared as double, but its value is 'fast'; it is taken as a text"),
        ("1", SET.format(name="speed", value="fast"), "'speed' is declared as double, and here set to 'fast'"),
        ("1", SET.format(name="count", value="1.5"), "'count' is declared as int, and here set to '1.5'"),
        ("1", ADD.format(name="mood"), "'mood' is declared as string, and here calculated with; declare it as double"),
    ],
)
def test_what_does_not_fit_is_told(scenario_xml: Callable[..., bytes], speed: str, init: str, message: str) -> None:
    (warning,) = load_scenario(scenario_xml(declarations=VARIABLES.format(speed=speed), init=init)).warnings
    assert message in str(warning)
    assert warning.line is not None


def test_what_fits_is_not(scenario_xml: Callable[..., bytes]) -> None:
    """Truth values may have the capitals that Python writes."""
    init = "".join(
        (
            SET.format(name="speed", value="1e-3"),
            SET.format(name="open", value="True"),
            SET.format(name="mood", value="calm"),
            ADD.format(name="count"),
        )
    )
    assert load_scenario(scenario_xml(declarations=VARIABLES.format(speed="2.5"), init=init)).warnings == ()
