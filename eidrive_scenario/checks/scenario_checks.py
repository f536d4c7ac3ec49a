"""Everything that can be said against a scenario without playing it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

from eidrive_scenario.checks.catalog_checks import check_catalog
from eidrive_scenario.checks.registry import check_rule_names, run_rules
from eidrive_scenario.checks.scenario_rules import Level
from eidrive_scenario.driving.station_declarations import torchscript_warnings
from eidrive_scenario.errors import Diagnostic, InputError, capped
from eidrive_scenario.evaluation.criteria_parser import unsupported_criteria
from eidrive_scenario.openscenario import Source, load_scenario
from eidrive_scenario.openscenario.diagnostics import sort_diagnostics
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import Simulation


@dataclass(frozen=True)
class CheckReport:
    """What keeps a scenario from being played, what is most likely a mistake, and what is worth knowing."""

    errors: tuple[Diagnostic, ...]
    warnings: tuple[Diagnostic, ...] = ()
    notes: tuple[Diagnostic, ...] = field(default=(), kw_only=True)


def check_scenario(source: Source, ignored: Collection[str] = ()) -> CheckReport:
    """Read a scenario with its roads, controllers, channels and criteria; every problem says where and what is right.

    source  all that load_scenario takes

    Commands of later events are read too, which a run would only meet on its way. What the rules find comes with
    the names of these; `ignored` are the names of rules that are left out. Raises SettingError for an unknown name.
    """
    try:
        scenario = load_scenario(source)
    except InputError as error:
        return CheckReport(error.diagnostics)
    unbuilt = [diagnostic for diagnostic in unsupported_criteria(scenario) if diagnostic not in scenario.warnings]
    found: dict[Level, list[Diagnostic]] = {
        Level.ERROR: [],
        Level.WARNING: [*scenario.warnings, *unbuilt],
        Level.NOTE: [],
    }
    for level, diagnostic in run_rules(scenario, ignored):
        found[level].append(diagnostic)
    try:
        Simulation(scenario, load_weights=False).close()
        found[Level.WARNING] += torchscript_warnings(scenario)
    except InputError as error:
        known = [replace(diagnostic, rule="") for diagnostic in found[Level.ERROR]]
        found[Level.ERROR] += [diagnostic for diagnostic in error.diagnostics if diagnostic not in known]
    diagnostics, warnings, notes = (tuple(capped(sort_diagnostics(diagnostics))) for diagnostics in found.values())
    return CheckReport(diagnostics, warnings, notes=notes)


def inspect_catalog(path: Path, ignored: Collection[str] = ()) -> CheckReport:
    """Read a catalog file, each entry with the defaults of its parameters. No rule applies to a catalog by itself.

    Raises SettingError for an unknown name in `ignored`.
    """
    check_rule_names(ignored)
    return CheckReport(*check_catalog(path))


def check_road_file(path: Path, ignored: Collection[str] = ()) -> CheckReport:
    """Read an OpenDRIVE file: what keeps it from being read, and what its roads have against themselves.

    `ignored` are the names of rules that are left out. Raises SettingError for an unknown name.
    """
    check_rule_names(ignored)
    try:
        roads = RoadNetwork.load(path)
    except InputError as error:
        return CheckReport(error.diagnostics)
    found = [diagnostic for diagnostic in roads.map_warnings if diagnostic.rule not in ignored]
    return CheckReport((), tuple(capped(sorted(found, key=lambda diagnostic: diagnostic.line or 0))))
