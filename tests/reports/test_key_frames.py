"""Key frames of a run, against the kinematics of the synthetic street of conftest."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from types import MappingProxyType

import msgspec
import numpy as np
import pytest
from eidrive_reports.key_frames import KeyFrames, Story

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.world.view import Contact, WorldView

Play = Callable[..., list[Frame]]


AREA = np.array([[29.0, 4.5], [32.0, 4.5], [32.0, 10.5], [29.0, 10.5]])


def story_of(frames: list[Frame]) -> Story:
    observer = KeyFrames("Ego", "Incoming", [AREA])
    for frame in frames:
        observer.observe(frame)
    observer.close()
    return observer.story()


def detections_of(view: WorldView, *names: str) -> Detections:
    rows = [view.row(name) for name in names]
    count = len(rows)
    return Detections(
        view.time,
        view.boxes[rows].reshape(-1, 7),
        np.ones(count),
        ("car",) * count,
        np.zeros((count, 2)),
        np.zeros((count, 2, 2)),
    )


def time_of(story: Story, kind: str) -> float:
    snapshot = story.moment(kind).snapshot
    assert snapshot is not None
    return snapshot.time


def test_hidden_frame_is_first_detection_of_helper(street: Play) -> None:
    story = story_of(street(None))
    assert time_of(story, "hidden") == pytest.approx(1.40)
    assert story.moment("hidden").title == "RSU sees Incoming, Ego does not"


@pytest.mark.parametrize("delay", [1, 3, 6])
def test_reception_frame_follows_after_message_delay(street: Play, delay: int) -> None:
    story = story_of(street(delay))
    assert time_of(story, "received") == pytest.approx(1.40 + 0.05 * delay)
    assert time_of(story, "braked") == time_of(story, "received")


def test_hidden_frame_requires_missing_detection_of_ego(street: Play) -> None:
    """The ego detects the car until 1.00 s, and the RSU at all times."""
    frames = []
    for frame in street(None):
        seen = detections_of(frame.view, "Incoming")
        steps = {
            "Ego": msgspec.structs.replace(
                frame.steps["Ego"], detections=seen if frame.view.time < 0.99 else detections_of(frame.view)
            ),
            "RSU": msgspec.structs.replace(frame.steps["RSU"], detections=seen),
        }
        frames.append(msgspec.structs.replace(frame, steps=steps))
    assert time_of(story_of(frames), "hidden") == pytest.approx(1.0)


def test_reception_frame_is_delayed_by_lost_messages(street: Play) -> None:
    story = story_of(street(1, frozenset({28, 29, 30})))
    assert time_of(story, "received") == pytest.approx(1.60)


def test_story_without_messages_has_no_braked_frame(street: Play) -> None:
    story = story_of(street(None))
    assert [(moment.kind, moment.snapshot is None) for moment in story.moments] == [
        ("hidden", False),
        ("entered", False),
        ("braked", True),
        ("closest", False),
    ]
    assert story.moment("braked").title == "Ego never brakes"


def test_entered_frame_depends_on_center_of_car(street: Play) -> None:
    """y = 39.5 - 14 t falls below 10.5 m after 2.071 s."""
    assert time_of(story_of(street(1)), "entered") == pytest.approx(2.10)


def test_closest_frame_of_contact_is_a_collision(street: Play) -> None:
    frames = street(1)
    blow = Contact("Ego", "Incoming", (0.0, 0.0, 0.0), 3.0)
    frames[50] = msgspec.structs.replace(frames[50], view=msgspec.structs.replace(frames[50].view, contacts=(blow,)))
    story = story_of(frames)
    assert (story.touched, time_of(story, "closest")) == (True, frames[50].view.time)
    assert story_of(street(1)).touched is False


def test_story_without_conflict_area_has_no_entered_frame(street: Play) -> None:
    observer = KeyFrames("Ego", "Incoming")
    for frame in street(1):
        observer.observe(frame)
    assert [moment.kind for moment in observer.story().moments] == ["received", "braked", "closest"]


def test_story_contains_distances_of_centers_and_bodies(street: Play) -> None:
    story = story_of(street(None))
    assert len(story.times) == len(story.centers) == len(story.boxes) == len(story.speeds) == 100
    assert story.centers[0] == pytest.approx(math.hypot(29.5, 39.5))
    gap = (29.5 - (4.892 + 1.837) / 2, 39.5 - (4.892 + 1.837) / 2)
    assert story.boxes[0] == pytest.approx(math.hypot(*gap))


def test_closest_frame_has_minimum_distance_of_bodies(street: Play) -> None:
    story = story_of(street(1))
    nearest = min(story.boxes)
    assert nearest > 0.0
    assert time_of(story, "closest") == story.times[story.boxes.index(nearest)]
    assert story.moment("closest").title == f"minimum distance, {nearest:.2f} m"


def test_story_with_cached_view_values_is_picklable(street: Play) -> None:
    """A view may cache values that cannot be pickled, such as a read-only mapping of names."""
    frames = street(1)
    for frame in frames:
        frame.view.__dict__["rows"] = MappingProxyType(dict(frame.view.rows))
    story = pickle.loads(pickle.dumps(story_of(frames)))
    assert story.moment("closest").title == story_of(street(1)).moment("closest").title
    assert story.moment("closest").snapshot.view.rows["Truck"] == 2


def test_closest_frame_of_collision_is_first_contact(street: Play) -> None:
    """With an offset of 7.5 m of the ego, the two cars collide."""
    further = np.array([[7.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    frames = [
        Frame(msgspec.structs.replace(frame.view, position=frame.view.position + further), frame.steps)
        for frame in street(None)
    ]
    story = story_of(frames)
    assert story.moment("closest").title == "Incoming and Ego collide"
    assert time_of(story, "closest") == story.times[story.boxes.index(0.0)]
