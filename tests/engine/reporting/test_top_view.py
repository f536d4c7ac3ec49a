"""Top views: well-formed, with the right shapes in the right places."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable

import numpy as np
import pytest
from lxml import etree

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window, legend, roads_symbol, top_view
from eidrive_scenario.reporting.snapshot import SnapshotBuilder, StationSnapshot
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState

Play = Callable[..., list[Frame]]
SVG = "{http://www.w3.org/2000/svg}"
WINDOW = Window(left=-5.0, right=50.0, bottom=-12.0, top=45.0)


def snapshot_at(frames: list[Frame], tick: int) -> StationSnapshot:
    knowledge = SnapshotBuilder("Ego")
    return [knowledge.observe(frame) for frame in frames[: tick + 1]][-1]


def shapes(svg: str, kind: str) -> list[np.ndarray]:
    """The corners (M, 2) of the paths of that class, in world coordinates."""
    found = []
    for element in etree.fromstring(svg).iter(f"{SVG}path"):
        if element.get("class") == kind:
            numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", element.get("d") or "")]
            found.append(np.array(numbers).reshape(-1, 2) * (1, -1))
    return found


def test_view_box_is_the_window_with_y_upwards(street: Play) -> None:
    root = etree.fromstring(top_view(snapshot_at(street(1), 40), WINDOW))
    assert root.get("viewBox") == "-5.00 -45.00 55.00 57.00"
    assert root.findtext(f"{SVG}title") == "top view at 2.00 s as Ego knows it"


def test_truth_is_an_outline_around_each_vehicle(street: Play) -> None:
    svg = top_view(snapshot_at(street(None), 40), WINDOW)
    ego, incoming, truck = shapes(svg, "truth")
    assert ego.mean(axis=0) == pytest.approx([16.0, 0.0], abs=0.01)
    assert np.ptp(ego, axis=0) == pytest.approx([4.89, 1.84], abs=0.02)
    assert incoming.mean(axis=0) == pytest.approx([29.5, 11.5], abs=0.01)
    assert np.ptp(incoming, axis=0) == pytest.approx([1.84, 4.89], abs=0.02)
    assert np.ptp(truck, axis=0) == pytest.approx([2.89, 8.47], abs=0.02)


def test_a_mast_is_a_dot(street: Play) -> None:
    circle = etree.fromstring(top_view(snapshot_at(street(None), 40), WINDOW)).find(f"{SVG}circle[@class='truth']")
    assert circle is not None
    assert (circle.get("cx"), circle.get("cy")) == ("42.20", "6.00")


def test_own_and_received_boxes_are_told_apart(street: Play) -> None:
    svg = top_view(snapshot_at(street(1), 40), WINDOW)
    assert len(shapes(svg, "own")) == 1
    received = sorted(shapes(svg, "received"), key=lambda corners: corners.mean(axis=0)[0])
    assert [tuple(np.round(corners.mean(axis=0), 1)) for corners in received] == [(25.4, 5.6), (29.5, 12.2)]


def test_a_late_message_shows_the_car_where_it_was(street: Play) -> None:
    """Six ticks at 14 m/s: 4.2 m behind the truth."""
    svg = top_view(snapshot_at(street(6), 40), WINDOW)
    late = max(shapes(svg, "received"), key=lambda corners: corners.mean(axis=0)[1])
    assert late.mean(axis=0) == pytest.approx([29.5, 11.5 + 4.2], abs=0.01)


def test_links_run_from_sender_to_receiver_and_tell_a_loss(street: Play) -> None:
    for lost, outcome in ((frozenset[int](), "delivered"), (frozenset({39}), "lost")):
        root = etree.fromstring(top_view(snapshot_at(street(1, lost), 40), WINDOW))
        (line,) = root.iter(f"{SVG}line")
        assert line.get("class") == f"link {outcome}"
        assert (line.get("x1"), line.get("y1")) == ("42.20", "6.00")
        assert float(line.get("y2") or "nan") == 0.0


def test_without_a_channel_nothing_is_received(street: Play) -> None:
    svg = top_view(snapshot_at(street(None), 40), WINDOW)
    assert not shapes(svg, "received")
    assert not list(etree.fromstring(svg).iter(f"{SVG}line"))


def test_what_was_heard_stays_as_long_as_a_station_goes_by_it(street: Play) -> None:
    """All messages from tick 30 on are lost; the last one was measured at 1.45 s, and is forgotten 1 s later."""
    frames = street(1, frozenset(range(30, 100)))
    assert len(snapshot_at(frames, 49).heard) == 1
    assert len(snapshot_at(frames, 50).heard) == 0


def test_own_detections_that_travel_the_channel_are_shown_when_they_come_back(street: Play) -> None:
    frames = street(None)
    sent = [frame.steps["Ego"].detections for frame in frames]
    traveling = []
    for tick, frame in enumerate(frames):
        state = StationState(frame.view.time, 0.0, 0.0, 0.0, 0.0, 0.0)
        back = Message("Ego", tick - 6, 0.0, state, sent[tick - 6], 100)
        inbox = (ReceivedMessage(back, frame.view.time),) if tick >= 6 else ()
        step = dataclasses.replace(frame.steps["Ego"], inbox=inbox)
        event = LinkEvent("Ego", "Ego", tick, frame.view.time, "delivered", frame.view.time + 0.3, "", 100)
        traveling.append(Frame(frame.view, {"Ego": step}, (), (event,)))
    assert len(snapshot_at(traveling, 5).own) == 0
    snapshot = snapshot_at(traveling, 40)
    assert snapshot.own is sent[34]
    assert (snapshot.heard, snapshot.links) == ((), ())


def heard_by_ego(frames: list[Frame], *messages: Message) -> tuple[ReceivedMessage, ...]:
    """What Ego holds in the end where it hears these, one after the other, from the first frame on."""
    knowledge = SnapshotBuilder("Ego")
    for frame, message in zip(frames, messages, strict=False):
        step = dataclasses.replace(frame.steps["Ego"], inbox=(ReceivedMessage(message, frame.view.time),))
        snapshot = knowledge.observe(Frame(frame.view, {"Ego": step}))
    return snapshot.heard


def test_who_tells_of_itself_is_still_known_to_see_others(street: Play) -> None:
    """A CAM has its sender as its only object, and takes no CPM's place."""
    frames = street(None)
    state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    seen = frames[0].steps["Ego"].detections
    report = Message("Rsu", 0, 0.0, state, seen, 100)
    itself = Message("Rsu", 1, 0.05, state, dataclasses.replace(seen.subset([0]), time=0.05), 100, "cam")
    heard = heard_by_ego(frames, report, itself)
    assert [(held.message.kind, len(held.message.detections)) for held in heard] == [("cpm", len(seen)), ("cam", 1)]


