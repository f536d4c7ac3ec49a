"""Agents of stations: perception, messages, fusion and control."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent, station_sensors
from eidrive_scenario.driving.planning.conflict_area import ConflictAreaSettings
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import SettingError
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.messages.message import ReceivedMessage
from eidrive_scenario.v2x.profile import build_channel, load_profile
from eidrive_scenario.world.actor import ActorSpec

DT = 0.05
RSU = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))
Place = tuple[float, float]


def readings(time: float, at: Place, *objects: Place, speed: float = 0.0, due: bool = True) -> Readings:
    """A station at a place, heading east, that has cars at these places in sight."""
    count = len(objects)
    boxes = np.array([(x, y, 0.745, 4.892, 1.837, 1.49, 0.0) for x, y in objects]).reshape(count, 7)
    truth = TruthReading(
        tuple(f"Car{index}" for index in range(count)), ("car",) * count, boxes, np.zeros((count, 2)), np.ones(count)
    )
    ego = EgoState(time, np.array([*at, 0.0]), 0.0, 0.0, 0.0, speed, 0.0, 0.0)
    return Readings(time, ego, truth if due else None)


def agent(spec: ActorSpec, **settings: object) -> Agent:
    parsed = AgentSettings.model_validate({"fusion": "average", **settings})
    return build_agent(parsed, spec, None, seed=0, dt=DT)


class Cooperation:
    """Ego and RSU on a channel, in the order of a run: deliver, act, send."""

    def __init__(self, car: ActorSpec, channel: str | None, seed: int = 0, **ego: object) -> None:
        profile = load_profile(channel) if channel is not None else None
        self.channel: Channel | None = build_channel(profile, seed)
        self.own_perception = self.channel is not None and self.channel.own_perception
        self.agents = {"Ego": agent(car, **ego), "RSU": agent(RSU)}
        self.tick = 0

    def step(self, seen: Mapping[str, tuple[Place, ...]], ego_at: Place = (0.0, 0.0)) -> dict[str, AgentStep]:
        now = self.tick * DT
        places = {"Ego": ego_at, "RSU": (30.0, -6.0)}
        steps = {
            name: agent.act(
                readings(now, places[name], *seen.get(name, ())),
                self.channel.deliver(name, now) if self.channel is not None else (),
                now,
                None,
                own_perception=self.own_perception,
            )
            for name, agent in self.agents.items()
        }
        if self.channel is not None:
            for name, step in steps.items():
                receivers = [
                    receiver
                    for receiver, agent in self.agents.items()
                    if agent.receives_from(name, own_perception=self.own_perception)
                ]
                for message in step.outbox:
                    self.channel.send(message, receivers, now)
        self.tick += 1
        return steps


HIDDEN, OPEN = (30.0, 20.0), (15.0, 0.0)


def known(step: AgentStep) -> list[Place]:
    return sorted((round(x, 6), round(y, 6)) for x, y in step.fused.boxes[:, :2].tolist())


@pytest.mark.parametrize("fusion", ["average", "covariance_intersection"])
def test_arrays_of_fused_reported_and_sent_objects_are_read_only(fusion: str, car: ActorSpec) -> None:
    """A planner or fusion method that computes in place would change the messages and the recording."""
    cooperation = Cooperation(car, "{model: composed}", fusion=fusion)
    for _ in range(2):
        steps = cooperation.step({"Ego": (OPEN,), "RSU": (HIDDEN, (0.0, 0.0))})
    ego = steps["Ego"]
    reports = [report.detections for report in cooperation.agents["Ego"].reports]
    assert len(reports) == 2
    for detections in (ego.fused, ego.detections, *reports, *(message.detections for message in ego.outbox)):
        for array in (detections.boxes, detections.scores, detections.velocity, detections.covariance):
            assert not array.flags.writeable


def test_ideal_channel_delivers_detections_of_others_in_next_tick(car: ActorSpec) -> None:
    cooperation = Cooperation(car, "{model: composed}")
    assert known(cooperation.step({"Ego": (OPEN,), "RSU": (HIDDEN,)})["Ego"]) == [OPEN]
    assert known(cooperation.step({"Ego": (OPEN,), "RSU": ()})["Ego"]) == [OPEN, HIDDEN]
    assert known(cooperation.step({"Ego": (OPEN,), "RSU": ()})["Ego"]) == [OPEN], "an empty report is news too"


def test_channel_without_delay_and_loss_equals_shared_memory_of_last_tick(car: ActorSpec) -> None:
    rng = np.random.default_rng(1)
    cooperation = Cooperation(car, "{loss: {kind: bernoulli, probability: 0.0}}")
    before: tuple[Place, ...] = ()
    for _ in range(60):
        own = tuple((float(x), 0.0) for x in range(10, 10 + 10 * rng.integers(0, 3), 10))
        other = tuple((float(x), 25.0) for x in range(10, 10 + 10 * rng.integers(0, 4), 10))
        step = cooperation.step({"Ego": own, "RSU": other})["Ego"]
        assert known(step) == sorted((*own, *before))
        before = other


def test_total_loss_equals_no_cooperation_exactly(car: ActorSpec) -> None:
    lossy = Cooperation(car, "{loss: {kind: bernoulli, probability: 1.0}}")
    alone = Cooperation(car, None)
    for tick in range(30):
        seen = {"Ego": (OPEN,) if tick % 3 else (), "RSU": (HIDDEN,)}
        first, second = lossy.step(seen)["Ego"], alone.step(seen)["Ego"]
        np.testing.assert_array_equal(first.fused.boxes, second.fused.boxes)
        assert first.control == second.control
        assert first.inbox == second.inbox == ()


def test_station_that_enters_late_sends_no_detections_from_before_its_entry() -> None:
    """The first detections are available after 0.3 s; until then nothing is measured."""
    rsu = agent(RSU, detector_latency=0.3)
    sent = [rsu.act(readings(6.0 + DT * tick, (0.0, 0.0), (9.0, 0.0)), (), 6.0 + DT * tick, None) for tick in range(8)]
    listed = [step.outbox[0].detections for step in sent]
    assert [len(detections) for detections in listed] == [0] * 6 + [1] * 2
    assert [detections.time for detections in listed] == pytest.approx([6.0] * 7 + [6.05])


def test_latency_delays_received_detections_only(car: ActorSpec) -> None:
    cooperation = Cooperation(car, "{delay: {kind: constant, seconds: 0.3}}")
    for tick in range(12):
        step = cooperation.step({"Ego": (OPEN,), "RSU": (HIDDEN,)})["Ego"]
        assert known(step) == ([OPEN] if tick < 6 else [OPEN, HIDDEN])


def test_own_perception_of_channel_is_delayed_like_received_detections(car: ActorSpec) -> None:
    cooperation = Cooperation(car, "{delay: {kind: constant, seconds: 0.3}, own_perception: true}")
    for tick in range(12):
        step = cooperation.step({"Ego": (OPEN,), "RSU": (HIDDEN,)})["Ego"]
        assert len(step.detections) == 1
        assert known(step) == ([] if tick < 6 else [OPEN, HIDDEN])


def test_own_cam_is_not_an_object_of_its_sender(car: ActorSpec) -> None:
    """A channel with own perception returns the CAMs of a station to it as well."""
    cooperation = Cooperation(car, "{model: composed, own_perception: true}", messages="cpm, cam")
    for _ in range(4):
        step = cooperation.step({"Ego": (OPEN,)})["Ego"]
    assert {received.message.kind for received in step.inbox if received.message.sender == "Ego"} == {"cpm", "cam"}
    assert known(step) == [OPEN]


def test_report_older_than_report_timeout_is_deleted(car: ActorSpec) -> None:
    cooperation = Cooperation(car, "{model: composed}")
    cooperation.step({"RSU": (HIDDEN,)})
    del cooperation.agents["RSU"]
    ages = [cooperation.tick * DT for _ in range(60) if known(cooperation.step({})["Ego"])]
    assert max(ages) == pytest.approx(2.30), "the tick counter is one on: last known at an age of 2.25 s of 2.28 s"
    short = Cooperation(car, "{model: composed}", report_timeout=0.2)
    short.step({"RSU": (HIDDEN,)})
    del short.agents["RSU"]
    assert [bool(known(short.step({})["Ego"])) for _ in range(6)] == [True] * 4 + [False] * 2


@pytest.mark.parametrize(
    ("delay", "settings", "used"),
    [
        (2.25, {}, True),
        (2.3, {}, False),
        (0.2, {"report_timeout": 0.2}, True),
        (0.25, {"report_timeout": 0.2}, False),
        (3.0, {"report_timeout": 4.0}, True),
        (2.25, {"fusion": "covariance_intersection"}, True),
        (2.3, {"fusion": "covariance_intersection"}, False),
        (0.25, {"fusion": "covariance_intersection", "fusion_settings": {"max_age": 0.2}}, False),
        (3.0, {"fusion": "covariance_intersection", "report_timeout": 4.0}, False),
    ],
)
def test_message_older_than_its_lifetime_on_arrival_is_expired(
    car: ActorSpec, delay: float, settings: dict[str, Any], used: bool
) -> None:
    cooperation = Cooperation(car, f"{{delay: {{kind: constant, seconds: {delay}}}}}", **settings)
    steps = [cooperation.step({"RSU": (HIDDEN,)})["Ego"] for _ in range(round(delay / DT) + 4)]
    for step in steps:
        assert step.expired == (() if used else tuple(range(len(step.inbox))))
        assert known(step) == ([HIDDEN] if used and step.inbox else [])
    assert [len(step.inbox) for step in steps[-4:]] == [1] * 4


def test_report_of_a_fast_clock_ends_with_its_lifetime_after_arrival(car: ActorSpec) -> None:
    """Its time of measurement lies a minute ahead, as does the end of its lifetime by that time."""
    ego, fast = agent(car, report_timeout=0.2), agent(RSU, clock_offset=60.0)
    (message,) = fast.act(readings(0.0, (30.0, -6.0), HIDDEN), (), 0.0, None).outbox
    inboxes = [(ReceivedMessage(message, 0.05),), *[()] * 5]
    steps = [
        ego.act(readings(0.05 * (1 + tick), (0.0, 0.0)), inboxes[tick], 0.05 * (1 + tick), None) for tick in range(6)
    ]
    assert [bool(known(step)) for step in steps] == [True] * 5 + [False]


def test_out_of_sequence_message_does_not_replace_newer_report(car: ActorSpec) -> None:
    ego, rsu = agent(car), agent(RSU)
    first, second = (
        rsu.act(readings(tick * DT, (30.0, -6.0), (30.0, 20.0 + tick)), (), tick * DT, None) for tick in (0, 1)
    )
    channel = build_channel(load_profile("{model: composed}"), 0)
    assert channel is not None
    channel.send(second.outbox[0], ["Ego"], 0.1)
    step = ego.act(readings(0.2, (0.0, 0.0)), channel.deliver("Ego", 0.2), 0.2, None)
    assert known(step) == [(30.0, 21.0)]
    channel.send(first.outbox[0], ["Ego"], 0.2)
    step = ego.act(readings(0.25, (0.0, 0.0)), channel.deliver("Ego", 0.25), 0.25, None)
    assert len(step.inbox) == 1
    assert known(step) == [(30.0, 21.0)]


def test_cooperates_with_selects_receivers(car: ActorSpec) -> None:
    for names, expected in ((["RSU"], [HIDDEN]), (["Spectator"], []), ([], []), (None, [HIDDEN])):
        cooperation = Cooperation(car, "{model: composed}", cooperates_with=names)
        cooperation.step({"RSU": (HIDDEN,)})
        step = cooperation.step({"RSU": (HIDDEN,)})["Ego"]
        assert known(step) == expected
        assert len(step.inbox) == len(expected)


def test_outbox_contains_own_detections_only(car: ActorSpec) -> None:
    """Otherwise a box would come back to its first reporter and count twice."""
    cooperation = Cooperation(car, "{model: composed}")
    for _ in range(5):
        steps = cooperation.step({"RSU": (HIDDEN,)})
    assert known(steps["Ego"]) == [HIDDEN]
    assert len(steps["Ego"].outbox[0].detections) == 0
    assert steps["Ego"].outbox[0].size == 121 + 35
    assert steps["RSU"].outbox[0].size == 121 + 70
    assert steps["RSU"].outbox[0].number == 4


@pytest.mark.parametrize("latency", [0.0, 0.3, 0.6])
def test_received_box_of_ego_body_is_ignored(car: ActorSpec, latency: float) -> None:
    """The RSU sees the ego at 15 m/s; even 9 m behind where it is by now, that box is not an obstacle."""
    cooperation = Cooperation(car, f"{{delay: {{kind: constant, seconds: {latency}}}}}")
    for tick in range(30):
        x = 15.0 * tick * DT
        center = (x + car.offset[0], car.offset[1])
        step = cooperation.step({"RSU": (center, HIDDEN)}, ego_at=(x, 0.0))["Ego"]
        assert known(step) in ([], [HIDDEN])
    assert known(step) == [HIDDEN]


def test_received_box_beside_or_behind_ego_is_kept(car: ActorSpec) -> None:
    """Half a meter of air between the bodies: centers 2.3 m apart across, 5.4 m along."""
    x = car.offset[0]
    for place in ((x, 2.337), (x, -2.337), (x - 5.392, 0.0), (x + 5.392, 0.0)):
        cooperation = Cooperation(car, "{model: composed}")
        cooperation.step({"RSU": (place,)})
        assert len(known(cooperation.step({"RSU": (place,)})["Ego"])) == 1


def test_last_detections_are_used_between_readings_until_timeout(car: ActorSpec) -> None:
    ego = agent(car, report_timeout=0.1)
    counts = [
        len(ego.act(readings(tick * DT, (0.0, 0.0), OPEN, due=tick == 0), (), tick * DT, None).fused)
        for tick in range(5)
    ]
    assert counts == [1, 1, 1, 0, 0]


def test_message_rate_sets_the_interval_of_messages(car: ActorSpec) -> None:
    ego = agent(car, message_rate=10, message_phase=0)
    said = [ego.act(readings(tick * DT, (0.0, 0.0)), (), tick * DT, None).outbox for tick in range(10)]
    assert [len(outbox) for outbox in said] == [1, 0] * 5
    assert [outbox[0].number for outbox in said if outbox] == [0, 1, 2, 3, 4]


def test_plan_and_control_depend_on_wheels_and_planner(car: ActorSpec) -> None:
    here = readings(0.0, (0.0, 0.0))
    mast = agent(RSU).act(here, (), 0.0, None)
    assert mast.plan is None
    assert mast.control is None
    parked = agent(car, planner="none").act(here, (), 0.0, None)
    assert parked.plan is None
    assert parked.control is not None
    assert parked.control.brake == 1.0
    moving = agent(car, target_speed=8.0, planner="route").act(here, (), 0.0, None)
    assert moving.plan is not None
    assert moving.control is not None
    assert moving.control.throttle == pytest.approx(3.5 / 5.0)
    with pytest.raises(SettingError, match="has no wheels"):
        agent(RSU, planner="route")


def test_received_object_in_conflict_area_brakes_with_conflict_deceleration(car: ActorSpec) -> None:
    cooperation = Cooperation(
        car,
        "{model: composed}",
        planner="conflict_area",
        target_speed=8.0,
        planner_settings=ConflictAreaSettings.model_validate(
            {"conflict_area": [29, 31, 18, 22], "conflict_deceleration": 4.5}
        ),
    )
    first = cooperation.step({"RSU": (HIDDEN,)})["Ego"]
    second = cooperation.step({"RSU": (HIDDEN,)})["Ego"]
    assert first.control is not None
    assert second.control is not None
    assert first.control.brake == 0.0
    assert second.control.brake == pytest.approx(4.5 / car.max_deceleration)
    assert second.control.throttle == 0.0


def test_rig_contains_sensors_that_the_detector_needs(car: ActorSpec) -> None:
    assert Rig(car, station_sensors(AgentSettings())).due(0.0).keys() == {"truth"}
    with pytest.raises(SettingError, match="needs a sensor of kind truth"):
        station_sensors(AgentSettings.model_validate({"sensors": "camera"}))


def test_message_contains_state_of_sender(car: ActorSpec) -> None:
    state = agent(car).act(readings(1.0, (3.0, 4.0), speed=7.0), (), 1.0, None).outbox[0].state
    assert (state.time, state.x, state.y, state.yaw, state.speed) == (1.0, 3.0, 4.0, 0.0, 7.0)
    assert math.isfinite(state.z)
