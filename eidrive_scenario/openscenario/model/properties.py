"""Free-form properties and files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from eidrive_scenario.openscenario.model.element import Element, children, text, visible_parameters


@dataclass(frozen=True, kw_only=True)
class Property(Element):
    """One name and its value."""

    name: str
    value: str
    scope: Any = visible_parameters()


@dataclass(frozen=True, kw_only=True)
class File(Element):
    """A file, by its path."""

    filepath: str


@dataclass(frozen=True, kw_only=True)
class Directory(Element):
    """A folder, by its path."""

    path: str


@dataclass(frozen=True, kw_only=True)
class CustomContent(Element):
    """Free text that a tool may understand."""

    content: str = text()


@dataclass(frozen=True, kw_only=True)
class Properties(Element):
    """What a tool may know about an object beyond the standard."""

    property: tuple[Property, ...] = ()
    file: tuple[File, ...] = ()
    custom_content: tuple[CustomContent, ...] = children(since="1.2")