def test_objects_that_a_message_leaves_out_are_known_from_those_before(street: Play) -> None:
    frames = street(None)
    state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    one = frames[0].steps["Ego"].detections.subset([0])
    other = dataclasses.replace(one, time=0.05, boxes=one.boxes + np.eye(7)[0] * 20.0)
    parts = [
        Message("Rsu", n, now, state, held, 100, objects=(n,))
        for n, (now, held) in enumerate([(0.0, one), (0.05, other)])
    ]
    (known,) = heard_by_ego(frames, *parts)
    assert known.message.detections.tracks == (0, 1)


def test_conflict_area_and_roads_are_drawn_below_the_cars(street: Play) -> None:
    area = np.array([[29.0, 4.5], [32.0, 4.5], [32.0, 10.5], [29.0, 10.5]])
    lane = np.array([[0.0, -1.75], [60.0, -1.75], [60.0, 1.75], [0.0, 1.75]])
    roads = RoadDrawing(lanes=(("driving", lane),), markings=(("broken", "yellow", lane[:2]),))
    svg = top_view(snapshot_at(street(1), 40), WINDOW, roads=roads, conflict_areas=[area])
    (drawn,) = shapes(svg, "area")
    assert drawn == pytest.approx(area)
    assert svg.index('class="area"') < svg.index('class="received"') < svg.index('class="truth"')
    assert svg.index("M0.00 1.75L60.00 1.75L60.00 -1.75") < svg.index('class="area"')
    assert 'stroke="#f4c542" stroke-width="0.18" stroke-dasharray="3 3"' in svg


def test_roads_may_be_shared_by_many_pictures(street: Play) -> None:
    symbol = roads_symbol(RoadDrawing(), "roads-1")
    svg = top_view(snapshot_at(street(1), 40), WINDOW, roads_id="roads-1")
    assert 'id="roads-1"' in symbol
    assert '<use href="#roads-1"/>' in svg


def test_labels_are_names_unless_said_otherwise_and_escaped(street: Play) -> None:
    svg = top_view(snapshot_at(street(1), 40), WINDOW, labels={"Truck": "", "RSU": "mast <1> & more"})
    texts = [element.text for element in etree.fromstring(svg).iter(f"{SVG}text")]
    assert texts == ["Ego", "Incoming", "mast <1> & more", "t = 2.00 s"]


def test_window_around_points_has_a_margin() -> None:
    window = Window.around([(0.0, 1.0, 9.0), (10.0, 5.0, 9.0)], margin=2.0)
    assert window == Window(-2.0, 12.0, -1.0, 7.0)


def test_legend_is_well_formed() -> None:
    root = etree.fromstring(f"<div>{legend()}</div>")
    assert len(root) == 7
