"""State of the stations at the violation of a criterion, as text: decision, perception, age of received messages."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import counted
from eidrive_scenario.evaluation.known_actors import GATE, known_actors, nearest_pairs
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.run_log import describe_decision

LOOKBACK = 2.0
"""Time before a violation in which received messages and measurements are searched [s]."""
_SHOWN = 3
"""Maximum number of stations, of perceived actors and of senders that are listed."""


def describe_violation(frames: Sequence[Frame], actors: Sequence[str]) -> Iterator[str]:
    """Yield lines about the stations among the actors of a criterion; about all planners if it names no actors.

    For each station: its decision, what it perceives of the other actors, and the ages of its newest messages.

    frames  of the last LOOKBACK [s] at least; the last one is that of the violation
    """
    frame = frames[-1]
    first = bisect_left(frames, frame.view.time - LOOKBACK - TIME_TOLERANCE, key=_time)
    frames = frames[first:]
    yield from (f"{name} is absent" for name in actors if name not in frame.view.rows)
    stations = [name for name in actors if name in frame.steps]
    if not actors:
        stations = [name for name, step in frame.steps.items() if step.plan is not None]
    for station in stations[:_SHOWN]:
        step = frame.steps[station]
        if step.plan is not None:
            yield f"decision of {station}: {describe_decision(step.plan)}: {step.plan.reason}"
        excluded = {station, *frame.attached(station)}
        for actor in [name for name in actors if name in frame.view.rows and name not in excluded][:_SHOWN]:
            yield _perceived(frames, station, actor)
        yield _messages(frames, station)
    if len(stations) > _SHOWN:
        yield f"and {counted(len(stations) - _SHOWN, 'more station')}"


def _time(frame: Frame) -> float:
    return frame.view.time


def _perceived(frames: Sequence[Frame], station: str, actor: str) -> str:
    """Describe the object that the planner gets of an actor, and its newest measurement."""
    view = frames[-1].view
    measured = _newest_measurement(frames, station, actor)
    age = None if measured is None else view.time - measured[0]
    # An object that is not predicted is where the actor was when it was measured
    reach = GATE + abs(float(view.speed[view.rows[actor]])) * (age or 0.0)
    distance = known_actors(frames[-1], station, "fused", within=reach).get(actor)
    text = f"{station} perceived nothing of {actor}"
    if distance is not None:
        text = f"{station} perceived {actor} {distance:.2f} m from the truth"
    if measured is None:
        return text if distance is None else f"{text}, age above {view.time - _time(frames[0]):.2f} s"
    return f"{text}, age {'of its last measurement ' * (distance is None)}{age:.2f} s ({measured[1]})"


def _newest_measurement(frames: Sequence[Frame], station: str, actor: str) -> tuple[float, str] | None:
    """Return time [s] and source of the newest measurement of an actor that a station used; None without one.

    An object is a measurement of the actor that is nearest to it at the time of the measurement.
    """
    newest: tuple[float, str] | None = None
    for frame in reversed(frames):
        step = frame.steps.get(station)
        for detections, source in () if step is None else _measurements(step):
            if newest is not None and detections.time <= newest[0]:
                continue
            index = bisect_left(frames, detections.time - TIME_TOLERANCE, key=_time)
            if index < len(frames) and (index or abs(detections.time - _time(frames[0])) <= TIME_TOLERANCE):
                view = frames[index].view
                pairs = nearest_pairs(detections.boxes, view.boxes, GATE)
                if any(view.names[row] == actor for _, row, _ in pairs):
                    newest = detections.time, source
    return newest


def _measurements(step: AgentStep) -> Iterator[tuple[Detections, str]]:
    """Yield the detections that a station got in one tick: its own ones, and those of messages that it used."""
    yield step.detections, "own detection"
    for row, received in enumerate(step.inbox):
        if row not in step.expired:
            yield received.message.detections, f"message of {received.message.sender}"


def _messages(frames: Sequence[Frame], station: str) -> str:
    """Describe the ages of the newest message from each sender: the time since its generation."""
    now = _time(frames[-1])
    generated: dict[str, float] = {}
    for frame in frames:
        step = frame.steps.get(station)
        for received in () if step is None else step.inbox:
            message = received.message
            generated[message.sender] = max(message.generated, generated.get(message.sender, message.generated))
    if not generated:
        since = "so far" if frames[0].view.tick == 0 else f"in the last {now - _time(frames[0]):.2f} s"
        return f"{station} received no message {since}"
    ages = sorted((now - time, sender) for sender, time in generated.items())
    listed = ", ".join(f"{sender} {age:.2f} s" for age, sender in ages[:_SHOWN])
    more = f" and {len(ages) - _SHOWN} more up to {ages[-1][0]:.2f} s" if len(ages) > _SHOWN else ""
    return f"age of the newest messages at {station}: {listed}{more}"
