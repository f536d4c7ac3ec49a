"""Intermediate fusion: messages of a sender, and the objects of a receiver."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from cell_detector import CELL, CellDetector
from msgspec.structs import replace

from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InvalidResult, SettingError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.fusion.intermediate import AttentionFusion, MaxFusion, Where2commFusion
from eidrive_scenario.sensing.readings import EgoState, LidarReading, Readings
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage
from eidrive_scenario.world.actor import ActorSpec

EGO = ActorSpec("Ego", "car", "car", (4.6, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.85, max_steering=0.6)
MASTS = [ActorSpec(f"RSU{number}", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5)) for number in range(20)]
HERE, THERE = (0.0, 0.0, 0.0), (40.0, 12.0, 2.5)
METHODS = ("max", "attention", "where2comm")


def readings(time: float, at: tuple[float, float, float], *points: tuple[float, float]) -> Readings:
    """Return the readings of a lidar at x, y and yaw that measures these points."""
    x, y, yaw = at
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    pose[:3, 3] = x, y, 1.8
    world = np.array([(*point, 1.0) for point in points]).reshape(-1, 3)
    lidar = LidarReading((world - pose[:3, 3]) @ pose[:3, :3], np.ones(len(world)), pose)
    ego = EgoState(time, np.array([x, y, 0.0]), yaw, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Readings(time, ego, lidars={"lidar": lidar})


def agent(spec: ActorSpec, velocity: tuple[float, float] = (0.0, 0.0), **more: Any) -> Agent:
    settings = {"fusion": "max", "detector": "lidar", "tracker": "none", **more}
    detector = CellDetector(velocity)
    return build_agent(AgentSettings.model_validate(settings), spec, None, seed=0, dt=0.05, detector=detector)


def sent(
    spec: ActorSpec, time: float, *points: tuple[float, float], at: tuple[float, float, float] = THERE, **more: Any
) -> tuple[Message, ...]:
    """Return the messages of a new station at its first reading."""
    return agent(spec, **more).act(readings(time, at, *points), (), time, None).outbox


def received(messages: Sequence[Message], time: float) -> list[ReceivedMessage]:
    return [ReceivedMessage(message, time) for message in messages]


def positions(boxes: np.ndarray) -> list[tuple[float, float]]:
    return sorted(map(tuple, boxes[:, :2].tolist()))


def frames(messages: Sequence[Message]) -> list[FeatureFrame]:
    return [message.features for message in messages if message.features is not None]


def fused(inbox: Sequence[Message], time: float = 0.1, *own: tuple[float, float], **more: Any) -> np.ndarray:
    """Return the fused boxes of the ego that receives these messages at its first reading."""
    step = agent(EGO, **more).act(readings(time, HERE, *own), received(inbox, time), time, None)
    return step.fused.boxes


def own_objects(time: float, inbox: Sequence[Message], earlier: Sequence[Message] = ()) -> np.ndarray:
    """Return the boxes in the fused features of the ego, after a reading at 0.05 s with earlier messages."""
    ego = agent(EGO)
    ego.act(readings(0.05, HERE), received(earlier, 0.05), 0.05, None)
    ego.act(readings(time, HERE), received(inbox, time), time, None)
    return next(report for report in ego.reports if report.station == "Ego").detections.boxes


def near(boxes: np.ndarray, *expected: tuple[float, float]) -> bool:
    """Return whether there are boxes at all of these places and nowhere else, within two cells."""
    offsets = boxes[:, None, :2] - np.array(expected).reshape(-1, 2)
    within = np.hypot(offsets[..., 0], offsets[..., 1]) <= 2.0 * CELL
    return bool(within.any(axis=0).all() and within.any(axis=1).all())


@pytest.mark.parametrize(("name", "kind"), [*zip(METHODS, (MaxFusion, AttentionFusion, Where2commFusion), strict=True)])
def test_methods_are_registered_as_entry_points(name: str, kind: type) -> None:
    assert registry("fusion").load(name) is kind


def test_frames_follow_the_boxes_in_messages_of_their_size() -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), (30.0, 4.0), security_bytes=100, fusion_settings={"share": 0.1})
    assert [message.kind for message in messages] == ["cpm", *["features"] * 14]
    assert [message.number for message in messages] == list(range(15))
    assert len(messages[0].detections) == 2
    assert messages[0].payload is None
    for message in messages[1:]:
        assert message.features is not None
        assert message.payload is message.features
        assert message.size == len(message.features.encode()) + 100 <= 1400
        assert not len(message.detections)
    assert sum(len(frame.cells) for frame in frames(messages)) == 1638
    assert {frame.station for frame in frames(messages)} == {int.from_bytes(b"RSU0", "little")}


@pytest.mark.parametrize(("method", "cells"), [("max", 16384), ("attention", 16384), ("where2comm", 164)])
def test_default_share_of_cells(method: str, cells: int) -> None:
    assert sum(len(frame.cells) for frame in frames(sent(MASTS[0], 0.0, fusion=method))) == cells


def test_most_confident_cells_are_in_the_first_frames() -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), (30.0, 4.0), fusion="where2comm", mtu=200)
    shown = [int((frame.integers[0] > 0).sum()) for frame in frames(messages)]
    assert (shown[0], sum(shown)) == (2, 2)


def test_map_is_sent_once() -> None:
    """The lidar measures in every second tick; the boxes are sent in each tick."""
    mast = agent(MASTS[0], fusion="where2comm")
    count, times = [], set()
    for tick in range(6):
        given = readings(0.05 * tick, THERE, (20.0, 4.0))
        step = mast.act(given if tick % 2 == 0 else replace(given, lidars={}), (), 0.05 * tick, None)
        assert step.outbox[0].kind == "cpm"
        count.append(len(step.outbox) - 1)
        times |= {frame.time for frame in frames(step.outbox)}
    assert count == [2, 0, 2, 0, 2, 0]
    assert times == {0.0, 0.1, 0.2}


def test_message_rate_sends_the_newest_map() -> None:
    mast = agent(MASTS[0], fusion="where2comm", message_rate=5.0, message_phase=0.0)
    times = []
    for tick in range(9):
        step = mast.act(readings(0.05 * tick, THERE, (20.0, 4.0)), (), 0.05 * tick, None)
        times += [frame.time for frame in frames(step.outbox) if frame.number == 0]
    np.testing.assert_allclose(times, [0.0, 0.2, 0.4], atol=1e-9)


def test_features_are_sent_after_the_computing_time() -> None:
    mast = agent(MASTS[0], fusion="where2comm", detector_latency=0.1)
    at: dict[float, float] = {}
    for tick in range(5):
        given = readings(0.05 * tick, THERE, (20.0, 4.0))
        step = mast.act(given if tick == 0 else replace(given, lidars={}), (), 0.05 * tick, None)
        at |= {frame.time: 0.05 * tick for frame in frames(step.outbox)}
    assert at == {0.0: pytest.approx(0.1)}


@pytest.mark.parametrize("encoding", ["int8", "codes"])
@pytest.mark.parametrize("method", METHODS)
def test_receiver_detects_what_another_station_sees(method: str, encoding: str) -> None:
    settings: Any = {"fusion": method, "fusion_settings": {"encoding": encoding}}
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), (-15.0, -8.0), **settings)
    assert near(fused(messages, 0.1, (30.0, -3.0), **settings), (20.0, 4.0), (-15.0, -8.0), (30.0, -3.0))
    assert near(fused((), 0.1, (30.0, -3.0), **settings), (30.0, -3.0))


def test_poses_as_stated_and_as_assumed_place_the_features() -> None:
    """The sender states a pose that is 3.2 m off, and the receiver detects the object there."""
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm")[1:]
    shifted = [
        replace(message, features=dataclasses.replace(message.features, x=message.features.x + 3.2))
        for message in messages
        if message.features is not None
    ]
    assert near(fused(messages), (20.0, 4.0))
    assert near(fused(shifted), (23.2, 4.0))


COMMON = ((20.0, 4.0), (12.0, -9.0), (-15.0, -8.0), (25.0, 16.0))
"""Objects that both stations see."""


def displaced(time: float, hidden: tuple[float, float], error: float = 1.6, **more: Any) -> list[Message]:
    """Return the messages of a station with an error of x [m], which it states, that sees another object."""
    points = [(x + error, y) for x, y in (*COMMON, hidden)]
    covariance = np.diag([0.64, 0.64, math.radians(0.4) ** 2])
    messages = sent(MASTS[0], time, *points, at=(THERE[0] + error, *THERE[1:]), **more)
    return [replace(message, state=replace(message.state, pose_covariance=covariance)) for message in messages]


def test_shared_boxes_correct_the_pose_of_the_sender() -> None:
    """Four objects that both see show the error; the fifth is seen by the sender alone."""
    stated = displaced(0.0, (30.0, -4.0), fusion="where2comm")
    for align_poses, x in ((False, 31.6), (True, 30.0)):
        ego = agent(EGO, fusion_settings={"align_poses": align_poses})
        ego.act(readings(0.05, HERE, *COMMON), received(stated[:1], 0.05), 0.05, None)
        step = ego.act(readings(0.1, HERE, *COMMON), received(stated[1:], 0.1), 0.1, None)
        centers = step.fused.boxes[:, :2]
        alone = centers[np.hypot(centers[:, 0] - x, centers[:, 1] + 4.0) < 3.0]
        assert abs(alone.mean(axis=0)[0] - x) < 0.6, align_poses


@pytest.mark.parametrize("later", [1.6, 0.0, -1.6])
def test_objects_in_features_correct_their_place_whatever_later_boxes_show(later: float) -> None:
    """As above, with a pose error of 1.6 m in the features, and another in the boxes of the next time step."""
    stated = displaced(0.0, (30.0, -4.0), fusion="where2comm")
    boxes = displaced(0.05, (30.0, -4.0), later, fusion="where2comm")[:1]
    ego = agent(EGO, fusion_settings={"align_poses": True})
    ego.act(readings(0.05, HERE, *COMMON), received(stated, 0.05), 0.05, None)
    ego.act(readings(0.1, HERE, *COMMON), received(boxes, 0.1), 0.1, None)
    centers = next(report for report in ego.reports if report.station == "Ego").detections.boxes[:, :2]
    alone = centers[np.hypot(centers[:, 0] - 30.0, centers[:, 1] + 4.0) < 3.0]
    assert abs(alone.mean(axis=0)[0] - 30.0) < 0.6


def test_shared_boxes_with_features_correct_boxes_without() -> None:
    """As above, but the fifth object is beyond the grid of the receiver, so that only its box reports it."""
    for align_poses, x in ((False, 81.6), (True, 80.0)):
        ego = agent(EGO, fusion_settings={"align_poses": align_poses})
        for tick in range(1, 5):
            stated = displaced(0.05 * tick, (80.0, -4.0))
            step = ego.act(readings(0.05 * tick, HERE, *COMMON), received(stated, 0.05 * tick), 0.05 * tick, None)
        far = step.fused.boxes[step.fused.boxes[:, 0] > 60.0]
        assert len(far) == 1
        assert abs(far[0, 0] - x) < CELL, align_poses


def test_lost_frame_costs_its_cells_only() -> None:
    """Objects of two frames: whichever arrives is detected."""
    points = [(12.0 + 5.0 * n, 4.0) for n in range(18)]
    _, *messages = sent(MASTS[0], 0.0, *points, mtu=200, fusion="where2comm")
    grids = {message.number: message.features for message in messages if message.features is not None}
    holding = [number for number, frame in grids.items() if (frame.integers[0] > 0).any()]
    assert len(holding) == 2
    everything = set(positions(fused(messages)))
    first, second = (
        set(positions(fused([message for message in messages if message.number != lost]))) for lost in holding
    )
    assert first != everything != second
    assert first | second == everything
    assert len(first) >= 8


def test_boxes_without_features_are_fused() -> None:
    """Without any frame all boxes are, afterwards those in absent cells and those beyond the grid of the receiver."""
    boxes, *messages = sent(MASTS[0], 0.0, (20.0, 4.0), (80.0, 4.0))
    ego = agent(EGO)
    first = ego.act(readings(0.05, HERE), received([boxes], 0.05), 0.05, None)
    assert near(first.fused.boxes, (20.0, 4.0), (80.0, 4.0))
    empty = [message for message in messages if message.features and not (message.features.integers[0] > 0).any()]
    step = ego.act(readings(0.1, HERE), received(empty, 0.1), 0.1, None)
    late = replace(boxes, detections=replace(boxes.detections, time=0.05))
    step = ego.act(readings(0.15, HERE), received([late], 0.15), 0.15, None)
    assert near(step.fused.boxes, (20.0, 4.0), (80.0, 4.0))
    step = ego.act(readings(0.2, HERE), received([*messages, late], 0.2), 0.2, None)
    assert near(step.fused.boxes, (20.0, 4.0), (80.0, 4.0))
    reports = {report.station: report for report in ego.reports}
    assert near(reports["Ego"].detections.boxes, (20.0, 4.0))


@pytest.mark.parametrize("has_scanned", [False, True])
def test_boxes_of_a_station_are_fused_until_its_features_are(has_scanned: bool) -> None:
    """The own lidar has no reading in the tick in which they arrive. The features show the object at 20 m, the box at
    30 m."""
    boxes, *messages = sent(MASTS[0], 0.05, (20.0, 4.0))
    box = replace(boxes.detections, boxes=boxes.detections.boxes + np.array([10.0, *[0.0] * 6]))
    inbox = received([replace(boxes, detections=box), *messages], 0.1)
    ego = agent(EGO)
    if has_scanned:
        ego.act(readings(0.0, HERE), (), 0.0, None)
    waiting = ego.act(replace(readings(0.1, HERE), lidars={}), inbox, 0.1, None).fused
    merged = ego.act(readings(0.15, HERE), (), 0.15, None).fused
    assert near(waiting.boxes, (30.0, 4.0))
    assert near(merged.boxes, (20.0, 4.0))


@pytest.mark.parametrize("fusion", ["average", "covariance_intersection", "early"])
def test_station_without_features_is_fused_by_its_boxes(fusion: str) -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion=fusion)
    assert near(fused(messages), (20.0, 4.0))


@pytest.mark.parametrize("fusion", ["average", "early"])
def test_stations_with_other_methods_ignore_features(fusion: str) -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0))
    step = agent(EGO, fusion=fusion).act(readings(0.1, HERE, (30.0, -3.0)), received(messages, 0.1), 0.1, None)
    own = [] if fusion == "early" else [(30.0, -3.0)]  # one point is no object of the detector `lidar`
    assert near(step.fused.boxes, (20.0, 4.0), *own)
    assert step.expired == ()


def test_order_and_duplicates_of_frames_have_no_effect() -> None:
    _, *messages = sent(MASTS[0], 0.0, (20.0, 4.0), (30.0, 9.0))
    expected = fused(messages)
    np.testing.assert_array_equal(fused(messages[::-1]), expected)
    np.testing.assert_array_equal(fused([*messages, *messages[:7]]), expected)


def test_late_frames_of_older_maps_are_dropped() -> None:
    mast = agent(MASTS[0], fusion="where2comm", mtu=200)
    old = mast.act(readings(0.0, THERE, (20.0, 4.0)), (), 0.0, None).outbox[1:]
    new = mast.act(readings(0.1, THERE, (30.0, 9.0)), (), 0.1, None).outbox[1:]
    assert near(fused([*old, *new], 0.2), (30.0, 9.0))
    assert near(fused([*new, *old], 0.2), (30.0, 9.0))
    assert near(fused([*new[:1], *old, *new[1:]], 0.2), (30.0, 9.0))


def test_features_older_than_max_lateness_are_expired() -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm")
    settings: Any = {"fusion_settings": {"max_lateness": 0.2}}
    assert near(fused(messages[1:], 0.2, **settings), (20.0, 4.0))
    step = agent(EGO, **settings).act(readings(0.25, HERE), received(messages[1:], 0.25), 0.25, None)
    assert step.expired == (0, 1)
    assert not len(step.fused)


def test_clock_of_the_sender_shifts_its_times() -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm", clock_offset=-0.4)
    assert {frame.time for frame in frames(messages)} == {-0.4}
    settings: Any = {"fusion_settings": {"max_lateness": 0.3}}
    assert not len(fused(messages[1:], 0.1, **settings))
    assert near(fused(messages[1:], 0.1, clock_offset=-0.4, **settings), (20.0, 4.0))


@pytest.mark.parametrize(
    "change",
    [
        {"x": math.nan}, {"y": math.inf}, {"time": 0.05, "cell": 0.0}, {"shape": (2, 2)}, {"shape": (60000, 60000)},
        {"scale": 0.5}, {"encoding": "codes"}, {"count": 0},
    ],
)  # fmt: skip
def test_hostile_frames_are_ignored(change: dict[str, Any]) -> None:
    _, *messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm")
    broken = [
        replace(message, features=dataclasses.replace(message.features, **change))
        for message in messages
        if message.features is not None
    ]
    assert not len(fused(broken))
    assert near(fused([*broken, *messages, *broken]), (20.0, 4.0))


def test_frame_of_the_same_map_with_another_pose_is_ignored() -> None:
    _, *messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm")
    assert messages[1].features is not None
    moved = replace(messages[1], features=dataclasses.replace(messages[1].features, x=0.0))
    assert near(fused([messages[0], moved]), (20.0, 4.0))


def test_cells_of_a_moving_object_are_moved() -> None:
    """At 20 m/s, features that are 0.4 s old are 8 m behind."""
    boxes, *messages = sent(MASTS[0], 0.0, (20.0, 4.0), velocity=(20.0, 0.0), fusion="where2comm")
    assert near(fused(messages, 0.4), (20.0, 4.0))
    assert near(fused([*messages, boxes], 0.4), (28.0, 4.0))


def test_late_report_of_an_older_measurement_does_not_move_cells() -> None:
    """The object turned back: at 0 s it had another velocity than at 0.1 s, when the features were measured."""
    old = sent(MASTS[0], 0.0, (20.0, 4.0), velocity=(-20.0, 0.0), fusion="where2comm")[0]
    new, *messages = sent(MASTS[0], 0.1, (20.0, 4.0), velocity=(20.0, 0.0), fusion="where2comm")
    for inbox in ([*messages, new, old], [*messages, old, new]):
        assert near(own_objects(0.5, inbox), (28.0, 4.0))


def test_report_of_a_clock_that_is_set_back_moves_cells() -> None:
    """The first report is of a clock that was 60 s ahead."""
    ahead = sent(MASTS[0], 60.0, (20.0, 4.0), velocity=(-20.0, 0.0), fusion="where2comm")[0]
    new, *messages = sent(MASTS[0], 0.1, (20.0, 4.0), velocity=(20.0, 0.0), fusion="where2comm")
    assert near(own_objects(0.5, [ahead, *messages, new]), (28.0, 4.0))


def test_boxes_older_than_their_maximum_age_do_not_move_cells() -> None:
    """A car passes at 8 m/s; 3 s later another one stands where it would be, and its report is lost."""
    boxes, *_ = sent(MASTS[0], 0.0, (20.0, 4.0), velocity=(8.0, 0.0), fusion="where2comm")
    _, *messages = sent(MASTS[0], 3.0, (44.0, 4.0), fusion="where2comm")
    assert near(own_objects(3.4, messages, earlier=[boxes]), (44.0, 4.0))


def test_station_that_enters_again_counts_its_maps_from_the_start() -> None:
    first = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm")
    again = sent(MASTS[0], 0.3, (25.0, -4.0), at=(42.0, 9.0, 1.0), fusion="where2comm")
    assert frames(first)[0].sequence == frames(again)[0].sequence
    assert near(own_objects(0.4, again[1:], earlier=first[1:]), (25.0, -4.0))


@pytest.mark.parametrize("ahead", [3.0, 1e4])
def test_features_of_the_far_future_do_not_replace_later_ones(ahead: float) -> None:
    hostile = sent(MASTS[0], 0.0, (30.0, -8.0), fusion="where2comm", clock_offset=ahead)[1:]
    messages = sent(MASTS[0], 0.1, (20.0, 4.0), fusion="where2comm")[1:]
    ego = agent(EGO)
    step = ego.act(readings(0.1, HERE), received(hostile, 0.1), 0.1, None)
    assert not len(step.fused)
    assert step.expired == ()
    step = ego.act(readings(0.2, HERE), received(messages, 0.2), 0.2, None)
    assert near(step.fused.boxes, (20.0, 4.0))


@pytest.mark.parametrize(("own", "others", "expected"), [(0.2, 0.2, 0.2), (0.2, None, None), (None, 0.2, None)])
def test_motion_in_fused_features_is_known_if_all_stations_show_it(
    own: float | None, others: float | None, expected: float | None
) -> None:
    def features(time: float, interval: float | None) -> Readings:
        detector = CellDetector()
        detector.detect(readings(time, HERE, (20.0, 4.0)))
        assert detector.feature_map is not None
        return replace(readings(time, HERE), features=replace(detector.feature_map, interval=interval))

    sender, receiver = MaxFusion(), MaxFusion()
    for method in (sender, receiver):
        method.setup(CellDetector())
    for frame in sender.payloads(features(0.0, others), 1400):
        assert isinstance(frame, FeatureFrame)
        receiver.add_payload("RSU0", FeatureFrame.decode(frame.encode()), np.array([0.0, 0, 0, 4, 2, 2, 0]))
    merged = receiver.merge_readings(features(0.1, own)).features
    assert merged is not None
    assert merged.interval == expected


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (np.zeros((8, 128, 128)), r"returned an array of shape \(8, 128, 128\) \(expected .* \(96, 128, 128\)\)"),
        (np.full((96, 128, 128), np.nan), "returned features with the value nan"),
        (None, "returned None"),
    ],
)
def test_invalid_result_of_a_method_names_the_method(
    monkeypatch: pytest.MonkeyPatch, result: np.ndarray | None, text: str
) -> None:
    monkeypatch.setattr(MaxFusion, "fuse_maps", lambda *given: result)
    with pytest.raises(InvalidResult, match=f"fuse_maps {text}"):
        fused(sent(MASTS[0], 0.0, (20.0, 4.0)))


def test_false_object_of_the_receiver_is_in_fused_features() -> None:
    ghost = [{"kind": "car", "x": 25.0, "y": -6.0}]
    inbox = sent(MASTS[0], 0.0, (20.0, 4.0))
    assert near(fused(inbox, 0.1, false_objects=ghost), (20.0, 4.0), (25.0, -6.0))


def test_partial_reports_move_cells() -> None:
    boxes, *messages = sent(
        MASTS[0], 0.0, (20.0, 4.0), velocity=(20.0, 0.0), fusion="where2comm", generation="etsi", message_phase=0.0
    )
    assert boxes.objects is not None
    assert near(fused([*messages, boxes], 0.4), (28.0, 4.0))


def test_cells_on_the_own_body_are_removed() -> None:
    """The ego drives at 15 m/s, and the features are 0.3 s old."""
    messages = sent(MASTS[0], 0.0, (0.5, 0.5), (3.0, -0.4), (-0.5, 0.0), fusion="where2comm")
    ego = agent(EGO)
    for tick in range(6):
        ego.act(readings(0.05 * tick, (0.75 * tick, 0.0, 0.0)), (), 0.05 * tick, None)
    step = ego.act(readings(0.3, (4.5, 0.0, 0.0)), received(messages, 0.3), 0.3, None)
    assert not len(step.fused)


def test_twenty_senders_are_fused() -> None:
    points = [(-40.0 + 4.0 * n, 8.0) for n in range(20)]
    inbox = [
        message
        for mast, point in zip(MASTS, points, strict=True)
        for message in sent(mast, 0.0, point, at=(point[0], 20.0, 0.1 * point[0]), fusion="where2comm")[1:]
    ]
    assert near(fused(inbox), *points)


def test_sender_reports_its_own_objects_only() -> None:
    messages = sent(MASTS[0], 0.0, (20.0, 4.0), fusion="where2comm")
    step = agent(EGO).act(readings(0.1, HERE, (30.0, -3.0)), received(messages, 0.1), 0.1, None)
    assert near(step.outbox[0].detections.boxes, (30.0, -3.0))
    assert sum(int((frame.integers[0] > 0).sum()) for frame in frames(step.outbox)) == 1


@pytest.mark.parametrize("method", METHODS)
def test_detector_without_features_is_an_error(method: str) -> None:
    settings = AgentSettings.model_validate({"fusion": method, "detector": "lidar"})
    expected = f"fusion method '{method}' shares features, which detector 'lidar' does not compute"
    with pytest.raises(SettingError, match=expected):
        build_agent(settings, EGO, None, seed=0, dt=0.05)


def test_max_equals_plain_statement() -> None:
    random = np.random.default_rng(3)
    own = random.uniform(0, 1, (96, 4, 4)).astype(np.float32)
    received = random.uniform(0, 1, (2, 96, 4, 4)).astype(np.float32)
    present = random.random((2, 4, 4)) < 0.5
    result = MaxFusion().fuse_maps(own, received, present)
    np.testing.assert_array_equal(result, np.maximum(own, np.where(present[:, None], received, -np.inf).max(axis=0)))
