"""The decisive instants of a run, against the plain kinematics of conftest's street."""

from __future__ import annotations

import dataclasses
import math
import pickle
from collections.abc import Callable
from types import MappingProxyType

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.drawing.key_frames import KeyFrames, Story
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


def test_the_helper_sees_the_car_at_20_m(street: Play) -> None:
    story = story_of(street(None))
    assert time_of(story, "hidden") == pytest.approx(1.40)
    assert story.moment("hidden").title == "RSU sees Incoming, Ego does not"


@pytest.mark.parametrize("delay", [1, 3, 6])
def test_the_ego_hears_of_it_as_many_ticks_later_as_the_message_takes(street: Play, delay: int) -> None:
    story = story_of(street(delay))
    assert time_of(story, "heard") == pytest.approx(1.40 + 0.05 * delay)
    assert time_of(story, "braked") == time_of(story, "heard")


def test_what_the_ego_sees_itself_is_not_hidden(street: Play) -> None:
    """Until 1.00 s the ego sees the car too; the RSU sees it all the time."""
    frames = []
    for frame in street(None):
        seen = detections_of(frame.view, "Incoming")
        steps = {
            "Ego": dataclasses.replace(
                frame.steps["Ego"], detections=seen if frame.view.time < 0.99 else detections_of(frame.view)
            ),
            "RSU": dataclasses.replace(frame.steps["RSU"], detections=seen),
        }
        frames.append(dataclasses.replace(frame, steps=steps))
    assert time_of(story_of(frames), "hidden") == pytest.approx(1.0)


def test_lost_messages_put_it_off(street: Play) -> None:
    story = story_of(street(1, frozenset({28, 29, 30})))
    assert time_of(story, "heard") == pytest.approx(1.60)


def test_without_a_channel_the_ego_does_not_brake(street: Play) -> None:
    story = story_of(street(None))
    assert [(moment.kind, moment.snapshot is None) for moment in story.moments] == [
        ("hidden", False),
        ("entered", False),
        ("braked", True),
        ("closest", False),
    ]
    assert story.moment("braked").title == "Ego never brakes for it"


def test_the_car_enters_the_area_when_its_center_does(street: Play) -> None:
    """y = 39.5 - 14 t falls below 10.5 m after 2.071 s."""
    assert time_of(story_of(street(1)), "entered") == pytest.approx(2.10)


def test_a_contact_that_the_world_reports_is_a_collision(street: Play) -> None:
    frames = street(1)
    blow = Contact("Ego", "Incoming", (0.0, 0.0, 0.0), 3.0)
    frames[50] = dataclasses.replace(frames[50], view=dataclasses.replace(frames[50].view, contacts=(blow,)))
    story = story_of(frames)
    assert (story.touched, time_of(story, "closest")) == (True, frames[50].view.time)
    assert story_of(street(1)).touched is False


def test_without_an_area_nothing_is_told_of_one(street: Play) -> None:
    observer = KeyFrames("Ego", "Incoming")
    for frame in street(1):
        observer.observe(frame)
    assert [moment.kind for moment in observer.story().moments] == ["heard", "braked", "closest"]


def test_distances_over_time_are_those_of_centers_and_bodies(street: Play) -> None:
    story = story_of(street(None))
    assert len(story.times) == len(story.centers) == len(story.boxes) == len(story.speeds) == 100
    assert story.centers[0] == pytest.approx(math.hypot(29.5, 39.5))
    gap = (29.5 - (4.892 + 1.837) / 2, 39.5 - (4.892 + 1.837) / 2)
    assert story.boxes[0] == pytest.approx(math.hypot(*gap))


def test_closest_is_the_smallest_gap_between_bodies(street: Play) -> None:
    story = story_of(street(1))
    nearest = min(story.boxes)
    assert nearest > 0.0
    assert time_of(story, "closest") == story.times[story.boxes.index(nearest)]
    assert story.moment("closest").title == f"closest, {nearest:.2f} m apart"


def test_a_story_travels_between_processes(street: Play) -> None:
    """Also where views hold cached things that do not, such as a read-only mapping of names."""
    frames = street(1)
    for frame in frames:
        frame.view.__dict__["rows"] = MappingProxyType(dict(frame.view.rows))
    story = pickle.loads(pickle.dumps(story_of(frames)))
    assert story.moment("closest").title == story_of(street(1)).moment("closest").title
    assert story.moment("closest").snapshot.view.rows["Truck"] == 2


def test_a_collision_is_shown_at_its_first_touch(street: Play) -> None:
    """With the ego 7.5 m further on, the two meet."""
    further = np.array([[7.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    frames = [
        Frame(dataclasses.replace(frame.view, position=frame.view.position + further), frame.steps)
        for frame in street(None)
    ]
    story = story_of(frames)
    assert story.moment("closest").title == "Incoming and Ego collide"
    assert time_of(story, "closest") == story.times[story.boxes.index(0.0)]
