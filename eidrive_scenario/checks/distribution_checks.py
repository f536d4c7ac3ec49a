"""Check of a parameter value distribution without its runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from eidrive_scenario.checks.registry import check_rule_names, run_rules
from eidrive_scenario.checks.report import CheckReport
from eidrive_scenario.checks.rule import Level
from eidrive_scenario.checks.scenario_checks import added_sources, scenario_diagnostics
from eidrive_scenario.errors import ConstraintError, Diagnostic, InputError
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution, load_scenario
from eidrive_scenario.openscenario.distributions import CartesianProduct, ListedValues
from eidrive_scenario.simulation import RunSettings

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
        return DistributionCheckReport.collect((Level.ERROR, diagnostic) for diagnostic in error.diagnostics)
    found = _DistributionDiagnostics(expansion, ignored, settings)
    if not any(level is Level.ERROR for level, _ in found):
        found.read_runs()
    return DistributionCheckReport.collect(found, runs=len(expansion))


class _DistributionDiagnostics:
    """Diagnostics of a distribution: each rule once per element over all runs that are read."""

    def __init__(
        self, expansion: DistributionExpansion, ignored: Collection[str], settings: RunSettings | None
    ) -> None:
        self._expansion = expansion
        self._ignored = ignored
        self._added = added_sources(settings)
        self._found: dict[tuple[Level, Diagnostic], None] = {}
        self._add(Level.WARNING, expansion.warnings)
        self._found.update(dict.fromkeys(scenario_diagnostics(expansion.scenario, ignored, settings)))
        self._known_rules = {_location(diagnostic) for _, diagnostic in self._found if diagnostic.rule}
        self._read: set[int] = set()

    def __iter__(self) -> Iterator[tuple[Level, Diagnostic]]:
        return iter(self._found)

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
        known = {_location(diagnostic) for _, diagnostic in self._found}
        diagnostics = [one for one in error.diagnostics if every_value or _location(one) not in known]
        if isinstance(error, ConstraintError):
            self._add(Level.WARNING, (replace(one, hint=f"{one.hint}; such runs are skipped") for one in diagnostics))
        else:
            self._add(Level.ERROR, diagnostics)

    def _add(self, level: Level, diagnostics: Iterable[Diagnostic]) -> None:
        self._found.update(dict.fromkeys((level, diagnostic) for diagnostic in diagnostics))


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
