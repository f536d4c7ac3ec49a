"""What a reader finds wrong or outdated, gathered so that a file's findings come in one go."""

from __future__ import annotations

from dataclasses import dataclass, field

from eidrive_scenario.errors import ConstraintError, Problem, ScenarioError


@dataclass(frozen=True)
class RuledOut(Problem):
    """A parameter has a value that its constraints do not allow."""


@dataclass
class Findings:
    """Problems that forbid a file, and warnings that do not."""

    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)

    def error(self, message: str, remedy: str = "", *, source: str = "", line: int | None = None) -> None:
        """Something is wrong."""
        self.problems.append(Problem(message, remedy, source, line))

    def rule_out(self, message: str, remedy: str = "", *, source: str = "", line: int | None = None) -> None:
        """A parameter has a value that its constraints do not allow."""
        self.problems.append(RuledOut(message, remedy, source, line))

    def warn(self, message: str, remedy: str = "", *, source: str = "", line: int | None = None) -> None:
        """Something is outdated or doubtful."""
        self.warnings.append(Problem(message, remedy, source, line))

    def settle(self) -> tuple[Problem, ...]:
        """The warnings, if nothing is wrong.

        Raises ScenarioError with all problems in the order of the files: ConstraintError if nothing but values that
        constraints rule out is wrong.
        """
        if self.problems:
            only_ruled_out = all(isinstance(problem, RuledOut) for problem in self.problems)
            raise (ConstraintError if only_ruled_out else ScenarioError)(in_order(self.problems))
        return tuple(in_order(self.warnings))


def in_order(problems: list[Problem]) -> list[Problem]:
    """Each problem once, the files in the order in which they appear, the lines of a file ascending."""
    unique = list(dict.fromkeys(problems))
    files = list(dict.fromkeys(problem.source for problem in unique))
    return sorted(unique, key=lambda problem: (files.index(problem.source), problem.line or 0))
