"""Deterministic distributions: lists of choices, whose combinations are the runs.

Lists are not expanded: a range of a million steps costs no more than one of two.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from operator import attrgetter
from typing import Protocol

from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector, Location
from eidrive_scenario.openscenario.values.parameters import Assignment, format_value

Assignments = Mapping[str, Assignment]


class ValueSource(Protocol):
    """Interface of one distribution of a file: the assignments from which a run takes one."""

    @property
    def count(self) -> int:
        """Return the number of choices."""

    @property
    def names(self) -> Mapping[str, Location]:
        """Return the parameters with the locations of their first values."""

    def at(self, index: int) -> Assignments:
        """Return the choice of an index from 0 to count - 1."""


@dataclass(frozen=True)
class CartesianProduct:
    """All combinations of choices; the last one varies fastest."""

    choices: tuple[ValueSource, ...]

    @property
    def count(self) -> int:
        """Return the number of combinations; without choices, one combination without assignments."""
        return math.prod(choice.count for choice in self.choices)

    @property
    def names(self) -> Mapping[str, Location]:
        """Return the parameters with the locations of their first values."""
        return {name: origin for choice in reversed(self.choices) for name, origin in choice.names.items()}

    def at(self, index: int) -> Assignments:
        """Return the combination of an index."""
        parts: list[Assignments] = []
        for choice in reversed(self.choices):
            index, own = divmod(index, choice.count)
            parts.append(choice.at(own))
        return {name: assignment for part in reversed(parts) for name, assignment in part.items()}


@dataclass(frozen=True)
class ListedValues:
    """Choices that the file lists."""

    choices: tuple[Assignments, ...]

    @property
    def names(self) -> Mapping[str, Location]:
        """Return the parameters with the locations of their first values."""
        assignments = [item for choice in reversed(self.choices) for item in choice.items()]
        return {name: assignment.origin or Location() for name, assignment in assignments}

    @property
    def count(self) -> int:
        """Return the number of choices."""
        return len(self.choices)

    def at(self, index: int) -> Assignments:
        """Return the choice of an index."""
        return self.choices[index]


@dataclass(frozen=True)
class SteppedRange:
    """Values `lower`, `lower + step`, … of one parameter.

    The numbers are exact decimals: three steps of 0.1 from 0 are 0.3, and rounding does not miss the upper limit.
    """

    name: str
    lower: Fraction
    step: Fraction
    count: int
    origin: Location

    @property
    def names(self) -> Mapping[str, Location]:
        """Return the parameter and the location of its range."""
        return {self.name: self.origin}

    def at(self, index: int) -> Assignments:
        """Return the choice of an index."""
        return {self.name: Assignment(format_value(float(self.lower + index * self.step)), self.origin)}


def combinations_of(deterministic: model.Deterministic, collector: DiagnosticCollector) -> CartesianProduct:
    """Return the product of the distributions in the order of the file; report their errors."""
    distributions: list[
        model.DeterministicMultiParameterDistribution | model.DeterministicSingleParameterDistribution
    ] = [
        *deterministic.deterministic_multi_parameter_distribution,
        *deterministic.deterministic_single_parameter_distribution,
    ]
    sources: list[ValueSource] = []
    for distribution in sorted(distributions, key=attrgetter("sibling_index")):
        if isinstance(distribution, model.DeterministicMultiParameterDistribution):
            sources.append(_value_sets(distribution, collector))
        else:
            choices = _single(distribution, collector)
            if choices is not None:
                sources.append(choices)
    varied_once(((name, origin) for source in sources for name, origin in source.names.items()), collector)
    magnitude = sum(math.log10(source.count) for source in sources if source.count)
    if magnitude > math.log10(sys.maxsize):
        count = f"{10.0**magnitude:.1e}" if magnitude < 300.0 else f"1e{int(magnitude)}"
        message = f"the distribution expands to {count} runs"
        collector.error(message, "use larger steps in its ranges", at=deterministic)
        return CartesianProduct(())
    return CartesianProduct(tuple(sources))


def varied_once(names: Iterable[tuple[str, Location]], collector: DiagnosticCollector) -> None:
    """Report every parameter that more than one distribution assigns."""
    seen: dict[str, Location] = {}
    for name, origin in names:
        if name in seen:
            message = f"parameter {name!r} is also varied by another distribution"
            collector.error(message, f"see line {seen[name].line}", at=origin)
        seen.setdefault(name, origin)


def _value_sets(
    distribution: model.DeterministicMultiParameterDistribution, collector: DiagnosticCollector
) -> ListedValues:
    choices = []
    for value_set in distribution.value_set_distribution.parameter_value_set:
        choice: dict[str, Assignment] = {}
        for assignment in value_set.parameter_assignment:
            name = assignment.parameter_ref
            if name in choice:
                collector.error(f"ParameterValueSet assigns {name!r} twice", "remove one", at=assignment)
            choice[name] = Assignment(assignment.value, Location.of(assignment))
        choices.append(choice)
    return ListedValues(tuple(choices))


def _single(
    distribution: model.DeterministicSingleParameterDistribution, collector: DiagnosticCollector
) -> ValueSource | None:
    name = distribution.parameter_name
    if distribution.distribution_set is not None:
        elements = distribution.distribution_set.element
        return ListedValues(tuple({name: Assignment(element.value, Location.of(element))} for element in elements))
    if distribution.distribution_range is not None:
        return _steps(name, distribution.distribution_range, collector)
    reject_user_defined(distribution, name, "DistributionSet or DistributionRange", collector)
    return None


def _steps(name: str, given: model.DistributionRange, collector: DiagnosticCollector) -> SteppedRange | None:
    """Return the values from the lower limit in equal steps up to the upper limit."""
    if not valid_range(given.range, collector, finite=True):
        return None
    if not (math.isfinite(given.step_width) and given.step_width > 0):
        collector.error(f"stepWidth is {format_value(given.step_width)}", "specify a number above zero", at=given)
        return None
    # The decimals of the file, not the binary numbers next to them
    limits = (given.range.lower_limit, given.range.upper_limit, given.step_width)
    lower, upper, step = (Fraction(repr(value)) for value in limits)
    return SteppedRange(name, lower, step, (upper - lower) // step + 1, Location.of(given))


def valid_range(given: model.Range, collector: DiagnosticCollector, *, finite: bool = False) -> bool:
    """Whether the limits are ordered numbers; report an error otherwise."""
    lower, upper = given.lower_limit, given.upper_limit
    if math.isnan(lower) or math.isnan(upper) or lower > upper:
        message = f"the range from {format_value(lower)} to {format_value(upper)} is empty"
        collector.error(message, "lowerLimit must be at most upperLimit", at=given)
        return False
    if math.inf in (lower, -upper) or (finite and math.inf in (-lower, upper)):
        message = f"the range from {format_value(lower)} to {format_value(upper)} is infinite"
        collector.error(message, "specify finite limits", at=given)
        return False
    return True


def reject_user_defined(element: model.Element, name: str, instead: str, collector: DiagnosticCollector) -> None:
    """Report a UserDefinedDistribution, which only another tool can expand."""
    collector.error(f"UserDefinedDistribution of {name!r} is specific to another tool", f"write {instead}", at=element)
