"""StoryboardElementStateCondition: an element is in a state, or passes through a transition."""

from __future__ import annotations

from eidrive_scenario.api.actions import (
    Condition,
    ElementState,
    ElementStateObserver,
    ElementTransition,
    RuntimeContext,
    model,
)
from eidrive_scenario.api.common import Diagnostic, ScenarioError, suggestion

STATES = {state.value: state for state in ElementState}
TRANSITIONS = {transition.value: transition for transition in ElementTransition}


class StoryboardElementStateCondition(Condition):
    """An element of the storyboard, by its name or by the end of its path (`Act::Event::Action`).

    A transition is seen in the step in which it happens, by a trigger that is not asked then in the next one.
    """

    instant = True
    element: model.StoryboardElementStateCondition
    _watch: ElementStateObserver | None = None

    def bind(self, context: RuntimeContext) -> None:
        """Find the element. Raises ScenarioError if the storyboard has none of that name and type."""
        kind, name = self.element.storyboard_element_type.value, self.element.storyboard_element_ref
        self._watch = context.progress.observe_element(kind, name)
        if self._watch is None:
            raise ScenarioError(
                Diagnostic(
                    f"the storyboard has no {kind} named {name!r}",
                    suggestion(name, context.progress.names(kind)),
                    self.element.source,
                    self.element.line,
                )
            )

    def holds(self, context: RuntimeContext) -> bool:
        """Look at the element's state or at what it just went through."""
        if self._watch is None:
            return False
        word = self.element.state.value
        if word in TRANSITIONS:
            return self._watch.passed(TRANSITIONS[word])
        return self._watch.in_state(STATES[word])

    def explain(self, context: RuntimeContext) -> str:
        """Which element, and what of it."""
        return self.describe()

    def describe(self) -> str:
        """Which element, and what of it."""
        kind, name = self.element.storyboard_element_type.value, self.element.storyboard_element_ref
        return f"{kind} {name} in {self.element.state.value}"
