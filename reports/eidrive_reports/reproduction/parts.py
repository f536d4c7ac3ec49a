"""Parts of the reproduction, in the order of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from eidrive_reports.reproduction import (
    benchmark,
    channels,
    detection,
    drives,
    learned,
    perception,
    sensitivity,
    table_2,
    table_3,
)
from eidrive_reports.reproduction.part import Part
from eidrive_scenario.api.common import Diagnostic, SettingError, quoted, suggestion

PARTS = {
    part.name: part
    for part in (
        table_2.PART,
        table_3.PART,
        detection.PART,
        drives.PIPELINE,
        drives.EI,
        sensitivity.PART,
        channels.PART,
        perception.PART,
        learned.PART,
    )
}
"""Parts by name."""
ALL = "all"
"""Name of all parts in PARTS together."""


def selected_parts(names: Sequence[str], others: Mapping[str, Part] | None = None) -> tuple[Part, ...]:
    """Return the parts of these names in the order of the paper, then those of `others`, which `all` omits.

    Raise SettingError for an unknown name.
    """
    others = others or {}
    _check_names("part", names, dict.fromkeys((*PARTS, *others, benchmark.NAME, ALL)))
    chosen = [part for name, part in PARTS.items() if ALL in names or name in names]
    return (*chosen, *(part for name, part in others.items() if name in names))


def selected_detectors(part: Part, names: Sequence[str]) -> tuple[str, ...]:
    """Return the detectors of a part among these names; its default without names.

    Raise SettingError for a name that no part uses, or if the part uses none of them.
    """
    _check_names(
        "--detectors", names, dict.fromkeys(name for user in (*PARTS.values(), part) for name in user.detectors)
    )
    detectors = tuple(name for name in part.detectors if name in names) if names else part.default or part.detectors
    if not detectors:
        message = f"--detectors: part {part.name} uses none of them (got {quoted(','.join(names))})"
        raise SettingError(Diagnostic(message, f"known: {', '.join(part.detectors)}"))
    return detectors


def _check_names(what: str, names: Iterable[str], valid: Iterable[str]) -> None:
    valid = tuple(valid)
    for name in names:
        if name not in valid:
            raise SettingError(Diagnostic(f"{what}: unknown name {quoted(name)}", suggestion(name, valid)))
