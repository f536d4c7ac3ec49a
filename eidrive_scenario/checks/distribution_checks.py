"""What can be said against a parameter value distribution without playing its runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from eidrive_scenario.checks.registry import run_rules
from eidrive_scenario.checks.scenario_checks import CheckReport, check_scenario
from eidrive_scenario.checks.scenario_rules import Level
from eidrive_scenario.errors import ConstraintError, Diagnostic, InputError
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution, load_scenario
from eidrive_scenario.openscenario.distributions import CartesianProduct, ListedValues

_MOST_LOADED = 1000
"""Runs that are read; the file of a distribution may list more values."""
_SPREAD = 100
"""Runs that are read besides, spread over all combinations."""
_FIRST_DRAWS = 20


@dataclass(frozen=True)
class DistributionCheckReport(CheckReport):
    """What keeps a distribution's runs from being played, what is worth knowing, and how many runs there are."""

    runs: int = 0


def check_distribution(path: Path, ignored: Collection[str] = ()) -> DistributionCheckReport:
    """Read a distribution, its scenario, and the scenario with each value that the distribution lists.

    Every listed value is in one of the runs that are read, with the first value of all other parameters; so are the
    ends of each range, and the first draws. A run that constraints rule out is a warning, as it will be left out. What
    the rules find in these runs and in some more all over, and not in the scenario alone, is told with a run's number.
    """
    try:
        unfolding = load_distribution(path)
    except InputError as error:
        return DistributionCheckReport(error.diagnostics)
    alone = check_scenario(unfolding.scenario, ignored)
    if alone.errors:
        known = (*unfolding.warnings, *alone.warnings)
        return DistributionCheckReport(alone.errors, known, len(unfolding), notes=alone.notes)
    found = _Gathered(alone, unfolding.warnings, ignored)
    telling = sorted(set(_telling(unfolding)))
    for number in telling[:_MOST_LOADED]:
        found.read(unfolding[number], every_value=True)
    for number in unfolding.spread(_SPREAD):
        found.read(unfolding[number], every_value=False)
    if len(telling) > _MOST_LOADED:
        unread = f"{len(telling) - _MOST_LOADED} of the listed values were not tried"
        found.told[Level.WARNING][Diagnostic(unread, "run them", unfolding.source)] = None
    diagnostics, warnings, notes = (tuple(found.told[level]) for level in (Level.ERROR, Level.WARNING, Level.NOTE))
    return DistributionCheckReport(diagnostics, warnings, len(unfolding), notes=notes)


class _Gathered:
    """What is found in one run after the other; of each rule at each place once."""

    def __init__(self, alone: CheckReport, warnings: Iterable[Diagnostic], ignored: Collection[str]) -> None:
        self.told: dict[Level, dict[Diagnostic, None]] = {
            Level.ERROR: {},
            Level.WARNING: dict.fromkeys((*warnings, *alone.warnings)),
            Level.NOTE: dict.fromkeys(alone.notes),
        }
        self._ignored = ignored
        self._known = {_place(diagnostic) for diagnostic in (*alone.warnings, *alone.notes) if diagnostic.rule}
        self._read: set[int] = set()

    def read(self, run: ConcreteRun, *, every_value: bool) -> None:
        """Read the scenario of a run, and ask the rules; with `every_value` each value that is refused is told."""
        if run.number in self._read:
            return
        self._read.add(run.number)
        try:
            scenario = load_scenario(run.scenario, run.assignments)
        except InputError as error:
            self._refused(error, every_value)
            return
        for level, diagnostic in run_rules(scenario, self._ignored):
            if _place(diagnostic) not in self._known:
                self._known.add(_place(diagnostic))
                self.told[level][replace(diagnostic, message=f"in run {run.number}: {diagnostic.message}")] = None

    def _refused(self, error: InputError, every_value: bool) -> None:
        """A run that cannot be played; of one that was read besides only what is new."""
        known = {_place(diagnostic) for told in self.told.values() for diagnostic in told}
        diagnostics = [one for one in error.diagnostics if every_value or _place(one) not in known]
        if isinstance(error, ConstraintError):
            left_out = (replace(one, hint=f"{one.hint}; such runs are left out") for one in diagnostics)
            self.told[Level.WARNING].update(dict.fromkeys(left_out))
        else:
            self.told[Level.ERROR].update(dict.fromkeys(diagnostics))


def _place(diagnostic: Diagnostic) -> tuple[str, str, int | None]:
    return diagnostic.rule, diagnostic.source, diagnostic.line


def _telling(unfolding: DistributionExpansion) -> Iterator[int]:
    """Numbers of runs that hold each listed value at least once."""
    varied = unfolding.varied
    if not isinstance(varied, CartesianProduct):
        yield from range(min(len(unfolding), _FIRST_DRAWS))
        return
    yield 0
    stride = len(unfolding)
    for choices in varied.choices:
        stride //= choices.count
        ends = (0, min(1, choices.count - 1), choices.count - 1)
        yield from (index * stride for index in (range(choices.count) if isinstance(choices, ListedValues) else ends))
