"""Generation rules of CAM and CPM, with expectations derived by hand from the standards."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.v2x.messages.generation import (
    CamGenerationRules,
    CpmContents,
    CpmGenerationRules,
    ObjectIdAssigner,
    cam_size,
    cpm_size,
    objects_that_fit,
    quality,
)
from eidrive_scenario.v2x.messages.message import Message, StationClock, StationState, shift_timestamps
from eidrive_scenario.v2x.messages.point_cloud import compress

DT = 0.05


def state(time: float, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, speed: float = 0.0) -> StationState:
    return StationState(time, x, y, 0.0, yaw, speed)


def intervals(times: list[float]) -> list[float]:
    return [round(second - first, 6) for first, second in itertools.pairwise(times)]


def cams_at_constant_speed(speed: float, dt: float = DT) -> list[float]:
    rules = CamGenerationRules()
    ticks = [tick * dt for tick in range(round(10.0 / dt))]
    return [now for now in ticks if rules.is_due(state(now, x=speed * now, speed=speed), now)]


@pytest.mark.parametrize(("speed", "milliseconds"), [(10, 500), (15, 300), (50, 100), (3, 1000), (0, 1000), (4.5, 900)])
def test_cam_intervals_at_constant_speed(speed: float, milliseconds: int) -> None:
    """Closed form (floor(4 / 0.1 v) + 1) 100 ms, limited to 100 to 1000: 4.0 m at 10 m/s do not exceed 4 m."""
    expected = min(max((math.floor(4 / (0.1 * speed)) + 1) * 100, 100), 1000) if speed else 1000
    assert expected == milliseconds
    for dt in (0.05, 0.02, 0.1):
        found = intervals(cams_at_constant_speed(speed, dt))
        assert set(found[1:]) == {milliseconds / 1000}, dt


def test_cam_heading_change_across_180_degrees_is_wrapped() -> None:
    """A change from 179.5 to -179.5 degrees is one degree and no trigger; six degrees trigger."""
    rules = CamGenerationRules()
    assert rules.is_due(state(0.0, yaw=math.radians(179.5)), 0.0)
    assert not rules.is_due(state(0.1, yaw=math.radians(-179.5)), 0.1)
    assert rules.is_due(state(0.2, yaw=math.radians(-174.5)), 0.2)


def test_cam_speed_change_triggers_above_half_a_meter_per_second() -> None:
    rules = CamGenerationRules()
    assert rules.is_due(state(0.0, speed=10.0), 0.0)
    assert not rules.is_due(state(0.1, speed=10.5), 0.1)
    assert rules.is_due(state(0.2, speed=10.51), 0.2)


def test_cam_interval_is_at_least_the_shortest_interval() -> None:
    rules = CamGenerationRules()
    assert rules.is_due(state(0.0), 0.0)
    assert not rules.is_due(state(0.05, x=100.0), 0.05)
    assert rules.is_due(state(0.1, x=100.0), 0.1)
    assert not rules.is_due(state(0.2, x=200.0), 0.2, shortest=0.3), "congestion control requires more"
    assert rules.is_due(state(0.4, x=200.0), 0.4, shortest=0.3)


def test_cam_interval_of_a_trigger_is_kept_for_three_messages() -> None:
    """After a trigger at 0.3 s the next three CAMs follow at 0.3 s, then at 1 s (N_GenCam = 3)."""
    rules = CamGenerationRules()
    sent = [t / 10 for t in range(45) if rules.is_due(state(t / 10, x=5.0 if t >= 3 else 0.0), t / 10)]
    assert sent == pytest.approx([0.0, 0.3, 0.6, 0.9, 1.2, 2.2, 3.2, 4.2])


def test_cam_low_frequency_container_is_sent_every_half_second() -> None:
    rules = CamGenerationRules()
    carried = [t / 10 for t in range(20) if rules.low_frequency(t / 10)]
    assert carried == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert (cam_size(False), cam_size(True)) == (190, 300)


def objects(time: float, *rows: tuple[float, float, float, str], scores: tuple[float, ...] = ()) -> Detections:
    """Return detections from rows of x, speed along the heading, yaw, class."""
    count = len(rows)
    boxes = np.array([[x, 10.0 * n, 0.8, 4.5, 1.8, 1.5, yaw] for n, (x, _, yaw, _) in enumerate(rows)]).reshape(-1, 7)
    velocity = np.array([[v * math.cos(yaw), v * math.sin(yaw)] for _, v, yaw, _ in rows]).reshape(-1, 2)
    classes = tuple(name for *_, name in rows)
    given = np.array(scores) if scores else np.ones(count)
    return Detections(time, boxes, given, classes, velocity, np.full((count, 2, 2), np.nan))


def run(rules: CpmGenerationRules, now: float, seen: Detections) -> CpmContents | None:
    return rules.contents(seen, tuple(range(len(seen))), now)


def test_cpm_of_stationary_vehicle_is_sent_once_per_second_with_sensors() -> None:
    rules = CpmGenerationRules()
    found = {t / 10: run(rules, t / 10, objects(t / 10, (5.0, 0.0, 0.0, "car"))) for t in range(25)}
    sent = {time: contents for time, contents in found.items() if contents is not None}
    assert list(sent) == pytest.approx([0.0, 1.0, 2.0])
    assert all(contents == CpmContents((0,), True) for contents in sent.values())


@pytest.mark.parametrize(("speed", "interval"), [(10.0, 0.5), (15.0, 0.3), (45.0, 0.1)])
def test_cpm_includes_vehicles_that_moved_more_than_4_m(speed: float, interval: float) -> None:
    rules = CpmGenerationRules()
    times = [
        t / 10
        for t in range(30)
        if (c := run(rules, t / 10, objects(t / 10, (speed * t / 10, speed, 0.0, "car")))) is not None and c.rows
    ]
    assert set(intervals(times)) == {interval}


def test_cpm_includes_new_vehicles_and_changes_of_speed_and_direction() -> None:
    rules = CpmGenerationRules()
    assert run(rules, 0.0, objects(0.0, (0.0, 5.0, math.radians(179.0), "car"))) == CpmContents((0,), True)
    assert run(rules, 0.1, objects(0.1, (0.0, 5.5, math.radians(179.0), "car"))) is None
    assert run(rules, 0.2, objects(0.2, (0.0, 5.0, math.radians(-178.0), "car"))) is None, "three degrees"
    assert run(rules, 0.3, objects(0.3, (0.0, 5.0, math.radians(-176.0), "car"))) == CpmContents((0,), False)
    assert run(rules, 0.4, objects(0.4, (0.0, 5.6, math.radians(-176.0), "car"))) == CpmContents((0,), False)
    two = objects(0.5, (0.0, 5.6, math.radians(-176.0), "car"), (50.0, 0.0, 0.0, "truck"))
    assert run(rules, 0.5, two) == CpmContents((1,), False)


def test_cpm_includes_all_pedestrians_and_cyclists_together() -> None:
    rules = CpmGenerationRules()
    walker, rider = (0.0, 1.0, 0.0, "pedestrian"), (9.0, 4.0, 0.0, "bicycle")
    assert run(rules, 0.0, objects(0.0, walker)) == CpmContents((0,), True)
    assert run(rules, 0.2, objects(0.2, walker)) is None
    both = run(rules, 0.3, objects(0.3, walker, rider))
    assert both is not None
    assert sorted(both.rows) == [0, 1]
    assert run(rules, 0.7, objects(0.7, walker, rider)) is None
    again = run(rules, 0.8, objects(0.8, walker, rider))
    assert again is not None
    assert sorted(again.rows) == [0, 1]


def test_cpm_omits_objects_of_low_perception_quality() -> None:
    assert [quality(score) for score in (0.0, 0.2, 0.23, 0.24, 1.0)] == [0, 3, 3, 4, 15]
    seen = objects(0.0, (0.0, 0.0, 0.0, "car"), (9.0, 0.0, 0.0, "car"), scores=(0.23, 0.24))
    assert run(CpmGenerationRules(), 0.0, seen) == CpmContents((1,), True)


def test_cpm_sorts_new_objects_before_changed_ones() -> None:
    rules = CpmGenerationRules()
    run(rules, 0.0, objects(0.0, (0.0, 0.0, 0.0, "car"), (0.0, 0.0, 0.0, "car")))
    later = objects(0.5, (4.5, 0.0, 0.0, "car"), (8.0, 0.0, 0.0, "car"), (0.0, 0.0, 0.0, "car"))
    assert run(rules, 0.5, later) == CpmContents((2, 1, 0), False)


def test_cpm_without_objects_and_sensors_is_not_sent() -> None:
    rules = CpmGenerationRules()
    assert run(rules, 0.0, Detections(0.0)) == CpmContents((), True)
    assert run(rules, 0.5, Detections(0.5)) is None
    assert run(rules, 1.0, Detections(1.0)) == CpmContents((), True)


def test_object_ids_without_tracker_are_constant() -> None:
    """Two cars pass each other at 15 m/s, in alternating order of rows; a third car appears later."""
    assigner = ObjectIdAssigner()
    for tick in range(40):
        time = tick * 0.1
        forward, backward = (-30.0 + 15.0 * time, 15.0, 0.0, "car"), (30.0 - 15.0 * time, 15.0, math.pi, "car")
        rows = [forward, backward] if tick % 2 else [backward, forward]
        seen = objects(time, *rows)
        seen.boxes[:, 1] = [0.0, 3.5] if tick % 2 else [3.5, 0.0]
        numbers = assigner.assign_ids(seen)
        if tick == 0:
            backward_id, forward_id = numbers
        assert numbers == ((forward_id, backward_id) if tick % 2 else (backward_id, forward_id))
    assert assigner.assign_ids(objects(4.0, (500.0, 0.0, 0.0, "car"))) == (2,)


def test_object_ids_near_objects_keep_ids_beside_unmatched_ones() -> None:
    """The pairs are 6.4 m apart in total, the crossed pairs 6.2 m; only the first is within the gate of 3 m."""
    before = objects(0.0, (0.0, 0.0, 0.0, "car"), (3.2, 0.0, 0.0, "car"))
    after = objects(0.1, (0.1, 0.0, 0.0, "car"), (-3.1, 0.0, 0.0, "car"))
    before.boxes[:, 1] = after.boxes[:, 1] = 0.0
    assigner = ObjectIdAssigner()
    assert assigner.assign_ids(before) == (0, 1)
    assert assigner.assign_ids(after) == (0, 2)


def test_object_ids_of_a_tracker_are_kept() -> None:
    seen = objects(0.0, (0.0, 0.0, 0.0, "car"), (9.0, 0.0, 0.0, "car"))
    tracked = Detections(0.0, seen.boxes, seen.scores, seen.classes, seen.velocity, seen.covariance, (7, 3))
    assert ObjectIdAssigner().assign_ids(tracked) == (7, 3)


def test_objects_that_fit_are_the_maximum_below_the_mtu() -> None:
    assert cpm_size(3, 1, 100) == 121 + 4 * 35 + 100
    assert objects_that_fit(1400, 0) == 36
    assert cpm_size(36, 0) <= 1400 < cpm_size(37, 0)
    assert objects_that_fit(200, 3, 150) == 1


def test_station_clock_shifts_timestamps_only() -> None:
    sender, receiver = StationClock(offset=0.02, drift=1e-4), StationClock(offset=-0.01)
    points = compress(np.zeros((1, 3)), 99.8, 0.2)
    message = Message("A", 0, 100.0, state(100.0), Detections(99.9), 121, points=points)
    stamped = shift_timestamps(message, sender.error(100.0))
    assert stamped.generated == 100.0
    assert stamped.state.time == pytest.approx(100.03)
    assert stamped.detections.time == pytest.approx(99.93)
    assert stamped.points is not None
    assert stamped.points.time == pytest.approx(99.83)
    local = shift_timestamps(stamped, -receiver.error(100.2))
    assert local.detections.time == pytest.approx(99.94), "30 ms by the sender, 10 ms by the receiver"
    assert shift_timestamps(message, StationClock().error(100.0)) is message
