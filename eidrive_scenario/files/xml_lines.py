"""Lines of XML elements in long files.

libxml2 keeps the line of an element in 16 bits. Beyond line 65,534 it guesses from white space nearby, if there is any,
and is off by a line then. In files as long as that the lines are counted once more, by expat.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, cast
from xml.parsers import expat

from lxml import etree

COUNTED = 65_534
"""The last line that libxml2 knows for certain."""


class _Numbered(etree.ElementBase):
    """An element that knows its line, as long as somebody holds it."""

    line: int | None = None
    others: tuple[etree._Element, ...] = ()
    """Of the root: all elements with lines of their own, which live as long as it does."""

    @property
    def sourceline(self) -> int | None:  # type: ignore[override]
        """The line where it begins."""
        return self.line if self.line is not None else cast("int | None", super().sourceline)


def parse_numbered(content: bytes, parser: etree.XMLParser) -> etree._Element:
    """The root of an XML text whose elements have their right `sourceline`, however long the text.

    Raises etree.XMLSyntaxError, as the parser does.
    """
    if content.count(b"\n") < COUNTED:
        return etree.fromstring(content, parser)
    parser.set_element_class_lookup(etree.ElementDefaultClassLookup(element=_Numbered))
    root = etree.fromstring(content, parser)
    docinfo: Any = root.getroottree().docinfo
    if docinfo.doctype:
        return root
    beyond = []
    for element, line in zip(root.iter("*"), _lines(content), strict=False):
        if line > COUNTED:
            numbered = cast(_Numbered, element)
            numbered.line = line
            beyond.append(numbered)
    cast(_Numbered, root).others = tuple(beyond)
    return root


def _lines(content: bytes) -> list[int]:
    """The line where each element begins, in the order of the text; none beyond what expat cannot read."""
    lines: list[int] = []
    reader = expat.ParserCreate()
    reader.StartElementHandler = lambda *_: lines.append(reader.CurrentLineNumber)
    with suppress(expat.ExpatError, ValueError):
        reader.Parse(content, True)
    return lines
