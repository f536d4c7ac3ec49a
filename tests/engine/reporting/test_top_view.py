"""Snapshots of stations, and sections of top views."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.drawing.top_view import Window
from eidrive_scenario.reporting.snapshot import SnapshotBuilder, StationSnapshot
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState

Play = Callable[..., list[Frame]]


def snapshot_at(frames: list[Frame], tick: int) -> StationSnapshot:
    builder = SnapshotBuilder("Ego")
    return [builder.observe(frame) for frame in frames[: tick + 1]][-1]


def test_snapshot_keeps_message_for_its_lifetime(street: Play) -> None:
    """All messages from tick 30 are lost. The last one was measured at 1.45 s and expires after 2.28 s."""
    frames = street(1, frozenset(range(30, 100)))
    assert len(snapshot_at(frames, 74).received) == 1
    assert len(snapshot_at(frames, 75).received) == 0


def test_snapshot_omits_expired_message(street: Play) -> None:
    frames = street(1)
    frames = [
        msgspec.structs.replace(
            frame, steps={**frame.steps, "Ego": msgspec.structs.replace(frame.steps["Ego"], expired=(0,))}
        )
        for frame in frames
    ]
    assert snapshot_at(frames, 40).received == ()


def test_snapshot_of_own_detections_over_channel_has_channel_delay(street: Play) -> None:
    frames = street(None)
    sent = [frame.steps["Ego"].detections for frame in frames]
    traveling = []
    for tick, frame in enumerate(frames):
        state = StationState(frame.view.time, 0.0, 0.0, 0.0, 0.0, 0.0)
        back = Message("Ego", tick - 6, 0.0, state, sent[tick - 6], 100)
        inbox = (ReceivedMessage(back, frame.view.time),) if tick >= 6 else ()
        step = msgspec.structs.replace(frame.steps["Ego"], inbox=inbox)
        event = LinkEvent("Ego", "Ego", tick, frame.view.time, "delivered", frame.view.time + 0.3, "", 100)
        traveling.append(Frame(frame.view, {"Ego": step}, (), (event,)))
    assert len(snapshot_at(traveling, 5).own) == 0
    snapshot = snapshot_at(traveling, 40)
    assert snapshot.own is sent[34]
    assert (snapshot.received, snapshot.links) == ((), ())


def received_by_ego(frames: list[Frame], *messages: Message) -> tuple[ReceivedMessage, ...]:
    """Return the messages that Ego holds after it has received these in consecutive frames."""
    builder = SnapshotBuilder("Ego")
    for frame, message in zip(frames, messages, strict=False):
        step = msgspec.structs.replace(frame.steps["Ego"], inbox=(ReceivedMessage(message, frame.view.time),))
        snapshot = builder.observe(Frame(frame.view, {"Ego": step}))
    return snapshot.received


def test_snapshot_keeps_cpm_after_cam_of_same_sender(street: Play) -> None:
    """A CAM has its sender as its only object and does not replace a CPM."""
    frames = street(None)
    state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    seen = frames[0].steps["Ego"].detections
    report = Message("Rsu", 0, 0.0, state, seen, 100)
    itself = Message("Rsu", 1, 0.05, state, msgspec.structs.replace(seen.subset([0]), time=0.05), 100, "cam")
    received = received_by_ego(frames, report, itself)
    assert [(held.message.kind, len(held.message.detections)) for held in received] == [("cpm", len(seen)), ("cam", 1)]


def test_snapshot_completes_partial_messages(street: Play) -> None:
    frames = street(None)
    state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    one = frames[0].steps["Ego"].detections.subset([0])
    other = msgspec.structs.replace(one, time=0.05, boxes=one.boxes + np.eye(7)[0] * 20.0)
    parts = [
        Message("Rsu", n, now, state, held, 100, objects=(n,))
        for n, (now, held) in enumerate([(0.0, one), (0.05, other)])
    ]
    (known,) = received_by_ego(frames, *parts)
    assert known.message.detections.tracks == (0, 1)


def test_window_enclosing_points_has_margin() -> None:
    window = Window.enclosing([(0.0, 1.0, 9.0), (10.0, 5.0, 9.0)], margin=2.0)
    assert window == Window(-2.0, 12.0, -1.0, 7.0)
