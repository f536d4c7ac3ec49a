"""States and transitions of storyboard elements (ASAM OpenSCENARIO XML, StoryboardElementState)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class ElementState(Enum):
    """Where an element is in its life."""

    STANDBY = "standbyState"
    RUNNING = "runningState"
    COMPLETE = "completeState"


class ElementTransition(Enum):
    """How it came there; visible to conditions in the step in which it happens and until the next evaluation."""

    START = "startTransition"
    END = "endTransition"
    STOP = "stopTransition"
    SKIP = "skipTransition"


@dataclass(frozen=True)
class StateChange:
    """One element changed its state at `time` [s]."""

    time: float
    element: str
    """Its name; `path` gives those above it too, with slashes."""
    path: str
    kind: str
    """storyboard, story, act, maneuverGroup, maneuver, event or action."""
    before: ElementState
    transition: ElementTransition | None
    after: ElementState
    why: str = ""
    """What fired, in words, where a trigger did."""
