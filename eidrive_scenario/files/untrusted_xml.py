"""Parser for XML from untrusted sources: no network, no document type, no entities, bounded size and depth.

Messages never quote the content of a file that is not well-formed: it may be a file of another kind.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NoReturn, cast
from xml.parsers import expat

from lxml import etree

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.bounded import MIB

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


MAX_DEPTH = 100
"""Maximum nesting depth of elements."""
MAX_ATTRIBUTES = 200
"""Maximum number of attributes of an element; the parsing time of libxml2 is quadratic in this number."""

_SYNTAX_HINT = "close every tag, quote every value, write & as &amp;"
_ENCODING_HINT = "save the file in UTF-8 and declare encoding='UTF-8'"
_TOO_MANY = etree.XPath(f"descendant-or-self::*[@*[{MAX_ATTRIBUTES + 1}]]")
_LINE_REFERENCE = re.compile(r"\bline (\d+)")


@dataclass(frozen=True)
class XmlLimits:
    """Limits of one kind of file.

    max_bytes  maximum size of the file [B]
    max_nodes  maximum number of elements and attributes; each takes 100 to 200 bytes of memory
    """

    max_bytes: int
    max_nodes: int


class _Done(Exception):
    """Exception that ends the scan of a prolog or the count of nodes."""


def parse_untrusted(
    content: bytes,
    source: str,
    limits: XmlLimits,
    error: Callable[[Diagnostic], InputError],
    *,
    remove_comments: bool = False,
) -> etree._Element:
    """Return the root element of the bytes of an XML file.

    error  returns the exception to raise for a diagnostic; each diagnostic has `source` and the line
    """

    def refuse(message: str, hint: str, line: int | None) -> NoReturn:
        raise error(Diagnostic(message, hint, source, line))

    if len(content) > limits.max_bytes:
        refuse(f"the file is larger than {limits.max_bytes // MIB} MiB", "split it", None)
    try:
        _scan(content, limits, refuse)
    except expat.ExpatError as failure:
        hint = _SYNTAX_HINT if content.strip() else "the file is empty"
        refuse(f"not well-formed XML: {expat.ErrorString(failure.code)}", hint, failure.lineno)
    except (LookupError, ValueError):  # errors of the codec that the file declares
        refuse("the encoding of the file is not supported", _ENCODING_HINT, 1)
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=remove_comments,
        remove_pis=remove_comments,
    )
    try:
        root = parse_numbered(content, parser)
    except etree.XMLSyntaxError as failure:
        refuse(f"not well-formed XML: {_describe_error(failure)}", _SYNTAX_HINT, failure.lineno or None)
    docinfo: Any = root.getroottree().docinfo
    if docinfo.doctype:
        refuse("the file has a document type declaration (DOCTYPE)", "remove it", 1)
    too_deep = next(iter(cast(list[etree._Element], root.xpath("/*" * (MAX_DEPTH + 1)))), None)
    if too_deep is not None:
        refuse(f"elements are nested deeper than {MAX_DEPTH} levels", "flatten them", line_of(too_deep))
    if content.count(b"=") > MAX_ATTRIBUTES:
        for element in cast(list[etree._Element], _TOO_MANY(root)):
            refuse(f"an element has more than {MAX_ATTRIBUTES} attributes", "remove them", line_of(element))
    return root


def first_elements(content: bytes, max_elements: int, visit: Callable[[int, str, Mapping[str, str]], bool]) -> bool:
    """Call `visit` with the depth (root: 1), name without prefix and attributes of each element until it returns True.

    Return True if it did within `max_elements`. No entity is expanded. Raise ValueError if the file is not XML up to
    that element.
    """
    parser = expat.ParserCreate()
    depth = count = 0
    is_done = False

    def start(name: str, attributes: Mapping[str, str]) -> None:
        nonlocal depth, count, is_done
        depth += 1
        count += 1
        is_done = visit(depth, name.rsplit(":", 1)[-1], attributes)
        if is_done or count >= max_elements:
            raise _Done

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.DefaultHandler = lambda _: None  # with this handler expat does not expand entities
    try:
        parser.Parse(content, True)
    except _Done:
        pass
    except (expat.ExpatError, LookupError) as error:
        raise ValueError("not XML") from error
    return is_done


def _scan(content: bytes, limits: XmlLimits, refuse: Callable[[str, str, int | None], NoReturn]) -> None:
    """Call `refuse` for a document type declaration or too many nodes, before a tree is built.

    A file is scanned beyond the prolog only if its size allows too many nodes.
    """
    parser = expat.ParserCreate()
    may_exceed = content.count(b"<") - content.count(b"</") + content.count(b"=") > limits.max_nodes
    nodes = 0

    def document_type(*_: object) -> None:
        refuse(
            "the file has a document type declaration (DOCTYPE), which may include entities and other files",
            "remove it; neither OpenSCENARIO nor OpenDRIVE needs one",
            parser.CurrentLineNumber,
        )

    def element(_: str, attributes: list[str]) -> None:
        nonlocal nodes
        nodes += 1 + len(attributes) // 2
        if not may_exceed:
            raise _Done
        if nodes > limits.max_nodes:
            message = f"the file has more than {limits.max_nodes} elements and attributes"
            refuse(message, "split it", parser.CurrentLineNumber)

    parser.ordered_attributes = True
    parser.StartDoctypeDeclHandler = document_type
    parser.StartElementHandler = element
    try:
        parser.Parse(content, True)
    except _Done:
        return


def _describe_error(error: etree.XMLSyntaxError) -> str:
    """Describe the kind of a syntax error, without any content of the file except a line number."""
    number = getattr(error, "code", None) or 0
    text = error.msg or ""
    start = _LINE_REFERENCE.search(text)
    if number in _ERROR_TEXTS:
        return _ERROR_TEXTS[number].format(start=f", which begins in line {start[1]}," if start else "")
    return f"libxml2 reports error {number}"


_CODES = etree.ErrorTypes
_ERROR_TEXTS = {
    int(getattr(_CODES, name)): text
    for name, text in {
        "ERR_DOCUMENT_EMPTY": "the document is empty",
        "ERR_DOCUMENT_END": "there is content after the end of the root element",
        "ERR_INVALID_CHAR": "a character is not allowed in XML",
        "ERR_INVALID_CHARREF": "a character reference is not valid",
        "ERR_INVALID_ENCODING": "bytes do not fit the encoding",
        "ERR_UNSUPPORTED_ENCODING": "the encoding is not supported",
        "ERR_UNKNOWN_ENCODING": "the encoding is not supported",
        "ERR_UNDECLARED_ENTITY": "an entity is not declared",
        "ERR_ENTITYREF_SEMICOL_MISSING": "a reference lacks its semicolon",
        "ERR_NAME_REQUIRED": "a name is expected",
        "ERR_ATTRIBUTE_NOT_STARTED": "the value of an attribute is not quoted",
        "ERR_ATTRIBUTE_NOT_FINISHED": "the value of an attribute is not closed",
        "ERR_ATTRIBUTE_WITHOUT_VALUE": "an attribute has no value",
        "ERR_ATTRIBUTE_REDEFINED": "an attribute occurs twice in one element",
        "ERR_LT_IN_ATTRIBUTE": "the value of an attribute contains <",
        "ERR_TAG_NAME_MISMATCH": "an end tag does not match its start tag{start}",
        "ERR_TAG_NOT_FINISHED": "the start tag of an element{start} is not closed",
        "ERR_GT_REQUIRED": "a tag is not closed",
        "ERR_LTSLASH_REQUIRED": "an end tag is missing",
        "ERR_COMMENT_NOT_FINISHED": "a comment is not closed",
        "ERR_HYPHEN_IN_COMMENT": "a comment contains --",
        "ERR_CDATA_NOT_FINISHED": "a CDATA section is not closed",
        "ERR_PI_NOT_FINISHED": "a processing instruction is not closed",
        "ERR_SPACE_REQUIRED": "a space is missing between attributes",
        "ERR_STRING_NOT_STARTED": "the XML declaration is not valid",
        "ERR_XMLDECL_NOT_FINISHED": "the XML declaration is not closed",
        "ERR_RESERVED_XML_NAME": "the XML declaration is not at the start of the file",
        "ERR_NAME_TOO_LONG": "a name is too long",
        "ERR_INTERNAL_ERROR": "a limit of the parser is exceeded, such as depth or length of a value",
        "ERR_RESOURCE_LIMIT": "a limit of the parser is exceeded, such as depth or length of a value",
        "NS_ERR_UNDEFINED_NAMESPACE": "the prefix of a namespace is not declared",
    }.items()
    if hasattr(_CODES, name)
}
