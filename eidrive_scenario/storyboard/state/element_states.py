"""Where every storyboard element stands, and what happened to it: the memory of StoryboardElementStateConditions."""

from __future__ import annotations

from dataclasses import dataclass, field

from eidrive_scenario.openscenario.validation.storyboard_names import ReferenceMatch
from eidrive_scenario.storyboard.state.states import ElementState, ElementTransition, StateChange

NOT_BEGUN = ElementState.STANDBY
"""What an element counts as while those above it do not run."""


@dataclass
class ElementRecord:
    """One element: its place in the tree, its state, and the ticks of its transitions."""

    kind: str
    path: tuple[str, ...]
    state: ElementState | None = None
    transitions: list[tuple[int, ElementTransition]] = field(default_factory=list)


class ElementStates:
    """States of all elements, and the changes of the current tick."""

    def __init__(self) -> None:
        self.records: list[ElementRecord] = []
        self.changes: list[StateChange] = []
        self.tick = -1
        self.time = 0.0
        self._meant: ReferenceMatch[ElementRecord] | None = None

    def register(self, kind: str, path: tuple[str, ...]) -> ElementRecord:
        """Keep track of one more element."""
        record, self._meant = ElementRecord(kind, path), None
        self.records.append(record)
        return record

    def begin(self, tick: int, time: float) -> None:
        """A new tick: the changes of the last one are over."""
        self.tick, self.time = tick, time
        self.changes = []

    def change(
        self, record: ElementRecord, transition: ElementTransition | None, after: ElementState, why: str = ""
    ) -> None:
        """An element goes to another state (or, skipped, stays where it is)."""
        before = record.state or NOT_BEGUN
        if transition is None and record.state is after:
            return
        record.state = after
        if transition is not None:
            record.transitions.append((self.tick, transition))
        self.changes.append(
            StateChange(self.time, record.path[-1], "/".join(record.path), record.kind, before, transition, after, why)
        )

    def find(self, kind: str, reference: str) -> list[ElementRecord]:
        """The elements of one kind that a reference means."""
        if self._meant is None:
            self._meant = ReferenceMatch((record.path, record) for record in self.records)
        return [record for record in self._meant.by(reference) if record.kind == kind]

    def observe_element(self, kind: str, reference: str) -> ElementStateObserver | None:
        """A watch on the elements that a reference means, None if there is none."""
        found = self.find(kind, reference)
        return ElementStateObserver(self, found) if found else None

    def names(self, kind: str) -> list[str]:
        """The names of all elements of one kind."""
        return [record.path[-1] for record in self.records if record.kind == kind]


class ElementStateObserver:
    """One observer's eye on elements: each transition is shown to it in one tick, and not long after it happened."""

    def __init__(self, progress: ElementStates, records: list[ElementRecord]) -> None:
        self._progress = progress
        self._records = records
        self._seen = [0] * len(records)
        self._before = [0] * len(records)
        """How many transitions were seen in earlier ticks."""
        self._looked_at = -1

    def in_state(self, state: ElementState) -> bool:
        """True where one of the elements is in that state."""
        return any(record.state is state for record in self._records)

    def passed(self, transition: ElementTransition) -> bool:
        """True where one of them went through that transition in this tick or, unseen so far, in the one before."""
        found = False
        if self._looked_at != self._progress.tick:
            self._looked_at, self._before = self._progress.tick, list(self._seen)
        for index, record in enumerate(self._records):
            fresh = record.transitions[self._before[index] :]
            self._seen[index] = len(record.transitions)
            found = found or any(kind is transition and tick >= self._progress.tick - 1 for tick, kind in fresh)
        return found
