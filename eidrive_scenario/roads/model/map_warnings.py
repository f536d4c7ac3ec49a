"""What is doubtful in a road file: single flaws, and how they are told.

Real maps have many small flaws of one kind. So each kind is told once, with its first place and a count.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from eidrive_scenario.errors import Diagnostic

SHOWN = 4
"""Further lines that a finding names."""


class MapWarning(NamedTuple):
    """One flaw: the rule that it breaks, what kind it is, what it is here, and what would be right."""

    rule: str
    kind: str
    message: str
    hint: str
    line: int | None


def group_map_warnings(flaws: Iterable[MapWarning], source: str) -> tuple[Diagnostic, ...]:
    """One finding for each kind of flaw, with its rule of `eidrive check`."""
    kinds: dict[tuple[str, str], list[MapWarning]] = {}
    for flaw in flaws:
        kinds.setdefault((flaw.rule, flaw.kind), []).append(flaw)
    return tuple(_told(group, source) for group in kinds.values())


def _told(flaws: list[MapWarning], source: str) -> Diagnostic:
    first = flaws[0]
    message = first.message
    if len(flaws) > 1:
        lines = [str(flaw.line) for flaw in flaws[1 : 1 + SHOWN]]
        more = ", …" if len(flaws) > 1 + SHOWN else ""
        message += f"; {len(flaws) - 1} more of {first.kind}: line {', '.join(lines)}{more}"
    return Diagnostic(message, first.hint, source, first.line, first.rule)
