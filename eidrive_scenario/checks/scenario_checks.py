"""Checks of scenarios, catalogs, distributions and road files without a run, by all rules of `eidrive check`."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eidrive_scenario.checks.road_rules import ROAD_FILE_RULES, ROAD_RULES, RoadLintContext
from eidrive_scenario.checks.rule import CheckReport, Level, Rule, S
from eidrive_scenario.checks.scenario_rules import RULES
from eidrive_scenario.errors import (
    ConstraintError,
    Diagnostic,
    InputError,
    ScenarioError,
    SettingError,
    quoted,
    suggestion,
)
from eidrive_scenario.evaluation.criteria_parser import unsupported_criteria
from eidrive_scenario.openscenario import (
    ConcreteRun,
    DistributionExpansion,
    Scenario,
    Source,
    load_distribution,
    load_scenario,
)
from eidrive_scenario.openscenario.catalogs import duplicate_entries
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.distributions.deterministic import CartesianProduct, ListedValues
from eidrive_scenario.openscenario.model import OpenScenario
from eidrive_scenario.openscenario.reading.document import VERSIONS, version_of
from eidrive_scenario.openscenario.reading.parsing import open_document
from eidrive_scenario.openscenario.reading.reader import Reader
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.validation.rules import check_values
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.run_options import checked_settings
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.simulation.run_outcome import HOW_TO_JUDGE, UNJUDGED

ALL_RULES: tuple[Rule[Any], ...] = (*RULES, *ROAD_RULES, *ROAD_FILE_RULES)
"""All rules; each name, level and summary is defined once."""


def run_rules(
    scenario: Scenario, ignored: Collection[str] = (), added: Iterable[str | Path] = ()
) -> Iterator[tuple[Level, Diagnostic]]:
    """Yield the diagnostics of all rules except `ignored`; if the road file is invalid, only of rules without roads.

    added  criteria and driving stacks of the run, YAML texts or files, which may refer to parameters

    Raise SettingError if `ignored` has an unknown name.
    """
    check_rule_names(ignored)
    rules: tuple[Rule[RoadLintContext], ...] = (*RULES, *ROAD_RULES)
    roads = None
    try:
        roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    except InputError:
        rules = RULES
    yield from _run_rules(rules, RoadLintContext(scenario, roads, tuple(added)), ignored)
    if roads is not None:
        yield from _run_rules(ROAD_FILE_RULES, roads, ignored)


def check_rule_names(ignored: Collection[str]) -> None:
    """Raise SettingError if `ignored` has an unknown name, or is no collection of names."""
    if isinstance(ignored, str) or not isinstance(ignored, Collection):
        raise SettingError(Diagnostic(f"ignored is {quoted(ignored)}", "give a list of rules"))
    names = {rule.name for rule in ALL_RULES}
    for name in ignored:
        if name not in names:
            raise SettingError(Diagnostic(f"unknown rule {name!r}", suggestion(name, names)))


def _run_rules(rules: Iterable[Rule[S]], context: S, ignored: Collection[str]) -> Iterator[tuple[Level, Diagnostic]]:
    for rule in rules:
        if rule.name not in ignored:
            for diagnostic in rule.run(context):
                yield rule.level, diagnostic


def check_scenario(source: Source, ignored: Collection[str] = (), settings: RunSettings | None = None) -> CheckReport:
    """Check a scenario with its roads, controllers, channels and criteria.

    source   any argument of `load_scenario`
    ignored  names of rules that are not evaluated
    settings  of the run that is checked, with its driving stacks and criteria

    Commands of later events are included, although a run reaches them only later. Raise SettingError if `ignored` has
    an unknown name.
    """
    check_rule_names(ignored)
    return CheckReport.collect(scenario_diagnostics(source, ignored, settings))


def scenario_diagnostics(
    source: Source,
    ignored: Collection[str] = (),
    settings: RunSettings | None = None,
    parameters: Mapping[str, Assignment] | None = None,
) -> Iterator[tuple[Level, Diagnostic]]:
    """Yield all diagnostics of a scenario with these parameters, neither sorted nor limited in number."""
    try:
        scenario = load_scenario(source, parameters)
    except InputError as error:
        yield from _errors(error)
        return
    yield from ((Level.WARNING, diagnostic) for diagnostic in (*scenario.warnings, *unsupported_criteria(scenario)))
    errors: set[Diagnostic] = set()
    for level, diagnostic in run_rules(scenario, ignored, added_sources(settings)):
        if level is Level.ERROR:
            errors.add(replace(diagnostic, rule=""))
        yield level, diagnostic
    try:
        simulation = Simulation(scenario, settings=settings, load_weights=False)
        simulation.close()
        for diagnostic in (*simulation.progress_warnings, *simulation.start_warnings):
            yield Level.WARNING, diagnostic
        if not simulation.can_be_judged:
            yield Level.NOTE, Diagnostic(UNJUDGED, HOW_TO_JUDGE, str(scenario.path or ""))
    except InputError as error:
        yield from ((level, diagnostic) for level, diagnostic in _errors(error) if diagnostic not in errors)


def added_sources(settings: RunSettings | None) -> tuple[str | Path, ...]:
    """Return the criteria and driving stacks that settings add to a scenario, as YAML texts and files."""
    given = checked_settings(settings)
    return (*given.criteria_sources, *(stack for stack in given.stacks.values() if stack is not None))


def check_road_file(path: Path, ignored: Collection[str] = ()) -> CheckReport:
    """Check an OpenDRIVE file. Raise SettingError if `ignored` has an unknown name."""
    check_rule_names(ignored)
    try:
        network = RoadNetwork.load(path)
    except InputError as error:
        return CheckReport.collect(_errors(error))
    return CheckReport.collect(_run_rules(ROAD_FILE_RULES, network, ignored))


def _errors(error: InputError) -> Iterator[tuple[Level, Diagnostic]]:
    return ((Level.ERROR, diagnostic) for diagnostic in error.diagnostics)


def check_catalog(path: Path, ignored: Collection[str] = ()) -> CheckReport:
    """Check a catalog file. No rule applies to a catalog without a scenario.

    Each entry is read with the defaults of the parameters that it declares. References of an entry to other catalogs
    are checked with the scenarios that use it, as only these define the folders. Raise SettingError if `ignored` has
    an unknown name.
    """
    check_rule_names(ignored)
    return CheckReport.collect(_catalog_diagnostics(path))


def _catalog_diagnostics(path: Path) -> Iterator[tuple[Level, Diagnostic]]:
    collector = DiagnosticCollector()
    try:
        document = open_document(path)
        version = version_of(document, collector, older=VERSIONS[0])
        if version is not None:
            tree = apply_workarounds(document.root, document.name, version, collector)
            root = Reader(document.name, version, collector).read(tree, OpenScenario)
            check_values(list(root.walk()), version, collector)
        catalog = document.root.find("Catalog")
        if catalog is not None:
            collector.errors.extend(duplicate_entries(catalog, document.name).values())
    except ScenarioError as error:
        collector.errors.extend(error.diagnostics)
    yield from ((Level.ERROR, diagnostic) for diagnostic in collector.errors)
    yield from ((Level.WARNING, diagnostic) for diagnostic in collector.listed_warnings())


_MAX_VALUE_RUNS = 1000
"""Maximum number of runs that are read for the listed values; a distribution may list more."""
_SPREAD_RUNS = 100
"""Number of further runs that are read, spread over all combinations."""
_FIRST_DRAWS = 20
"""Number of runs that are read of a stochastic distribution before the spread ones."""


@dataclass(frozen=True)
class DistributionCheckReport(CheckReport):
    """Diagnostics of a distribution and of its scenario, and the number of concrete runs."""

    runs: int = 0


def check_distribution(
    path: Path, ignored: Collection[str] = (), settings: RunSettings | None = None
) -> DistributionCheckReport:
    """Check a distribution, its scenario, and the scenario with each value that the distribution lists.

    One run is read for each listed value, with the first values of all other parameters; also for the ends of each
    range and for the first draws. A run with a violated constraint is a warning, as it is skipped. Diagnostics of the
    rules that these and the spread runs have, but not the scenario itself, are reported with the number of a run.
    `settings` are those of the runs. Raise SettingError if `ignored` has an unknown name.
    """
    check_rule_names(ignored)
    try:
        expansion = load_distribution(path)
    except InputError as error:
        return DistributionCheckReport.collect(_errors(error))
    diagnostics = _DistributionDiagnostics(expansion, ignored, settings)
    if not any(level is Level.ERROR for level, _ in diagnostics):
        diagnostics.read_runs()
    return DistributionCheckReport.collect(diagnostics, runs=len(expansion))


class _DistributionDiagnostics:
    """Diagnostics of a distribution: each rule once per element over all runs that are read."""

    def __init__(
        self, expansion: DistributionExpansion, ignored: Collection[str], settings: RunSettings | None
    ) -> None:
        self._expansion = expansion
        self._ignored = ignored
        self._added = added_sources(settings)
        self._diagnostics: dict[tuple[Level, Diagnostic], None] = {}
        self._add(Level.WARNING, expansion.warnings)
        parameters = self._allowed_parameters()
        self._diagnostics.update(dict.fromkeys(scenario_diagnostics(expansion.scenario, ignored, settings, parameters)))
        self._known_rules = {_location(diagnostic) for _, diagnostic in self._diagnostics if diagnostic.rule}
        self._read: set[int] = set()

    def __iter__(self) -> Iterator[tuple[Level, Diagnostic]]:
        return iter(self._diagnostics)

    def _allowed_parameters(self) -> Mapping[str, Assignment]:
        """Return no parameters if the defaults satisfy their constraints, otherwise those of the first run that does.

        No run uses the default of a parameter that the distribution varies.
        """
        runs = (self._expansion[number].assignments for number in sorted(set(_value_runs(self._expansion))))
        for parameters in itertools.islice(itertools.chain([{}], runs), _MAX_VALUE_RUNS):
            try:
                load_scenario(self._expansion.scenario, parameters)
            except ConstraintError:
                continue
            except InputError:
                break
            return parameters
        return {}

    def read_runs(self) -> None:
        """Read the runs of all listed values, and further ones spread over all combinations."""
        value_runs = sorted(set(_value_runs(self._expansion)))
        for number in value_runs[:_MAX_VALUE_RUNS]:
            self._read_run(self._expansion[number], every_value=True)
        for number in self._expansion.spread(_SPREAD_RUNS):
            self._read_run(self._expansion[number], every_value=False)
        if len(value_runs) > _MAX_VALUE_RUNS:
            message = f"{len(value_runs) - _MAX_VALUE_RUNS} of the listed values are not checked"
            self._add(Level.WARNING, [Diagnostic(message, "run them", self._expansion.source)])

    def _read_run(self, run: ConcreteRun, *, every_value: bool) -> None:
        """Read the scenario of a run and evaluate the rules; with `every_value` each invalid value is reported."""
        if run.number in self._read:
            return
        self._read.add(run.number)
        try:
            scenario = load_scenario(run.scenario, run.assignments)
        except InputError as error:
            self._add_invalid_run(error, every_value)
            return
        for level, diagnostic in run_rules(scenario, self._ignored, self._added):
            if _location(diagnostic) not in self._known_rules:
                self._known_rules.add(_location(diagnostic))
                self._add(level, [replace(diagnostic, message=f"in run {run.number}: {diagnostic.message}")])

    def _add_invalid_run(self, error: InputError, every_value: bool) -> None:
        """Add the errors of a run that cannot be read; of a spread run only those at new locations."""
        locations = {_location(diagnostic) for _, diagnostic in self._diagnostics}
        diagnostics = [
            diagnostic for diagnostic in error.diagnostics if every_value or _location(diagnostic) not in locations
        ]
        if isinstance(error, ConstraintError):
            skipped = [
                replace(diagnostic, hint=f"{diagnostic.hint}; such runs are skipped") for diagnostic in diagnostics
            ]
            self._add(Level.WARNING, skipped)
        else:
            self._add(Level.ERROR, diagnostics)

    def _add(self, level: Level, diagnostics: Iterable[Diagnostic]) -> None:
        self._diagnostics.update(dict.fromkeys((level, diagnostic) for diagnostic in diagnostics))


def _location(diagnostic: Diagnostic) -> tuple[str, str, int | None]:
    return diagnostic.rule, diagnostic.source, diagnostic.line


def _value_runs(expansion: DistributionExpansion) -> Iterator[int]:
    """Yield numbers of runs that contain each listed value at least once."""
    varied = expansion.varied
    if not isinstance(varied, CartesianProduct):
        yield from range(min(len(expansion), _FIRST_DRAWS))
        return
    yield 0
    stride = len(expansion)
    for choices in varied.choices:
        stride //= choices.count
        ends = (0, min(1, choices.count - 1), choices.count - 1)
        yield from (index * stride for index in (range(choices.count) if isinstance(choices, ListedValues) else ends))
