"""States and transitions of storyboard elements (ASAM OpenSCENARIO XML, StoryboardElementState)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


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
