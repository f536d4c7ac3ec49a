"""Synthetic frames with the geometry of scenario 1 of the paper, in which a truck occludes a car."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import Control
from eidrive_scenario.world.view import WorldView

DT = 0.05
NAMES = ("Ego", "Incoming", "Truck", "RSU")
SIZES = np.array([[4.892, 1.837, 1.49], [4.892, 1.837, 1.49], [8.468, 2.891, 3.827], [0.4, 0.4, 3.0]])


def view_at(tick: int, ego_x: float, ego_speed: float, incoming_y: float) -> WorldView:
    """Return a view whose box centers equal the reference points, for simple numbers."""
    count = len(NAMES)
    position = np.array([[ego_x, 0.0, 0.75], [29.5, incoming_y, 0.75], [25.4, 5.6, 1.9], [42.2, -6.0, 1.5]])
    velocity = np.zeros((count, 3))
    velocity[0, 0], velocity[1, 1] = ego_speed, -14.0
    return WorldView(
        time=tick * DT,
        tick=tick,
        names=NAMES,
        categories=("car", "car", "truck", "misc"),
        position=position,
        yaw=np.array([0.0, -np.pi / 2, -np.pi / 2, np.deg2rad(150.0)]),
        pitch=np.zeros(count),
        roll=np.zeros(count),
        velocity=velocity,
        acceleration=np.zeros((count, 3)),
        yaw_rate=np.zeros(count),
        speed=np.array([ego_speed, 14.0, 0.0, 0.0]),
        size=SIZES,
        offset=np.zeros((count, 3)),
    )


def detections_of(view: WorldView, time: float, *names: str) -> Detections:
    """Return the true boxes of these actors as detections of `time`."""
    rows = [view.row(name) for name in names]
    return Detections(
        time=time,
        boxes=view.boxes[rows].reshape(-1, 7),
        scores=np.ones(len(rows)),
        classes=tuple(view.categories[row] for row in rows),
        velocity=view.velocity[rows, :2].reshape(-1, 2),
        covariance=np.full((len(rows), 2, 2), np.nan),
    )


def play(delay: int | None, lost: frozenset[int] = frozenset()) -> list[Frame]:
    """Return a run in which the RSU detects the car from 20 m, with a message delay in ticks (None: no messages).

    The ego brakes at 5 m/s² from the first message that contains the car. Messages of the ticks `lost` are lost.
    """
    frames: list[Frame] = []
    messages: dict[int, Message] = {}
    ego_x, speed, known = 0.0, 8.0, False
    for tick in range(100):
        view = view_at(tick, ego_x, speed, 39.5 - 14.0 * tick * DT)
        seen = view.position[1, 1] < 20.0
        by_rsu = detections_of(view, view.time, *(("Truck", "Incoming") if seen else ("Truck",)))
        by_ego = detections_of(view, view.time, "Truck")
        state = StationState(view.time, 42.2, -6.0, 0.0, 2.6, 0.0)
        messages[tick] = Message("RSU", tick, view.time, state, by_rsu, 200)
        inbox: tuple[ReceivedMessage, ...] = ()
        links: tuple[LinkEvent, ...] = ()
        if delay is not None:
            sent = tick - delay
            if sent in messages and sent not in lost:
                inbox = (ReceivedMessage(messages[sent], view.time),)
                known = known or len(messages[sent].detections) == 2
            before = tick - 1
            if before in messages:
                gone = before in lost
                links = (
                    LinkEvent(
                        "RSU",
                        "Ego",
                        before,
                        before * DT,
                        "lost" if gone else "delivered",
                        None if gone else (before + delay) * DT,
                        "loss" if gone else "",
                        200,
                    ),
                )
        plan = Plan(
            np.empty((0, 2)), np.empty(0), "conflict area" if known else "route", braking=5.0 if known else None
        )
        steps = {
            "Ego": AgentStep(by_ego, inbox, by_ego, plan, Control(brake=0.5 if known else 0.0), ()),
            "RSU": AgentStep(by_rsu, (), by_rsu, None, None, (messages[tick],)),
        }
        frames.append(Frame(view, steps, (), links))
        ego_x += speed * DT
        speed = max(0.0, speed - 5.0 * DT) if known else speed
    return frames


@pytest.fixture(scope="session")
def street() -> Callable[..., list[Frame]]:
    return play
