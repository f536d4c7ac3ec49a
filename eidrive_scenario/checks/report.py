"""Report of `eidrive check` on one file: the diagnostics by level, sorted and limited in number."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Self

from eidrive_scenario.checks.rule import Level
from eidrive_scenario.errors import Diagnostic, limit_diagnostics, sort_diagnostics


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
    def collect(cls, found: Iterable[tuple[Level, Diagnostic]], **fields: Any) -> Self:
        """Build the report from the diagnostics of a check; `fields` are the further fields of a subclass.

        Every level lists each diagnostic once, in the order of the file, up to MAX_DIAGNOSTICS.
        """
        by_level: dict[Level, list[Diagnostic]] = {level: [] for level in Level}
        for level, diagnostic in found:
            by_level[level].append(diagnostic)
        errors, warnings, notes = (
            tuple(limit_diagnostics(sort_diagnostics(diagnostics))) for diagnostics in by_level.values()
        )
        return cls(errors, warnings, notes=notes, **fields)
