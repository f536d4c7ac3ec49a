"""Bytes of a file into an XML tree: no network, no document type, no entities, bounded size and depth."""

from __future__ import annotations

import copy
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias, cast
from xml.etree import ElementTree
from xml.parsers import expat

from lxml import etree

from eidrive_scenario.errors import Problem, ScenarioError
from eidrive_scenario.xml_lines import parse_numbered


class WrittenInPython(Protocol):
    """What scenariogeneration calls a Scenario, and whatever else gives its XML on demand."""

    def get_element(self) -> Any:
        """The root element."""


Source: TypeAlias = (
    "Path | str | bytes | etree._Element | etree._ElementTree | ElementTree.Element | ElementTree.ElementTree | "
    "WrittenInPython"
)

MAX_BYTES = 64 * 2**20
"""Size of a file."""
MAX_DEPTH = 100
"""Levels of elements."""


@dataclass(frozen=True)
class Document:
    """A parsed file.

    name    what messages call it
    path    where it lies; None where it was handed in otherwise
    folder  what its relative paths start from
    text    what it was parsed from, where there is no file to read again
    digest  SHA-256 of the content, as hexadecimal digits
    """

    root: etree._Element
    name: str
    path: Path | None
    folder: Path
    text: bytes | None = None
    digest: str = ""


class _PrologEnds(Exception):
    """The first element has begun: nothing dangerous can follow."""


def open_document(source: Source) -> Document:
    """Parses a file, its bytes, or takes a tree that is parsed already. Raises ScenarioError with file:line."""
    if isinstance(source, bytes):
        return Document(parse(source, "<bytes>"), "<bytes>", None, Path(), source, _digest(source))
    if not isinstance(source, str | Path):
        return _from_tree(source)
    path = Path(source)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ScenarioError(Problem(f"the file is larger than {MAX_BYTES // 2**20} MiB", "split it", str(source)))
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ScenarioError(Problem(f"cannot be read: {reason}", "check the path", str(source))) from error
    return Document(parse(content, str(source)), str(source), path, path.parent, digest=_digest(content))


def text_of(source: Source) -> bytes:
    """The text of a file: its bytes, or those that a tree has as a file. Raises ScenarioError with file:line."""
    if isinstance(source, bytes):
        return source
    if isinstance(source, str | Path):
        return Path(source).read_bytes()
    return etree.tostring(open_document(source).root, encoding="utf-8", xml_declaration=True)


def _from_tree(source: Any) -> Document:
    """The tree as it is where lxml made it, as then it knows its lines."""
    name = f"<{type(source).__name__}>"
    root = source
    if hasattr(root, "get_element"):
        root = _element_of(root, name)
    if hasattr(root, "getroot"):
        root = root.getroot()
    if isinstance(root, etree._Element):
        base = Path(root.base) if root.base else None
        digest = _digest(etree.tostring(root))
        return Document(root, str(base or "<element>"), base, base.parent if base else Path(), digest=digest)
    if not isinstance(root, ElementTree.Element):
        what = "this is neither a path nor XML"
        remedy = "give a path, bytes, an XML tree, or an object with get_element()"
        raise ScenarioError(Problem(what, remedy, name))
    text = _as_written(root, name)
    return Document(parse(text, name), name, None, Path(), text, _digest(text))


def _element_of(source: WrittenInPython, name: str) -> Any:
    """Its root element. Raises ScenarioError where the library that made it finds something wrong by now."""
    try:
        return source.get_element()
    except Exception as error:  # of whichever library that is: scenariogeneration raises what its versions do not have
        what = f"get_element() gives no XML: {error} ({type(error).__name__})"
        raise ScenarioError(Problem(what, "write_xml would fail alike; mend what it names", name)) from error


def _as_written(root: ElementTree.Element, name: str) -> bytes:
    """The text of a tree that knows no lines.

    It has one element a line after the XML declaration, as write_xml of scenariogeneration sets it: the line of a
    message is the line that the element would have in such a file. Attributes that are None are left out.
    """
    indented = copy.deepcopy(root)
    try:
        for node in indented.iter():
            _texts_only(node, name)
        ElementTree.indent(indented)
        text: bytes = ElementTree.tostring(indented, "utf-8", xml_declaration=True)
    except (TypeError, ValueError, AttributeError, RecursionError) as error:
        raise ScenarioError(Problem(f"cannot be written as XML: {error}", "give texts only", name)) from error
    return text


def _texts_only(node: ElementTree.Element, name: str) -> None:
    """Takes the attributes away that are None. Raises ScenarioError for others that are no text."""
    attributes: list[tuple[str, Any]] = list(node.items())
    for attribute, value in attributes:
        if value is None:
            del node.attrib[attribute]
        elif not isinstance(value, str):
            what = f"{attribute} of {node.tag} is {value!r} of the type {type(value).__name__}"
            raise ScenarioError(Problem(what, "give a text, as XML has nothing else", name))


def parse(content: bytes, name: str) -> etree._Element:
    """The root element of an XML file's bytes. Raises ScenarioError with file:line."""
    if len(content) > MAX_BYTES:
        raise ScenarioError(Problem(f"the file is larger than {MAX_BYTES // 2**20} MiB", "split it", name))
    _refuse_document_type(content, name)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = parse_numbered(content, parser)
    except etree.XMLSyntaxError as error:
        raise ScenarioError(_not_well_formed(error.msg, error.lineno, name)) from error
    too_deep = next(iter(cast(list[etree._Element], root.xpath("/*" * (MAX_DEPTH + 1)))), None)
    if too_deep is not None:
        problem = Problem(f"elements are nested more than {MAX_DEPTH} deep", "flatten them", name, line_of(too_deep))
        raise ScenarioError(problem)
    return root


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def line_of(node: etree._Element) -> int | None:
    """The line where an element begins."""
    return cast("int | None", node.sourceline)


def _refuse_document_type(content: bytes, name: str) -> None:
    """Reads no further than to the first element; a document type, where entities are declared, ends it at once."""
    parser = expat.ParserCreate()

    def document_type(*_: object) -> None:
        raise ScenarioError(
            Problem(
                "the file has a document type declaration (DOCTYPE), which may bring in entities and other files",
                "remove it; OpenSCENARIO needs none",
                name,
                parser.CurrentLineNumber,
            )
        )

    def first_element(*_: object) -> None:
        raise _PrologEnds

    parser.StartDoctypeDeclHandler = document_type
    parser.StartElementHandler = first_element
    try:
        parser.Parse(content, True)
    except _PrologEnds:
        return
    except expat.ExpatError as error:
        raise ScenarioError(_not_well_formed(expat.ErrorString(error.code), error.lineno, name)) from error


def _not_well_formed(what: str | None, line: int | None, name: str) -> Problem:
    remedy = "every tag has to be closed, every value quoted, & written as &amp;"
    return Problem(f"not well-formed XML: {what or 'unreadable'}", remedy, name, line)
