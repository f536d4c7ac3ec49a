"""Random parameters per seed, specified by `eidrive.variation` commands of a scenario.

    <CustomCommandAction type="eidrive.variation">
        {EgoStart: {uniform: [-0.15, 0.15]}, EgoSpeedFactor: {normal: [1.0, 0.005]}}
    </CustomCommandAction>

The parameters are declared in the file like all others; other engines use their declared value.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field, model_validator

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.files.yaml_text import load_yaml
from eidrive_scenario.openscenario.model import CustomCommandAction
from eidrive_scenario.openscenario.scenario import Scenario
from eidrive_scenario.openscenario.values.references import resolve_references, without
from eidrive_scenario.randomness import generator
from eidrive_scenario.settings import Settings, parse_settings

COMMAND = "eidrive.variation"


class Distribution(Settings):
    """Distribution of one parameter: either uniform or normal."""

    uniform: tuple[float, float] | None = None
    """Lower and upper bound."""
    normal: tuple[float, Annotated[float, Field(ge=0)]] | None = None
    """Mean and standard deviation; draws are clipped at three standard deviations."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Distribution:
        if (self.uniform is None) == (self.normal is None):
            raise ValueError("give either uniform: [low, high] or normal: [mean, sd]")
        if self.uniform is not None and self.uniform[0] > self.uniform[1]:
            raise ValueError("the lower bound of uniform is above the upper one")
        return self

    def draw(self, seed: int, name: str) -> float:
        """Return the value of the parameter `name` for this seed."""
        random = generator(seed, "variation", name)
        if self.uniform is not None:
            return float(random.uniform(*self.uniform))
        mean, sd = self.normal or (0.0, 0.0)
        return mean + sd * min(3.0, max(-3.0, float(random.standard_normal())))


def drawn_parameters(scenario: Scenario, seed: int) -> dict[str, str]:
    """Return the parameters that this scenario draws for `seed`.

    The bounds may refer to other parameters (`{normal: [$Mean, 0.5]}`), but not to drawn ones. Raise SettingError with
    file and line if a command is invalid.
    """
    found: list[tuple[CustomCommandAction, dict[Any, Any]]] = []
    for action in _commands(scenario):
        data = load_yaml(action.content, source=action.source, line=action.line)
        if not isinstance(data, dict):
            raise SettingError(
                Diagnostic(
                    f"{COMMAND} is {quoted(data)}",
                    "write a mapping such as {EgoStart: {uniform: [-0.15, 0.15]}}",
                    action.source,
                    action.line,
                )
            )
        found.append((action, data))
    names = {str(name) for _, data in found for name in data}
    drawn: dict[str, str] = {}
    for action, data in found:
        scope = without(action.scope, names)
        bounds = resolve_references(data, scope, source=action.source, line=action.line)
        for name, spec in bounds.items():
            drawn[name] = repr(_distribution(scenario, action, str(name), spec).draw(seed, str(name)))
    return drawn


def _distribution(scenario: Scenario, action: CustomCommandAction, name: str, spec: Any) -> Distribution:
    if name not in scenario.parameters:
        raise SettingError(
            Diagnostic(
                f"{COMMAND}: parameter {quoted(name)} is not declared",
                suggestion(name, scenario.parameters),
                action.source,
                action.line,
            )
        )
    if not isinstance(spec, dict):
        spec = {"": spec}
    return parse_settings(Distribution, spec, source=action.source, line=action.line)


def _commands(scenario: Scenario) -> Iterator[CustomCommandAction]:
    init = scenario.storyboard.init
    for user_defined in init.actions.user_defined_action:
        command = user_defined.custom_command_action
        if command.type == COMMAND:
            yield command
