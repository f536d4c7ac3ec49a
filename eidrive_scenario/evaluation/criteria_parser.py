"""Criteria as scenario files state them.

- ours: `CustomCommandAction type="eidrive.criterion"` with a YAML flow mapping, one criterion or several:
  `min_distance: {of: Ego, to: Incoming, at_least: 1.5}`
- ScenarioRunner's: ParameterConditions named `criteria_…` in the Storyboard's StopTrigger, about the ego vehicle
- scenario_simulator_v2's: CustomCommandActions of the types `exitSuccess` and `exitFailure`
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, Protocol

from eidrive_scenario.errors import Diagnostic, InvalidResult, SettingError, suggestion
from eidrive_scenario.evaluation.criterion import Criterion, Verdict
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import Condition, Vehicle
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.openscenario.values.references import resolve_references
from eidrive_scenario.registry import construct, registry
from eidrive_scenario.settings import key_lines, load_yaml, parse_settings

EXITS = {"exitSuccess": True, "exitFailure": False}
"""Types of scenario_simulator_v2's commands, and whether the run passes with them."""

PREFIX = "criteria_"
"""How the name of a condition begins that ScenarioRunner reads as a criterion."""

_EXAMPLE = "min_distance: {of: Ego, to: Incoming, at_least: 1.5}"


def parse_criteria(
    text: str,
    *,
    source: str = "",
    line: int | None = None,
    entities: Collection[str] | None = None,
    monitors: Collection[str] | None = None,
    taken: Collection[str] = (),
    scope: Scope | None = None,
) -> list[Criterion]:
    """The criteria that a command's text declares, in its order.

    entities  names of the scenario's entities, to check the actors against
    monitors  names of the scenario's monitors, to check those against that are read
    taken     names of criteria that the run already has; a criterion that would repeat one gets a number after it
    scope     parameters to which settings refer as `$name` or `${expression}`

    Raises SettingError with the file and line of every mistake.
    """
    data = load_yaml(text, source=source, line=line)
    entries = [data] if isinstance(data, dict) else data
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise SettingError(Diagnostic(f"{text.strip()!r} declares no criterion", f"write {_EXAMPLE}", source, line))
    names = set(taken)
    criteria = []
    diagnostics: list[Diagnostic] = []
    for kind, settings, lines in _items(entries, text, line):
        here = lines.get("", line)
        try:
            settings = resolve_references(settings, scope, source=source, line=here, lines=lines)
            criterion = _build(kind, settings, source, here, lines)
            _check_known(criterion, criterion.subjects, "entity", entities, source, here)
            _check_known(criterion, criterion.monitors, "monitor", monitors, source, here)
        except SettingError as error:
            diagnostics.extend(error.diagnostics)
            continue
        criterion.name = _free_name(criterion.name, names)
        names.add(criterion.name)
        criteria.append(criterion)
    if diagnostics:
        raise SettingError(diagnostics)
    return criteria


def _items(entries: list[dict[Any, Any]], text: str, line: int | None) -> Iterator[tuple[str, Any, Mapping[str, int]]]:
    """Each criterion's kind and settings, with the lines of its settings and under the empty name its own."""
    known = key_lines(text, 1 if line is None else line)
    several = "0" in known
    paths = {
        f"{place}.{kind}" if several else str(kind): (str(kind), settings)
        for place, entry in enumerate(entries)
        for kind, settings in entry.items()
    }
    lines: dict[str, dict[str, int]] = {path: {"": known[path]} if path in known else {} for path in paths}
    for key, number in known.items():
        for dot in (place for place, sign in enumerate(key) if sign == "."):
            if key[:dot] in lines:
                lines[key[:dot]][key[dot + 1 :]] = number
                break
    for path, (kind, settings) in paths.items():
        yield kind, settings, lines[path]


def _build(kind: str, settings: Any, source: str, line: int | None, lines: Mapping[str, int]) -> Criterion:
    known = registry("criteria")
    if kind not in known:
        raise SettingError(Diagnostic(f"unknown criterion {kind!r}", suggestion(kind, known), source, line))
    criterion_type = known.load(kind, Criterion)
    settings = {} if settings is None else settings
    if not isinstance(settings, dict):
        fields = criterion_type.settings_type.model_fields.items()
        hint = f"write {kind}: {{…}} with the settings {', '.join(field.alias or name for name, field in fields)}"
        raise SettingError(Diagnostic(f"{kind} is given {settings!r}", hint, source, line))
    parsed = parse_settings(criterion_type.settings_type, settings, source=source, line=line, lines=lines)
    criterion: Criterion = construct(criterion_type, parsed)
    name: object = getattr(criterion, "name", kind)
    if not isinstance(name, str) or not name:
        raise InvalidResult(criterion, "name", f"is {name!r} (expected a text)")
    criterion.name = name
    return criterion


