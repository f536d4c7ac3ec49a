"""Free-form properties and files."""

from __future__ import annotations

from typing import Any

from eidrive_scenario.openscenario.model.element import Element, children, element_type, text, visible_parameters


@element_type
class Property(Element):
    """Name and value of a property."""

    name: str
    value: str
    scope: Any = visible_parameters()


@element_type
class File(Element):
    """File by its path."""

    filepath: str


@element_type
class Directory(Element):
    """Folder by its path."""

    path: str


@element_type
class CustomContent(Element):
    """Free text for specific tools."""

    content: str = text()


@element_type
class Properties(Element):
    """Properties of an object beyond the standard."""

    property: tuple[Property, ...] = ()
    file: tuple[File, ...] = ()
    custom_content: tuple[CustomContent, ...] = children(since="1.2")
