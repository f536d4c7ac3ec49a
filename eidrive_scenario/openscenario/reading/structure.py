"""Check of the children of an element: unknown, missing, duplicate and misplaced ones."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable

from lxml import etree

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.reading.matching import Automaton
from eidrive_scenario.openscenario.reading.schema import Rules, rules
from eidrive_scenario.openscenario.values.scalars import Version, availability

_MAX_NAME = 100
"""Maximum number of characters of a name that are compared with others."""

Report = Callable[[str, str, etree._Element], None]
"""Callback for a diagnostic: message, hint and element."""


def check_children(
    node: etree._Element, children: Iterable[etree._Element], known: Rules, version: Version, report: Report
) -> None:
    """Report every child that the rules forbid, and every required child that is missing.

    A misspelled child counts as the most similar known one, so that this one is not reported as missing.
    """
    named: list[tuple[str, etree._Element]] = []
    for child in children:
        if child.tag in known.children:
            named.append((child.tag, child))
            continue
        report(f"unknown element {child.tag} in {node.tag}", _hint(node, child.tag, known, version), child)
        similar = difflib.get_close_matches(child.tag[:_MAX_NAME], known.children, n=1)
        named.extend((name, child) for name in similar)
    if known.order is None:
        _check_each_once(node, named, known, report)
    else:
        _check_order(node, named, known, known.order, report)


def _hint(node: etree._Element, name: str, known: Rules, version: Version) -> str:
    usage = known.other_children.get(name)
    if usage:
        return availability(usage, version)
    parents = [tag for tag, rule in known.children.items() if name in rules(rule.cls, version).children]
    if parents:
        return f"{name} belongs into {' or '.join(parents)}, which is allowed here"
    return suggestion(name, known.children) if known.children else f"{node.tag} contains no elements"


def _check_each_once(
    node: etree._Element, children: list[tuple[str, etree._Element]], known: Rules, report: Report
) -> None:
    seen: set[str] = set()
    for name, child in children:
        if name in seen and child.tag == name:
            report(f"{node.tag} contains {name} twice", "remove one", child)
        seen.add(name)
    for name, rule in known.children.items():
        if rule.minimum and name not in seen:
            report(f"{node.tag} lacks the element {name}", f"it contains {known.summary}", node)


def _check_order(
    node: etree._Element, children: list[tuple[str, etree._Element]], known: Rules, order: Automaton, report: Report
) -> None:
    """Follow the automaton; report the first misplaced child, and continue as if it were allowed."""
    present = {name for name, _ in children}
    state, misplaced = 0, False
    seen: set[str] = set()
    for name, child in children:
        skipped = order.skipped(state, name)
        if skipped and not present & set(skipped):
            for missing in skipped:
                report(f"{node.tag} lacks the element {missing}", f"it contains {known.summary}", node)
        elif skipped is None or skipped:
            if not misplaced and child.tag == name:
                problem = "is not allowed here again" if name in seen else "is not allowed here"
                report(f"{name} {problem}", f"{node.tag} contains {known.summary}", child)
            misplaced = True
        state = order.after(state, name)
        seen.add(name)
    for names in order.missing(state):
        if not (misplaced and seen & set(names)):
            if len(names) > 1:
                missing = "one of " + ", ".join(names)
            else:
                missing = f"another {names[0]}" if names[0] in seen else f"the element {names[0]}"
            report(f"{node.tag} lacks {missing}", f"it contains {known.summary}", node)