def _check_known(
    criterion: Criterion,
    names: Collection[str],
    what: str,
    known: Collection[str] | None,
    source: str,
    line: int | None,
) -> None:
    unknown = [name for name in names if known is not None and name not in known]
    if unknown:
        raise SettingError(
            [
                Diagnostic(
                    f"{criterion.name} looks at {name!r}, which is no {what} of this scenario",
                    suggestion(name, known) if known else "it declares none",
                    source,
                    line,
                )
                for name in unknown
            ]
        )


def _free_name(name: str, taken: Collection[str]) -> str:
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free


class Command(Protocol):
    """A CustomCommandAction that the storyboard has just carried out."""

    @property
    def type(self) -> str: ...
    @property
    def content(self) -> str: ...


def exit_verdict(command: Command, time: float | None = None) -> Verdict:
    """The verdict of an `exitSuccess` or `exitFailure` command, given at `time` [s].

    Raises KeyError for a command of another type.
    """
    passed = EXITS[command.type]
    when = "" if time is None else f" at {time:.2f} s"
    text = command.content.strip()
    reason = f"the scenario called {command.type}{when}" + (f": {text}" if text else "")
    return Verdict(command.type, passed, None, None, "", None if passed else time, reason, fatal=True)


def stop_trigger_criteria(scenario: Scenario, taken: Collection[str] = ()) -> list[Criterion]:
    """The criteria that a file written for ScenarioRunner asks for, about its ego vehicle.

    Those that this engine does not have are left out and named by `unsupported_criteria`. Raises SettingError where the
    condition's value is wrong or no entity is the ego vehicle.
    """
    criteria: list[Criterion] = []
    for condition in _criterion_conditions(scenario):
        translated = _TRANSLATIONS.get(condition.name.removeprefix(PREFIX))
        if translated is None:
            continue
        kind, settings_of = translated
        settings = {"of": _ego(scenario, condition), **settings_of(_value(condition))}
        criterion = _build(kind, settings, condition.source, condition.line, {})
        criterion.name = _free_name(criterion.name, {*taken, *(other.name for other in criteria)})
        criteria.append(criterion)
    return criteria


def unsupported_criteria(scenario: Scenario) -> list[Diagnostic]:
    """ScenarioRunner's criteria in this file that this engine does not judge: warnings, as the run goes on."""
    return [
        Diagnostic(
            f"criterion {condition.name.removeprefix(PREFIX)!r} is not judged",
            f"this engine reads {', '.join(sorted(_TRANSLATIONS))}",
            condition.source,
            condition.line,
        )
        for condition in _criterion_conditions(scenario)
        if condition.name.removeprefix(PREFIX) not in _TRANSLATIONS
    ]


def _criterion_conditions(scenario: Scenario) -> Iterator[Condition]:
    trigger = scenario.storyboard.stop_trigger
    for group in trigger.condition_group if trigger is not None else ():
        for condition in group.condition:
            by_value = condition.by_value_condition
            if condition.name.startswith(PREFIX) and by_value is not None and by_value.parameter_condition is not None:
                yield condition


def _value(condition: Condition) -> str:
    by_value = condition.by_value_condition
    parameter = by_value.parameter_condition if by_value is not None else None
    return parameter.value if parameter is not None else ""


def _ego(scenario: Scenario, condition: Condition) -> str:
    """The vehicle with the property `type = ego_vehicle`, as ScenarioRunner has it; else the one named so."""
    for name, entity in scenario.entities.items():
        properties = entity.properties if isinstance(entity, Vehicle) else None
        for entry in properties.property if properties is not None else ():
            if (entry.name, entry.value) == ("type", "ego_vehicle"):
                return name
    for name in scenario.entities:
        if name.lower() in ("ego", "hero", "ego_vehicle"):
            return name
    raise SettingError(
        Diagnostic(
            f"{condition.name} is about the ego vehicle, and no entity is one",
            'give a Vehicle the property type="ego_vehicle"',
            condition.source,
            condition.line,
        )
    )


def _number(value: str) -> Any:
    try:
        return float(value)
    except ValueError:
        return value


_TRANSLATIONS: Mapping[str, tuple[str, Callable[[str], dict[str, Any]]]] = {
    "CollisionTest": ("collision", lambda _: {}),
    "DrivenDistanceTest": ("driven_distance", lambda value: {"at_least": _number(value)}),
    "MaxVelocityTest": ("max_speed", lambda value: {"at_most": _number(value)}),
}
"""ScenarioRunner's class, our criterion, and what becomes of the condition's value (SI units on both sides)."""
