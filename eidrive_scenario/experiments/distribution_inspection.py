"""What can be said against a parameter value distribution without playing its runs."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from eidrive_scenario.errors import ConstraintError, InputError, Problem
from eidrive_scenario.experiments.inspection import Findings, inspect_scenario
from eidrive_scenario.openscenario import Unfolding, load_distribution, load_scenario
from eidrive_scenario.openscenario.distributions import Combinations, Listed

_MOST_LOADED = 1000
"""Runs that are read; the file of a distribution may list more values."""
_FIRST_DRAWS = 20


@dataclass(frozen=True)
class DistributionFindings(Findings):
    """What keeps a distribution's runs from being played, what is worth knowing, and how many runs there are."""

    runs: int = 0


def inspect_distribution(path: Path, ignored: Collection[str] = ()) -> DistributionFindings:
    """Read a distribution, its scenario, and the scenario with each value that the distribution lists.

    Every listed value is in one of the runs that are read, with the first value of all other parameters; so are the
    ends of each range, and the first draws. A run that constraints rule out is a warning, as it will be left out.
    """
    try:
        unfolding = load_distribution(path)
    except InputError as error:
        return DistributionFindings(error.problems)
    alone = inspect_scenario(unfolding.scenario, ignored)
    if alone.problems:
        known = (*unfolding.warnings, *alone.warnings)
        return DistributionFindings(alone.problems, known, len(unfolding), notes=alone.notes)
    problems: dict[Problem, None] = {}
    warnings = dict.fromkeys((*unfolding.warnings, *alone.warnings))
    telling = sorted(set(_telling(unfolding)))
    for number in telling[:_MOST_LOADED]:
        try:
            load_scenario(unfolding.scenario, unfolding[number].assignments)
        except ConstraintError as error:
            left_out = (replace(one, remedy=f"{one.remedy}; such runs are left out") for one in error.problems)
            warnings.update(dict.fromkeys(left_out))
        except InputError as error:
            problems.update(dict.fromkeys(error.problems))
    if len(telling) > _MOST_LOADED:
        unread = f"{len(telling) - _MOST_LOADED} of the listed values were not tried"
        warnings[Problem(unread, "run them", unfolding.source)] = None
    return DistributionFindings(tuple(problems), tuple(warnings), len(unfolding), notes=alone.notes)


def _telling(unfolding: Unfolding) -> Iterator[int]:
    """Numbers of runs that hold each listed value at least once."""
    varied = unfolding.varied
    if not isinstance(varied, Combinations):
        yield from range(min(len(unfolding), _FIRST_DRAWS))
        return
    yield 0
    stride = len(unfolding)
    for choices in varied.choices:
        stride //= choices.count
        ends = (0, min(1, choices.count - 1), choices.count - 1)
        yield from (index * stride for index in (range(choices.count) if isinstance(choices, Listed) else ends))
