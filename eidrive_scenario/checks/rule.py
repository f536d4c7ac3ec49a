"""Rules of `eidrive check`, and its report on one file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Generic, Self, TypeVar

from eidrive_scenario.errors import Diagnostic, limit_diagnostics, sort_diagnostics

S = TypeVar("S", contravariant=True)


class Level(Enum):
    """Severity of a diagnostic: an error prevents a run, a warning is probably a mistake, a note may be intended."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Rule(Generic[S]):
    """One rule of `eidrive check`.

    name     key in docs/checks.md and argument of `--ignore`
    summary  what violates the rule, in a few words
    check    yields the violations in a lint context
    """

    name: str
    level: Level
    summary: str
    check: Callable[[S], Iterable[Diagnostic]]

    def run(self, context: S) -> Iterator[Diagnostic]:
        """Yield the diagnostics of the rule, with its name."""
        for diagnostic in self.check(context):
            yield replace(diagnostic, rule=self.name)


at = Diagnostic.at


@dataclass(frozen=True)
class CheckReport:
    """Diagnostics of one file.

    errors    prevent a run of the file
    warnings  are probably mistakes
    notes     may be intended
    """

    errors: tuple[Diagnostic, ...]
    warnings: tuple[Diagnostic, ...] = ()
    notes: tuple[Diagnostic, ...] = field(default=(), kw_only=True)

    @classmethod
    def collect(cls, diagnostics: Iterable[tuple[Level, Diagnostic]], **fields: Any) -> Self:
        """Build the report from the diagnostics of a check; `fields` are the further fields of a subclass.

        Every level lists each diagnostic once, in the order of the file, up to MAX_DIAGNOSTICS.
        """
        by_level: dict[Level, list[Diagnostic]] = {level: [] for level in Level}
        for level, diagnostic in diagnostics:
            by_level[level].append(diagnostic)
        errors, warnings, notes = (
            tuple(limit_diagnostics(sort_diagnostics(of_level))) for of_level in by_level.values()
        )
        return cls(errors, warnings, notes=notes, **fields)
