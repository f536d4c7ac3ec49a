"""StoryboardElementStateCondition: state or transition of a storyboard element."""

from __future__ import annotations

from eidrive_scenario.api.actions import (
    Condition,
    ConditionContext,
    ElementState,
    ElementStateObserver,
    ElementTransition,
    model,
)
from eidrive_scenario.api.common import Diagnostic, ScenarioError, suggestion

STATES = {state.value: state for state in ElementState}
TRANSITIONS = {transition.value: transition for transition in ElementTransition}


class StoryboardElementStateCondition(Condition):
    """State or transition of an element, by its name or by the end of its path (`Act::Event::Action`).

    A transition is observed in the step in which it occurs. A trigger that is not evaluated in that step observes it in
    the next one.
    """

    instant = True
    reads = ()
    element: model.StoryboardElementStateCondition
    _observer: ElementStateObserver | None = None

    def bind(self, context: ConditionContext) -> None:
        """Find the element. Raise ScenarioError if the storyboard has no element of that name and type."""
        kind, name = self.element.storyboard_element_type.value, self.element.storyboard_element_ref
        self._observer = context.observe_element(kind, name)
        if self._observer is None:
            raise ScenarioError(
                Diagnostic.at(
                    self.element,
                    f"the storyboard has no {kind} named {name!r}",
                    suggestion(name, context.element_names(kind)),
                )
            )

    def holds(self, context: ConditionContext) -> bool:
        """Return True if the element is in the state or passed through the transition."""
        if self._observer is None:
            return False
        word = self.element.state.value
        if word in TRANSITIONS:
            return self._observer.passed(TRANSITIONS[word])
        return self._observer.in_state(STATES[word])

    def explain(self, context: ConditionContext) -> str:
        """Describe element and state."""
        return self.describe()

    def describe(self) -> str:
        """Describe element and state."""
        kind, name = self.element.storyboard_element_type.value, self.element.storyboard_element_ref
        return f"{kind} {name} in {self.element.state.value}"
