"""Parser from files to XML trees: no network, no document type, no entities, bounded size and depth."""

from __future__ import annotations

import copy
import os
from collections import OrderedDict
from collections.abc import Hashable
from pathlib import Path
from typing import Any, Generic, Protocol, TypeAlias, TypeVar
from xml.etree import ElementTree

import msgspec
from lxml import etree

from eidrive_scenario.base.content_digest import sha256_of
from eidrive_scenario.errors import Diagnostic, ScenarioError, shortened
from eidrive_scenario.extensions.library import scenario_suggestion
from eidrive_scenario.files.bounded import MIB, read_regular_file, reason_of
from eidrive_scenario.files.untrusted_xml import XmlLimits, parse_untrusted

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class KeptFiles(Generic[K, V]):
    """Values by key, up to a maximum size of their files in all [byte]."""

    def __init__(self, max_size: int) -> None:
        self._max_size = max_size
        self._kept: OrderedDict[K, tuple[V, int]] = OrderedDict()

    def get(self, key: K) -> V | None:
        """Return the value of a key, or None."""
        kept = self._kept.get(key)
        if kept is None:
            return None
        self._kept.move_to_end(key)
        return kept[0]

    def put(self, key: K, value: V, size: int) -> None:
        """Store the value of a file of this size [byte]. Larger files than the maximum are not kept."""
        if size > self._max_size:
            return
        self._kept[key] = value, size
        self._kept.move_to_end(key)
        while sum(each for _, each in self._kept.values()) > self._max_size:
            self._kept.popitem(last=False)


class SupportsGetElement(Protocol):
    """Object that creates its XML on demand, such as a Scenario of scenariogeneration."""

    def get_element(self) -> Any:
        """Return the root element."""


Source: TypeAlias = (
    "os.PathLike[str] | str | bytes | etree._Element | etree._ElementTree | ElementTree.Element | "
    "ElementTree.ElementTree | SupportsGetElement"
)

LIMITS = XmlLimits(max_bytes=64 * MIB, max_nodes=2_000_000)
"""Limits of a scenario, a catalog and a parameter value distribution."""


class Document(msgspec.Struct, frozen=True):
    """Parsed file.

    name    name in messages
    path    path of the file; None for other sources
    folder  base of relative paths
    text    parsed text of a source without a file
    digest  SHA-256 of the content, as hexadecimal digits
    read    elements that have the same content in each reading, by their nodes; None if the document is not kept
    """

    root: etree._Element
    name: str
    path: Path | None
    folder: Path
    text: bytes | None = None
    digest: str = ""
    read: dict[etree._Element, Any] | None = None


MAX_KEPT = 2**18
"""Maximum size of all files whose documents are kept [byte]."""
_kept: KeptFiles[tuple[str, str], Document] = KeptFiles(MAX_KEPT)
"""Documents by name and digest: a scenario is read again for each combination of parameter values."""


def open_document(source: Source) -> Document:
    """Parse a file or its bytes, or wrap a parsed tree. Raise ScenarioError with file and line if it is invalid."""
    if isinstance(source, bytes):
        return _parsed(source, "<bytes>", None)
    if not isinstance(source, str | os.PathLike):
        return _from_tree(source)
    return _parsed(_content(source), str(source), Path(source))


def _parsed(content: bytes, name: str, path: Path | None) -> Document:
    """Return the document of a content; the kept one from the second time on."""
    key = name, sha256_of(content)
    kept = _kept.get(key)
    if kept is None:
        folder, text = (Path(), content) if path is None else (path.parent, None)
        kept = Document(parse(content, name), name, path, folder, text, key[1])
    elif kept.read is None:
        kept = msgspec.structs.replace(kept, read={})
    _kept.put(key, kept, len(content))
    return kept


def text_of(source: Source) -> bytes:
    """Return the bytes of a file, or of a tree written as a file. Raise ScenarioError if the source is invalid."""
    if isinstance(source, bytes):
        return source
    if isinstance(source, str | os.PathLike):
        return _content(source)
    return etree.tostring(open_document(source).root, encoding="utf-8", xml_declaration=True)


def _content(path: str | os.PathLike[str]) -> bytes:
    try:
        return read_regular_file(path, LIMITS.max_bytes)
    except OSError as error:
        hint = scenario_suggestion(path) if isinstance(error, FileNotFoundError) else "check the path"
        diagnostic = Diagnostic(f"cannot read: {reason_of(error)}", hint, shortened(str(path)))
        raise ScenarioError(diagnostic) from error


def _from_tree(source: Any) -> Document:
    """Return the document of a tree; a tree of lxml is used directly, as it has line numbers."""
    name = f"<{type(source).__name__}>"
    root = source
    if hasattr(root, "get_element"):
        try:
            root = root.get_element()
        except Exception as error:  # libraries raise any type; scenariogeneration one of unsupported versions
            message = f"get_element() raises {type(error).__name__}: {error}"
            hint = "correct the object; write_xml fails for the same reason"
            raise ScenarioError(Diagnostic(message, hint, name)) from error
    if hasattr(root, "getroot"):
        root = root.getroot()
    if isinstance(root, etree._Element):
        base = Path(root.base) if root.base else None
        digest = sha256_of(etree.tostring(root))
        return Document(root, str(base or "<element>"), base, base.parent if base else Path(), digest=digest)
    if not isinstance(root, ElementTree.Element):
        message = "the source is neither a path nor XML"
        hint = "use a path, bytes, an XML tree, or an object with get_element()"
        raise ScenarioError(Diagnostic(message, hint, name))
    text = _serialize(root, name)
    return Document(parse(text, name), name, None, Path(), text, sha256_of(text))


def _serialize(root: ElementTree.Element, name: str) -> bytes:
    """Return the text of a tree without line numbers.

    It has one element per line after the XML declaration, like write_xml of scenariogeneration: the line of a message
    is the line of the element in such a file. Attributes that are None are omitted.
    """
    indented = copy.deepcopy(root)
    try:
        for node in indented.iter():
            attributes: list[tuple[str, Any]] = list(node.items())
            for attribute, value in attributes:
                if value is None:
                    del node.attrib[attribute]
                elif not isinstance(value, str):
                    message = f"{attribute} of {node.tag} is {value!r} of the type {type(value).__name__}"
                    raise ScenarioError(Diagnostic(message, "use a text, the only type of XML attributes", name))
        ElementTree.indent(indented)
        text: bytes = ElementTree.tostring(indented, "utf-8", xml_declaration=True)
    except (TypeError, ValueError, AttributeError, RecursionError) as error:
        raise ScenarioError(Diagnostic(f"cannot be written as XML: {error}", "use only texts", name)) from error
    return text


def parse(content: bytes, name: str) -> etree._Element:
    """Return the root element of the bytes of an XML file. Raise ScenarioError if they are invalid."""
    return parse_untrusted(content, name, LIMITS, ScenarioError)
