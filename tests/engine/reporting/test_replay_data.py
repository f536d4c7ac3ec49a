"""Parts of the data of a replay: ellipses, series, messages, timeline, camera images, repetitions."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from written_recording import detected, step, view

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import box_distance
from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.evaluation.nearest_actor import nearest_body, nearest_pair
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.reporting.replay.frame_data import (
    MessageList,
    Timeline,
    describe_content,
    overlay,
    packed,
    replay_data,
)
from eidrive_scenario.reporting.replay.page import camera_files
from eidrive_scenario.reporting.replay.series import SeriesBuilder, closest_approach
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, StationState
from eidrive_scenario.v2x.messages.point_cloud import PointCloud
from eidrive_scenario.world.view import Contact

Play = Callable[..., list[Frame]]
QUANTILE = 5.991464547107979
"""95 % quantile of the chi-squared distribution with two degrees of freedom."""


def change(time: float, before: ElementState, after: ElementState, why: str = "", name: str = "Go") -> StateChange:
    started = after is ElementState.RUNNING
    transition = ElementTransition.START if started else ElementTransition.END
    return StateChange(time, name, f"S/{name}", "event", before, transition, after, why)


def observe(frames: list[Frame]) -> SeriesBuilder:
    series = SeriesBuilder()
    for frame in frames:
        series.observe(frame)
        series.keep()
    return series


def test_fused_objects_have_ellipse_of_95_percent(street: Play) -> None:
    """The variances along and across a direction of 30° are 4 and 1 m²."""
    frame = street(1)[40]
    step = frame.steps["Ego"]
    turn = math.radians(30.0)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    covariance = rotation @ np.diag([4.0, 1.0]) @ rotation.T
    fused = replace(step.detections, covariance=np.repeat(covariance[None], len(step.detections), axis=0))
    data = replay_data([Frame(frame.view, {"Ego": replace(step, fused=fused)})])
    long, short, direction = data["stations"]["Ego"][0]["fused"][0][7:]
    assert long == pytest.approx(2.0 * math.sqrt(QUANTILE), abs=0.005)
    assert short == pytest.approx(math.sqrt(QUANTILE), abs=0.005)
    assert direction == pytest.approx(turn, abs=0.001)


def test_fused_objects_without_covariance_have_no_ellipse(street: Play) -> None:
    frame = street(1)[40]
    step = frame.steps["Ego"]
    data = replay_data([Frame(frame.view, {"Ego": replace(step, fused=step.detections)})])
    assert [len(box) for box in data["stations"]["Ego"][0]["fused"]] == [6]


def test_packed_columns_contain_all_entries(street: Play) -> None:
    data = replay_data(street(6))
    page = packed(data)
    for name, column in page["poses"].items():
        shown = None
        for index, entry in enumerate(column):
            shown = shown if entry == 0 else entry
            assert shown == data["poses"][index].get(name)
    for name, parts in page["stations"].items():
        for key, column in parts.items():
            shown = None
            for index, entry in enumerate(column):
                shown = shown if entry == 0 and entry is not False else entry
                assert shown == data["stations"][name][index][key], (name, key, index)
    assert page["poses"]["Truck"][1:] == [0] * 99


def test_nearest_body_equals_smallest_of_all_distances(street: Play) -> None:
    for frame in street(1)[::7]:
        view = frame.view
        for row, name in enumerate(view.names):
            every = {
                other: box_distance(view.boxes[row], view.boxes[number])
                for number, other in enumerate(view.names)
                if number != row
            }
            gap, nearest = nearest_body(view, name)
            assert gap == min(every.values())
            assert every[nearest] == gap


def test_nearest_pair_equals_smallest_gap_of_moving_actors(street: Play) -> None:
    """The ego and the crossing car move; the truck and the RSU stand."""
    for frame in street(1)[::7]:
        view = frame.view
        moving = [name for name, speed in zip(view.names, view.speed.tolist(), strict=True) if speed > 0.1]
        gaps = [nearest_body(view, name)[0] for name in moving]
        found = nearest_pair(view, math.inf)
        assert found is not None
        assert found[0] == min(gap for gap in gaps if gap > 0.0)
        assert found[1] in moving
        assert nearest_pair(view, found[0]) is None


def test_ages_of_many_links_count_for_the_size_of_a_page(street: Play, monkeypatch: pytest.MonkeyPatch) -> None:
    """300 stations receive the message of one sender in the last of 100 frames: 30 000 values of ages."""
    frames = street(1)
    step = frames[40].steps["Ego"]
    crowd = {f"S{number}": replace(step, detections=step.detections.subset([])) for number in range(300)}
    frames[-1] = replace(frames[-1], steps=crowd)
    monkeypatch.setattr("eidrive_scenario.reporting.replay.frame_data._LARGEST_PAGE", 2**18)
    data = replay_data(frames, report=DamageReport())
    assert len(json.dumps(data)) < 2**18
    assert len(data["times"]) == 99


def test_series_contain_speed_gap_and_age_of_information(street: Play) -> None:
    """Messages take 4 ticks of 0.05 s: the first is received in tick 4, and the age is 0.2 s from then on."""
    frames = street(4)
    columns = observe(frames).take()["Ego"]
    assert columns["speed"][0] == 8.0
    view = frames[0].view
    gap = min(box_distance(view.boxes[0], view.boxes[row]) for row in (1, 2, 3))
    assert columns["gap"][0] == pytest.approx(gap, abs=0.005)
    assert columns["age"]["RSU"][:4] == [None] * 4
    assert columns["age"]["RSU"][4:] == pytest.approx([0.2] * 96)


def test_age_of_information_grows_while_messages_are_lost(street: Play) -> None:
    """The delay is 1 tick. The messages of ticks 30 to 39 are lost, so that of tick 29 is the newest in tick 40."""
    ages = observe(street(1, frozenset(range(30, 40)))).take()["Ego"]["age"]["RSU"]
    assert ages[30] == pytest.approx(0.05)
    assert ages[40] == pytest.approx(0.55)
    assert ages[41] == pytest.approx(0.05)


def test_station_that_does_not_drive_has_no_speed(street: Play) -> None:
    columns = observe(street(1)).take()
    assert "speed" not in columns.get("RSU", {})


def test_decisive_instant_is_smallest_gap_of_driven_vehicle(street: Play) -> None:
    frames = street(1)
    gaps = [nearest_body(frame.view, "Ego")[0] for frame in frames]
    decisive = observe(frames).decisive
    assert decisive is not None
    assert decisive["time"] == pytest.approx(frames[int(np.argmin(gaps))].view.time)
    assert f"{min(gaps):.2f} m" in decisive["text"]


def test_decisive_instant_is_first_contact(street: Play) -> None:
    frames = street(1)
    touch = Contact("Ego", "Truck", (0.0, 0.0, 0.0), 5.0)
    for tick in (30, 60):
        frames[tick] = replace(frames[tick], view=replace(frames[tick].view, contacts=(touch,)))
    series = observe(frames)
    assert series.contact == {"time": 1.5, "text": "contact of Ego and Truck at 5.0 m/s"}
    assert series.decisive == series.contact


def test_contact_of_others_is_not_decisive_for_driven_vehicle(street: Play) -> None:
    frames = street(1)
    touch = Contact("Incoming", "Truck", (0.0, 0.0, 0.0), 5.0)
    frames[30] = replace(frames[30], view=replace(frames[30].view, contacts=(touch,)))
    assert observe(frames).contact is None


def test_trailer_of_a_vehicle_is_not_decisive(street: Play) -> None:
    """In the first 30 frames the car stands where the ego is, without a contact."""
    frames = street(1)
    for tick in range(30):
        position = frames[tick].view.position.copy()
        position[1] = position[0]
        frames[tick] = replace(frames[tick], view=replace(frames[tick].view, position=position))
    decisive = observe(frames).decisive
    assert decisive is not None
    assert decisive["time"] >= 1.5
    assert "0.00 m" not in decisive["text"]


def distance_verdicts(*values: float | None) -> list[Verdict]:
    """Return verdicts of criteria `min_distance` with these values, named as those of one run."""
    return [
        Verdict("min_distance" if n == 1 else f"min_distance_{n}", True, value) for n, value in enumerate(values, 1)
    ]


def test_closest_approach_is_the_distance_that_a_criterion_measured() -> None:
    """The bus comes nearer by its center, the car by its body, which is what its criterion measures."""
    metrics = {
        "min_distance.Ego.Car.center": 4.5,
        "min_distance.Ego.Car.box": 0.4,
        "min_distance.Ego.Car.time": 3.0,
        "min_distance.Ego.Bus.center": 2.5,
        "min_distance.Ego.Bus.box": 1.0,
        "min_distance.Ego.Bus.time": 7.0,
        "min_distance.Ego.Lost.center": None,
        "min_distance.Ego.Lost.time": 1.0,
    }
    bus = {"time": 7.0, "text": "closest approach of Ego and Bus: 2.50 m between centers"}
    assert (
        closest_approach(metrics, distance_verdicts(4.5, 2.5)) == closest_approach(metrics, distance_verdicts()) == bus
    )
    car = {"time": 3.0, "text": "closest approach of Ego and Car: 0.40 m between bodies"}
    assert (
        closest_approach(metrics, distance_verdicts(None, 0.4, 1.0))
        == closest_approach(metrics, distance_verdicts(4.5, 0.4))
        == car
    )
    second = closest_approach({**metrics, "min_distance_2.Ego.Car.time": 5.0}, distance_verdicts(4.5, 0.4))
    assert second == {"time": 5.0, "text": "closest approach of Ego and Car: 0.40 m between bodies"}
    metrics["first_detection.Ego.Car.time"] = 1.5
    assert closest_approach(metrics, [*distance_verdicts(4.5, 0.4), Verdict("first_detection", True, 1.5)]) == car
    assert closest_approach({"collision.count": 1.0}, distance_verdicts()) is None


def test_closest_approach_names_actors_with_dots() -> None:
    metrics = {"min_distance.Ego.v2.Car.1.center": 4.5, "min_distance.Ego.v2.Car.1.time": 3.0}
    closest = closest_approach(metrics, distance_verdicts(4.5), ["Car.1", "Ego.v2"])
    assert closest is not None
    assert closest["text"] == "closest approach of Ego.v2 and Car.1: 4.50 m between centers"
    unknown = closest_approach(metrics, distance_verdicts(4.5))
    assert unknown is not None
    assert unknown["text"] == "closest approach of Ego.v2.Car.1: 4.50 m between centers"


def sent_message(classes: tuple[str, ...], **changes: Any) -> Message:
    """Return the first message of the RSU, with objects of these classes."""
    count = len(classes)
    detections = Detections(
        0.1, np.zeros((count, 7)), np.ones(count), classes, np.zeros((count, 2)), np.zeros((count, 2, 2))
    )
    return replace(Message("RSU", 1, 0.1, StationState(0.1, 0.0, 0.0, 0.0, 0.0, 0.0), detections, 200), **changes)


def test_messages_have_arrival_or_reason_of_loss() -> None:
    messages = MessageList()
    messages.observe_sent([sent_message(("car", "truck", "car"))])
    messages.observe([
        LinkEvent("RSU", "Ego", 1, 0.1, "delivered", 0.4, "", 200),
        LinkEvent("RSU", "Ego", 2, 0.2, "lost", None, "shadowing", 300),
        LinkEvent("RSU", "Ego", 3, 0.3, "lost", None, "propagation", 300, los="nlosv", blockers=("Bus", "Van")),
        LinkEvent("RSU", "Ego", 4, 0.4, "lost", None, "propagation", 300, los="nlos"),
        LinkEvent("RSU", "Ego", 5, 0.5, "lost", None, "queue", 300, los="nlosv", blockers=("Bus",)),
        LinkEvent("Ego", "Ego", 1, 0.2, "delivered", 0.3, "", 200),
    ])  # fmt: skip
    assert messages.take() == [
        [0.1, "RSU", "Ego", 0.4, "", 200, "CPM, car (2), truck"],
        [0.2, "RSU", "Ego", None, "shadowing", 300, ""],
        [0.3, "RSU", "Ego", None, "propagation, behind Bus, Van", 300, ""],
        [0.4, "RSU", "Ego", None, "propagation, behind the ground or a building", 300, ""],
        [0.5, "RSU", "Ego", None, "queue", 300, ""],
    ]


def test_content_of_messages_names_objects_and_other_parts() -> None:
    cloud = PointCloud(0.1, (0.0, 0.0, 0.0), 0.1, (1, 1, 1), np.zeros(68, dtype=np.uint8))
    assert describe_content(sent_message((), kind="cam")) == "CAM, no objects"
    assert describe_content(sent_message(("car",), objects=(3,))) == "CPM, updates of car"
    full = sent_message(("bus",), points=cloud, sensors=(ViewSector(0.0, 0.0, 1.0, 0.0, 1.0, 50.0),))
    assert describe_content(full) == "CPM, bus, sensor information, point cloud of 102 bytes"
    frame = FeatureFrame(
        0, 5, 1, 2, 0.1, 0.0, 0.0, 0.0, 1.8, 0.0, 0.8, (128, 128), "int8", 0.1, np.zeros((31, 10), np.uint8)
    )
    features = sent_message((), kind="features", features=frame)
    assert describe_content(features) == "FEATURES, 31 cells, frame 2 of 2"
    assert len(describe_content(sent_message(("x" * 1000,)))) == 200


def test_packed_messages_contain_each_text_once(street: Play) -> None:
    data = replay_data(street(1))
    page = packed(data)
    texts = page["texts"]
    assert len(set(texts)) == len(texts)
    resolved = [
        [texts[entry] if index in (1, 2, 4, 6) else entry for index, entry in enumerate(row)]
        for row in page["messages"]
    ]
    assert resolved == data["messages"]


def test_contacts_of_all_actors_have_impact_speed(street: Play) -> None:
    frames = street(1)
    for tick, touch in (
        (30, Contact("Incoming", "Truck", (0.0, 0.0, 0.0), 5.004)),
        (60, Contact("Ego", "Truck", (0.0, 0.0, 0.0), math.nan)),
    ):
        frames[tick] = replace(frames[tick], view=replace(frames[tick].view, contacts=(touch,)))
    data = replay_data(frames)
    assert data["contacts"] == [[1.5, "Incoming", "Truck", 5.0], [3.0, "Ego", "Truck", None]]
    assert data["contact"] == {"time": 3.0, "text": "contact of Ego and Truck"}


def test_instants_before_the_first_driven_vehicle_are_not_decisive() -> None:
    """Lead touches Last after 0.1 s and is 1 m beside Last later; Ego joins after 0.3 s and stands 20 m behind Lead."""
    bodies = {
        name: {"position": (x, y, 0.0), "velocity": (2.0, 0.0, 0.0)}
        for name, x, y in (("Lead", 24.0, 0.0), ("Last", 24.0, 3.0))
    }
    frames = [Frame(view(bodies, tick)) for tick in range(3)]
    frames[1] = replace(
        frames[1], view=replace(frames[1].view, contacts=(Contact("Lead", "Last", (0.0, 0.0, 0.0), 3.0),))
    )
    assert observe(frames).decisive == {"time": 0.1, "text": "contact of Lead and Last at 3.0 m/s"}
    joined = Frame(view({**bodies, "Ego": {"velocity": (2.0, 0.0, 0.0)}}, 3), {"Ego": step(detected(0.3, []))})
    assert observe([*frames, joined]).decisive == {"time": 0.3, "text": "smallest gap of Ego and Lead: 20.00 m"}


def test_overlay_has_lost_messages_and_plans_without_boxes(street: Play) -> None:
    data = replay_data(street(1, frozenset(range(30, 40))))
    second = overlay(data)
    lost = [row[0] for row in second["messages"]]
    assert lost == pytest.approx([0.05 * tick for tick in range(30, 40)])
    assert {key for step in second["stations"]["Ego"] for key in step} == {"plan", "braking"}
    assert second["poses"] == data["poses"]


def test_number_of_messages_in_page_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eidrive_scenario.reporting.replay.frame_data.MOST", 3)
    messages = MessageList()
    for number in range(5):
        messages.observe([LinkEvent("RSU", "Ego", number, 0.1 * number, "delivered", 1.0, "", 200)])
    assert len(messages.take()) == messages.count == 3
    assert messages.omitted == 2


def test_names_are_in_the_order_of_the_recording() -> None:
    """JavaScript sorts keys such as "10" and "9" of an object by their numbers: the page needs lists."""
    steps = {name: step(detected(0.0, [])) for name in ("10", "9")}
    page = packed(replay_data([Frame(view({"A": {}, "10": {}, "9": {}}), steps)]))
    assert (page["names"], page["station_names"]) == (["A", "10", "9"], ["10", "9"])


def test_timeline_has_interval_per_execution_with_reasons() -> None:
    timeline = Timeline()
    timeline.observe([change(1.0, ElementState.STANDBY, ElementState.RUNNING, "time > 1 s")])
    timeline.observe([change(2.0, ElementState.RUNNING, ElementState.STANDBY)])
    timeline.observe([change(3.0, ElementState.STANDBY, ElementState.RUNNING, "again")])
    timeline.observe([change(4.0, ElementState.STANDBY, ElementState.RUNNING, "first", name="On/Off")])
    assert timeline.take() == [
        ["S/Go", "Go", "event", [[1.0, 2.0, "time > 1 s", ""], [3.0, None, "again", ""]]],
        ["S/On/Off", "On/Off", "event", [[4.0, None, "first", ""]]],
    ]


def test_camera_files_lists_ticks_with_relative_address(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "a"
    folder = run / "images" / "Ego car%2F1"
    folder.mkdir(parents=True)
    for name in ("front left-000012.jpg", "front left-000004.jpg", "front left.json", "notes.txt"):
        (folder / name).write_bytes(b"")
    found = camera_files(run, tmp_path / "pages")
    assert found == {
        "Ego car/1": {
            "front left": {"address": "../runs/a/images/Ego%20car%252F1/front%20left-", "ticks": [4, 12]},
        }
    }
    assert camera_files(tmp_path / "pages", tmp_path) == {}


def test_gap_of_road_train_excludes_its_own_bodies(street: Play) -> None:
    """The truck and the RSU are coupled to the ego here, so that the crossing car is the only other body."""
    frames = [replace(frame, trailers={"Ego": "Truck", "Truck": "RSU"}) for frame in street(1)]
    assert frames[0].attached("Ego") == {"Truck", "RSU"}
    assert frames[0].attached("RSU") == {"Ego", "Truck"}
    view = frames[0].view
    (other,) = set(view.names) - {"Ego", "Truck", "RSU"}
    gap = box_distance(view.boxes[view.row("Ego")], view.boxes[view.row(other)])
    assert observe(frames).take()["Ego"]["gap"][0] == pytest.approx(gap, abs=0.005)
    pair = nearest_pair(view, math.inf, {"Ego": other})
    assert pair is not None
    assert {pair[1], pair[2]} != {"Ego", other}


def test_contact_of_own_trailer_is_decisive(street: Play) -> None:
    frames = street(1)
    touch = Contact("Truck", "RSU", (0.0, 0.0, 0.0), 5.0)
    hit = replace(frames[50], view=replace(frames[50].view, contacts=(touch,)))
    assert observe([*frames[:50], hit]).contact is None
    contact = observe([*frames[:50], replace(hit, trailers={"Ego": "Truck"})]).contact
    assert contact is not None
    assert contact["text"] == "contact of Truck and RSU at 5.0 m/s"
