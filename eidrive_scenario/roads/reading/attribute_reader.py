"""Attributes of XML elements, checked; what is wrong is collected, so that one reading reports all of it."""

from __future__ import annotations

import math
from typing import Literal, overload

from lxml import etree

from eidrive_scenario.errors import Diagnostic, RoadError, quoted, suggestion
from eidrive_scenario.roads.model.map_warnings import ROAD_MARK, MapRule, MapWarning

MOST = 100
"""Problems after which reading ends."""
MOST_DOUBTS = 5000
"""Doubts that are remembered."""
LARGEST = 1e9
"""Size of a number that is read at all: no length, place or coefficient of a road comes near it."""


def line_of(element: etree._Element | None) -> int | None:
    """Where an element begins in its file."""
    line = None if element is None else element.sourceline
    return line if isinstance(line, int) else None


class AttributeReader:
    """Reads attributes of elements of one file and remembers each problem with its line."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.errors: list[Diagnostic] = []
        self.map_warnings: list[MapWarning] = []
        self._spent: dict[str, float] = {}

    def report_error(self, element: etree._Element | None, message: str, hint: str) -> None:
        """Remember a problem at an element."""
        self.append_diagnostic(Diagnostic(message, hint, self.source, line_of(element)))

    def append_diagnostic(self, diagnostic: Diagnostic) -> None:
        """Remember a problem. Raise RoadError with all of them once there are too many."""
        self.errors.append(diagnostic)
        if len(self.errors) >= MOST:
            last = Diagnostic(f"reading ends after {MOST} errors", "", self.source, diagnostic.line)
            raise RoadError([*sorted(self.errors, key=lambda one: one.line or 0), last])

    def spend(self, element: etree._Element, what: str, amount: float, limit: float) -> None:
        """Count what takes memory or time; the element that exceeds the limit is a problem."""
        before = self._spent.get(what, 0.0)
        self._spent[what] = before + amount
        if before <= limit < before + amount:
            self.report_error(element, f"the file has more than {limit:g} {what}", "split it")

    def report_warning(self, element: etree._Element, rule: MapRule, kind: str, message: str, hint: str) -> None:
        """Remember what is against the standard, and is read all the same."""
        if len(self.map_warnings) < MOST_DOUBTS:
            self.map_warnings.append(MapWarning(rule, kind, message, hint, line_of(element)))

    @overload
    def number(self, element: etree._Element, name: str) -> float: ...
    @overload
    def number(self, element: etree._Element, name: str, default: float) -> float: ...
    @overload
    def number(self, element: etree._Element, name: str, default: None) -> float | None: ...
    def number(self, element: etree._Element, name: str, default: float | None = math.nan) -> float | None:
        """Return a number up to LARGEST. Missing without a default, or not such a number, is a problem and gives 0."""
        text = element.get(name)
        if text is None:
            if default is not None and math.isnan(default):
                self._missing(element, name)
                return 0.0
            return default
        value = _number(text)
        if abs(value) <= LARGEST:
            return value
        hint = f"give a number of at most {LARGEST:g}" if math.isfinite(value) else "give a finite number"
        self.report_error(element, f"<{element.tag}> has {name}={quoted(text)}", hint)
        return 0.0

    def mark_number(self, element: etree._Element, name: str, default: float | None) -> float | None:
        """Return a number of a road mark. It is paint only: one that cannot be read is a warning, and the default."""
        text = element.get(name)
        if text is None:
            return default
        value = _number(text)
        if abs(value) <= LARGEST:
            return value
        self.doubt_mark(element, f"<{element.tag}> has {name}={quoted(text)}")
        return default

    def doubt_mark(self, element: etree._Element, what: str) -> None:
        """Remember what is missing or wrong in a road mark."""
        message, hint = f"{what}, and is drawn without it", "correct it, or take the element out"
        self.report_warning(element, ROAD_MARK, "road marks that are not complete", message, hint)

    def polynomial(self, element: etree._Element, start: str) -> tuple[float, float, float, float, float]:
        """Return a piece of a cubic: its start and a, b, c, d."""
        return (
            self.number(element, start),
            self.number(element, "a"),
            self.number(element, "b"),
            self.number(element, "c"),
            self.number(element, "d"),
        )

    def text(self, element: etree._Element, name: str, default: str | None = None) -> str:
        """Return a text. Missing without a default is a problem and gives ''."""
        text = element.get(name)
        if text is not None:
            return text
        if default is None:
            self._missing(element, name)
            return ""
        return default

    def integer(self, element: etree._Element, name: str) -> int:
        """Return a whole number. Missing, or not one, is a problem and gives 0."""
        text = element.get(name)
        if text is None:
            self._missing(element, name)
            return 0
        try:
            value = int(text) if _plain(text) and len(text) < 100 else None
        except ValueError:
            value = None
        if value is not None and abs(value) <= LARGEST:
            return value
        self.report_error(element, f"<{element.tag}> has {name}={quoted(text)}", "give a whole number")
        return 0

    def contact(self, element: etree._Element, name: str) -> Literal["start", "end"] | None:
        """Which end of a road; None if the attribute is missing."""
        text = element.get(name)
        if text == "start":
            return "start"
        if text == "end":
            return "end"
        if text is not None:
            self.report_error(element, f"<{element.tag}> has {name}={quoted(text)}", suggestion(text, ("start", "end")))
        return None

    def flag(self, element: etree._Element, name: str) -> bool:
        """yes, true or 1 are true; anything else, or nothing, is false."""
        return element.get(name, "").strip().lower() in ("yes", "true", "1")

    def _missing(self, element: etree._Element, name: str) -> None:
        near = suggestion(name, map(str, element.attrib)) if element.attrib else ""
        hint = f"{near} (rename it to {name})" if near.startswith("did you mean") else "add it"
        self.report_error(element, f"<{element.tag}> lacks the attribute {name!r}", hint)


def _number(text: str) -> float:
    """Return the number that a text states, NaN if it is none."""
    try:
        return float(text) if _plain(text) else math.nan
    except ValueError:
        return math.nan


def _plain(text: str) -> bool:
    """False for what only Python takes for a number: 1_000, or the digits of other scripts."""
    return text.isascii() and "_" not in text
