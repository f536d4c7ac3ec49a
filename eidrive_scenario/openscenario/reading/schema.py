"""Schema rules of a model class in one version of the standard, and the check of the children of an element by them.

The rules are derived from the fields of the class on first use.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from dataclasses import MISSING, Field, fields
from datetime import datetime
from types import MappingProxyType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import msgspec
from lxml import etree

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.model import Element, Enumeration
from eidrive_scenario.openscenario.model.declarations import Limits, NameOf
from eidrive_scenario.openscenario.model.element import (
    ABOUT,
    USAGE,
    All,
    Changed,
    Choice,
    Content,
    Sequence,
    Usage,
    alternatives,
)
from eidrive_scenario.openscenario.reading.matching import Automaton, Group, Leaf, automaton
from eidrive_scenario.openscenario.values import scalars
from eidrive_scenario.openscenario.values.scalars import (
    Scalar,
    Version,
    availability,
    is_deprecated,
    is_known,
    parse_version,
)

_SCALARS = {
    float: scalars.DOUBLE,
    int: scalars.INTEGER,
    bool: scalars.BOOLEAN,
    str: scalars.STRING,
    datetime: scalars.DATE_TIME,
}
_PLAIN = Usage()


class AttributeRule(msgspec.Struct, frozen=True):
    """Rule of an attribute: field of the class, type, and whether it is required."""

    field: str
    scalar: Scalar
    required: bool
    deprecated: str
    points_to: str
    """Kind of the element to which the attribute refers (see model.scalars.NameOf); "" if it is not a reference."""


class ChildRule(msgspec.Struct, frozen=True):
    """Rule of a child element: field of the class, type, and number of occurrences."""

    field: str
    cls: type[Element]
    minimum: int
    many: bool
    single: bool
    """Whether the version allows only one, although the field is a tuple."""
    deprecated: str


class Rules(msgspec.Struct, frozen=True):
    """Content that one version allows for an element of a class.

    order             automaton over the names of the children; None for any order
    other_attributes  attributes that only other versions have
    other_children    children that only other versions have
    summary           description of the content model
    """

    cls: type[Element]
    attributes: MappingProxyType[str, AttributeRule]
    children: MappingProxyType[str, ChildRule]
    text_field: str
    order: Automaton | None
    other_attributes: MappingProxyType[str, Usage]
    other_children: MappingProxyType[str, Usage]
    summary: str
    choice: tuple[str, ...]
    """Children of which one is required by meaning, although the schema of this version allows none."""


def rules(cls: type[Element], version: Version) -> Rules:
    """Return the rules of a class in a version."""
    key = (cls, version)
    content = _RULES.get(key)
    if content is None:
        content = _RULES[key] = _read(cls, version)
    return content


def _read(cls: type[Element], version: Version) -> Rules:
    hints = get_type_hints(cls, localns=vars(model), include_extras=True)
    attributes: dict[str, AttributeRule] = {}
    children: dict[str, ChildRule] = {}
    other_attributes: dict[str, Usage] = {}
    other_children: dict[str, Usage] = {}
    spelling: dict[str, str] = {}
    text_field = ""
    for field in fields(cls):
        usage: Usage = field.metadata.get(USAGE, _PLAIN)
        if field.name in ABOUT:
            continue
        if usage.text:
            text_field = field.name
            continue
        kind, extras, many = _kind(hints[field.name])
        is_child = isinstance(kind, type) and issubclass(kind, Element)
        name = usage.name or _xml_name(field.name, capital=is_child)
        required = _required(field, usage, version)
        deprecated = usage.deprecated if is_deprecated(usage, version) else ""
        if not is_known(usage, version):
            (other_children if is_child else other_attributes)[name] = usage
        elif is_child:
            minimum = usage.minimum if required else 0
            single = not many or (bool(usage.single_until) and version <= parse_version(usage.single_until))
            children[name] = ChildRule(field.name, kind, minimum, many, single, deprecated)
            spelling[field.name] = name
        else:
            points_to = next((extra.kind for extra in extras if isinstance(extra, NameOf)), "")
            scalar = _scalar(kind, extras, version)
            attributes[name] = AttributeRule(field.name, scalar, required, deprecated, points_to)
    content = cls.content_model
    if isinstance(content, Changed):
        content = content.before if version < parse_version(content.since) else content.after
    group = _group(content, children, spelling, version)
    return Rules(
        cls,
        MappingProxyType(attributes),
        MappingProxyType(children),
        text_field,
        None if isinstance(content, All) else automaton(group),
        MappingProxyType(other_attributes),
        MappingProxyType(other_children),
        "in any order " + ", ".join(children) if isinstance(content, All) else _describe_content(group),
        _required_choice(cls, spelling, version),
    )


def _kind(hint: Any) -> tuple[Any, tuple[Any, ...], bool]:
    """Return the type inside Optional, Annotated and tuple, its annotations, and whether it is a tuple."""
    if get_origin(hint) in (Union, UnionType):
        hint = next(option for option in get_args(hint) if option is not type(None))
    many = get_origin(hint) is tuple
    if many:
        hint = get_args(hint)[0]
    extras: tuple[Any, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *rest = get_args(hint)
        extras = tuple(rest)
    return hint, extras, many


def _scalar(kind: Any, extras: tuple[Any, ...], version: Version) -> Scalar:
    if issubclass(kind, Enumeration):
        return scalars.enumeration(kind, version)
    limits = next((extra for extra in extras if isinstance(extra, Limits)), None)
    return scalars.whole_number(limits) if limits else _SCALARS[kind]


def _required(field: Field[Any], usage: Usage, version: Version) -> bool:
    without_default = field.default is MISSING and field.default_factory is MISSING
    return (
        without_default
        or usage.required
        or (bool(usage.required_until) and version <= parse_version(usage.required_until))
        or (bool(usage.required_since) and version >= parse_version(usage.required_since))
    )


def _xml_name(field_name: str, *, capital: bool) -> str:
    """Return the name in the file: camel case, for children with a capital."""
    first, *rest = field_name.rstrip("_").split("_")
    head = first[:1].upper() + first[1:] if capital else first
    return head + "".join(word[:1].upper() + word[1:] for word in rest)


def _group(content: Content, children: dict[str, ChildRule], spelling: dict[str, str], version: Version) -> Group:
    """Return a content model with the fields of the version, under their names in the file."""
    exclusive = isinstance(content, Choice)
    fields_or_groups = getattr(content, "parts", ()) or tuple(spelling)
    parts: list[Leaf | Group] = []
    for part in fields_or_groups:
        if isinstance(part, Sequence | Choice):
            parts.append(_group(part, children, spelling, version))
        elif part in spelling:
            child = children[spelling[part]]
            repeated = isinstance(content, Choice) and content.maximum is None
            minimum = max(child.minimum, 1) if exclusive else child.minimum
            parts.append(Leaf(spelling[part], minimum, 1 if child.single or repeated else None))
    if not isinstance(content, Choice):
        return Group(tuple(parts), exclusive=False)
    empty = bool(content.empty_until) and version <= parse_version(content.empty_until)
    return Group(tuple(parts), True, content.minimum == 0 or empty or not parts, content.maximum is None)


def _required_choice(cls: type[Element], spelling: dict[str, str], version: Version) -> tuple[str, ...]:
    content = cls.content_model
    if isinstance(content, Changed):
        lenient = version < parse_version(content.since)
    else:
        parts = content.parts if isinstance(content, Sequence) else (content,)
        choices = [part for part in parts if isinstance(part, Choice)]
        lenient = any(part.empty_until and version <= parse_version(part.empty_until) for part in choices)
    return tuple(spelling[name] for name in alternatives(cls) if name in spelling) if lenient else ()


def _describe_content(group: Group) -> str:
    return _describe_group(group) + " in this order" * (len(group.parts) > 1 and not group.exclusive)


def _describe_group(group: Group) -> str:
    parts = [
        f"({_describe_group(part)})" if isinstance(part, Group) else part.name + "…" * (part.maximum is None)
        for part in group.parts
    ]
    return (" or " if group.exclusive else ", ").join(parts) or "nothing"


_RULES: dict[tuple[type[Element], Version], Rules] = {}
"""Cache of `rules`; mypy rejects classes of dataclasses as arguments of a function with functools.cache."""


_MAX_NAME = 100
"""Maximum number of characters of a name that are compared with others."""

Report = Callable[[str, str, etree._Element], None]
"""Callback for a diagnostic: message, hint and element."""


def check_children(
    node: etree._Element, children: Iterable[etree._Element], content: Rules, version: Version, report: Report
) -> None:
    """Report every child that the rules forbid, and every required child that is missing.

    A misspelled child counts as the most similar known one, so that this one is not reported as missing.
    """
    named: list[tuple[str, etree._Element]] = []
    for child in children:
        if child.tag in content.children:
            named.append((child.tag, child))
            continue
        report(f"unknown element {child.tag} in {node.tag}", _hint(node, child.tag, content, version), child)
        similar = difflib.get_close_matches(child.tag[:_MAX_NAME], content.children, n=1)
        named.extend((name, child) for name in similar)
    if content.order is None:
        _check_each_once(node, named, content, report)
    else:
        _check_order(node, named, content, content.order, report)


def _hint(node: etree._Element, name: str, content: Rules, version: Version) -> str:
    usage = content.other_children.get(name)
    if usage:
        return availability(usage, version)
    parents = [tag for tag, rule in content.children.items() if name in rules(rule.cls, version).children]
    if parents:
        return f"{name} belongs into {' or '.join(parents)}, which is allowed here"
    return suggestion(name, content.children) if content.children else f"{node.tag} contains no elements"


def _check_each_once(
    node: etree._Element, children: list[tuple[str, etree._Element]], content: Rules, report: Report
) -> None:
    seen: set[str] = set()
    for name, child in children:
        if name in seen and child.tag == name:
            report(f"{node.tag} contains {name} twice", "remove one", child)
        seen.add(name)
    for name, rule in content.children.items():
        if rule.minimum and name not in seen:
            report(f"{node.tag} lacks the element {name}", f"it contains {content.summary}", node)


def _check_order(
    node: etree._Element, children: list[tuple[str, etree._Element]], content: Rules, order: Automaton, report: Report
) -> None:
    """Follow the automaton; report the first misplaced child, and continue as if it were allowed."""
    present = {name for name, _ in children}
    state, misplaced = 0, False
    seen: set[str] = set()
    for name, child in children:
        skipped = order.skipped(state, name)
        if skipped and not present & set(skipped):
            for missing in skipped:
                report(f"{node.tag} lacks the element {missing}", f"it contains {content.summary}", node)
        elif skipped is None or skipped:
            if not misplaced and child.tag == name:
                problem = "is not allowed here again" if name in seen else "is not allowed here"
                report(f"{name} {problem}", f"{node.tag} contains {content.summary}", child)
            misplaced = True
        state = order.after(state, name)
        seen.add(name)
    for names in order.missing(state):
        if not (misplaced and seen & set(names)):
            if len(names) > 1:
                missing = "one of " + ", ".join(names)
            else:
                missing = f"another {names[0]}" if names[0] in seen else f"the element {names[0]}"
            report(f"{node.tag} lacks {missing}", f"it contains {content.summary}", node)
