"""Lines of XML elements in long files.

libxml2 stores the line of an element in 16 bits. Beyond line 65,534 it estimates the line from adjacent white space,
with an error of up to one line. In longer files, expat counts the lines again.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, cast
from xml.parsers import expat

from lxml import etree

MAX_EXACT_LINE = 65_534
"""Last line number that is exact in libxml2."""


class _NumberedElement(etree.ElementBase):
    """Element with its own line number, which is lost when the last reference to the element is dropped."""

    line: int | None = None
    others: tuple[etree._Element, ...] = ()
    """All elements with own line numbers; only the root has them, to keep these elements alive."""

    @property
    def sourceline(self) -> int | None:  # type: ignore[override]
        """Return the line of the start tag."""
        return self.line if self.line is not None else cast("int | None", super().sourceline)


def line_of(element: etree._Element | None) -> int | None:
    """Return the line of the start tag of an element; None for an element that was not read from a text."""
    line = None if element is None else element.sourceline
    return line if isinstance(line, int) else None


def parse_numbered(content: bytes, parser: etree.XMLParser) -> etree._Element:
    """Return the root of an XML text, with the exact `sourceline` of each element in texts of any length.

    Raise etree.XMLSyntaxError if the text is not well-formed.
    """
    if content.count(b"\n") < MAX_EXACT_LINE:
        return etree.fromstring(content, parser)
    parser.set_element_class_lookup(etree.ElementDefaultClassLookup(element=_NumberedElement))
    root = etree.fromstring(content, parser)
    docinfo: Any = root.getroottree().docinfo
    if docinfo.doctype:
        return root
    beyond = []
    for element, line in zip(root.iter("*"), _lines(content), strict=False):
        if line > MAX_EXACT_LINE:
            numbered = cast(_NumberedElement, element)
            numbered.line = line
            beyond.append(numbered)
    cast(_NumberedElement, root).others = tuple(beyond)
    return root


def _lines(content: bytes) -> list[int]:
    """Return the line of each start tag in the order of the text, up to the first error of expat."""
    lines: list[int] = []
    reader = expat.ParserCreate()
    reader.StartElementHandler = lambda *_: lines.append(reader.CurrentLineNumber)
    with suppress(expat.ExpatError, ValueError):
        reader.Parse(content, True)
    return lines
