"""Complete files: header, version of the standard and root element."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import msgspec
from lxml import etree

from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector, Location
from eidrive_scenario.openscenario.model import OpenScenario
from eidrive_scenario.openscenario.reading.parsing import Document, Source, open_document
from eidrive_scenario.openscenario.reading.reader import Reader, ReferenceUse
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.values.parameters import Assignment, Parameter
from eidrive_scenario.openscenario.values.scalars import Version

VERSIONS: tuple[Version, ...] = ((1, 0), (1, 1), (1, 2), (1, 3), (1, 4))
ROOTS = ("OpenSCENARIO", "OpenScenario")
"""Names of the root element; the schema declares both spellings."""


class ReadDocument(msgspec.Struct, frozen=True):
    """Content of a file, with catalog references that are not resolved yet."""

    root: OpenScenario
    version: Version
    references: tuple[ReferenceUse, ...]
    parameters: dict[str, Parameter]


def read_document(source: Source) -> OpenScenario:
    """Return the root element of a scenario, catalog or parameter value distribution with substituted parameters.

    The file itself is checked, not the files to which it refers. Raise ScenarioError with all errors of the file.
    """
    collector = DiagnosticCollector()
    read = read_root(open_document(source), collector)
    collector.raise_on_error()
    assert read is not None
    return read.root


def read_root(
    document: Document, collector: DiagnosticCollector, assignments: Mapping[str, Assignment] | None = None
) -> ReadDocument | None:
    """Read a parsed file; return None if its version is unknown."""
    version = version_of(document, collector)
    if version is None:
        return None
    tree = apply_workarounds(document.root, document.name, version, collector)
    reader = Reader(document.name, version, collector, document.read if tree is document.root else None)
    root = cast(OpenScenario, reader.read(tree, OpenScenario, assignments))
    declared = reader.declared if root.parameter_declarations else None
    return ReadDocument(root, version, tuple(reader.references), declared.parameters if declared else {})


def version_of(document: Document, collector: DiagnosticCollector, older: Version | None = None) -> Version | None:
    """Return the version in the header; report an error if it is unknown.

    older  version as which a file of revMajor 0 is read, with a warning
    """
    root = document.root
    at = Location(document.name, line_of(root))
    if root.tag not in ROOTS:
        name = etree.QName(root)
        hint = "check the kind of the file"
        if name.namespace and name.localname in ROOTS:
            hint = f"remove xmlns={name.namespace!r}: the standard has no namespace"
        collector.error(f"the root element is {root.tag} (expected OpenSCENARIO)", hint, at=at)
        return None
    header = root.find("FileHeader")
    if header is None:
        hint = "its revMajor and revMinor specify the version of the standard"
        collector.error("OpenSCENARIO lacks the element FileHeader", hint, at=at)
        return None
    at = Location(document.name, line_of(header))
    numbers = []
    for attribute in ("revMajor", "revMinor"):
        text = header.get(attribute)
        if text is None or not (text.strip().isascii() and text.strip().isdigit()):
            problem = f"lacks the attribute {attribute!r}" if text is None else f"has the {attribute} {text!r}"
            collector.error(f"FileHeader {problem}", "version 1.4 is revMajor 1 and revMinor 4", at=at)
            return None
        numbers.append(int(text.strip()[:9]))
    version = (numbers[0], numbers[1])
    if version in VERSIONS:
        return version
    is_older = older is not None and version < older
    supported = "known: " + ", ".join(f"{major}.{minor}" for major, minor in VERSIONS)
    report = collector.warning if is_older else collector.error
    report(f"FileHeader has the version {version[0]}.{version[1]}", supported, at=at)
    return older if is_older else None
