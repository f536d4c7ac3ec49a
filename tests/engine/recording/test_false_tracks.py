"""False tracks and brakings without a cause, counted by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.evaluation.false_tracks import FalseTracks
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.world.view import WorldView

Place = tuple[float, float]
LEAST = {"Ego": 0.5}
STEP = 0.1


def view(time: float) -> WorldView:
    """The ego at the origin, and a truck of 8 m x 2.5 m across the road at x = 20."""
    zeros = np.zeros((2, 3))
    return WorldView(
        time=time,
        tick=round(time / STEP),
        names=("Ego", "Truck"),
        categories=("car", "truck"),
        position=np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]]),
        yaw=np.array([0.0, np.pi / 2]),
        pitch=np.zeros(2),
        roll=np.zeros(2),
        velocity=zeros,
        acceleration=zeros,
        yaw_rate=np.zeros(2),
        speed=np.zeros(2),
        size=np.array([[4.6, 1.8, 1.5], [8.0, 2.5, 3.5]]),
        offset=zeros,
    )


def frame(tick: int, places: Sequence[Place], existence: float = 0.9, brakes_for: Sequence[int] | None = None) -> Frame:
    """Objects known at these places; the ego brakes for the objects in these rows, None: it does not brake."""
    time, count = tick * STEP, len(places)
    boxes = np.array([(x, y, 0.8, 4.6, 1.8, 1.5, 0.0) for x, y in places]).reshape(count, 7)
    known = Detections(
        time,
        boxes,
        np.ones(count),
        ("car",) * count,
        np.zeros((count, 2)),
        np.tile(np.eye(2), (count, 1, 1)),
        existence=np.full(count, existence),
    )
    braking = None if brakes_for is None else 5.0
    plan = Plan(np.zeros((1, 2)), np.zeros(1), "", braking=braking, objects=tuple(brakes_for or ()))
    return Frame(view(time), {"Ego": AgentStep(known, (), known, plan, None, ())})


def counted(*frames: Frame) -> dict[str, float]:
    """Metrics without the name of the station."""
    fold = FalseTracks()
    for one in frames:
        fold.observe(one, LEAST)
    return {name.removeprefix("false_tracks.Ego."): value for name, value in fold.metrics().items()}


def test_true_objects_are_no_false_tracks() -> None:
    """A center up to 2 m beside the body is true: the body reaches from x = 18.75 to 21.25 and y = -4 to 4."""
    places = [(20.0, 0.0), (20.0, 5.9), (16.8, -3.0)]
    found = counted(*(frame(tick, places) for tick in range(7)))
    assert found == {"per_minute": 0.0, "brakings": 0, "brakings_without_cause": 0}


@pytest.mark.parametrize("place", [(20.0, 6.1), (16.7, 0.0), (40.0, 0.0), (0.5, 0.0)])
def test_one_false_object_for_some_ticks_is_one_false_track(place: Place) -> None:
    """The own body is no true object: the last place is there. In 0.6 s, one track is 100 per minute."""
    found = counted(*(frame(tick, [place] if 2 <= tick < 5 else []) for tick in range(7)))
    assert found["per_minute"] == pytest.approx(100.0)


def test_false_track_that_moves_is_one_and_reappearing_ones_are_two() -> None:
    moving = counted(*(frame(tick, [(40.0 + 2.0 * tick, 0.0)]) for tick in range(7)))
    again = counted(*(frame(tick, [(40.0, 0.0)] if tick % 4 == 0 else []) for tick in range(7)))
    two = counted(*(frame(tick, [(40.0, 0.0), (60.0, 0.0)]) for tick in range(7)))
    assert [round(found["per_minute"]) for found in (moving, again, two)] == [100, 200, 200]


def test_object_that_hardly_exists_is_no_false_track() -> None:
    assert counted(*(frame(tick, [(40.0, 0.0)], existence=0.4) for tick in range(7)))["per_minute"] == 0.0


def test_braking_without_cause_is_one_whose_objects_are_all_false() -> None:
    places = [(40.0, 0.0), (20.0, 0.0)]

    def braking(*rows: Sequence[int] | None) -> tuple[float, float]:
        found = counted(*(frame(tick, places, brakes_for=row) for tick, row in enumerate(rows)))
        return found["brakings"], found["brakings_without_cause"]

    assert braking(None, (0,), (0,), None) == (1, 1)
    assert braking(None, (1,), (1,), None) == (1, 0)
    assert braking(None, (0, 1), None) == (1, 0)
    assert braking((0,), (1,), None, (0,)) == (2, 2), "the first tick of a braking decides"
    assert braking(None, (), ()) == (1, 0), "a planner that states no objects has its reasons"


def test_station_without_planner_or_not_there_is_not_counted() -> None:
    fold = FalseTracks()
    fold.observe(replace(frame(0, []), steps={}), LEAST)
    step = frame(1, [(40.0, 0.0)]).steps["Ego"]
    fold.observe(replace(frame(1, []), steps={"Ego": replace(step, plan=None)}), LEAST)
    assert fold.metrics() == {}


def test_run_with_the_oracle_has_metrics_without_false_tracks() -> None:
    result = run_file(resolve_scenario("coop/scenario_1"), seed=1, settings=RunSettings(channel="ideal"))
    found = {name: value for name, value in result.metrics.items() if name.startswith("false_tracks.")}
    assert found == {
        "false_tracks.Ego.per_minute": 0.0,
        "false_tracks.Ego.brakings": 1,
        "false_tracks.Ego.brakings_without_cause": 0,
    }
