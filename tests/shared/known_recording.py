"""Recording by hand, on the roads of scenario 1, for which the values of all criteria are known in closed form.

41 frames of 0.1 s. Boxes are 4 m by 2 m; road 1 is along x, with its lanes at y = 0 and, against x, at y = 3.5 m.

- Ego drives 8 m/s from x = -70 to -38 m, behind Lead, which stands at -22 m: the last gap is 12 m.
- Crosser drives 5 m/s along y from -20 m, at x = -62 m. Ego leaves x = -61 m after 11/8 s, and Crosser reaches y = -1 m
  after 3.4 s.
- Braker brakes from 10 m/s at 2 m/s², in the lane against x. Wrong drives 5 m/s in it in the wrong direction.
- Walker stands on the sidewalk at x = -54 m, Last at the end of the road.
- Changer drives 8 m/s along x and crosses the edge of its lane after 2 s.
- Runner drives 6 m/s over the stop line at x = 15.6 m, its front after 1.43 s, its rear after 2.1 s, and touches Wreck
  after 4 s. The light 10 is red for 1.8 s, then green.
- Ego knows Lead by its own objects from 2 s on. The fused objects are Lead, 0.5 m beside it, and Walker, from 1 s on.
- Ego brakes once, from 1.5 to 1.9 s, for a fused object without a body.
- Lead sends to Ego at 0, 1, 2 and 3 s with a delay of 0.2 s; the third message is lost.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.api.common import Contact, WorldView
from eidrive_scenario.api.criteria import Frame, LinkStatistics
from eidrive_scenario.api.v2x import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.v2x.messages.message import StationState

STEP = 0.1
ACTORS = ("Ego", "Lead", "Crosser", "Braker", "Wrong", "Walker", "Last", "Changer", "Runner", "Wreck")
LINKS = {("Lead", "Ego"): LinkStatistics(4, 3, 1, 0, 400, 0.2, 0.2, 0.2, 0.1, 0.2, channel_busy_ratio=0.3)}
"""Statistics of the link at the end of the run."""
SENT = ((0.0, 0.2), (1.0, 1.2), (2.0, None), (3.0, 3.2))
"""Times of sending and of arrival of the messages [s]; None for the lost one."""


class _Pose(NamedTuple):
    x: float
    y: float
    yaw: float
    speed: float


def frames() -> list[Frame]:
    """Return the frames of the recording."""
    return [_frame(tick) for tick in range(41)]


def _poses(time: float) -> tuple[_Pose, ...]:
    """Return the pose of each of `ACTORS`."""
    return (
        _Pose(-70.0 + 8.0 * time, 0.0, 0.0, 8.0),
        _Pose(-22.0, 0.0, 0.0, 0.0),
        _Pose(-62.0, -20.0 + 5.0 * time, math.pi / 2, 5.0),
        _Pose(15.0 - 10.0 * time + time * time, 3.5, math.pi, 10.0 - 2.0 * time),
        _Pose(-75.0 + 5.0 * time, 3.5, 0.0, 5.0),
        _Pose(-54.0, -7.2, 0.0, 0.0),
        _Pose(131.0, 0.0, 0.0, 0.0),
        _Pose(60.0 + 8.0 * time, 3.5 * time / 4.0, 0.0, 8.0),
        _Pose(5.0 + 6.0 * time, 0.0, 0.0, 6.0),
        _Pose(33.0, 0.0, 0.0, 0.0),
    )


def _frame(tick: int) -> Frame:
    time = tick * STEP
    x, y, yaw, speed = np.array(_poses(time)).T
    zeros = np.zeros(len(x))
    acceleration = np.zeros((len(x), 3))
    acceleration[ACTORS.index("Braker"), 0] = 2.0  # along x, against its heading
    view = WorldView(
        time=time,
        tick=tick,
        names=ACTORS,
        categories=("car",) * len(x),
        position=np.stack([x, y, zeros], axis=1),
        yaw=yaw,
        pitch=zeros,
        roll=zeros,
        velocity=np.stack([speed * np.cos(yaw), speed * np.sin(yaw), zeros], axis=1),
        acceleration=acceleration,
        yaw_rate=zeros,
        speed=speed,
        size=np.tile((4.0, 2.0, 1.5), (len(x), 1)),
        offset=np.tile((0.0, 0.0, 0.75), (len(x), 1)),
        contacts=(Contact("Runner", "Wreck", (31.0, 0.0, 0.5), 6.0),) if tick == 40 else (),
    )
    steps = {"Ego": _ego_step(tick), "Lead": _step(time)}
    frame = Frame(view, signals={"10": "red" if tick < 18 else "green"}, monitors={"Seen": tick >= 10})
    return replace(frame, steps=steps, links=_events(tick))


def _ego_step(tick: int) -> AgentStep:
    time = tick * STEP
    own = [(-22.0, 0.0)] if tick >= 20 else []
    fused = [(-22.0, 0.5), (-54.0, -7.2), (0.0, 50.0)] if tick >= 10 else []
    braking = 5.0 if 15 <= tick < 20 else None
    plan = Plan(np.zeros((1, 2)), np.zeros(1), "", 0.0, braking, (2,) if braking else ())
    state = StationState(time, 0.0, 0.0, 0.0, 0.0, 0.0)
    inbox = tuple(
        ReceivedMessage(Message("Lead", number, sent, state, Detections(sent), 100), arrival)
        for number, (sent, arrival) in enumerate(SENT)
        if arrival is not None and round(arrival / STEP) == tick
    )
    return replace(_step(time), detections=_objects(time, own), fused=_objects(time, fused), plan=plan, inbox=inbox)


def _step(time: float) -> AgentStep:
    return AgentStep(_objects(time, []), (), _objects(time, []), None, None, ())


def _objects(time: float, points: list[tuple[float, float]]) -> Detections:
    count = len(points)
    boxes: Any = np.array([(x, y, 0.75, 4.0, 2.0, 1.5, 0.0) for x, y in points]).reshape(count, 7)
    unknown = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
    return Detections(time, boxes, np.ones(count), ("car",) * count, *unknown)


def _events(tick: int) -> tuple[LinkEvent, ...]:
    """Return the outcomes of the messages that are sent in this tick."""
    return tuple(
        LinkEvent(
            "Lead", "Ego", number, sent, "lost" if at is None else "delivered", at, "error" if at is None else "", 100
        )
        for number, (sent, at) in enumerate(SENT)
        if round(sent / STEP) == tick
    )
