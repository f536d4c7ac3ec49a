"""Random parameters per seed, specified by `eidrive.variation` commands of a scenario.

    <CustomCommandAction type="eidrive.variation">
        {EgoStart: {uniform: [-0.15, 0.15]}, EgoSpeedFactor: {normal: [1.0, 0.005]}}
    </CustomCommandAction>

The parameters are declared in the file like all others; other engines use their declared value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any
from weakref import WeakKeyDictionary

from pydantic import Field, model_validator

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import Diagnostic, ErrorCollector, SettingError, quoted, suggestion
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.files.yaml_text import load_mapping
from eidrive_scenario.openscenario.model import CustomCommandAction
from eidrive_scenario.openscenario.scenario import Scenario
from eidrive_scenario.openscenario.values.parameters import hide_parameters, parameter_hints, resolve_references

COMMAND = "eidrive.variation"
_EXPECTED = "give either uniform: [low, high] or normal: [mean, sd]"


class Distribution(Settings):
    """Distribution of one parameter: either uniform or normal."""

    uniform: tuple[float, float] | None = None
    """Lower and upper bound."""
    normal: tuple[float, Annotated[float, Field(ge=0)]] | None = None
    """Mean and standard deviation; draws are clipped at three standard deviations."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Distribution:
        if (self.uniform is None) == (self.normal is None):
            raise ValueError(_EXPECTED)
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
    """Return the parameters that this scenario draws for `seed`. Raise InputError like `variations`."""
    return {name: repr(distribution.draw(seed, name)) for name, distribution in variations(scenario).items()}


_variations: WeakKeyDictionary[Scenario, Mapping[str, Distribution]] = WeakKeyDictionary()
"""Variations of scenarios without errors."""


def variations(scenario: Scenario) -> Mapping[str, Distribution]:
    """Return the distribution of each parameter that this scenario draws, by its name.

    The bounds may refer to other parameters (`{normal: [$Mean, 0.5]}`), but not to drawn ones. Raise InputError with
    file and line of every error in the commands, SettingError for an object that is no scenario, such as its path.
    """
    if not isinstance(scenario, Scenario):
        raise SettingError(Diagnostic(f"scenario is {quoted(scenario)}", "give the result of load_scenario"))
    distributions = _variations.get(scenario)
    if distributions is None:
        distributions = _variations[scenario] = _read_variations(scenario)
    return distributions


def _read_variations(scenario: Scenario) -> Mapping[str, Distribution]:
    errors = ErrorCollector()
    specified: list[tuple[CustomCommandAction, dict[Any, Any], dict[str, int]]] = []
    for command in scenario.custom_commands:
        if command.type == COMMAND:
            with errors:
                specified.append((command, *_content(scenario, command)))
    drawn = {str(name) for _, content, _ in specified for name in content}
    distributions: dict[str, Distribution] = {}
    for command, content, lines in specified:
        scope = hide_parameters(command.scope, drawn)
        for key, bounds in content.items():
            name, prefix = str(key), f"{key}."
            source, line = command.source, lines.get(name, command.line)
            own = {path.removeprefix(prefix): at for path, at in lines.items() if path.startswith(prefix)}
            message, hint = "", ""
            if name in distributions:
                message, hint = f"parameter {quoted(name)} is drawn twice", "remove one"
            elif name not in scenario.parameters:
                message, hint = f"parameter {quoted(name)} is not declared", suggestion(name, scenario.parameters)
            elif not isinstance(bounds, dict) or not bounds:
                message, hint = f"parameter {quoted(name)} is {quoted(bounds)}", _EXPECTED
            with errors:
                if message:
                    raise SettingError(Diagnostic(f"{COMMAND}: {message}", hint, source, line))
                origins = parameter_hints(bounds, scope)
                resolved = resolve_references(bounds, scope, source=source, line=line, lines=own)
                distributions[name] = parse_settings(
                    Distribution, resolved, source=source, line=line, lines=own, origins=origins
                )
    errors.raise_if_any()
    return distributions


def _content(scenario: Scenario, command: CustomCommandAction) -> tuple[dict[Any, Any], dict[str, int]]:
    """Return the bounds of each parameter of a command, and the lines of the keys.

    Raise SettingError if it is not a mapping or not in Init.
    """
    source, line = command.source, command.line
    initial = scenario.storyboard.init.actions.user_defined_action
    if not any(command is action.custom_command_action for action in initial):
        raise SettingError(Diagnostic(f"{COMMAND} has no effect in an event", "move it to Init", source, line))
    hint = "write a mapping such as {EgoStart: {uniform: [-0.15, 0.15]}}"
    return load_mapping(command.content, COMMAND, hint, source=source, line=line)
