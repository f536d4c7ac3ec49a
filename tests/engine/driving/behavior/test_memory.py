"""Memory of the planner: association, velocity, acceleration, loss."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from planned_drive import KnownBox, PlannedDrive, behavior, detections, two_lane_road

from eidrive_scenario.base.arrays import Bools
from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.planning.behavior.memory import KnownObject, ObjectMemory
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings


def memory(**settings: float) -> ObjectMemory:
    return ObjectMemory(BehaviorSettings.model_validate(settings))


def test_velocity_is_estimated_where_the_detector_has_none() -> None:
    objects = memory()
    for tick in range(20):
        now = 0.1 * tick
        (known,) = objects.update(detections(now, KnownBox(50.0 - 8.0 * now, vx=math.nan, vy=math.nan)), now)
    assert (known.vx, known.vy) == pytest.approx((-8.0, 0.0), abs=1e-6)


def test_velocity_of_a_lost_object_is_that_since_its_last_observation() -> None:
    """It is seen at 0 m and 0.5 s later at 2 m, by a vehicle that decides every 0.1 s."""
    objects, box = memory(), KnownBox(0.0, vx=math.nan, vy=math.nan)
    objects.update(detections(0.0, box), 0.0)
    for now in (0.1, 0.2, 0.3, 0.4):
        objects.update(Detections(now), now)
    (known,) = objects.update(detections(0.5, box._replace(x=2.0)), 0.5)
    assert (known.vx, known.vy) == pytest.approx((4.0, 0.0))


@pytest.mark.parametrize("rate", [20, 10, 5])
def test_readings_that_several_decisions_get_are_one_observation(rate: int) -> None:
    """A sensor is up to four times slower than the decisions; the car drives at 8 m/s, then brakes with 2 m/s²."""
    objects = memory()
    for tick in range(100):
        now = 0.05 * tick
        read = math.floor(now * rate + 1e-6) / rate
        braking = max(read - 2.0, 0.0)
        box = KnownBox(8.0 * read - braking**2, vx=math.nan, vy=math.nan)
        (car,) = objects.update(detections(now, box), now)
        if 1.0 < now < 2.0:
            assert (car.x, car.vx) == pytest.approx((8.0 * now, 8.0), abs=1e-6)
    assert car.acceleration == pytest.approx(-2.0, rel=0.1)


def test_measured_velocity_is_taken_as_it_is() -> None:
    objects = memory()
    for now in (0.0, 0.1):
        (known,) = objects.update(detections(now, KnownBox(10.0, vx=3.0, vy=-4.0)), now)
    assert (known.vx, known.vy, known.speed) == (3.0, -4.0, 5.0)


def test_acceleration_converges_to_that_of_the_object() -> None:
    objects = memory()
    for tick in range(30):
        now = 0.1 * tick
        (known,) = objects.update(detections(now, KnownBox(20.0 * now - 1.5 * now**2, vx=20.0 - 3.0 * now)), now)
    assert known.acceleration == pytest.approx(-3.0, rel=0.02)


def test_two_objects_that_exchange_rows_keep_their_motion() -> None:
    objects = memory()
    first, second = KnownBox(0.0, 0.0, vx=math.nan, vy=math.nan), KnownBox(10.0, 4.0, vx=math.nan, vy=math.nan)
    objects.update(detections(0.0, first, second), 0.0)
    objects.update(detections(0.1, first._replace(x=1.0), second), 0.1)
    known = objects.update(detections(0.2, second, first._replace(x=2.0)), 0.2)
    assert [(round(entry.vx, 6), entry.row) for entry in known] == [(0.0, 0), (10.0, 1)]


def test_lost_object_moves_on_grows_and_is_dropped() -> None:
    objects = memory(memory=1.0)
    objects.update(detections(0.0, KnownBox(0.0, vx=10.0)), 0.0)
    nothing = Detections(0.0)
    (known,) = objects.update(nothing, 0.6)
    assert known.row is None
    assert known.x == pytest.approx(6.0)
    assert known.error == pytest.approx(0.1 + 0.5 * 0.6)
    assert objects.update(nothing, 1.0)
    assert not objects.update(nothing, 1.1)


def test_lost_object_is_kept_while_its_place_is_out_of_view() -> None:
    objects = memory(memory=1.0)
    objects.update(detections(0.0, KnownBox(0.0, vx=10.0)), 0.0)
    for tick in range(1, 60):
        (known,) = objects.update(Detections(0.1 * tick), 0.1 * tick, lambda lost: np.zeros(len(lost), dtype=bool))
    assert known.x == pytest.approx(59.0)

    def shown(lost: Sequence[KnownObject]) -> Bools:
        return np.ones(len(lost), dtype=bool)

    assert objects.update(Detections(6.0), 6.0, shown)
    assert objects.update(Detections(6.8), 6.8, shown)
    assert not objects.update(Detections(7.1), 7.1, shown)


@pytest.mark.parametrize("has_van", [True, False])
def test_pedestrian_behind_a_parked_van_is_remembered(*, has_van: bool) -> None:
    """At 1.5 s the line of sight from x = 35 m to the pedestrian at (80, -6.75) passes x = 70 m at y = -5.6 m, inside
    the van; at 3.2 s that from 52 m to (80, -4.2) passes 74 m at y = -3.7 m."""
    van = KnownBox(70.0, -4.6, kind="van", size=(8.0, 2.2))
    roads = two_lane_road()
    planner = behavior(roads)
    planner.view = (ViewSector(1.4, 0.0, 1.6, 0.0, math.pi, 100.0),)
    run = PlannedDrive(planner, roads)

    def objects(now: float) -> list[KnownBox]:
        walker = KnownBox(80.0, -9.0 + 1.5 * now, vy=1.5, kind="pedestrian", size=(0.5, 0.5))
        return [van] * has_van + [walker] * (now < 1.5)

    run.run(3.2, objects)
    run.world.close()
    assert ("pedestrian" in run.reasons[-1]) == has_van


def test_object_out_of_view_is_forgotten_after_some_time() -> None:
    objects = memory()
    objects.update(detections(0.0, KnownBox(0.0)), 0.0)
    for tick in range(1, 110):
        kept = objects.update(Detections(0.1 * tick), 0.1 * tick, lambda lost: np.zeros(len(lost), dtype=bool))
        assert bool(kept) == (tick <= 100)


def test_lost_track_of_an_object_in_view_is_dropped() -> None:
    objects = memory()
    objects.update(detections(0.0, KnownBox(0.0), KnownBox(2.0, -1.0), KnownBox(8.0)), 0.0)
    kept = objects.update(detections(0.1, KnownBox(0.1)), 0.1)
    assert [(known.row, round(known.x, 1)) for known in kept] == [(0, 0.1), (None, 8.0)]


def test_lost_object_of_low_existence_is_dropped_at_once() -> None:
    objects = memory(possible_existence=0.3, min_existence=0.5)
    assert objects.update(detections(0.0, KnownBox(0.0, score=0.4)), 0.0)
    assert not objects.update(Detections(0.1), 0.1)


def test_object_below_possible_existence_is_ignored() -> None:
    assert not memory(possible_existence=0.3).update(detections(0.0, KnownBox(0.0, score=0.29)), 0.0)


def test_old_detections_are_moved_to_the_present() -> None:
    (known,) = memory().update(detections(1.0, KnownBox(0.0, 0.0, vx=4.0, vy=2.0)), 1.5)
    assert (known.x, known.y) == pytest.approx((2.0, 1.0))
    assert known.error == pytest.approx(0.1 + 0.5 * 0.5)


def test_time_since_an_object_stands() -> None:
    objects = memory()
    for tick in range(41):
        now = 0.1 * tick
        speed = max(4.0 - 4.0 * now, 0.0)
        (known,) = objects.update(detections(now, KnownBox(4.0 * now - 2.0 * min(now, 1.0) ** 2, vx=speed)), now)
    assert known.still_since == pytest.approx(0.9)
    assert known.moving_since is None


def test_class_changes_only_if_the_new_one_was_observed_most() -> None:
    """The shares tend to the observations with a time constant of 1 s: they are equal after ln 2 s."""
    objects = memory()
    kinds = []
    for tick in range(40):
        now = 0.1 * tick
        flickers = tick % 3 == 0 and 0 < tick < 20
        kind = "bicycle" if flickers or tick >= 20 else "car"
        (known,) = objects.update(detections(now, KnownBox(50.0, kind=kind)), now)
        kinds.append(known.kind)
    assert set(kinds[:20]) == {"car"}
    steady = memory()
    for tick in range(20):
        now = 0.1 * tick
        (known,) = steady.update(detections(now, KnownBox(50.0, kind="car" if tick == 0 else "bicycle")), now)
        assert known.kind == ("car" if now < math.log(2.0) else "bicycle")
