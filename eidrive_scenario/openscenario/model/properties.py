"""Free-form properties and files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from eidrive_scenario.openscenario.model.element import Element, children, text, visible_parameters


@dataclass(frozen=True, kw_only=True)
class Property(Element):
    """Name and value of a property."""

    name: str
    value: str
    scope: Any = visible_parameters()


@dataclass(frozen=True, kw_only=True)
class File(Element):
    """File by its path."""

    filepath: str


@dataclass(frozen=True, kw_only=True)
class Directory(Element):
    """Folder by its path."""

    path: str


@dataclass(frozen=True, kw_only=True)
class CustomContent(Element):
    """Free text for specific tools."""

    content: str = text()


@dataclass(frozen=True, kw_only=True)
class Properties(Element):
    """Properties of an object beyond the standard."""

    property: tuple[Property, ...] = ()
    file: tuple[File, ...] = ()
    custom_content: tuple[CustomContent, ...] = children(since="1.2")
