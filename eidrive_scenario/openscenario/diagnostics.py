"""Collection of the diagnostics of one scenario file, so that one reading reports all of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from eidrive_scenario.errors import (
    MAX_DIAGNOSTICS,
    ConstraintError,
    Diagnostic,
    Located,
    ScenarioError,
    limit_diagnostics,
    sort_diagnostics,
)

MAX_TEXT = 65_536
"""Maximum number of characters of a text that an expression concatenates."""
MAX_JOINED = 16 * 2**20
"""Maximum number of characters of all such texts of a scenario."""
MAX_CATALOG_ELEMENTS = 300_000
"""Maximum number of elements of the used catalog entries; an entry counts once for each reference to it."""
MAX_NESTED_REFERENCES = 50
"""Maximum nesting depth of catalog entries that refer to others."""


class Location(NamedTuple):
    """File and line of a value; "" and None if unknown."""

    source: str = ""
    line: int | None = None

    @classmethod
    def of(cls, element: Located) -> Location:
        """Return the location of an element."""
        return cls(element.source, element.line)


class BudgetError(Exception):
    """Exceeded limit; the text of the error states which one."""


@dataclass
class Budget:
    """Usage of the limits by one scenario."""

    concatenated: int = 0
    catalog_elements: int = 0

    def join(self, length: int) -> None:
        """Count the characters of a text before its concatenation. Raise BudgetError if it is too long."""
        if length > MAX_TEXT:
            raise BudgetError(f"the text has more than {MAX_TEXT} characters")
        self.concatenated += length
        if self.concatenated > MAX_JOINED:
            raise BudgetError(f"the texts of all expressions have more than {MAX_JOINED} characters")

    def enter_catalog_element(self, count: int) -> None:
        """Count the elements of an entry before it is read. Raise BudgetError if there are too many."""
        self.catalog_elements += count
        if self.catalog_elements > MAX_CATALOG_ELEMENTS:
            raise BudgetError(f"the entries of catalogs have more than {MAX_CATALOG_ELEMENTS} elements in total")


@dataclass(frozen=True)
class ConstraintDiagnostic(Diagnostic):
    """Violation of the ConstraintGroups of a parameter."""


@dataclass
class DiagnosticCollector:
    """Errors, which prevent the use of a file, and warnings.

    Reading ends at error number MAX_DIAGNOSTICS, so that the cost of a file with many errors is bounded. The first
    MAX_DIAGNOSTICS warnings are stored and the others counted.
    """

    errors: list[Diagnostic] = field(default_factory=list)
    warnings: list[Diagnostic] = field(default_factory=list)
    unlisted_warnings: int = 0
    """Number of warnings that are not stored."""
    budget: Budget = field(default_factory=Budget)
    """Limits of the size to which the scenario may expand."""

    @property
    def count(self) -> int:
        """Number of errors and warnings."""
        return len(self.errors) + len(self.warnings) + self.unlisted_warnings

    def error(self, message: str, hint: str = "", *, at: Located | None = None) -> None:
        """Store an error. Raise ScenarioError with all errors at error number MAX_DIAGNOSTICS."""
        self._add(Diagnostic.at(at or Location(), message, hint))

    def constraint_error(self, message: str, hint: str = "", *, at: Located | None = None) -> None:
        """Store a violation of parameter constraints, like `error`."""
        self._add(ConstraintDiagnostic.at(at or Location(), message, hint))

    def warning(self, message: str, hint: str = "", *, at: Located | None = None) -> None:
        """Store a warning about something deprecated or questionable."""
        if len(self.warnings) < MAX_DIAGNOSTICS:
            self.warnings.append(Diagnostic.at(at or Location(), message, hint))
        else:
            self.unlisted_warnings += 1

    def raise_on_error(self) -> tuple[Diagnostic, ...]:
        """Return the sorted warnings if there is no error.

        Raise ConstraintError if all errors are violations of constraints, and ScenarioError if others are among them;
        its diagnostics are all errors in the order of the files.
        """
        if self.errors:
            only_constraints = all(isinstance(diagnostic, ConstraintDiagnostic) for diagnostic in self.errors)
            raise (ConstraintError if only_constraints else ScenarioError)(sort_diagnostics(self.errors))
        return self.listed_warnings()

    def listed_warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings in the order of the files; the last one counts those that are not stored."""
        return tuple(limit_diagnostics(sort_diagnostics(self.warnings), self.unlisted_warnings))

    def _add(self, diagnostic: Diagnostic) -> None:
        self.errors.append(diagnostic)
        if len(self.errors) >= MAX_DIAGNOSTICS:
            listed = sort_diagnostics(self.errors)
            message = f"reading ends after {MAX_DIAGNOSTICS} errors"
            raise ScenarioError([*listed, Diagnostic.at(listed[-1], message)])
