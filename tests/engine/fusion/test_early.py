"""Early fusion of lidar points."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from cell_detector import CellDetector
from msgspec.structs import replace
from scenario_1 import FrameCollector, edited, simulate

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.fusion.early import EarlyFusion, EarlyFusionSettings
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.sensing.readings import EgoState, LidarReading, Readings
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.v2x.messages.message import ReceivedMessage
from eidrive_scenario.v2x.messages.point_cloud import HEADER_BYTES, PointCloud
from eidrive_scenario.world.actor import ActorSpec

EGO = ActorSpec("Ego", "car", "car", (4.6, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.85, max_steering=0.6)
RSU = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))
HIGH = 1.9
CAR = (20.0, 4.0)


def pose(x: float, y: float, yaw: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    matrix[:3, 3] = x, y, HIGH
    return matrix


def ground() -> np.ndarray:
    x, y = np.meshgrid(np.arange(-8.0, 40.0, 0.8), np.arange(-12.0, 12.0, 0.8))
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


def car(x: float, y: float, sides: str, length: float = 4.5) -> np.ndarray:
    """Return points on the sides (f, b, l, r) of a car with heading x, 1.8 m wide and 1.5 m high."""
    end = length / 2.0
    along, across, up = np.arange(-end, end + 0.01, 0.15), np.arange(-0.9, 0.91, 0.15), np.arange(0.2, 1.5, 0.15)
    faces = {
        "l": [(a, 0.9, z) for a in along for z in up],
        "r": [(a, -0.9, z) for a in along for z in up],
        "f": [(end, a, z) for a in across for z in up],
        "b": [(-end, a, z) for a in across for z in up],
    }
    points = np.concatenate([np.array(faces[side]) for side in sides])
    return np.asarray(points + np.array([x, y, 0.0]))


def readings(time: float, at: tuple[float, float, float], *objects: np.ndarray, height: float = 0.0) -> Readings:
    """Return lidar readings at x, y, yaw of these points and of the ground, shifted by `height`."""
    sensor = pose(*at)
    points = (np.concatenate([ground(), *objects]) - sensor[:3, 3]) @ sensor[:3, :3]
    sensor[2, 3] += height
    lidar = LidarReading(points, np.ones(len(points)), sensor)
    ego = EgoState(time, np.array([at[0], at[1], height]), at[2], 0.0, 0.0, 0.0, 0.0, 0.0)
    return Readings(time, ego, lidars={"lidar": lidar})


def agent(spec: ActorSpec, **more: object) -> Agent:
    settings = {"fusion": "early", "detector": "lidar", "tracker": "none", **more}
    return build_agent(AgentSettings.model_validate(settings), spec, None, seed=0, dt=0.05)


def test_early_fusion_is_registered_as_entry_point() -> None:
    assert registry("fusion").load("early") is EarlyFusion


def test_merge_readings_keeps_world_positions_of_received_points() -> None:
    fusion = EarlyFusion(EarlyFusionSettings(cell=0.05))
    other = readings(0.0, (40.0, -5.0, 2.5), car(*CAR, "f"))
    (cloud,) = fusion.payloads(other, 1400)
    assert isinstance(cloud, PointCloud)
    own = readings(0.0, (1.0, 2.0, 0.3))
    fusion.add_payload("RSU", cloud, np.array([100.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0]))
    merged = fusion.merge_readings(own).lidars["lidar"]
    world = merged.world_points
    count = len(own.lidars["lidar"].points)
    np.testing.assert_array_equal(merged.points[:count], own.lidars["lidar"].points)
    np.testing.assert_allclose(world[count:], cloud.points(), atol=1e-9)
    assert len(merged.intensity) == len(merged.points)
    assert fusion.payloads(Readings(0.0, own.ego), 1400) == ()


def test_early_fusion_detects_car_in_received_points_without_forwarding_it() -> None:
    ego, rsu = agent(EGO), agent(RSU)
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None).outbox
    assert sent[0].points is not None
    assert sent[0].size == 121 + 35 * (1 + len(sent[0].detections)) + sent[0].points.size > 1000
    step = ego.act(readings(0.05, (0.0, 0.0, 0.0)), [ReceivedMessage(sent[0], 0.05)], 0.05, None)
    assert len(step.detections) == 0
    assert len(step.outbox[0].detections) == 0, "objects in the own points only"
    assert len(step.fused) == 1
    assert math.dist(step.fused.boxes[0, :2], CAR) < 0.5


def test_station_shares_the_points_of_its_last_revolution() -> None:
    """Half a revolution in each tick: the car is in the first half, and the message follows the second one."""
    rsu = agent(RSU, sensors={"lidar": {"rotation": 10.0}}, message_rate=10.0, message_phase=0.05)
    rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None)
    (message,) = rsu.act(readings(0.05, (40.0, 12.0, math.pi)), (), 0.05, None).outbox
    assert message.points is not None
    assert (message.points.points()[:, 2] > 0.15).sum() > 100


def test_station_sends_the_points_of_a_revolution_once() -> None:
    """The lidar has 10 Hz, and there is a message in each tick of 0.05 s."""
    rsu, at = agent(RSU, sensors={"lidar": {"rate": 10.0}}), (40.0, 12.0, math.pi)
    sent = []
    for tick in range(4):
        given = readings(0.05 * tick, at, car(*CAR, "fl"))
        given = given if tick % 2 == 0 else replace(given, lidars={})
        (message,) = rsu.act(given, (), 0.05 * tick, None).outbox
        sent.append(message.points is not None)
    assert sent == [True, False, True, False]


def test_station_shares_the_points_of_all_lidars_at_different_rates() -> None:
    """The lidar with 10 Hz, which alone shows the car, has no reading in the ticks of the messages."""
    rsu = agent(RSU, sensors={"front": {"kind": "lidar"}, "rear": {"kind": "lidar", "rate": 10.0}}, message_rate=10.0)
    ego, at, durations = agent(EGO), (40.0, 12.0, math.pi), []
    for tick in range(-1, 6):
        now = 0.05 * tick
        given = {"front": readings(now, at).lidars["lidar"]}
        if tick % 2:
            given["rear"] = readings(now, at, car(*CAR, "fl")).lidars["lidar"]
        sent = rsu.act(replace(readings(now, at), lidars=given), (), now, None).outbox
        if tick % 2 == 0:
            (message,) = sent
            assert message.points is not None
            durations.append(message.points.duration)
            fused = ego.act(readings(now, (0.0, 0.0, 0.0)), [ReceivedMessage(message, now)], now, None).fused
            assert np.linalg.norm(fused.boxes[:, :2] - CAR, axis=1).tolist() == pytest.approx([0.0], abs=0.5)
    assert durations == [0.05] * 3


def test_points_of_earlier_messages_are_not_merged_again() -> None:
    """The received points show one car that moves by 6 m while the lidar of the ego completes its revolution."""
    ego, rsu = agent(EGO, sensors={"lidar": {"rotation": 10.0}}), agent(RSU)
    for now, x in ((0.0, 20.0), (0.05, 26.0)):
        sent = rsu.act(readings(now, (40.0, 12.0, math.pi), car(x, 4.0, "fl")), (), now, None).outbox[0]
        ego.act(readings(now + 0.05, (0.0, 0.0, 0.0)), [ReceivedMessage(sent, now)], now + 0.05, None)
        (detected,) = (report.detections for report in ego.reports if report.station == "Ego")
        assert detected.boxes[:, 0].tolist() == pytest.approx([x], abs=0.5)


def test_early_fusion_separates_far_cars_in_adjacent_lanes() -> None:
    """Both are near a unit and 76 m from the ego, where the columns of the ego rays are 3 m apart."""
    cars = (76.0, 4.0), (76.0, 7.2)
    ego, rsu = agent(EGO, sensors={"lidar": {"range": 100.0}}), agent(RSU)
    points = [car(*position, "fblr") for position in cars]
    sent = rsu.act(readings(0.0, (96.0, 5.6, math.pi), *points), (), 0.0, None).outbox
    fused = ego.act(readings(0.05, (0.0, 0.0, 0.0)), [ReceivedMessage(sent[0], 0.05)], 0.05, None).fused
    centers = sorted(map(tuple, fused.boxes[:, :2].tolist()))
    assert len(centers) == 2
    assert max(map(math.dist, centers, sorted(cars))) < 0.3


def test_early_fusion_box_from_several_sides_is_more_accurate() -> None:
    """The ego measures the rear, the unit the front and the left side of a long car."""
    ego, rsu = agent(EGO), agent(RSU)
    rear = car(*CAR, "b", 5.4)
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl", 5.4)), (), 0.0, None).outbox
    alone = agent(EGO).act(readings(0.05, (0.0, 4.0, 0.0), rear), (), 0.05, None).fused
    both = ego.act(readings(0.05, (0.0, 4.0, 0.0), rear), [ReceivedMessage(sent[0], 0.05)], 0.05, None).fused
    assert len(alone) == len(both) == 1
    assert math.dist(both.boxes[0, :2], CAR) < 0.1 < math.dist(alone.boxes[0, :2], CAR)
    assert both.boxes[0, 3] == pytest.approx(5.4, abs=0.1)


@pytest.mark.parametrize(("height", "timeout"), [(0.0, None), (60.0, None), (-20.0, None), (0.0, 0.1)])
def test_early_fusion_ignores_ego_body_in_received_points(height: float, timeout: float | None) -> None:
    """The ego drives at 15 m/s, and the point cloud is 0.3 s old; roads have any height."""
    ego, rsu = agent(EGO, report_timeout=timeout), agent(RSU)
    here = [readings(0.05 * tick, (0.75 * tick, 0.0, 0.0), height=height) for tick in range(8)]
    body = car(EGO.offset[0], 0.0, "fblr")
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), body, height=height), (), 0.0, None).outbox[0]
    for tick, given in enumerate(here[:-1]):
        ego.act(given, (), 0.05 * tick, None)
    assert len(ego.act(here[-1], [ReceivedMessage(sent, 0.35)], 0.35, None).fused) == 0


def test_early_fusion_ignores_ego_body_in_all_points_of_a_revolution() -> None:
    """The ego drives 1 m in a tick; a lidar shows its rear in one half of the revolution and its front in the other."""
    ego, rsu = agent(EGO), agent(RSU, sensors={"lidar": {"rotation": 10.0}})
    for tick in range(8):
        now, x = 0.05 * tick, float(tick)
        body = car(x + EGO.offset[0], 0.0, "fblr")
        half = body[(body[:, 0] < x + EGO.offset[0]) == (tick % 2 == 0)]
        (sent,) = rsu.act(readings(now, (40.0, 12.0, math.pi), half), (), now, None).outbox
        plain = replace(sent, detections=Detections(now))
        fused = ego.act(readings(now, (x, 0.0, 0.0)), [ReceivedMessage(plain, now)], now, None).fused
        assert len(fused) == 0


def test_early_fusion_ignores_old_points_and_keeps_the_newest() -> None:
    ego, rsu = agent(EGO, fusion_settings={"max_lateness": 0.2}), agent(RSU)
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None).outbox[0]
    old = replace(sent, detections=Detections(0.0))
    new = rsu.act(readings(0.1, (40.0, 12.0, math.pi)), (), 0.1, None).outbox[0]
    assert len(ego.act(readings(0.2, (0.0, 0.0, 0.0)), [ReceivedMessage(old, 0.2)], 0.2, None).fused) == 1
    assert len(ego.act(readings(0.25, (0.0, 0.0, 0.0)), (), 0.25, None).outbox) == 1
    assert len(ego.act(readings(0.3, (0.0, 0.0, 0.0)), [ReceivedMessage(old, 0.3)], 0.3, None).fused) == 0
    fresh = agent(EGO)
    step = fresh.act(readings(0.2, (0.0, 0.0, 0.0)), [ReceivedMessage(new, 0.15), ReceivedMessage(old, 0.2)], 0.2, None)
    assert len(step.fused) == 0


def test_boxes_of_a_station_are_fused_while_its_points_are_too_old() -> None:
    """The points show the car 20 m ahead and the box shows it 50 m ahead, so that a fused object has one source."""
    ego, rsu = agent(EGO, fusion_settings={"max_lateness": 0.2, "max_age": 1.0}), agent(RSU)
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None).outbox[0]
    box = replace(sent.detections, boxes=sent.detections.boxes + np.array([30.0, *[0.0] * 6]))
    inbox = {0.1: [ReceivedMessage(replace(sent, detections=box), 0.1)]}
    fused = {}
    for tick in range(2, 22):
        now = 0.05 * tick
        step = ego.act(readings(now, (0.0, 0.0, 0.0)), inbox.get(now, ()), now, None)
        fused[tick] = [round(x, -1) for x in step.fused.boxes[:, 0].tolist()]
        assert step.expired == ()
    assert [fused[tick] for tick in (2, 4)] == [[20.0], [20.0]]
    assert [fused[tick] for tick in (10, 20, 21)] == [[50.0], [50.0], []]
    late = agent(EGO, fusion_settings={"max_lateness": 0.2}).act(
        readings(0.4, (0.0, 0.0, 0.0)), [ReceivedMessage(replace(sent, detections=box), 0.4)], 0.4, None
    )
    assert [round(x, -1) for x in late.fused.boxes[:, 0].tolist()] == [50.0]


def test_boxes_of_a_station_are_fused_until_its_points_are_merged() -> None:
    """The own lidar has no reading in the tick in which the points arrive; places as above."""
    ego, rsu = agent(EGO), agent(RSU)
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None).outbox[0]
    box = replace(sent.detections, boxes=sent.detections.boxes + np.array([30.0, *[0.0] * 6]))
    received = ReceivedMessage(replace(sent, detections=box), 0.05)
    waiting = ego.act(replace(readings(0.05, (0.0, 0.0, 0.0)), lidars={}), [received], 0.05, None).fused
    merged = ego.act(readings(0.1, (0.0, 0.0, 0.0)), (), 0.1, None).fused
    assert [round(x, -1) for fused in (waiting, merged) for x in fused.boxes[:, 0].tolist()] == [50.0, 20.0]


def test_objects_in_merged_points_arrive_with_the_own_message() -> None:
    """A channel with own perception delays what the station detects; the message has objects in its own points only."""
    ego, rsu = agent(EGO), agent(RSU)
    sent = rsu.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None).outbox[0]
    inbox, fused = [ReceivedMessage(sent, 0.05)], []
    for tick in range(1, 5):
        now = 0.05 * tick
        step = ego.act(readings(now, (0.0, 0.0, 0.0)), inbox, now, None, own_perception=True)
        fused.append(step.fused.boxes[:, :2])
        (own,) = step.outbox
        assert len(own.detections) == 0
        inbox = [ReceivedMessage(own, now + 0.05)] if tick < 3 else []
    assert [len(boxes) for boxes in fused] == [0, 1, 1, 1]
    assert math.dist(fused[1][0], CAR) < 0.5


@pytest.mark.parametrize("senders", [(), (100.0, 110.0)])
def test_boxes_of_a_station_beyond_the_grid_of_the_detector_are_fused(senders: tuple[float, ...]) -> None:
    """The grid ends 51.2 m from the ego; points of the station are merged, and it reports cars 40 m and 60 m ahead.
    Others that report themselves change nothing about that."""
    fusion, detector = EarlyFusion(), CellDetector()
    fusion.setup(detector)
    own = readings(0.0, (0.0, 0.0, 0.0))
    detector.detect(own)
    far = readings(0.0, (50.0, 0.0, 0.0))
    boxes = np.array([[x, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0] for x in (40.0, 60.0)])
    seen = Detections(0.0, boxes, np.ones(2), ("car",) * 2, np.zeros((2, 2)), np.tile(0.1 * np.eye(2), (2, 1, 1)))
    fusion.add_payload("RSU", fusion.payloads(far, 1400)[0], np.zeros(7))
    fusion.merge_readings(own)
    reports = [Report("RSU", seen, 0.0)]
    for x in senders:
        itself = replace(seen.subset([0]), boxes=boxes[:1] + np.array([x - 40.0, *[0.0] * 6]))
        reports.append(Report(f"{x} itself", itself, 0.0, describes_sender=True))
    for report in reports:
        fusion.add_report(report)
    assert sorted(fusion.fuse(reports, 0.0).boxes[:, 0].tolist()) == [60.0, *senders]


def test_points_of_the_far_future_do_not_replace_later_ones() -> None:
    ego, rsu, ahead = agent(EGO), agent(RSU), agent(RSU, clock_offset=3.0)
    at = (40.0, 12.0, math.pi)
    hostile = ahead.act(readings(0.0, at, car(10.0, -6.0, "fl")), (), 0.0, None).outbox[0]
    sent = rsu.act(readings(0.1, at, car(*CAR, "fl")), (), 0.1, None).outbox[0]
    ego.act(readings(0.1, (0.0, 0.0, 0.0)), [ReceivedMessage(hostile, 0.1)], 0.1, None)
    fused = ego.act(readings(0.2, (0.0, 0.0, 0.0)), [ReceivedMessage(sent, 0.2)], 0.2, None).fused
    assert len(fused) == 1
    assert math.dist(fused.boxes[0, :2], CAR) < 0.5


def test_early_fusion_uses_boxes_of_stations_without_points() -> None:
    ego, plain = agent(EGO), agent(RSU, fusion="covariance_intersection")
    sent = plain.act(readings(0.0, (40.0, 12.0, math.pi), car(*CAR, "fl")), (), 0.0, None).outbox[0]
    assert sent.points is None
    fused = ego.act(readings(0.05, (0.0, 0.0, 0.0)), [ReceivedMessage(sent, 0.05)], 0.05, None).fused
    assert len(fused) == 1


def test_early_fusion_without_lidar_detector_raises() -> None:
    with pytest.raises(
        SettingError, match=r"fusion method 'early' shares points, which detector 'oracle' does not read"
    ):
        agent(EGO, detector="oracle")


EARLY = ('name="fusion" value="average"/>', 'name="fusion" value="early"/>')


@pytest.mark.parametrize(
    ("replacement", "expected"),
    [
        (EARLY, "detector 'oracle' does not read"),
        ((EARLY[0], 'name="fusion" value="erly"/>'), "did you mean 'early'"),
        (
            (EARLY[0], EARLY[1].replace("early", "covariance_intersection") + '<Property name="fusion_settings" '
             'value="{gaet: 0.9}"/>'),
            "did you mean 'gate'",
        ),
        (
            (EARLY[0], EARLY[1].replace("early", "covariance_intersection") + '<Property name="fusion_settings" '
             'value="{gate: 1.3}"/>'),
            "less than 1",
        ),
        ((EARLY[0], EARLY[0] + '<Property name="fusion_settings" value="{gate: 0.9}"/>'), "has no settings"),
    ],
)  # fmt: skip
def test_fusion_with_invalid_settings_raises_with_file_and_line(
    replacement: tuple[str, str], expected: str, tmp_path: Path
) -> None:
    path = edited(tmp_path, replacement)
    with pytest.raises(InputError, match=expected) as caught:
        Simulation(load_scenario(path), seed=1)
    diagnostic = caught.value.diagnostics[0]
    assert diagnostic.source == str(path)
    assert "fusion" in path.read_text().splitlines()[(diagnostic.line or 0) - 1]


def test_run_with_early_fusion_detects_the_hidden_car(tmp_path: Path) -> None:
    """Messages contain the size of the points, and the car behind the truck is in the fused objects."""
    path = edited(tmp_path, EARLY)
    collector = FrameCollector()
    simulate(path, "ideal", collector, detector="lidar", time_limit=1.0)
    frames = collector.frames
    sizes = [link.size for frame in frames for link in frame.links]
    assert min(sizes) > HEADER_BYTES + 3000
    last = frames[-1]
    truth = last.view.boxes[last.view.rows["Incoming"], :2]
    assert np.linalg.norm(last.steps["Ego"].fused.boxes[:, :2] - truth, axis=1).min() < 1.0
