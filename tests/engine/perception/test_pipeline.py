"""Detector, latency and tracker of one station together."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.localization import Localizer
from eidrive_scenario.perception.oracle import OracleDetector
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.tracking.settings import TrackerSettings
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.sensing.readings import EgoState, Readings, SignalReading, TruthReading
from eidrive_scenario.world.actor import ActorSpec

DT = 0.05
CAR = ActorSpec("Ego", "car", "car", (4.9, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.85, max_steering=0.6)


def readings(time: float, x: float | None = 0.0, **options: Any) -> Readings:
    """A car at x, 10 m/s eastwards; None: the sensor was not due."""
    ego = EgoState(time, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if x is None:
        return Readings(time, ego, **options)
    box = np.array([[x, 0.0, 0.75, 4.6, 1.8, 1.5, 0.0]])
    return Readings(time, ego, TruthReading(("A",), ("car",), box, np.array([[10.0, 0.0]]), np.ones(1)), **options)


def known(perception: Perception, ticks: int, every: int = 1) -> list[float | None]:
    """When what is new in each tick was measured."""
    found = []
    for tick in range(ticks):
        time = tick * DT
        new = perception.perceive(readings(time, 10.0 * time if tick % every == 0 else None))
        found.append(None if new is None else round(new.time, 6))
    return found


def test_without_latency_what_is_seen_is_known_at_once() -> None:
    assert known(Perception(OracleDetector()), 4) == [0.0, 0.05, 0.1, 0.15]


def test_latency_delays_each_detection_by_as_much() -> None:
    assert known(Perception(OracleDetector(), latency=0.15), 7) == [None, None, None, 0.0, 0.05, 0.1, 0.15]


def test_a_latency_between_two_ticks_waits_for_the_later_one() -> None:
    assert known(Perception(OracleDetector(), latency=0.11), 6) == [None, None, None, 0.0, 0.05, 0.1]


def test_a_sensor_that_is_not_due_makes_nothing_known() -> None:
    assert known(Perception(OracleDetector(), latency=0.1), 8, every=3) == [
        None,
        None,
        0.0,
        None,
        None,
        0.15,
        None,
        None,
    ]


def test_of_several_that_become_known_at_once_the_newest_counts() -> None:
    """Sensors at 20 Hz, steps of 0.1 s in between: both of the last step are there, the tracker has seen both."""
    perception = Perception(OracleDetector(), latency=0.1, tracker=Tracker(TrackerSettings(confirm=(2, 2))))
    assert perception.perceive(readings(0.0)) is None
    assert perception.perceive(readings(0.05, 0.5)) is None
    new = perception.perceive(readings(0.2, None))
    assert new is not None
    assert (new.time, len(new)) == (0.05, 1)


def test_a_tracker_gives_velocities_and_numbers_late_as_the_boxes() -> None:
    perception = Perception(OracleDetector(), latency=0.1, tracker=Tracker(TrackerSettings(kind="ctrv")))
    for tick in range(40):
        new = perception.perceive(readings(tick * DT, 10.0 * tick * DT))
    assert new is not None
    assert new.time == pytest.approx(39 * DT - 0.1)
    assert new.boxes[0, 0] == pytest.approx(10.0 * new.time, abs=0.05)
    np.testing.assert_allclose(new.velocity, [[10.0, 0.0]], atol=0.2)
    assert new.tracks == (1,)


class Blind(Detector):
    """Finds one box without velocity, and a light."""

    needs: ClassVar[frozenset[str]] = frozenset({"truth"})
    detectable_signals = frozenset({"light"})

    def __init__(self) -> None:
        self.installed: DetectorContext | None = None

    def setup(self, installation: DetectorContext) -> None:
        self.installed = installation

    def detect(self, readings: Readings) -> Detections:
        return replace(OracleDetector().detect(readings), velocity=np.full((1, 2), np.nan))

    def signals(self) -> tuple[SignalReading, ...]:
        return (SignalReading("own", "green"),)


def test_the_oracle_is_not_tracked_unless_asked_and_others_are_unless_forbidden() -> None:
    def tracks(detector: Detector, **settings: Any) -> bool:
        agent = build_agent(AgentSettings.model_validate(settings), CAR, None, seed=0, dt=DT, detector=detector)
        found = [agent.act(readings(tick * DT, 10.0 * tick * DT), (), tick * DT, None) for tick in range(4)]
        return bool(found[-1].detections.tracks)

    assert not tracks(OracleDetector())
    assert tracks(OracleDetector(), tracker="cv")
    assert tracks(Blind())
    assert not tracks(Blind(), tracker="none")


def test_a_detector_learns_where_it_works() -> None:
    blind = Blind()
    build_agent(AgentSettings(), CAR, None, seed=7, dt=DT, detector=blind)
    assert blind.installed is not None
    assert (blind.installed.spec, set(blind.installed.sensors), blind.installed.seed) == (CAR, {"truth"}, 7)


def test_signals_come_from_the_detector_that_sees_them_and_from_the_lookout() -> None:
    """The lookout is asked for what the detector does not see (test_lights_on_map)."""
    looked = readings(0.0, signals=(SignalReading("map", "red"),))
    assert [one.id for one in Perception(OracleDetector()).signals(looked)] == ["map"]
    assert [one.id for one in Perception(Blind()).signals(looked)] == ["own", "map"]


def test_without_the_oracle_objects_lie_where_the_station_takes_itself_to_be() -> None:
    """The first estimate is some decimeters off, and so is what the station sees."""
    perception = Perception(OracleDetector(), localizer=Localizer("Ego", 5))
    seen = perception.locate(readings(0.0, 20.0))
    shift = seen.ego.position[:2]
    assert np.linalg.norm(shift) > 0.05
    found = perception.perceive(seen)
    assert found is not None
    turn = np.array([np.cos(seen.ego.yaw), np.sin(seen.ego.yaw)])
    np.testing.assert_allclose(found.boxes[0, :2], shift + 20.0 * turn)
    exact = Perception(OracleDetector())
    assert exact.locate(readings(0.0)).ego.position.tolist() == [0.0, 0.0, 0.0]


def test_what_a_slow_detector_found_is_fused_and_sent_with_the_time_of_measurement() -> None:
    """The agent fuses and sends what it knows, with the time at which it was measured."""
    agent = build_agent(AgentSettings(detector_latency=0.1), CAR, None, seed=0, dt=DT)
    steps = [agent.act(readings(tick * DT, 10.0 * tick * DT), (), tick * DT, None) for tick in range(5)]
    assert [len(step.fused) for step in steps] == [0, 0, 1, 1, 1]
    assert [round(float(step.detections.boxes[0, 0]), 6) for step in steps[2:]] == [0.0, 0.5, 1.0]
    assert [round(step.outbox[0].detections.time, 6) for step in steps[2:]] == [0.0, 0.05, 0.1]


def test_perceive_between_scans_predicts_tracks_to_the_tick() -> None:
    """Scans at 10 Hz, ticks at 20 Hz: what is known moves on at 10 m/s, and ends when the scans have ended for long."""
    perception = Perception(OracleDetector(), tracker=Tracker(TrackerSettings(coast=0.5)))
    for tick in range(40):
        new = perception.perceive(readings(tick * DT, 0.5 * tick if tick % 2 == 0 else None))
    assert new is not None
    assert new.time == pytest.approx(39 * DT)
    assert new.boxes[0, 0] == pytest.approx(0.5 * 39, abs=0.05)
    assert known(Perception(OracleDetector(), tracker=Tracker(TrackerSettings(coast=0.1))), 8, every=7) == [
        *(0.0, 0.05, 0.1),
        *(None, None, None, None),
        0.35,
    ]


class Sees(Blind):
    """Answers `in_view` with what it is given."""

    def __init__(self, shares: Any) -> None:
        super().__init__()
        self.shares = shares

    def in_view(self, boxes: np.ndarray, readings: Readings, found: Detections) -> Any:
        return self.shares


@pytest.mark.parametrize("shares", [None, 1.0, np.ones(3), np.array([np.nan])])
def test_in_view_with_a_wrong_result_is_an_error_of_the_detector(shares: Any) -> None:
    perception = Perception(Sees(shares), tracker=Tracker(TrackerSettings()))
    for tick in range(4):
        perception.perceive(readings(tick * DT, 0.5 * tick))
    with pytest.raises(InvalidResult, match="in_view"):
        perception.perceive(readings(4 * DT, 200.0))


def test_in_view_zero_keeps_tracks_that_are_not_detected() -> None:
    left = []
    for share in (0.0, 1.0):
        perception = Perception(Sees(np.array([share])), tracker=Tracker(TrackerSettings(coast=10.0)))
        for tick in range(30):
            perception.perceive(readings(tick * DT, 5.0))
        for tick in range(30, 36):
            new = perception.perceive(readings(tick * DT, 200.0))
        left.append(0 if new is None else int((new.boxes[:, 0] < 100.0).sum()))
    assert left == [1, 0]
