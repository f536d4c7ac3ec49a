"""Frames that contain only moving boxes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.api.common import Contact, RoadNetwork, WorldView
from eidrive_scenario.api.criteria import Frame
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.v2x.messages.message import Message, StationState


class Car(NamedTuple):
    """An actor for a hand-made frame: box center [m], yaw [rad], speed along the heading [m/s]; box 4 x 2 x 1.5 m."""

    x: float
    y: float = 0.0
    yaw: float = 0.0
    speed: float = 0.0


MakeFrame = Callable[..., Frame]
Point = tuple[float, float]


@pytest.fixture
def car() -> type[Car]:
    return Car


@pytest.fixture
def roads() -> RoadNetwork:
    """Return the roads of scenario 1. Road 1 is along x from -80 m to the junction at 20 m.

    Lanes of road 1: driving at y = 0 (along x) and 3.5 m (against x), 3.5 m wide; parking until -5.25 m, shoulder until
    -6.38 m, sidewalk until -8.38 m.
    """
    return RoadNetwork.load(Path(__file__).parents[2] / "xosc" / "roads" / "coop_1.xodr")


@pytest.fixture
def frame() -> MakeFrame:
    """Return a function `frame(time, {"Ego": Car(…)}, contacts=[…], sizes={"Ego": (length, width, height)})`.

    The reference point is the box center on the ground.
    """

    def make(
        time: float,
        cars: Mapping[str, Car],
        contacts: Sequence[Contact] = (),
        sizes: Mapping[str, tuple[float, float, float]] | None = None,
        signals: Mapping[str, str] | None = None,
        categories: Mapping[str, str] | None = None,
    ) -> Frame:
        table = np.array(list(cars.values()), dtype=float).reshape(-1, 4)
        zeros, ones = np.zeros(len(table)), np.ones((len(table), 1))
        x, y, yaw, speed = table.T
        view = WorldView(
            time=time,
            tick=round(time / 0.05),
            names=tuple(cars),
            categories=tuple((categories or {}).get(name, "car") for name in cars),
            position=np.stack([x, y, zeros], axis=1),
            yaw=yaw,
            pitch=zeros,
            roll=zeros,
            velocity=np.stack([speed * np.cos(yaw), speed * np.sin(yaw), zeros], axis=1),
            acceleration=np.zeros((len(table), 3)),
            yaw_rate=zeros,
            speed=speed,
            size=np.array([(sizes or {}).get(name, (4.0, 2.0, 1.5)) for name in cars]).reshape(-1, 3),
            offset=ones * (0.0, 0.0, 0.75),
            contacts=tuple(contacts),
        )
        return Frame(view, signals=signals or {})

    return make


def objects(time: float, points: Sequence[Point], score: float = 1.0) -> Detections:
    """Return objects with the centers x, y [m], the size of a `Car` and a score."""
    count = len(points)
    boxes = np.array([(x, y, 0.75, 4.0, 2.0, 1.5, 0.0) for x, y in points]).reshape(count, 7)
    nothing = np.full((count, 2), np.nan)
    unknown = np.full((count, 2, 2), np.nan)
    return Detections(time, boxes, np.full(count, score), ("car",) * count, nothing, unknown)


@pytest.fixture
def perceived() -> MakeFrame:
    """Return a function `perceived(frame, "Ego", own=[(x, y)], fused=[(x, y)], sends=True)` that adds a step."""

    def make(
        frame: Frame,
        station: str,
        own: Sequence[Point] = (),
        fused: Sequence[Point] = (),
        score: float = 1.0,
        plan: Plan | None = None,
        sends: bool = False,
    ) -> Frame:
        time, known = frame.view.time, objects(frame.view.time, own, score)
        state = StationState(time, 0.0, 0.0, 0.0, 0.0, 0.0)
        outbox = (Message(station, frame.view.tick, time, state, known, 100),) if sends else ()
        step = AgentStep(known, (), objects(time, fused, score), plan, None, outbox)
        return replace(frame, steps={**frame.steps, station: step})

    return make
