"""States of storyboard elements, their transitions and observers, and control domains of actors.

ASAM OpenSCENARIO XML 1.3.1, StoryboardElementState and 7.5.1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, Flag, auto

from eidrive_scenario.openscenario.validation.names import ReferenceMatch


class Domain(Flag):
    """Domains of an actor that an action controls. An action that acquires a domain ends its previous holder."""

    NONE = 0
    LONGITUDINAL = auto()
    LATERAL = auto()
    LIGHTING = auto()
    ANIMATION = auto()


MOTION = Domain.LONGITUDINAL | Domain.LATERAL


class ElementState(Enum):
    """State of an element."""

    STANDBY = "standbyState"
    RUNNING = "runningState"
    COMPLETE = "completeState"


class ElementTransition(Enum):
    """Transition of an element. Conditions observe it in its step, and until their next evaluation."""

    START = "startTransition"
    END = "endTransition"
    STOP = "stopTransition"
    SKIP = "skipTransition"


@dataclass(frozen=True)
class StateChange:
    """Change of the state of one element at `time` [s]."""

    time: float
    element: str
    """Name of the element; `path` has the names of its parents too, separated by slashes."""
    path: str
    kind: str
    """Type of the element: storyboard, story, act, maneuverGroup, maneuver, event or action."""
    before: ElementState
    transition: ElementTransition | None
    after: ElementState
    why: str = ""
    """Description of the reason, such as the fulfilled trigger; empty without one."""


NOT_STARTED = ElementState.STANDBY
"""State of an element whose parents have not started."""


@dataclass
class ElementRecord:
    """Path of one element in the tree, its state, and the ticks of its transitions.

    number   position in the order of registration; that of events is the order in the file
    """

    kind: str
    path: tuple[str, ...]
    number: int
    state: ElementState | None = None
    transitions: list[tuple[int, ElementTransition]] = field(default_factory=list)


class ElementStates:
    """States of all elements, and the changes of the current tick."""

    def __init__(self) -> None:
        self.records: list[ElementRecord] = []
        self.changes: list[StateChange] = []
        self.tick = -1
        self.time = 0.0
        self.version = 0
        """Number of changes so far."""
        self._matches: ReferenceMatch[ElementRecord] | None = None

    def register(self, kind: str, path: tuple[str, ...]) -> ElementRecord:
        """Register an element and return its record."""
        record, self._matches = ElementRecord(kind, path, len(self.records)), None
        self.records.append(record)
        return record

    def begin(self, tick: int, time: float) -> None:
        """Start a tick without changes."""
        self.tick, self.time = tick, time
        self.changes = []

    def change(
        self, record: ElementRecord, transition: ElementTransition | None, after: ElementState, why: str = ""
    ) -> None:
        """Record the change of an element to another state. A skipTransition may keep the state."""
        before = record.state or NOT_STARTED
        if transition is None and record.state is after:
            return
        record.state = after
        if transition is not None:
            record.transitions.append((self.tick, transition))
        self.version += 1
        self.changes.append(
            StateChange(self.time, record.path[-1], "/".join(record.path), record.kind, before, transition, after, why)
        )

    def observe_element(self, kind: str, reference: str) -> ElementStateObserver | None:
        """Return an observer of the elements of one type that a reference matches, None without one."""
        if self._matches is None:
            self._matches = ReferenceMatch((record.path, record) for record in self.records)
        records = [record for record in self._matches.by(reference) if record.kind == kind]
        return ElementStateObserver(self, records) if records else None

    def names(self, kind: str) -> list[str]:
        """Return the names of all elements of one type."""
        return [record.path[-1] for record in self.records if record.kind == kind]


class ElementStateObserver:
    """Observer of elements. It reports each transition in one tick only: in its tick or in the next one."""

    def __init__(self, states: ElementStates, records: list[ElementRecord]) -> None:
        self._states = states
        self._records = records
        self._seen = [0] * len(records)
        self._before = [0] * len(records)
        """Number of transitions per element that were reported in earlier ticks."""
        self._evaluated_at = -1

    def in_state(self, state: ElementState) -> bool:
        """True if one of the elements is in this state."""
        return any(record.state is state for record in self._records)

    def passed(self, transition: ElementTransition) -> bool:
        """True if one of the elements had this transition in this tick or, unreported so far, in the previous tick."""
        has_passed = False
        if self._evaluated_at != self._states.tick:
            self._evaluated_at, self._before = self._states.tick, list(self._seen)
        for index, record in enumerate(self._records):
            fresh = record.transitions[self._before[index] :]
            self._seen[index] = len(record.transitions)
            has_passed = has_passed or any(kind is transition and tick >= self._states.tick - 1 for tick, kind in fresh)
        return has_passed
