"""What a reader finds wrong or outdated, gathered so that a file's findings come in one go."""

from __future__ import annotations

from dataclasses import dataclass, field

from eidrive_scenario.errors import MAX_DIAGNOSTICS, ConstraintError, Diagnostic, ScenarioError
from eidrive_scenario.openscenario.budget import Budget


@dataclass(frozen=True)
class ConstraintDiagnostic(Diagnostic):
    """A parameter has a value that its constraints do not allow."""


@dataclass
class DiagnosticCollector:
    """Problems that forbid a file, and warnings that do not.

    Reading ends with the error number MAX_DIAGNOSTICS, so that a file of errors costs no more than one of few. Of the
    warnings the first MAX_DIAGNOSTICS are kept and the others counted.
    """

    errors: list[Diagnostic] = field(default_factory=list)
    warnings: list[Diagnostic] = field(default_factory=list)
    uncounted: int = 0
    """Number of warnings that are not kept."""
    budget: Budget = field(default_factory=Budget)
    """What the scenario may expand to."""

    def error(self, message: str, hint: str = "", *, source: str = "", line: int | None = None) -> None:
        """Something is wrong. Raises ScenarioError with all errors once there are too many."""
        self._add(Diagnostic(message, hint, source, line))

    def constraint_error(self, message: str, hint: str = "", *, source: str = "", line: int | None = None) -> None:
        """A parameter has a value that its constraints do not allow."""
        self._add(ConstraintDiagnostic(message, hint, source, line))

    def warning(self, message: str, hint: str = "", *, source: str = "", line: int | None = None) -> None:
        """Something is outdated or doubtful."""
        if len(self.warnings) < MAX_DIAGNOSTICS:
            self.warnings.append(Diagnostic(message, hint, source, line))
        else:
            self.uncounted += 1

    def raise_on_error(self) -> tuple[Diagnostic, ...]:
        """The warnings, if nothing is wrong.

        Raises ScenarioError with all problems in the order of the files: ConstraintError if nothing but values that
        constraints rule out is wrong.
        """
        if self.errors:
            only_ruled_out = all(isinstance(diagnostic, ConstraintDiagnostic) for diagnostic in self.errors)
            raise (ConstraintError if only_ruled_out else ScenarioError)(sort_diagnostics(self.errors))
        more = [Diagnostic(f"{self.uncounted} more warnings are not listed")] if self.uncounted else []
        return (*sort_diagnostics(self.warnings), *more)

    def _add(self, diagnostic: Diagnostic) -> None:
        self.errors.append(diagnostic)
        if len(self.errors) >= MAX_DIAGNOSTICS:
            last = Diagnostic(f"reading ends after {MAX_DIAGNOSTICS} errors", "", diagnostic.source, diagnostic.line)
            raise ScenarioError([*sort_diagnostics(self.errors), last])


def sort_diagnostics(diagnostics: list[Diagnostic]) -> list[Diagnostic]:
    """Each problem once, the files in the order in which they appear, the lines of a file ascending."""
    unique = list(dict.fromkeys(diagnostics))
    files = list(dict.fromkeys(diagnostic.source for diagnostic in unique))
    return sorted(unique, key=lambda diagnostic: (files.index(diagnostic.source), diagnostic.line or 0))
