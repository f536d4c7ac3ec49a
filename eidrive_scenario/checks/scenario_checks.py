"""Checks of scenarios and road files without a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from eidrive_scenario.checks.registry import check_rule_names, run_road_file_rules, run_rules
from eidrive_scenario.checks.report import CheckReport
from eidrive_scenario.checks.rule import Level
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.evaluation.criteria_parser import unsupported_criteria
from eidrive_scenario.openscenario import Source, load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.simulation.added_settings import criteria_sources, drive_sources
from eidrive_scenario.simulation.run_outcome import HOW_TO_JUDGE, UNJUDGED


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
    source: Source, ignored: Collection[str] = (), settings: RunSettings | None = None
) -> Iterator[tuple[Level, Diagnostic]]:
    """Yield all diagnostics of a scenario, neither sorted nor limited in number."""
    try:
        scenario = load_scenario(source)
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
            hint = f"{HOW_TO_JUDGE} of `eidrive run`"
            yield Level.NOTE, Diagnostic(UNJUDGED, hint, str(scenario.path or ""))
    except InputError as error:
        yield from (found for found in _errors(error) if found[1] not in errors)


def added_sources(settings: RunSettings | None) -> tuple[str | Path, ...]:
    """Return the criteria and driving stacks that settings add to a scenario, as YAML texts and files."""
    given = settings or RunSettings()
    stacks = (stack for stack in drive_sources(given.drive).values() if stack is not None)
    return (*criteria_sources(given.criteria), *stacks)


def check_road_file(path: Path, ignored: Collection[str] = ()) -> CheckReport:
    """Check an OpenDRIVE file. Raise SettingError if `ignored` has an unknown name."""
    check_rule_names(ignored)
    return CheckReport.collect(_road_file_diagnostics(path, ignored))


def _road_file_diagnostics(path: Path, ignored: Collection[str]) -> Iterator[tuple[Level, Diagnostic]]:
    try:
        yield from run_road_file_rules(RoadNetwork.load(path), ignored)
    except InputError as error:
        yield from _errors(error)


def _errors(error: InputError) -> Iterator[tuple[Level, Diagnostic]]:
    return ((Level.ERROR, diagnostic) for diagnostic in error.diagnostics)
