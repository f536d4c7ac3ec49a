"""Acts and events that never started in a run."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import Element, Maneuver
from eidrive_scenario.storyboard.state.states import ElementTransition
from eidrive_scenario.storyboard.tree.elements import ActElement, StoryElement
from eidrive_scenario.storyboard.tree.events import EventElement

_SHOWN = 5
"""Elements that are named; of more, the number is given."""


def unstarted(root: StoryElement, scenario: Scenario, time: float, end: str) -> list[Diagnostic]:
    """Return a warning for each act that never started, and for each event that never did in an act that started.

    What may never be executed, as its maximumExecutionCount is 0, is left out.

    root   the storyboard after the run
    time   at which the run ended [s], and `end` the reason
    """
    found = list(_unstarted(root))
    if not found:
        return []
    places = dict(_places(scenario))
    diagnostics = []
    for element in found[:_SHOWN]:
        source, line = places.get(element.record.path, (str(scenario.path or ""), None))
        skipped = sum(transition is ElementTransition.SKIP for _, transition in element.record.transitions)
        why = "its start trigger was not fulfilled" if element.start_leaf is not None else "nothing started it"
        if skipped:
            why = f"it was skipped {skipped} times by its priority" if skipped > 1 else "it was skipped by its priority"
        diagnostics.append(
            Diagnostic(
                f"{element.kind} {element.name!r} never started: {why} until the run ended at {time:.2f} s ({end})",
                f"eidrive run --explain {element.name!r} states what its trigger lacked",
                source,
                line,
            )
        )
    if len(found) > _SHOWN:
        more = len(found) - _SHOWN
        what = f"{more} more {'act or event' if more == 1 else 'acts and events'} never started"
        diagnostics.append(Diagnostic(what, "eidrive run --log - shows those that did", str(scenario.path or "")))
    return diagnostics


def _unstarted(element: StoryElement) -> Iterator[StoryElement]:
    if element.limit < 1:
        return
    started = any(transition is ElementTransition.START for _, transition in element.record.transitions)
    if isinstance(element, ActElement | EventElement) and not started:
        yield element
    elif started and not isinstance(element, EventElement):
        for child in element.elements:
            yield from _unstarted(child)


def _places(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], tuple[str, int | None]]]:
    """File and line of each act and event, by its path."""
    for story in scenario.storyboard.story:
        for act in story.act:
            yield (story.name, act.name), _place(act)
            for group in act.maneuver_group:
                entries = (scenario.entries.get(reference) for reference in group.catalog_reference)
                for maneuver in (*group.maneuver, *(one for one in entries if isinstance(one, Maneuver))):
                    for event in maneuver.event:
                        yield (story.name, act.name, group.name, maneuver.name, event.name), _place(event)


def _place(element: Element) -> tuple[str, int | None]:
    return element.source, element.line
