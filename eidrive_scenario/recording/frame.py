"""Frame: the state and the events of one tick."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import quoted
from eidrive_scenario.storyboard.state.element_states import StateChange
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView


class ExecutedCommand(msgspec.Struct, frozen=True):
    """Executed CustomCommandAction: type, content, and the time of its execution [s].

    The content of a command that declares criteria contains all their settings, with their names in the run.
    """

    type: str
    content: str
    time: float


class Frame(msgspec.Struct, frozen=True):
    """Ground truth, steps of the stations, storyboard transitions and message outcomes of one tick.

    steps        step of each station, by name
    links        message outcomes that became known in the last tick, in the order of the channel. Array-based channels
                 provide a LinkEvents, which creates events on first access
    signals      state of each traffic signal by id, without signals whose state was never set
    appearances  lights, animations and visibility of the actors that differ from the default
    environment  time of day, weather and road condition; None until the scenario sets an environment
    monitors     values of the scenario's monitors by name
    routes       points (M, 3) of the routes that the scenario requested in this tick, by actor [m]
    commands     custom commands that were executed after the former frame; in the first frame those of Init, the
                 criteria of the StopTrigger, and the criteria that options of the run add
    trailers     trailer of each towing vehicle, by name; both are present
    """

    view: WorldView
    steps: Mapping[str, AgentStep] = msgspec.field(default_factory=dict)
    changes: tuple[StateChange, ...] = ()
    links: Sequence[LinkEvent] = ()
    signals: Mapping[str, str] = msgspec.field(default_factory=dict)
    appearances: Mapping[str, Appearance] = msgspec.field(default_factory=dict)
    environment: Environment | None = None
    monitors: Mapping[str, bool] = msgspec.field(default_factory=dict)
    routes: Mapping[str, Array] = msgspec.field(default_factory=dict)
    commands: tuple[ExecutedCommand, ...] = ()
    trailers: Mapping[str, str] = msgspec.field(default_factory=dict)

    def attached(self, name: str) -> frozenset[str]:
        """Return the other bodies of the road train of an actor: its trailers, and the vehicles that tow it."""
        if not self.trailers:
            return frozenset()
        road_train, added = {name}, {name}
        while added:
            added = {other for pair in self.trailers.items() if added & {*pair} for other in pair} - road_train
            road_train |= added
        return frozenset(road_train - {name})


MAX_TIME = 1e9
"""Maximum time of a frame [s]. In nanoseconds it fits into the 64 bits of MCAP."""
MAX_TICK = 2**32 - 1
"""Maximum tick of a frame: the sequence number of its message has 32 bits."""
MAX_NUMBER = 1e12
"""Maximum absolute value of the numbers of a view. Scenarios have positions and speeds of at most 1e9."""
_COLUMNS = {
    "position": 3,
    "yaw": 0,
    "pitch": 0,
    "roll": 0,
    "velocity": 3,
    "acceleration": 3,
    "yaw_rate": 0,
    "speed": 0,
    "size": 3,
    "offset": 3,
}
"""Number of columns of each array of a view; 0 for one number per actor."""


def check_frame(frame: Frame) -> None:
    """Raise ValueError if time or tick are out of range, an array of the view does not have one row per actor, or a
    station names a message that it did not receive."""
    view = frame.view
    if not 0.0 <= view.time <= MAX_TIME:
        raise ValueError(f"time is out of range (got {view.time}; expected 0 to {MAX_TIME:g})")
    if not 0 <= view.tick <= MAX_TICK:
        raise ValueError(f"tick is out of range (got {quoted(view.tick)}; expected 0 to {MAX_TICK})")
    count = len(view.names)
    if len(view.categories) != count or len(set(view.names)) != count:
        raise ValueError("names and categories of the actors are inconsistent")
    for name, columns in _COLUMNS.items():
        array = getattr(view, name)
        if array.shape != ((count, columns) if columns else (count,)):
            raise ValueError(f"{name} has an invalid shape (got {array.shape} for {count} actors)")
        if not (np.abs(array) <= MAX_NUMBER).all():
            raise ValueError(f"{name} is out of range (expected -{MAX_NUMBER:g} to {MAX_NUMBER:g})")
    for name, step in frame.steps.items():
        if not all(0 <= row < len(step.inbox) for row in step.expired):
            raise ValueError(f"expired messages of {name} were not received (got rows {list(step.expired)[:5]})")


class MessagesInFlight:
    """Messages that have not arrived; they are lost if their receiver leaves, though their outcome was `delivered`."""

    def __init__(self) -> None:
        self._events: list[LinkEvent] = []
        self._time = -math.inf

    def observe(self, frame: Frame) -> list[LinkEvent]:
        """Add a frame; return the events of the messages to stations that have left since the last one."""
        before = self._time
        # As in Links.deliver: a message is delivered after its arrival and after the instant of its sending
        undelivered = [
            event
            for event in (*self._events, *frame.links)
            if event.arrives is not None
            and (event.arrives > before + TIME_TOLERANCE or event.sent > before - TIME_TOLERANCE)
        ]
        self._time = frame.view.time
        self._events = [event for event in undelivered if event.receiver in frame.view]
        return [event for event in undelivered if event.receiver not in frame.view]
