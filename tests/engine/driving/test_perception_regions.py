"""Sensor information of CPMs, and the perception regions that a receiver derives from it."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace
from planned_drive import two_lane_road
from sample_car import CAR

from eidrive_scenario.base.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.communication.report_store import PerceptionRegionStore
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading
from eidrive_scenario.v2x.messages.asn1 import cpm_value
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.v2x.messages.point_cloud import compress
from eidrive_scenario.world.actor import ActorSpec

AHEAD = ViewSector(2.0, 0.0, 1.5, 0.0, math.radians(50.0), 60.0)
MAST = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))


def cpm(time: float, *, sensors: tuple[ViewSector, ...] | None, x: float = 10.0, yaw: float = 0.0) -> Message:
    state = StationState(time, x, 5.0, 0.0, yaw, 0.0)
    return Message("Helper", 0, time, state, Detections(time), 100, sensors=sensors)


def station(**settings: object) -> Agent:
    return build_agent(AgentSettings.model_validate({"fusion": "average", **settings}), MAST, None, seed=0, dt=0.05)


def sent(agent: Agent, seconds: float) -> list[Message]:
    """Return the messages of a station with nothing in sight."""
    messages: list[Message] = []
    for tick in range(round(seconds / 0.05)):
        now = tick * 0.05
        truth = TruthReading((), (), np.zeros((0, 7)), np.zeros((0, 2)), np.ones(0))
        ego = EgoState(now, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        messages += agent.act(Readings(now, ego, truth), (), now, None).outbox
    return messages


def test_region_is_placed_at_the_pose_of_the_sender() -> None:
    store = PerceptionRegionStore()
    store.add_message(cpm(2.0, sensors=(AHEAD,), yaw=math.pi / 2.0), 2.0)
    (region,) = store.newest(2.3)
    (sector,) = region.sectors
    assert (region.station, region.time) == ("Helper", 2.0)
    assert (sector.x, sector.y, sector.z) == pytest.approx((10.0, 7.0, 1.5))
    assert sector.yaw == pytest.approx(math.pi / 2.0)
    assert sector.contains(np.array([10.0, 10.0]), np.array([40.0, -40.0])).tolist() == [True, False]


def test_sensor_information_applies_to_later_messages_at_their_pose() -> None:
    store = PerceptionRegionStore()
    store.add_message(cpm(1.0, sensors=None), 1.0)
    assert store.newest(1.0) == (), "a sender without sensor information has no region"
    store.add_message(cpm(1.1, sensors=(AHEAD,)), 1.1)
    store.add_message(cpm(1.2, sensors=None, x=30.0), 1.2)
    (region,) = store.newest(1.2)
    assert (region.time, region.sectors[0].x) == (1.2, 32.0)


def test_region_expires_and_is_not_replaced_by_an_older_one() -> None:
    store = PerceptionRegionStore()
    store.add_message(cpm(2.0, sensors=(AHEAD,)), 2.0)
    store.add_message(cpm(1.5, sensors=(AHEAD,), x=90.0), 1.5)
    assert [region.sectors[0].x for region in store.newest(3.0)] == [12.0]
    assert store.newest(3.1) == ()


def test_region_of_a_fast_clock_expires_a_second_after_its_arrival() -> None:
    store = PerceptionRegionStore()
    store.add_message(cpm(7.0, sensors=(AHEAD,)), 2.0)
    assert len(store.newest(3.0)) == 1
    assert store.newest(3.1) == ()


def test_region_is_where_the_sender_was_at_its_measurement() -> None:
    """At 20 m/s along y it was 10 m back 0.5 s before."""
    store, message = PerceptionRegionStore(), cpm(2.0, sensors=(AHEAD,), yaw=math.pi / 2.0)
    store.add_message(replace(message, state=replace(message.state, speed=20.0), detections=Detections(1.5)), 2.0)
    (region,) = store.newest(2.0)
    assert region.time == 1.5
    assert (region.sectors[0].x, region.sectors[0].y) == pytest.approx((10.0, 7.0 - 10.0))


def test_predictions_between_two_scans_do_not_renew_the_region() -> None:
    """A tracked sensor with one reading in 2 s: the region of the only reading at 0 s ends after 1 s."""
    rsu, store = station(sensors={"truth": {"rate": 0.5}}, tracker="cv"), PerceptionRegionStore()
    box = np.array([[15.0, 20.0, 0.75, 4.9, 1.8, 1.5, 0.0]])
    times = []
    for tick in range(30):
        now = tick * 0.05
        truth = None if tick else TruthReading(("Car",), ("car",), box, np.zeros((1, 2)), np.ones(1))
        ego = EgoState(now, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for message in rsu.act(Readings(now, ego, truth), (), now, None).outbox:
            store.add_message(message, now)
        times.append([region.time for region in store.newest(now)])
    assert times == [[0.0]] * 21 + [[]] * 9


def test_cam_has_no_region() -> None:
    store = PerceptionRegionStore()
    state = StationState(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    store.add_message(Message("Helper", 0, 1.0, state, Detections(1.0), 100, "cam", sensors=(AHEAD,)), 1.0)
    assert store.newest(1.0) == ()


def test_station_without_sensors_covers_nothing() -> None:
    store = PerceptionRegionStore()
    store.add_message(cpm(1.0, sensors=()), 1.0)
    assert store.newest(1.0) == ()


def test_each_message_without_generation_rules_has_the_sectors_of_the_detector() -> None:
    messages = sent(station(range=70.0, field_of_view=120.0), 0.5)
    assert len(messages) == 10
    for message in messages:
        assert message.sensors is not None
        (sector,) = message.sensors
        assert sector.range == 70.0
        assert sector.half_angle == pytest.approx(math.radians(60.0))


def test_sensor_information_is_sent_once_per_second_by_the_rules_of_etsi() -> None:
    """T_AddSensorInformation of ETSI TS 103 324 is 1 s."""
    messages = sent(station(generation="etsi"), 3.2)
    times = [message.generated for message in messages if message.sensors is not None]
    assert np.diff(times).tolist() == pytest.approx([1.0] * (len(times) - 1), abs=0.05)
    assert len(times) >= 3


@pytest.mark.parametrize("settings", [{}, {"generation": "etsi"}])
def test_cpm_lists_sensors_from_the_first_result_of_the_detector_on(settings: dict[str, str]) -> None:
    """Its sectors count as perceived: before, no object in them is reported."""
    messages = sent(station(detector_latency=0.9, **settings), 2.5)
    first = min(message.generated for message in messages if message.sensors is not None)
    assert 0.9 <= first + 1e-9 <= 1.05


def test_cpm_lists_only_sensors_that_perceive_objects() -> None:
    """The size is 121 + 35 (S + O) bytes (Thandavarayan et al. 2019): GNSS and IMU have no detection area."""
    (message,) = sent(station(localization="ekf"), 0.05)
    assert message.size == 121 + 35 * (1 + len(message.detections))


def test_encoded_sensor_has_range_and_opening_angles() -> None:
    """Units of TR 103 562: 0.1 m, and 0.1 degree counter-clockwise from the axis of the station."""
    value = cpm_value(cpm(1.0, sensors=(AHEAD,)), "car")
    (sensor,) = value["cpm"]["cpmParameters"]["sensorInformationContainer"]
    (properties,) = sensor["detectionArea"][1]["vehicleSensorPropertyList"]
    assert properties == {
        "range": 600,
        "horizontalOpeningAngleStart": 3100,
        "horizontalOpeningAngleEnd": 500,
    }


def test_message_with_shared_points_has_a_region(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the first message of a second lists the sensors, and may be the one with the points."""
    settings = AgentSettings.model_validate({"fusion": "average", "planner": "behavior", "target_speed": 5.0})
    settings = settings.model_copy(update={"planner_settings": BehaviorSettings(caution=True)})
    agent = build_agent(settings, CAR, two_lane_road(), seed=0, dt=0.05)
    seen: list[PerceptionRegion] = []
    assert agent.planner is not None
    monkeypatch.setattr(agent.planner, "observe_regions", seen.extend)
    monkeypatch.setattr(agent, "sharing", SimpleNamespace(add=lambda *_: None, perceive=lambda *_: None, own=()))
    points = compress(np.zeros((1, 3)), 0.0, 0.1)
    message = replace(cpm(0.0, sensors=(AHEAD,)), points=points)
    truth = TruthReading((), (), np.zeros((0, 7)), np.zeros((0, 2)), np.ones(0))
    ego = EgoState(0.0, np.array([20.0, -1.75, 0.0]), 0.0, 0.0, 0.0, 5.0, 0.0, 0.0)
    agent.act(Readings(0.0, ego, truth), (ReceivedMessage(message, 0.0),), 0.0, None)
    assert [region.station for region in seen] == ["Helper"]
