"""Scenes of Foxglove: map, boxes, paths and messages, and their deletion."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from foxglove_topics import exported, point
from msgspec.structs import replace
from written_recording import Body, detected, step, view

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState

ROADS = Path(__file__).parents[3] / "xosc" / "roads"


def test_plan_follows_the_slope_of_the_road(tmp_path: Path) -> None:
    """From s = 240 m to 300 m the road rises by 0.06 from 2.7 m; its start is at x = -348 m, y = 7.5 m."""
    s = np.linspace(240.0, 300.0, 7)
    points = np.column_stack([s - 348.0, np.full(7, 5.0)])
    body: Body = {"position": (240.0 - 348.0, 5.0, 2.7)}
    steps = {"Ego": step(detected(0.0, []), plan=Plan(points, np.ones(7), "drive"))}
    topics = exported(tmp_path, Frame(view({"Ego": body}), steps), road=ROADS / "crest_road.xodr")
    (line,) = topics["/stations/Ego/plan"][0].entities[0].lines
    assert [one.z for one in line.points] == pytest.approx((2.7 + 0.06 * (s - 240.0) + 0.3).tolist(), abs=1e-6)


def test_absent_actor_is_deleted(tmp_path: Path) -> None:
    both: dict[str, Body] = {"A": {}, "B": {}}
    _, second = exported(tmp_path, Frame(view(both)), Frame(view({"A": {}}, 1)))["/ground_truth"]
    assert [deletion.id for deletion in second.deletions] == ["B"]
    assert [entity.id for entity in second.entities] == ["A"]


def test_scenes_of_absent_station_are_deleted_once(tmp_path: Path) -> None:
    """The station leaves in frame 1, returns in frame 3, and drives no longer in frame 4."""
    plan = Plan(np.array([[0.0, 0.0], [5.0, 0.0]]), np.ones(2), "drive")
    own = detected(0.0, [(5.0, 0.0, 0.5, 4.0, 2.0, 1.5, 0.0)])
    here, parked = {"Ego": step(own, plan=plan)}, {"Ego": step(own, drives=False)}
    steps = [here, {}, {}, here, parked]
    bodies: list[dict[str, Body]] = [{"Ego": {}} if one else {} for one in steps]
    frames = [Frame(view(body, tick), one) for tick, (body, one) in enumerate(zip(bodies, steps, strict=True))]
    topics = exported(tmp_path, *frames)
    for part, expected in (
        ("detections", [(0.0, 1), (0.1, 0), (0.3, 1), (0.4, 1)]),
        ("plan", [(0.0, 1), (0.1, 0), (0.3, 1), (0.4, 0)]),
    ):
        scenes = topics[f"/stations/Ego/{part}"]
        assert all(scene.deletions for scene in scenes if not scene.entities)
        times = [(list(scene.entities) or list(scene.deletions))[0].timestamp.ToNanoseconds() / 1e9 for scene in scenes]
        assert [(time, len(scene.entities)) for time, scene in zip(times, scenes, strict=True)] == expected


def test_boxes_of_both_messages_of_a_sender_are_one_entity(tmp_path: Path) -> None:
    """An entity replaces the former one of its id on the topic: a CAM must not hide the boxes of a CPM."""
    state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    boxes = [(x, 0.0, 0.5, 4.0, 2.0, 1.5, 0.0) for x in (10.0, 20.0, 30.0)]
    messages = (
        Message("B", 0, 0.0, state, detected(0.0, boxes[:2]), 100, kind="cpm"),
        Message("B", 1, 0.0, state, detected(0.0, boxes[2:]), 100, kind="cam"),
    )
    inbox = tuple(ReceivedMessage(message, 0.0) for message in messages)
    listening = replace(step(detected(0.0, [])), inbox=inbox)
    (scene,) = exported(tmp_path, Frame(view({"A": {}}), {"A": listening}))["/stations/A/received"]
    (entity,) = scene.entities
    assert entity.id == "B"
    assert [cube.pose.position.x for cube in entity.cubes] == [10.0, 20.0, 30.0]


def test_messages_are_lines_from_sender_to_receiver(tmp_path: Path) -> None:
    links = (
        LinkEvent("B", "A", 0, 0.0, "delivered", 0.0, "", 100),
        LinkEvent("A", "B", 0, 0.0, "lost", None, "error rate", 100),
        LinkEvent("A", "Gone", 0, 0.0, "lost", None, "absent", 100),
    )
    bodies: dict[str, Body] = {"A": {}, "B": {"position": (10.0, 0.0, 0.0)}}
    topics = exported(tmp_path, Frame(view(bodies), links=links))
    first, second = topics["/messages"][0].entities
    assert [one.x for one in first.lines[0].points] == [11.4, 1.4]
    assert (first.lines[0].color.g > first.lines[0].color.r) != (second.lines[0].color.g > second.lines[0].color.r)
    levels = [type(entry).Level.Name(entry.level) for entry in topics["/log/messages"]]
    assert levels == ["DEBUG", "WARNING", "WARNING"]


def test_line_of_a_message_does_not_replace_that_of_another(tmp_path: Path) -> None:
    """A sender may send a CAM and a CPM in one time step."""
    links = (LinkEvent("B", "A", 0, 0.0, "lost", None, "", 9), LinkEvent("B", "A", 1, 0.0, "delivered", 0.0, "", 9))
    (scene,) = exported(tmp_path, Frame(view({"A": {}, "B": {}}), links=links))["/messages"]
    assert len({entity.id for entity in scene.entities}) == 2


def test_map_lines_lie_on_lane_edges(tmp_path: Path) -> None:
    road = ROADS / "coop_1.xodr"
    (scene,) = exported(tmp_path, Frame(view({"A": {}})), road=road)["/map"]
    network = RoadNetwork.load(road)
    assert {entity.id for entity in scene.entities} == {f"road {name}" for name in network.roads}
    for entity in scene.entities:
        name = entity.id.removeprefix("road ")
        lanes = network.roads[name].sections[0].lanes.values()
        edges = {round(lane.side * lane.outer.value(0.0), 6) if lane.id else 0.0 for lane in lanes}
        starts = np.array([point(line.points[0]) for line in entity.lines])
        pose = network.road_pose_at(name, 0.0)
        aside = (starts[:, 1] - pose.y) * math.cos(pose.h) - (starts[:, 0] - pose.x) * math.sin(pose.h)
        along = (starts[:, 0] - pose.x) * math.cos(pose.h) + (starts[:, 1] - pose.y) * math.sin(pose.h)
        shift = network.roads[name].lane_offset.value(0.0)
        first = {round(value - shift, 6) for value, s in zip(aside.tolist(), along.tolist(), strict=True) if s < 1e-6}
        assert first <= edges
