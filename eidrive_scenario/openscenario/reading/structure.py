"""What is wrong with the children of one element: unknown, missing, too many, in the wrong place."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable

from lxml import etree

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.reading.matching import Automaton
from eidrive_scenario.openscenario.reading.schema import Rules, rules
from eidrive_scenario.openscenario.values.scalars import Version, availability

_LONGEST_NAME = 100
"""Characters of a name that are compared with others."""

Report = Callable[[str, str, etree._Element], None]
"""Takes what is wrong, the remedy, and the element where it is."""


def check_children(
    node: etree._Element, below: Iterable[etree._Element], known: Rules, version: Version, report: Report
) -> None:
    """Reports every child that the rules forbid, and every one that they miss.

    A misspelt child counts as what it was likely meant to be, so that it is not reported as missing too.
    """
    standing: list[tuple[str, etree._Element]] = []
    for child in below:
        if child.tag in known.children:
            standing.append((child.tag, child))
            continue
        report(f"unknown element {child.tag} in {node.tag}", _instead(node, child.tag, known, version), child)
        meant = difflib.get_close_matches(child.tag[:_LONGEST_NAME], known.children, n=1)
        standing.extend((name, child) for name in meant)
    if known.order is None:
        _check_each_once(node, standing, known, report)
    else:
        _check_order(node, standing, known, known.order, report)


def _instead(node: etree._Element, name: str, known: Rules, version: Version) -> str:
    usage = known.other_children.get(name)
    if usage:
        return availability(usage, version)
    around = [tag for tag, rule in known.children.items() if name in rules(rule.cls, version).children]
    if around:
        return f"{name} stands in {' or '.join(around)}, which may stand here"
    return suggestion(name, known.children) if known.children else f"{node.tag} holds no elements"


def _check_each_once(
    node: etree._Element, standing: list[tuple[str, etree._Element]], known: Rules, report: Report
) -> None:
    seen: set[str] = set()
    for name, child in standing:
        if name in seen and child.tag == name:
            report(f"{node.tag} holds {name} twice", "remove one", child)
        seen.add(name)
    for name, rule in known.children.items():
        if rule.minimum and name not in seen:
            report(f"{node.tag} lacks the element {name}", f"it holds {known.summary}", node)


def _check_order(
    node: etree._Element, standing: list[tuple[str, etree._Element]], known: Rules, order: Automaton, report: Report
) -> None:
    """Follows the automaton; where it is stuck, that is reported once, and it goes on as if all had been right."""
    present = {name for name, _ in standing}
    state, misplaced = 0, False
    seen: set[str] = set()
    for name, child in standing:
        skipped = order.skipped(state, name)
        if skipped and not present & set(skipped):
            for missing in skipped:
                report(f"{node.tag} lacks the element {missing}", f"it holds {known.summary}", node)
        elif skipped is None or skipped:
            if not misplaced and child.tag == name:
                what = "may not stand here again" if name in seen else "may not stand here"
                report(f"{name} {what}", f"{node.tag} holds {known.summary}", child)
            misplaced = True
        state = order.after(state, name)
        seen.add(name)
    for names in order.missing(state):
        if not (misplaced and seen & set(names)):
            if len(names) > 1:
                what = "one of " + ", ".join(names)
            else:
                what = f"another {names[0]}" if names[0] in seen else f"the element {names[0]}"
            report(f"{node.tag} lacks {what}", f"it holds {known.summary}", node)
