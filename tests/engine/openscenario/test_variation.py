"""Commands `eidrive.variation`: parameters that are drawn for each seed."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from openscenario_xml import parameters_xml, scenario_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import InputError
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.openscenario.variation import drawn_parameters

Build = Callable[..., Scenario]


def command(content: str) -> str:
    return (
        "<UserDefinedAction>"
        f'<CustomCommandAction type="eidrive.variation">{content}</CustomCommandAction></UserDefinedAction>'
    )


@pytest.fixture
def build() -> Build:
    """Return a function that loads a scenario with the parameters Start and Speed."""

    def loaded(init: str, action: str = "") -> Scenario:
        declarations = parameters_xml(Start=("double", "0"), Speed=("double", "10"))
        story = re.sub("<PrivateAction>.*</PrivateAction>", action, story_xml(), flags=re.DOTALL)
        return load_scenario(scenario_xml(declarations=declarations, init=init, story=story if action else ""))

    return loaded


def diagnostics(scenario: Scenario) -> list[str]:
    with pytest.raises(InputError) as caught:
        drawn_parameters(scenario, 1)
    return [f"{one.message}; {one.hint}" for one in caught.value.diagnostics]


def test_bounds_limit_the_drawn_value(build: Build) -> None:
    scenario = build(command("{Start: {uniform: [2, 3]}, Speed: {normal: [10, 0.5]}}"))
    for seed in range(20):
        drawn = drawn_parameters(scenario, seed)
        assert 2.0 <= float(drawn["Start"]) < 3.0
        assert 8.5 <= float(drawn["Speed"]) <= 11.5


def test_errors_of_all_parameters_and_commands_are_reported(build: Build) -> None:
    scenario = build(
        command("{Strat: {uniform: [0, 1]}, Start: 3, Speed: {unifrom: [0, 1]}}")
        + command("[]")
        + command("{Start: {}}")
    )
    expected = "give either uniform: [low, high] or normal: [mean, sd]"
    assert diagnostics(scenario) == [
        "eidrive.variation is []; write a mapping such as {EgoStart: {uniform: [-0.15, 0.15]}}",
        "eidrive.variation: parameter 'Strat' is not declared; did you mean 'Start'?",
        f"eidrive.variation: parameter 'Start' is 3; {expected}",
        "unknown setting 'unifrom'; did you mean 'uniform'?",
        f"eidrive.variation: parameter 'Start' is {{}}; {expected}",
    ]


def test_error_has_line_of_its_parameter(build: Build) -> None:
    scenario = build(command("{\n  Start: {uniform: [0, 1]},\n  Speed: {uniform: [1, 0]}}"))
    first = scenario.custom_commands[0].line
    with pytest.raises(InputError) as caught:
        drawn_parameters(scenario, 1)
    assert [one.line for one in caught.value.diagnostics] == [first + 2]


def test_parameter_that_two_commands_draw_is_an_error(build: Build) -> None:
    scenario = build(command("{Start: {uniform: [0, 1]}}") * 2)
    assert diagnostics(scenario) == ["eidrive.variation: parameter 'Start' is drawn twice; remove one"]


def test_variation_in_an_event_is_an_error(build: Build) -> None:
    """Parameters are substituted when the file is read; an equal command in Init does not hide the error."""
    given = command("{Start: {uniform: [0, 1]}}")
    assert diagnostics(build(given, action=given)) == ["eidrive.variation has no effect in an event; move it to Init"]
