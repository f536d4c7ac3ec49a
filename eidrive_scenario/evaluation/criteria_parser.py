"""Parser of criteria in scenario files.

- `CustomCommandAction type="eidrive.criterion"` with a YAML flow mapping, one criterion or several:
  `min_distance: {of: Ego, to: Incoming, at_least: 1.5}`
- ScenarioRunner: criteria in the StopTrigger of the Storyboard, about the ego vehicle (see `scenario_runner`)
- scenario_simulator_v2: CustomCommandActions of the types `exitSuccess` and `exitFailure`

A command is parsed once, before the run. `build_criteria` then creates new criteria at each execution of the command.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain, count
from typing import Any

from eidrive_scenario.errors import Diagnostic, InvalidResult, SettingError, suggestion
from eidrive_scenario.evaluation.criterion import Criterion, CriterionSettings, Verdict
from eidrive_scenario.extensions.registry import construct, registry
from eidrive_scenario.extensions.settings import parse_settings, settings_type_of
from eidrive_scenario.files.yaml_text import flow_yaml, load_yaml_text
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.conventions import CRITERION_PREFIX, criteria_of, property_entries
from eidrive_scenario.openscenario.model import Condition, Vehicle
from eidrive_scenario.openscenario.values.parameters import Scope, parameter_hints, resolve_references
from eidrive_scenario.storyboard.state.commands import CustomCommand


@dataclass(frozen=True)
class Translation:
    """Criterion for a class of ScenarioRunner.

    fixed      settings that agree with ScenarioRunner
    arguments  settings by argument of the class; the first one is that of a condition without a known argument
    """

    kind: str
    fixed: Mapping[str, Any] = field(default_factory=dict)
    arguments: Mapping[str, str] = field(default_factory=dict)


CLASSES: Mapping[str, Translation] = {
    "ActorBlockedTest": Translation("actor_blocked", arguments={"max_time": "at_most", "min_speed": "below"}),
    "AverageVelocityTest": Translation("average_speed", arguments={"velocity": "at_least"}),
    "CollisionTest": Translation("collision"),
    "DrivenDistanceTest": Translation("driven_distance", arguments={"distance": "at_least"}),
    "EndofRoadTest": Translation("end_of_road", arguments={"duration": "at_most"}),
    "InRouteTest": Translation("in_route", arguments={"offroad_max": "at_most", "offroad_min": "beyond"}),
    "KeepLaneTest": Translation("keep_lane"),
    "MaxVelocityTest": Translation("max_speed", arguments={"max_velocity": "at_most"}),
    "OffRoadTest": Translation("off_road", arguments={"duration": "at_most"}),
    "OnSidewalkTest": Translation("on_sidewalk", arguments={"duration": "at_most"}),
    "OutsideRouteLanesTest": Translation("outside_route_lanes"),
    "RouteCompletionTest": Translation("route_completion", fixed={"within": 10.0}),
    "RunningRedLightTest": Translation("running_red_light", fixed={"part": "rear"}),
    "RunningStopTest": Translation("running_stop_sign"),
    "WrongLaneTest": Translation("wrong_lane"),
    "YieldToEmergencyVehicleTest": Translation("yield_to_emergency_vehicle", arguments={"ev": "to"}),
}
"""Criteria by class of ScenarioRunner; SI units on both sides."""

INEXPRESSIBLE: Mapping[str, str] = {
    "InRadiusRegionTest": "reach_position: {of: Ego, x: 100, y: 20, within: 5}",
    "MinimumSpeedRouteTest": "average_speed: {of: Ego, at_least: 5}",
    "ReachedRegionTest": "reached_region: {of: Ego, region: [[100, 15], [110, 25]]}",
    "ScenarioTimeoutTest": "time_limit: {within: 60}",
}
"""Criteria to declare instead of classes whose arguments are not one number, all that such a condition can state."""

REQUIRED = ("DrivenDistanceTest", "MaxVelocityTest", "AverageVelocityTest", "YieldToEmergencyVehicleTest")
"""Classes that require a value; an empty one is an error."""


def translation(condition: Condition) -> tuple[str, dict[str, Any]] | None:
    """Return the name of the criterion and its settings; None for a class that is not supported."""
    name = condition.name.removeprefix(CRITERION_PREFIX)
    mapping = CLASSES.get(name)
    if mapping is None:
        return None
    settings = dict(mapping.fixed)
    by_value = condition.by_value_condition
    parameter = by_value.parameter_condition if by_value is not None else None
    value = parameter.value if parameter is not None else ""
    if mapping.arguments and (value or name in REQUIRED):
        argument = parameter.parameter_ref if parameter is not None else ""
        settings[mapping.arguments.get(argument, next(iter(mapping.arguments.values())))] = _number(value)
    return mapping.kind, settings


def _number(value: str) -> Any:
    try:
        return float(value)
    except ValueError:
        return value


EXITS = {"exitSuccess": True, "exitFailure": False}
"""Verdict of each exit command of scenario_simulator_v2: True for passed."""

CRITERION = "eidrive.criterion"
"""Type of the CustomCommandAction that declares criteria."""

_EXAMPLE = "min_distance: {of: Ego, to: Incoming, at_least: 1.5}"


@dataclass(frozen=True)
class CriterionDeclaration:
    """Declared criterion: its registered name, its class and its checked settings."""

    kind: str
    criterion_type: type[Criterion]
    settings: CriterionSettings

    def build(self) -> Criterion:
        """Return a new criterion. Raise InvalidResult if its name is not a non-empty text."""
        criterion: Criterion = construct(self.criterion_type, self.settings)
        name: object = getattr(criterion, "name", self.kind)
        if not isinstance(name, str) or not name:
            raise InvalidResult(criterion, "name", f"is {name!r} (expected a text)")
        criterion.name = name
        return criterion


def declaration_text(declaration: CriterionDeclaration, name: str) -> str:
    """Return a declaration with all settings, and the name of its verdict, as YAML that `parse_criteria` reads."""
    settings = declaration.settings.model_dump(mode="json", by_alias=True) | {"name": name}
    return flow_yaml({declaration.kind: settings}, setting=f"criterion {name!r}")


@dataclass(frozen=True)
class CriteriaContext:
    """Content of a scenario to which criteria refer; None for names that are unknown and therefore not checked.

    entities, monitors  their names
    has_roads           whether the scenario has roads
    has_routes          whether the scenario, or an action of an extension, may request a route
    """

    entities: tuple[str, ...] | None = None
    monitors: tuple[str, ...] | None = None
    has_roads: bool = True
    has_routes: bool = True


UNKNOWN = CriteriaContext()
"""Context in which all criteria are valid."""


def parse_criteria(
    text: str,
    context: CriteriaContext = UNKNOWN,
    *,
    source: str = "",
    line: int | None = None,
    scope: Scope | None = None,
) -> tuple[CriterionDeclaration, ...]:
    """Return the criteria that the text of a command declares, in its order.

    scope  parameters to which settings refer as `$name` or `${expression}`

    Raise SettingError with file and line of every error.
    """
    data, lines = load_yaml_text(text, source=source, line=line)
    shown = repr(text.strip())
    return declare_criteria(data, lines, context, source=source, line=line, scope=scope, command=CRITERION, shown=shown)


def declare_criteria(
    data: Any,
    known_lines: Mapping[str, int],
    context: CriteriaContext = UNKNOWN,
    *,
    source: str = "",
    line: int | None = None,
    scope: Scope | None = None,
    command: str = "",
    shown: str = "",
) -> tuple[CriterionDeclaration, ...]:
    """Return the criteria that parsed YAML declares: a mapping, or a list of mappings.

    known_lines  lines of the keys as returned by `load_yaml_text`
    command      type of the command that contains them, for messages
    shown        text of the data in messages; the other arguments are those of `parse_criteria`

    Raise SettingError with file and line of every error.
    """
    entries = [data] if isinstance(data, dict) else data
    if not isinstance(entries, list) or not any(entries) or not all(isinstance(entry, dict) for entry in entries):
        message = f"{command}{': ' * bool(command)}no criterion is declared (got {shown})"
        raise SettingError(Diagnostic(message, f"write {_EXAMPLE}", source, line))
    declarations = []
    diagnostics: list[Diagnostic] = []
    for kind, settings, lines in _criterion_settings(entries, known_lines, several=isinstance(data, list)):
        here = lines.get("", line)
        try:
            origins = parameter_hints(settings, scope)
            with _errors_of(kind):
                settings = resolve_references(settings, scope, source=source, line=here, lines=lines)
            declaration = _declare(kind, settings, source, here, lines, origins)
            criterion = declaration.build()
            _check_context(criterion, context, source, here)
        except SettingError as error:
            diagnostics.extend(error.diagnostics)
            continue
        declarations.append(declaration)
    if diagnostics:
        raise SettingError(diagnostics)
    return tuple(declarations)


def build_criteria(declarations: Iterable[CriterionDeclaration], taken: Collection[str] = ()) -> list[Criterion]:
    """Return new criteria. A number is appended to a name that another criterion or `taken` already has."""
    names = set(taken)
    criteria = []
    for declaration in declarations:
        criterion = declaration.build()
        numbered = (f"{criterion.name}_{number}" for number in count(2))
        criterion.name = next(name for name in chain([criterion.name], numbered) if name not in names)
        names.add(criterion.name)
        criteria.append(criterion)
    return criteria


def _criterion_settings(
    entries: list[dict[Any, Any]], known_lines: Mapping[str, int], *, several: bool
) -> Iterator[tuple[str, Any, Mapping[str, int]]]:
    """Yield kind and settings of each criterion, and the lines of its settings; the empty key has its own line."""
    paths = {
        f"{index}.{kind}" if several else str(kind): (str(kind), settings)
        for index, entry in enumerate(entries)
        for kind, settings in entry.items()
    }
    lines: dict[str, dict[str, int]] = {path: {"": known_lines[path]} if path in known_lines else {} for path in paths}
    for key, number in known_lines.items():
        for dot in (position for position, character in enumerate(key) if character == "."):
            if key[:dot] in lines:
                lines[key[:dot]][key[dot + 1 :]] = number
                break
    for path, (kind, settings) in paths.items():
        yield kind, settings, lines[path]


@contextmanager
def _errors_of(kind: str) -> Iterator[None]:
    """Name a criterion in the errors of its settings."""
    try:
        yield
    except SettingError as error:
        diagnostics = [replace(each, message=f"criterion {kind!r}: {each.message}") for each in error.diagnostics]
        raise SettingError(diagnostics) from error


def _declare(
    kind: str, settings: Any, source: str, line: int | None, lines: Mapping[str, int], origins: Mapping[str, str]
) -> CriterionDeclaration:
    criteria = registry("criteria")
    if kind not in criteria:
        raise SettingError(Diagnostic(f"unknown criterion {kind!r}", suggestion(kind, criteria), source, line))
    criterion_type = criteria.load(kind, Criterion)
    settings_type = settings_type_of("criteria", kind, criterion_type, CriterionSettings)
    settings = {} if settings is None else settings
    if not isinstance(settings, dict):
        fields = settings_type.model_fields.items()
        hint = f"write {kind}: {{…}} with the settings {', '.join(field.alias or name for name, field in fields)}"
        message = f"criterion {kind!r}: settings are not a mapping (got {settings!r})"
        raise SettingError(Diagnostic(message, hint, source, line))
    with _errors_of(kind):
        parsed = parse_settings(settings_type, settings, source=source, line=line, lines=lines, origins=origins)
    return CriterionDeclaration(kind, criterion_type, parsed)


def _check_context(criterion: Criterion, context: CriteriaContext, source: str, line: int | None) -> None:
    """Raise SettingError if the scenario lacks what a criterion requires."""
    name = criterion.name
    unknown = []
    for kind, names, declared in (
        ("entity", criterion.subjects, context.entities),
        ("monitor", criterion.monitors, context.monitors),
    ):
        for subject in names:
            if declared is not None and subject not in declared:
                hint = suggestion(subject, declared) if declared else f"the scenario declares no {kind}"
                unknown.append(Diagnostic(f"criterion {name!r}: unknown {kind} {subject!r}", hint, source, line))
    if unknown:
        raise SettingError(unknown)
    if criterion.needs_roads and not context.has_roads:
        message = f"criterion {name!r} requires roads, and the scenario has none"
        raise SettingError(Diagnostic(message, "add a LogicFile to its RoadNetwork", source, line))
    if criterion.needs_route and not context.has_routes:
        message = f"criterion {name!r} evaluates a route, and the scenario requests none"
        hint = "add an AssignRouteAction or an AcquirePositionAction, or give the points of the setting 'route'"
        raise SettingError(Diagnostic(message, hint, source, line))


def exit_verdict(command: CustomCommand, time: float) -> Verdict:
    """Return the verdict of an `exitSuccess` or `exitFailure` command at `time` [s].

    Raise KeyError for a command of another type.
    """
    passed = EXITS[command.type]
    text = command.content.strip()
    reason = f"the scenario executed {command.type} at {time:.2f} s" + (f": {text}" if text else "")
    return Verdict(command.type, passed, None, None, "", None if passed else time, reason, fatal=True)


def stop_trigger_declarations(scenario: Scenario) -> list[CriterionDeclaration]:
    """Return declarations of the criteria about the ego vehicle that a file for ScenarioRunner specifies.

    Unsupported criteria are omitted and reported by `unsupported_criteria`. Raise SettingError if the value of a
    condition is invalid or no entity is the ego vehicle.
    """
    declarations = []
    for condition in criteria_of(scenario.storyboard):
        translated = translation(condition)
        if translated is None or _lacks_roads(translated[0], scenario):
            continue
        kind, settings = translated
        settings = {"of": _ego(scenario, condition), **settings}
        declarations.append(_declare(kind, settings, condition.source, condition.line, {}, {}))
    return declarations


def unsupported_criteria(scenario: Scenario) -> list[Diagnostic]:
    """Return warnings about criteria of ScenarioRunner that this engine does not evaluate."""
    diagnostics = []
    for condition in criteria_of(scenario.storyboard):
        translated = translation(condition)
        name = condition.name.removeprefix(CRITERION_PREFIX)
        if name in INEXPRESSIBLE:
            places = f"{CRITERION} or RunSettings.criteria"
            hint = f"its arguments are not one number; declare {INEXPRESSIBLE[name]} ({places})"
        elif translated is None:
            hint = suggestion(name, sorted(CLASSES))
        elif _lacks_roads(translated[0], scenario):
            hint = "it requires roads, and the scenario has none"
        else:
            continue
        message = f"criterion {name!r} is not evaluated"
        diagnostics.append(Diagnostic.at(condition, message, hint))
    return diagnostics


def _lacks_roads(kind: str, scenario: Scenario) -> bool:
    needs_roads: bool = registry("criteria").load(kind, Criterion).needs_roads
    return needs_roads and scenario.road_file is None


def _ego(scenario: Scenario, condition: Condition) -> str:
    """Return the vehicle with the property `type = ego_vehicle` of ScenarioRunner, else the one named as an ego."""
    for name, entity in scenario.entities.items():
        for entry in property_entries(entity) if isinstance(entity, Vehicle) else ():
            if (entry.name, entry.value) == ("type", "ego_vehicle"):
                return name
    for name in scenario.entities:
        if name.lower() in ("ego", "hero", "ego_vehicle"):
            return name
    raise SettingError(
        Diagnostic.at(
            condition,
            f"condition {condition.name!r}: the scenario has no ego vehicle",
            'give a Vehicle the property type="ego_vehicle"',
        )
    )


def progress_warnings(
    scenario: Scenario, criteria: Iterable[Criterion], drivers: AbstractSet[str]
) -> tuple[Diagnostic, ...]:
    """Return a warning if no criterion demands progress of a vehicle that drives itself.

    criteria  all criteria of a run, including those that later events declare
    drivers   vehicles that a driving stack drives

    Without criteria, without drivers, and with an exit command of the scenario there is none.
    """
    declared = list(criteria)
    has_exit = any(command.type in EXITS for command in scenario.custom_commands)
    demanded = any(criterion.demands_progress and not drivers.isdisjoint(criterion.subjects) for criterion in declared)
    if not declared or not drivers or has_exit or demanded:
        return ()
    names = " or ".join(sorted(drivers))
    message = f"no criterion demands that {names} drives on: a vehicle that stands still passes"
    hint = f"add one such as driven_distance: {{of: {min(drivers)}, at_least: 50}}, reached_region or route_completion"
    return (Diagnostic(message, hint, str(scenario.path or "")),)
