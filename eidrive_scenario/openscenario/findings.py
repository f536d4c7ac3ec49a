"""What a reader finds wrong or outdated, gathered so that a file's findings come in one go."""

from __future__ import annotations

from dataclasses import dataclass, field

from eidrive_scenario.errors import MAX_DIAGNOSTICS, ConstraintError, Problem, ScenarioError
from eidrive_scenario.openscenario.budget import Budget


@dataclass(frozen=True)
class RuledOut(Problem):
    """A parameter has a value that its constraints do not allow."""


@dataclass
class Findings:
    """Problems that forbid a file, and warnings that do not.

    Reading ends with the error number MAX_DIAGNOSTICS, so that a file of errors costs no more than one of few. Of the
    warnings the first MAX_DIAGNOSTICS are kept and the others counted.
    """

    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    uncounted: int = 0
    """Number of warnings that are not kept."""
    budget: Budget = field(default_factory=Budget)
    """What the scenario may expand to."""

    def error(self, message: str, remedy: str = "", *, source: str = "", line: int | None = None) -> None:
        """Something is wrong. Raises ScenarioError with all errors once there are too many."""
        self._add(Problem(message, remedy, source, line))

    def rule_out(self, message: str, remedy: str = "", *, source: str = "", line: int | None = None) -> None:
        """A parameter has a value that its constraints do not allow."""
        self._add(RuledOut(message, remedy, source, line))

    def warn(self, message: str, remedy: str = "", *, source: str = "", line: int | None = None) -> None:
        """Something is outdated or doubtful."""
        if len(self.warnings) < MAX_DIAGNOSTICS:
            self.warnings.append(Problem(message, remedy, source, line))
        else:
            self.uncounted += 1

    def settle(self) -> tuple[Problem, ...]:
        """The warnings, if nothing is wrong.

        Raises ScenarioError with all problems in the order of the files: ConstraintError if nothing but values that
        constraints rule out is wrong.
        """
        if self.problems:
            only_ruled_out = all(isinstance(problem, RuledOut) for problem in self.problems)
            raise (ConstraintError if only_ruled_out else ScenarioError)(in_order(self.problems))
        more = [Problem(f"{self.uncounted} more warnings are not listed")] if self.uncounted else []
        return (*in_order(self.warnings), *more)

    def _add(self, problem: Problem) -> None:
        self.problems.append(problem)
        if len(self.problems) >= MAX_DIAGNOSTICS:
            last = Problem(f"reading ends after {MAX_DIAGNOSTICS} errors", "", problem.source, problem.line)
            raise ScenarioError([*in_order(self.problems), last])


def in_order(problems: list[Problem]) -> list[Problem]:
    """Each problem once, the files in the order in which they appear, the lines of a file ascending."""
    unique = list(dict.fromkeys(problems))
    files = list(dict.fromkeys(problem.source for problem in unique))
    return sorted(unique, key=lambda problem: (files.index(problem.source), problem.line or 0))
