"""False tracks and brakings without a cause, against manual counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.evaluation.known_actors import FalseTracks
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.world.view import WorldView

Point = tuple[float, float]
MIN_EXISTENCE = {"Ego": 0.5}
STEP = 0.1


def view(time: float) -> WorldView:
    """Return a view with the ego at the origin and a truck of 8 m x 2.5 m across the road at x = 20."""
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


def frame(tick: int, points: Sequence[Point], existence: float = 0.9, brakes_for: Sequence[int] | None = None) -> Frame:
    """Return a frame with fused objects at these points; the ego brakes for these rows, or not at all for None."""
    time, count = tick * STEP, len(points)
    boxes = np.array([(x, y, 0.8, 4.6, 1.8, 1.5, 0.0) for x, y in points]).reshape(count, 7)
    fused = Detections(
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
    return Frame(view(time), {"Ego": AgentStep(fused, (), fused, plan, None, ())})


def count(*frames: Frame) -> dict[str, float]:
    """Return the metrics without the name of the station."""
    counter = FalseTracks()
    for one in frames:
        counter.observe(one, MIN_EXISTENCE)
    return {name.removeprefix("false_tracks.Ego."): value for name, value in counter.metrics().items()}


def test_true_objects_are_not_counted_as_false_tracks() -> None:
    """A center up to 2 m outside the body is true. The body extends from x = 18.75 to 21.25 and from y = -4 to 4."""
    points = [(20.0, 0.0), (20.0, 5.9), (16.8, -3.0)]
    found = count(*(frame(tick, points) for tick in range(7)))
    assert found == {"per_minute": 0.0, "brakings": 0, "brakings_without_cause": 0}


@pytest.mark.parametrize("point", [(20.0, 6.1), (16.7, 0.0), (40.0, 0.0), (0.5, 0.0)])
def test_false_object_of_several_ticks_is_one_false_track(point: Point) -> None:
    """The ego body, at the last point, is not a true object. One track in 0.6 s is 100 per minute."""
    found = count(*(frame(tick, [point] if 2 <= tick < 5 else []) for tick in range(7)))
    assert found["per_minute"] == pytest.approx(100.0)


def test_moving_false_object_is_one_track_and_reappearing_object_two() -> None:
    moving = count(*(frame(tick, [(40.0 + 2.0 * tick, 0.0)]) for tick in range(7)))
    again = count(*(frame(tick, [(40.0, 0.0)] if tick % 4 == 0 else []) for tick in range(7)))
    two = count(*(frame(tick, [(40.0, 0.0), (60.0, 0.0)]) for tick in range(7)))
    assert [round(found["per_minute"]) for found in (moving, again, two)] == [100, 200, 200]


def test_object_below_min_existence_is_not_a_false_track() -> None:
    assert count(*(frame(tick, [(40.0, 0.0)], existence=0.4) for tick in range(7)))["per_minute"] == 0.0


def test_braking_for_false_objects_only_has_no_cause() -> None:
    points = [(40.0, 0.0), (20.0, 0.0)]

    def braking(*rows: Sequence[int] | None) -> tuple[float, float]:
        found = count(*(frame(tick, points, brakes_for=row) for tick, row in enumerate(rows)))
        return found["brakings"], found["brakings_without_cause"]

    assert braking(None, (0,), (0,), None) == (1, 1)
    assert braking(None, (1,), (1,), None) == (1, 0)
    assert braking(None, (0, 1), None) == (1, 0)
    assert braking((0,), (1,), None, (0,)) == (2, 2), "the first tick of a braking decides"
    assert braking(None, (), ()) == (1, 0), "a braking without stated objects has a cause"


def test_absent_station_and_station_without_planner_are_not_counted() -> None:
    counter = FalseTracks()
    counter.observe(replace(frame(0, []), steps={}), MIN_EXISTENCE)
    step = frame(1, [(40.0, 0.0)]).steps["Ego"]
    counter.observe(replace(frame(1, []), steps={"Ego": replace(step, plan=None)}), MIN_EXISTENCE)
    assert counter.metrics() == {}


def test_run_with_oracle_detector_has_no_false_tracks() -> None:
    result = run_file(resolve_scenario("coop/scenario_1"), seed=1, settings=RunSettings(channel="ideal"))
    found = {name: value for name, value in result.metrics.items() if name.startswith("false_tracks.")}
    assert found == {
        "false_tracks.Ego.per_minute": 0.0,
        "false_tracks.Ego.brakings": 1,
        "false_tracks.Ego.brakings_without_cause": 0,
    }
