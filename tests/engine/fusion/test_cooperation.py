"""Cooperation of stations that exchange messages and fuse by covariance intersection."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.profile import build_channel, load_profile
from eidrive_scenario.world.actor import ActorSpec

DT = 0.05
CAR_SIZE = (4.9, 1.8, 1.5)
Moving = tuple[float, float, float]
"""Position x, y [m] and speed along x [m/s]."""


def spec(name: str) -> ActorSpec:
    return ActorSpec(name, "car", "car", CAR_SIZE, (1.4, 0.0, 0.75), wheelbase=2.85, max_steering=0.6)


def readings(time: float, at: tuple[float, float], cars: tuple[Moving, ...]) -> Readings:
    boxes = np.array([(x + speed * time, y, 0.75, *CAR_SIZE, 0.0) for x, y, speed in cars]).reshape(-1, 7)
    velocity = np.array([(speed, 0.0) for _, _, speed in cars]).reshape(-1, 2)
    names = tuple(f"Car{row}" for row in range(len(cars)))
    truth = TruthReading(names, ("car",) * len(cars), boxes, velocity, np.ones(len(cars)))
    return Readings(time, EgoState(time, np.array([*at, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), truth)


class Cooperation:
    """Stations on a channel, stepped in the order of a run: deliver, act, send."""

    def __init__(self, places: dict[str, tuple[float, float]], channel: str | None, **more: object) -> None:
        settings = AgentSettings.model_validate({"fusion": "covariance_intersection", **more})
        self.places = places
        self.agents: dict[str, Agent] = {
            name: build_agent(settings, spec(name), None, seed=0, dt=DT) for name in places
        }
        self.channel: Channel | None = build_channel(load_profile(channel), 0) if channel is not None else None
        self.tick = 0
        self.sent: dict[str, Detections] = {}

    def step(self, seen: Mapping[str, tuple[Moving, ...]]) -> dict[str, Detections]:
        now = self.tick * DT
        steps = {
            name: agent.act(
                readings(now, self.places[name], seen.get(name, ())),
                self.channel.deliver(name, now) if self.channel is not None else (),
                now,
                None,
            )
            for name, agent in self.agents.items()
        }
        for name, step in steps.items():
            for message in step.outbox:
                self.sent[name] = message.detections
                if self.channel is not None:
                    self.channel.send(message, [other for other in self.agents if other != name], now)
        self.tick += 1
        return {name: step.fused for name, step in steps.items()}


PLACES = {"A": (0.0, -20.0), "B": (0.0, 60.0)}
CROSSING, HIDDEN = (10.0, 0.0, 8.0), (-30.0, 20.0, 14.0)


def test_stations_do_not_forward_received_objects() -> None:
    """Only A detects a car. B does not forward the report of A, which avoids data incest."""
    cooperation = Cooperation(PLACES, "{model: composed}")
    for _ in range(20):
        known = cooperation.step({"A": (CROSSING,)})
    assert len(known["A"]) == len(known["B"]) == 1
    assert len(cooperation.sent["B"]) == 0
    alone = Cooperation(PLACES, None)
    for _ in range(20):
        without = alone.step({"A": (CROSSING,)})
    np.testing.assert_array_equal(known["A"].boxes, without["A"].boxes)
    np.testing.assert_array_equal(known["A"].covariance, without["A"].covariance)


def test_fusion_of_repeated_reports_does_not_reduce_the_covariance() -> None:
    """Stations repeat the same report as their own; fusion as independent reports would divide the covariance."""
    fusion = CovarianceIntersectionFusion()
    box = np.array([[10.0, 0.0, 0.75, *CAR_SIZE, 0.0]])
    known = Detections(0.0, box, np.ones(1), ("car",), np.array([[8.0, 0.0]]), np.array([np.eye(2) * 0.09]))
    for station in "ABCDE":
        fusion.add_report(Report(station, known, 0.0))
    fused = fusion.fuse([Report(station, known, 0.0) for station in "ABCDE"], 0.0)
    np.testing.assert_allclose(fused.covariance, known.covariance, rtol=1e-9)
    np.testing.assert_allclose(fused.boxes, known.boxes, atol=1e-9)


def test_cooperation_without_delay_and_loss_equals_shared_memory() -> None:
    """The result equals, to the bit, the fusion of the own detections and those of B one tick earlier."""
    cooperation = Cooperation(
        PLACES, "{loss: {kind: bernoulli, probability: 0.0}, delay: {kind: constant, seconds: 0}}"
    )
    shared = CovarianceIntersectionFusion()
    before: Detections | None = None
    for tick in range(30):
        seen = {"A": (CROSSING,), "B": (CROSSING, HIDDEN) if tick > 3 else (HIDDEN,)}
        fused = cooperation.step(seen)["A"]
        now = tick * DT
        reports = [Report("B", before, now)] if before is not None else []
        reports.append(Report("A", cooperation.sent["A"], now))
        for report in reports:
            shared.add_report(report)
        expected = shared.fuse(reports, now)
        for name in ("boxes", "scores", "velocity", "covariance"):
            np.testing.assert_array_equal(getattr(fused, name), getattr(expected, name))
        before = cooperation.sent["B"]
    assert len(fused) == 2


def test_cooperation_with_total_loss_equals_no_cooperation() -> None:
    lossy = Cooperation(PLACES, "{loss: {kind: bernoulli, probability: 1.0}}")
    alone = Cooperation(PLACES, None)
    for tick in range(30):
        seen = {"A": (CROSSING,) if tick % 3 else (), "B": (HIDDEN,)}
        np.testing.assert_array_equal(lossy.step(seen)["A"].boxes, alone.step(seen)["A"].boxes)


@pytest.mark.parametrize("latency", [0.0, 0.1, 0.3, 0.6])
def test_cooperation_with_latency_predicts_objects_to_the_current_time(latency: float) -> None:
    """Only B detects a car at 14 m/s; A has it at its current position from the first message on."""
    cooperation = Cooperation(PLACES, f"{{delay: {{kind: constant, seconds: {latency}}}}}")
    first = round(max(latency, DT) / DT)
    for tick in range(30):
        fused = cooperation.step({"B": (HIDDEN,)})["A"]
        assert len(fused) == (tick >= first)
        if len(fused):
            assert fused.boxes[0, 0] == pytest.approx(HIDDEN[0] + HIDDEN[2] * tick * DT, abs=1e-6)


def test_cooperation_with_reordering_and_loss_keeps_one_track_per_car() -> None:
    cooperation = Cooperation(
        PLACES, "{delay: {kind: uniform, minimum: 0.05, maximum: 0.5}, loss: {kind: bernoulli, probability: 0.3}}"
    )
    for tick in range(60):
        fused = cooperation.step({"A": (CROSSING,), "B": (CROSSING, HIDDEN)})["A"]
        assert len(fused) <= 2
        if tick > 15:
            np.testing.assert_allclose(
                sorted(fused.boxes[:, 0].tolist()),
                sorted(x + speed * tick * DT for x, _, speed in (CROSSING, HIDDEN)),
                atol=1e-3,
            )


def test_cooperation_with_etsi_generation_keeps_all_cars() -> None:
    """Cars at rest are reported once per second, moving ones after 4 m; omitted objects are not deleted."""
    rest, slow = (30.0, 10.0, 0.0), (-20.0, 20.0, 6.0)
    cooperation = Cooperation(PLACES, "{delay: {kind: constant, seconds: 0.3}}", generation="etsi")
    for tick in range(100):
        fused = cooperation.step({"B": (rest, slow)})["A"]
        if tick > 12:
            np.testing.assert_allclose(
                sorted(fused.boxes[:, 0].tolist()), [slow[0] + slow[2] * tick * DT, rest[0]], atol=1e-3
            )


@pytest.mark.parametrize("latency", [0.05, 0.2, 0.45])
def test_cooperation_with_etsi_generation_keeps_parked_car_between_messages(latency: float) -> None:
    """By the ETSI rules a parked car is reported once per second; its track persists at any latency."""
    cooperation = Cooperation(PLACES, f"{{delay: {{kind: constant, seconds: {latency}}}}}", generation="etsi")
    counts = [len(cooperation.step({"B": ((5.0, 20.0, 0.0),)})["A"]) for _ in range(100)]
    assert counts[round(latency / DT) + 1 :] == [1] * (99 - round(latency / DT))


def test_etsi_generation_respects_the_interval_of_congestion_control() -> None:
    """At 25 m/s CAM and CPM are due every 0.2 s; with a required interval of 0.4 s the kinds alternate."""
    for kinds, interval, gap in (("cpm", 0.4, 0.4), ("cam", 0.4, 0.4), ("[cpm, cam]", 0.4, 0.8), ("cpm", 0.0, 0.2)):
        cooperation = Cooperation(PLACES, None, generation="etsi", messages=kinds.strip("[]"))
        agent = cooperation.agents["A"]
        sent: dict[str, list[float]] = {"cpm": [], "cam": []}
        for tick in range(100):
            now = tick * DT
            for message in agent.act(fast(now), (), now, None, message_interval=interval).outbox:
                sent[message.kind].append(now)
        for times in filter(None, sent.values()):
            assert np.diff(times) == pytest.approx(gap), (kinds, interval)
        if interval:
            assert np.diff(sorted(sent["cam"] + sent["cpm"])) == pytest.approx(interval), "one at a time"


def fast(time: float) -> Readings:
    """Return readings of a station at 25 m/s that detects a car of the same speed beside it."""
    seen = readings(time, (25.0 * time, 0.0), ((0.0, 5.0, 25.0),))
    return replace(seen, ego=replace(seen.ego, speed=25.0))
