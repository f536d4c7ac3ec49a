"""Typed XML attributes with collected diagnostics."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import cast, overload

from lxml import etree

from eidrive_scenario.errors import Diagnostic, RoadError, quoted, suggestion
from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.roads.model.map_warnings import MapRule, MapWarning
from eidrive_scenario.roads.model.polynomials import ROUNDING, Piece
from eidrive_scenario.roads.model.road_map import Contact

MAX_ERRORS = 100
"""Maximum number of errors of a file. Reading ends when it is reached."""
MAX_WARNINGS = 5000
"""Maximum number of warnings that are stored."""
LARGEST = 1e9
"""Maximum magnitude of a number, far above any length, position or coefficient of a road."""


class AttributeReader:
    """Reader of typed attributes of one file, which collects diagnostics with their lines."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.errors: list[Diagnostic] = []
        self.map_warnings: list[MapWarning] = []
        self._spent: dict[str, float] = {}

    def report_error(self, where: etree._Element | int | None, message: str, hint: str) -> None:
        """Append an error of an element or line, once. Raise RoadError with all errors if there are too many."""
        line = where if isinstance(where, int) else line_of(where)
        error = Diagnostic(message, hint, self.source, line)
        if error in self.errors:
            return
        self.errors.append(error)
        if len(self.errors) >= MAX_ERRORS:
            last = Diagnostic(f"reading ends after {MAX_ERRORS} errors", "", self.source, line)
            raise RoadError([*sorted(self.errors, key=lambda error: error.line or 0), last])

    def spend(self, element: etree._Element, what: str, amount: float, limit: float) -> None:
        """Count the use of a limited resource. Report an error at the element that exceeds the limit."""
        before = self._spent.get(what, 0.0)
        self._spent[what] = before + amount
        if before <= limit < before + amount:
            self.report_error(element, f"the file has more than {limit:g} {what}", "split it")

    def has_spent(self, what: str, limit: float) -> bool:
        """Return whether more of a limited resource is used than allowed."""
        return self._spent.get(what, 0.0) > limit

    def report_warning(self, element: etree._Element, rule: MapRule, kind: str, message: str, hint: str) -> None:
        """Append a warning of a deviation from the standard with which the element is readable."""
        if len(self.map_warnings) < MAX_WARNINGS:
            self.map_warnings.append(MapWarning(rule, kind, message, hint, line_of(element)))

    @overload
    def number(self, element: etree._Element, name: str, *, largest: float = ...) -> float: ...
    @overload
    def number(self, element: etree._Element, name: str, default: float) -> float: ...
    @overload
    def number(self, element: etree._Element, name: str, default: None) -> float | None: ...
    def number(
        self, element: etree._Element, name: str, default: float | None = math.nan, *, largest: float = LARGEST
    ) -> float | None:
        """Return a number of a magnitude of at most `largest`.

        A missing attribute without a default or an invalid number is reported and gives 0.
        """
        text = element.get(name)
        if text is None:
            if default is not None and math.isnan(default):
                self._missing(element, name)
                return 0.0
            return default
        value = _number(text)
        if abs(value) <= largest:
            return value
        hint = f"give a number of at most {largest:g}" if math.isfinite(value) else "give a finite number"
        self.report_error(element, f"<{element.tag}> has {name}={quoted(text)}", hint)
        return 0.0

    def mark_number(self, element: etree._Element, name: str, default: float | None) -> float | None:
        """Return a number of a road mark. An invalid one gives the default and only a warning, as marks are paint."""
        text = element.get(name)
        if text is None:
            return default
        value = _number(text)
        if abs(value) <= LARGEST:
            return value
        self.report_mark_warning(element, f"<{element.tag}> has {name}={quoted(text)}")
        return default

    def report_mark_warning(self, element: etree._Element, what: str) -> None:
        """Append a warning of an incomplete road mark."""
        message, hint = f"{what}, and is drawn without it", "correct it or remove the element"
        self.report_warning(element, MapRule.ROAD_MARK, "incomplete road marks", message, hint)

    def pieces(self, elements: Iterable[etree._Element], start: str) -> list[Piece]:
        """Return the pieces of a function, in the order of their starts.

        A piece that the next one replaces within ROUNDING is omitted. RoadRunner writes such pieces with lengths of
        1e-14 m and coefficients of 1e25. Coefficients of a shortest piece reach LARGEST at its end.
        """
        ordered = sorted(((self.number(element, start), element) for element in elements), key=lambda pair: pair[0])
        pieces: list[Piece] = []
        for i, (s, element) in enumerate(ordered):
            if i + 1 == len(ordered) or ordered[i + 1][0] - s > ROUNDING:
                limits = ((name, LARGEST / ROUNDING**power) for power, name in enumerate("abcd"))
                a, b, c, d = (self.number(element, name, largest=limit) for name, limit in limits)
                pieces.append((s, a, b, c, d))
        return pieces

    def text(self, element: etree._Element, name: str, default: str | None = None) -> str:
        """Return a text. A missing attribute without a default is reported and gives ''."""
        text = element.get(name)
        if text is not None:
            return text
        if default is None:
            self._missing(element, name)
            return ""
        return default

    def integer(self, element: etree._Element, name: str) -> int:
        """Return an integer. A missing or invalid attribute is reported and gives 0."""
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

    def contact(self, element: etree._Element, name: str) -> Contact | None:
        """Return the contact point, an end of a road, or None if the attribute is missing."""
        text = element.get(name)
        if text in ("start", "end"):
            return cast(Contact, text)
        if text is not None:
            self.report_error(element, f"<{element.tag}> has {name}={quoted(text)}", suggestion(text, ("start", "end")))
        return None

    def flag(self, element: etree._Element, name: str) -> bool:
        """Return True for yes, true or 1, and False for anything else or a missing attribute."""
        return element.get(name, "").strip().lower() in ("yes", "true", "1")

    def _missing(self, element: etree._Element, name: str) -> None:
        near = suggestion(name, map(str, element.attrib)) if element.attrib else ""
        hint = f"{near} (rename it to {name})" if near.startswith("did you mean") else "add it"
        self.report_error(element, f"<{element.tag}> lacks the attribute {name!r}", hint)


def _number(text: str) -> float:
    """Return the number in a text, or NaN if it is invalid."""
    try:
        return float(text) if _plain(text) else math.nan
    except ValueError:
        return math.nan


def _plain(text: str) -> bool:
    """Return whether a text is an ASCII number without underscores, which Python would also accept."""
    return text.isascii() and "_" not in text
