"""Bytes of a file into an XML tree: no network, no document type, no entities, bounded size and depth."""

from __future__ import annotations

import copy
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias, cast
from xml.etree import ElementTree

from lxml import etree

from eidrive_scenario.errors import Diagnostic, ScenarioError, shortened
from eidrive_scenario.files.bounded import MIB, read_regular_file, reason_of
from eidrive_scenario.files.untrusted_xml import XmlLimits, parse_untrusted


class SupportsGetElement(Protocol):
    """What scenariogeneration calls a Scenario, and whatever else gives its XML on demand."""

    def get_element(self) -> Any:
        """The root element."""


Source: TypeAlias = (
    "Path | str | bytes | etree._Element | etree._ElementTree | ElementTree.Element | ElementTree.ElementTree | "
    "SupportsGetElement"
)

LIMITS = XmlLimits(max_bytes=64 * MIB, max_nodes=2_000_000)
"""Limits of a scenario, a catalog and a parameter value distribution."""


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


def open_document(source: Source) -> Document:
    """Parses a file, its bytes, or takes a tree that is parsed already. Raises ScenarioError with file:line."""
    if isinstance(source, bytes):
        return Document(parse(source, "<bytes>"), "<bytes>", None, Path(), source, _digest(source))
    if not isinstance(source, str | Path):
        return _from_tree(source)
    path, content = Path(source), _content(source)
    return Document(parse(content, str(source)), str(source), path, path.parent, digest=_digest(content))


def text_of(source: Source) -> bytes:
    """The text of a file: its bytes, or those that a tree has as a file. Raises ScenarioError with file:line."""
    if isinstance(source, bytes):
        return source
    if isinstance(source, str | Path):
        return _content(source)
    return etree.tostring(open_document(source).root, encoding="utf-8", xml_declaration=True)


def _content(path: str | Path) -> bytes:
    try:
        return read_regular_file(path, LIMITS.max_bytes)
    except OSError as error:
        diagnostic = Diagnostic(f"cannot be read: {reason_of(error)}", "check the path", shortened(str(path)))
        raise ScenarioError(diagnostic) from error


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
        hint = "give a path, bytes, an XML tree, or an object with get_element()"
        raise ScenarioError(Diagnostic(what, hint, name))
    text = _as_written(root, name)
    return Document(parse(text, name), name, None, Path(), text, _digest(text))


def _element_of(source: SupportsGetElement, name: str) -> Any:
    """Its root element. Raises ScenarioError where the library that made it finds something wrong by now."""
    try:
        return source.get_element()
    except Exception as error:  # of whichever library that is: scenariogeneration raises what its versions do not have
        what = f"get_element() gives no XML: {error} ({type(error).__name__})"
        raise ScenarioError(Diagnostic(what, "write_xml would fail alike; mend what it names", name)) from error


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
        raise ScenarioError(Diagnostic(f"cannot be written as XML: {error}", "give texts only", name)) from error
    return text


def _texts_only(node: ElementTree.Element, name: str) -> None:
    """Takes the attributes away that are None. Raises ScenarioError for others that are no text."""
    attributes: list[tuple[str, Any]] = list(node.items())
    for attribute, value in attributes:
        if value is None:
            del node.attrib[attribute]
        elif not isinstance(value, str):
            what = f"{attribute} of {node.tag} is {value!r} of the type {type(value).__name__}"
            raise ScenarioError(Diagnostic(what, "give a text, as XML has nothing else", name))


def parse(content: bytes, name: str) -> etree._Element:
    """The root element of an XML file's bytes. Raises ScenarioError with file:line."""
    return parse_untrusted(content, name, LIMITS, ScenarioError)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def line_of(node: etree._Element) -> int | None:
    """The line where an element begins."""
    return cast("int | None", node.sourceline)
