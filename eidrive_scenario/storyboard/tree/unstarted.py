"""Acts and events that never started in a run."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.errors import Diagnostic, counted
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.diagnostics import Location
from eidrive_scenario.openscenario.validation.names import StoryboardNames
from eidrive_scenario.storyboard.state.element_states import ElementTransition
from eidrive_scenario.storyboard.tree.elements import ActElement, StoryElement
from eidrive_scenario.storyboard.tree.events import EventElement

_MAX_REPORTED = 5
"""Maximum number of elements that are reported individually."""


def unstarted(root: StoryElement, scenario: Scenario, time: float, end: str) -> list[Diagnostic]:
    """Return a warning for each act that never started, and for each event that never started in a started act.

    Elements with maximumExecutionCount 0 are not reported.

    root   storyboard after the run
    time   time of the end of the run [s]
    end    reason for the end of the run
    """
    elements = list(_find_unstarted(root))
    if not elements:
        return []
    named = StoryboardNames(scenario.storyboard, scenario.entries).named
    definitions = {entry.path: entry.element for entry in named}
    diagnostics = []
    for element in elements[:_MAX_REPORTED]:
        location = definitions.get(element.record.path, Location(str(scenario.path or "")))
        skipped = sum(transition is ElementTransition.SKIP for _, transition in element.record.transitions)
        why = "its start trigger was not fulfilled" if element.start_leaf is not None else "nothing started it"
        if skipped:
            why = f"it was skipped {skipped} times by its priority" if skipped > 1 else "it was skipped by its priority"
        diagnostics.append(
            Diagnostic.at(
                location,
                f"{element.kind} {element.name!r} never started: {why} until the run ended at {time:.2f} s ({end})",
                f"eidrive run --explain {element.name!r} states the unfulfilled conditions",
            )
        )
    if len(elements) > _MAX_REPORTED:
        remaining = len(elements) - _MAX_REPORTED
        message = f"{counted(remaining, 'more act or event', 'more acts and events')} never started"
        diagnostics.append(
            Diagnostic(message, "eidrive run --log - prints the elements that started", str(scenario.path or ""))
        )
    return diagnostics


def _find_unstarted(element: StoryElement) -> Iterator[StoryElement]:
    if element.limit < 1:
        return
    started = any(transition is ElementTransition.START for _, transition in element.record.transitions)
    if isinstance(element, ActElement | EventElement) and not started:
        yield element
    elif started and not isinstance(element, EventElement):
        for child in element.elements:
            yield from _find_unstarted(child)
