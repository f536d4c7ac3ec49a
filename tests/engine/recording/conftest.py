"""Fixtures of recording tests: random frames that use every field."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import Control
from eidrive_scenario.world.view import Contact, WorldView


@pytest.fixture
def make_frame() -> Callable[..., Frame]:
    """Return a factory of full frames with random numbers from `seed`; NaN for an unknown velocity."""

    def make(tick: int = 0, seed: int = 0, dt: float = 0.05) -> Frame:
        random = np.random.default_rng([seed, tick])
        time = tick * dt

        def numbers(*shape: int) -> NDArray[np.float64]:
            return random.normal(scale=100.0, size=shape)

        view = WorldView(
            time=time,
            tick=tick,
            names=("Ego", "Incoming", "Löschzug"),
            categories=("car", "car", "truck"),
            position=numbers(3, 3),
            yaw=numbers(3),
            pitch=numbers(3),
            roll=numbers(3),
            velocity=numbers(3, 3),
            acceleration=numbers(3, 3),
            yaw_rate=numbers(3),
            speed=numbers(3),
            size=numbers(3, 3),
            offset=numbers(3, 3),
            contacts=(Contact("Ego", "Incoming", (1.0, 2.0, 0.1 + 0.2), 11.5),) if tick % 2 else (),
        )
        seen = Detections(
            time=time,
            boxes=numbers(2, 7),
            scores=np.array([0.5, 1.0]),
            classes=("car", "truck"),
            velocity=np.array([[np.nan, np.nan], [1.0, -0.0]]),
            covariance=np.full((2, 2, 2), np.nan),
        )
        message = Message("Rsu", tick, time, StationState(time, 1.0, 2.0, 3.0, 0.1, 0.0), seen, 300)
        ego = AgentStep(
            detections=Detections(time),
            inbox=(ReceivedMessage(message, time),),
            fused=seen,
            plan=Plan(numbers(4, 2), numbers(4), "stops for Incoming", braking=5.0),
            control=Control(brake=1.0, steering=0.01),
            outbox=(),
        )
        unit = AgentStep(seen, (), seen, None, None, (message,))
        change = StateChange(
            time,
            "Stop",
            "Story/Act/Stop",
            "event",
            ElementState.STANDBY,
            ElementTransition.START,
            ElementState.RUNNING,
            "t > 3 s",
        )
        links = (
            LinkEvent("Rsu", "Ego", tick, time, "delivered", time + 0.3, "", 300),
            LinkEvent("Rsu", "Bus", tick, time, "lost", None, "error rate", 300),
        )
        return Frame(view, {"Ego": ego, "Rsu": unit}, (change,), links)

    return make
