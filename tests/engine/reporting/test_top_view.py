"""Top views: well-formed SVG with shapes at expected positions."""

from __future__ import annotations

import re
from collections.abc import Callable

import msgspec
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
    builder = SnapshotBuilder("Ego")
    return [builder.observe(frame) for frame in frames[: tick + 1]][-1]


def shapes(svg: str, kind: str) -> list[np.ndarray]:
    """Return the corners (M, 2) of the paths of a class in world coordinates."""
    found = []
    for element in etree.fromstring(svg).iter(f"{SVG}path"):
        if element.get("class") == kind:
            numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", element.get("d") or "")]
            found.append(np.array(numbers).reshape(-1, 2) * (1, -1))
    return found


def test_top_view_box_equals_window_with_y_upwards(street: Play) -> None:
    root = etree.fromstring(top_view(snapshot_at(street(1), 40), WINDOW))
    assert root.get("viewBox") == "-5.00 -45.00 55.00 57.00"
    assert root.findtext(f"{SVG}title") == "top view at 2.00 s with the detections of Ego"


def test_top_view_draws_truth_as_outline_of_each_vehicle(street: Play) -> None:
    svg = top_view(snapshot_at(street(None), 40), WINDOW)
    ego, incoming, truck = shapes(svg, "truth")
    assert ego.mean(axis=0) == pytest.approx([16.0, 0.0], abs=0.01)
    assert np.ptp(ego, axis=0) == pytest.approx([4.89, 1.84], abs=0.02)
    assert incoming.mean(axis=0) == pytest.approx([29.5, 11.5], abs=0.01)
    assert np.ptp(incoming, axis=0) == pytest.approx([1.84, 4.89], abs=0.02)
    assert np.ptp(truck, axis=0) == pytest.approx([2.89, 8.47], abs=0.02)


def test_top_view_draws_mast_as_dot(street: Play) -> None:
    circle = etree.fromstring(top_view(snapshot_at(street(None), 40), WINDOW)).find(f"{SVG}circle[@class='truth']")
    assert circle is not None
    assert (circle.get("cx"), circle.get("cy")) == ("42.20", "6.00")


def test_top_view_separates_own_and_received_boxes(street: Play) -> None:
    svg = top_view(snapshot_at(street(1), 40), WINDOW)
    assert len(shapes(svg, "own")) == 1
    received = sorted(shapes(svg, "received"), key=lambda corners: corners.mean(axis=0)[0])
    assert [tuple(np.round(corners.mean(axis=0), 1)) for corners in received] == [(25.4, 5.6), (29.5, 12.2)]


def test_top_view_of_late_message_shows_former_position(street: Play) -> None:
    """Six ticks at 14 m/s are 4.2 m."""
    svg = top_view(snapshot_at(street(6), 40), WINDOW)
    late = max(shapes(svg, "received"), key=lambda corners: corners.mean(axis=0)[1])
    assert late.mean(axis=0) == pytest.approx([29.5, 11.5 + 4.2], abs=0.01)


def test_top_view_links_connect_sender_and_receiver(street: Play) -> None:
    for lost, outcome in ((frozenset[int](), "delivered"), (frozenset({39}), "lost")):
        root = etree.fromstring(top_view(snapshot_at(street(1, lost), 40), WINDOW))
        (line,) = root.iter(f"{SVG}line")
        assert line.get("class") == f"link {outcome}"
        assert (line.get("x1"), line.get("y1")) == ("42.20", "6.00")
        assert float(line.get("y2") or "nan") == 0.0


def test_top_view_without_channel_has_no_received_boxes(street: Play) -> None:
    svg = top_view(snapshot_at(street(None), 40), WINDOW)
    assert not shapes(svg, "received")
    assert not list(etree.fromstring(svg).iter(f"{SVG}line"))


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


def test_top_view_draws_area_and_roads_below_cars(street: Play) -> None:
    area = np.array([[29.0, 4.5], [32.0, 4.5], [32.0, 10.5], [29.0, 10.5]])
    lane = np.array([[0.0, -1.75], [60.0, -1.75], [60.0, 1.75], [0.0, 1.75]])
    roads = RoadDrawing(lanes=(("driving", lane),), markings=(("broken", "yellow", lane[:2]),))
    svg = top_view(snapshot_at(street(1), 40), WINDOW, roads=roads, conflict_areas=[area])
    (drawn,) = shapes(svg, "area")
    assert drawn == pytest.approx(area)
    assert svg.index('class="area"') < svg.index('class="received"') < svg.index('class="truth"')
    assert svg.index("M0.00 1.75L60.00 1.75L60.00 -1.75") < svg.index('class="area"')
    assert 'stroke="#f4c542" stroke-width="0.18" stroke-dasharray="3 3"' in svg


def test_top_view_references_shared_roads(street: Play) -> None:
    symbol = roads_symbol(RoadDrawing(), "roads-1")
    svg = top_view(snapshot_at(street(1), 40), WINDOW, roads_id="roads-1")
    assert 'id="roads-1"' in symbol
    assert '<use href="#roads-1"/>' in svg


def test_top_view_labels_are_names_by_default_and_escaped(street: Play) -> None:
    svg = top_view(snapshot_at(street(1), 40), WINDOW, labels={"Truck": "", "RSU": "mast <1> & more"})
    texts = [element.text for element in etree.fromstring(svg).iter(f"{SVG}text")]
    assert texts == ["Ego", "Incoming", "mast <1> & more", "t = 2.00 s"]


def test_window_enclosing_points_has_margin() -> None:
    window = Window.enclosing([(0.0, 1.0, 9.0), (10.0, 5.0, 9.0)], margin=2.0)
    assert window == Window(-2.0, 12.0, -1.0, 7.0)


def test_legend_is_well_formed() -> None:
    root = etree.fromstring(f"<div>{legend()}</div>")
    assert len(root) == 7
