"""Detector, latency and tracker of one station."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.localization import Localizer, PoseNoise, PoseNoiseProcess
from eidrive_scenario.perception.oracle import OracleDetector
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.tracking.method import TrackerKind, TrackerSettings, TrackingMethod
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.sensing.readings import EgoState, Readings, SignalReading, TruthReading
from eidrive_scenario.world.actor import ActorSpec

DT = 0.05
CAR = ActorSpec("Ego", "car", "car", (4.9, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.85, max_steering=0.6)


def readings(time: float, x: float | None = 0.0, **options: Any) -> Readings:
    """Return readings of a car at x with 10 m/s eastwards; None: the sensor was not due."""
    ego = EgoState(time, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if x is None:
        return Readings(time, ego, **options)
    box = np.array([[x, 0.0, 0.75, 4.6, 1.8, 1.5, 0.0]])
    return Readings(time, ego, TruthReading(("A",), ("car",), box, np.array([[10.0, 0.0]]), np.ones(1)), **options)


def result_times(perception: Perception, ticks: int, every: int = 1) -> list[float | None]:
    """Return the measurement time of the result of each tick."""
    found = []
    for tick in range(ticks):
        time = tick * DT
        new = perception.perceive(readings(time, 10.0 * time if tick % every == 0 else None))
        found.append(None if new is None else round(new.time, 6))
    return found


def test_perceive_without_latency_returns_detections_at_once() -> None:
    assert result_times(Perception(OracleDetector()), 4) == [0.0, 0.05, 0.1, 0.15]


def test_perceive_with_latency_delays_each_detection() -> None:
    assert result_times(Perception(OracleDetector(), latency=0.15), 7) == [None, None, None, 0.0, 0.05, 0.1, 0.15]


class WithBuffer(OracleDetector):
    """Detector that writes all results into one array."""

    def __init__(self) -> None:
        self.boxes = np.zeros((1, 7))

    def detect(self, readings: Readings) -> Detections:
        result = super().detect(readings)
        self.boxes[:] = result.boxes
        return replace(result, boxes=self.boxes)


@pytest.mark.parametrize("latency", [0.0, DT])
@pytest.mark.parametrize("detector", [OracleDetector, WithBuffer])
def test_detections_keep_their_values_and_are_read_only(detector: type[Detector], latency: float) -> None:
    perception = Perception(detector(), latency=latency)
    results = [perception.perceive(readings(tick * DT, 5.0 * tick)) for tick in range(4)]
    boxes = [result.boxes for result in results if result is not None]
    assert [array[0, 0] for array in boxes] == [0.0, 5.0, 10.0, 15.0][: 3 if latency else 4]
    assert not any(array.flags.writeable for array in boxes)


def test_perceive_with_latency_between_ticks_returns_at_later_tick() -> None:
    assert result_times(Perception(OracleDetector(), latency=0.11), 6) == [None, None, None, 0.0, 0.05, 0.1]


@pytest.mark.parametrize("pose_is_exact", [True, False])
@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_tracker_weighs_velocities_by_the_deviation_of_the_detector(kind: Any, pose_is_exact: bool) -> None:
    """The detector states 10 m/s of boxes that move by 6 m/s. The first boxes do not disprove that, further ones do."""

    def speed(deviation: float, scans: int = 2) -> float:
        detector = OracleDetector()
        detector.velocity_deviation = deviation
        noise = None if pose_is_exact else PoseNoiseProcess(PoseNoise(position=1e-6), "Ego", 1)
        perception = Perception(detector, tracker=Tracker(TrackerSettings(kind=kind)), pose_noise=noise)
        for tick in range(scans):
            given = perception.locate(readings(tick * DT, 6.0 * tick * DT))
            found = perception.perceive(given)
        assert found is not None
        return float(found.velocity[0, 0])

    assert speed(0.01) == pytest.approx(10.0, abs=0.5)
    assert speed(50.0) == pytest.approx(6.0, abs=0.5)
    assert speed(0.01, scans=8) == pytest.approx(6.0, abs=0.5)


def test_perceive_without_due_sensor_returns_none() -> None:
    assert result_times(Perception(OracleDetector(), latency=0.1), 8, every=3) == [
        None,
        None,
        0.0,
        None,
        None,
        0.15,
        None,
        None,
    ]


def test_perceive_with_several_results_returns_newest() -> None:
    """Two results become available in one step of 0.1 s: the tracker processes both, and the newest is returned."""
    perception = Perception(OracleDetector(), latency=0.1, tracker=Tracker(TrackerSettings(confirm=(2, 2))))
    assert perception.perceive(readings(0.0)) is None
    assert perception.perceive(readings(0.05, 0.5)) is None
    new = perception.perceive(readings(0.2, None))
    assert new is not None
    assert (new.time, len(new)) == (0.05, 1)


def test_perceive_with_tracker_returns_delayed_velocities_and_numbers() -> None:
    perception = Perception(OracleDetector(), latency=0.1, tracker=Tracker(TrackerSettings(kind="ctrv")))
    for tick in range(40):
        new = perception.perceive(readings(tick * DT, 10.0 * tick * DT))
    assert new is not None
    assert new.time == pytest.approx(39 * DT - 0.1)
    assert new.boxes[0, 0] == pytest.approx(10.0 * new.time, abs=0.05)
    np.testing.assert_allclose(new.velocity, [[10.0, 0.0]], atol=0.2)
    assert new.tracks == (1,)


class WithoutVelocity(Detector):
    """Detector of one box without velocity, and a light."""

    needs: ClassVar[frozenset[str]] = frozenset({"truth"})
    detectable_signals = frozenset({"light"})

    def __init__(self) -> None:
        self.context: DetectorContext | None = None

    def setup(self, context: DetectorContext) -> None:
        self.context = context

    def detect(self, readings: Readings) -> Detections:
        return replace(OracleDetector().detect(readings), velocity=np.full((1, 2), np.nan))

    def signals(self) -> tuple[SignalReading, ...]:
        return (SignalReading("own", "green"),)


def test_build_agent_tracks_only_detectors_without_velocity_by_default() -> None:
    def tracks(detector: Detector, **settings: Any) -> bool:
        agent = build_agent(AgentSettings.model_validate(settings), CAR, None, seed=0, dt=DT, detector=detector)
        found = [agent.act(readings(tick * DT, 10.0 * tick * DT), (), tick * DT, None) for tick in range(4)]
        return bool(found[-1].detections.tracks)

    assert not tracks(OracleDetector())
    assert tracks(OracleDetector(), tracker="cv")
    assert tracks(WithoutVelocity())
    assert not tracks(WithoutVelocity(), tracker="none")


def test_build_agent_calls_setup_with_context() -> None:
    blind = WithoutVelocity()
    build_agent(AgentSettings(), CAR, None, seed=7, dt=DT, detector=blind)
    assert blind.context is not None
    assert (blind.context.spec, set(blind.context.sensors), blind.context.seed) == (CAR, {"truth"}, 7)


def test_signals_merge_detector_and_signal_sensor() -> None:
    """The signal sensor provides the kinds that the detector does not read (test_lights_on_map)."""
    sensed = readings(0.0, signals=(SignalReading("map", "red"),))
    assert [one.id for one in Perception(OracleDetector()).signals(sensed)] == ["map"]
    assert [one.id for one in Perception(WithoutVelocity()).signals(sensed)] == ["own", "map"]


def test_perceive_with_localizer_places_objects_by_estimated_pose() -> None:
    """The first estimate has an error of some decimeters, and so have the detections."""
    perception = Perception(OracleDetector(), localizer=Localizer("Ego", 5))
    located = perception.locate(readings(0.0, 20.0))
    shift = located.ego.position[:2]
    assert np.linalg.norm(shift) > 0.05
    found = perception.perceive(located)
    assert found is not None
    turn = np.array([np.cos(located.ego.yaw), np.sin(located.ego.yaw)])
    np.testing.assert_allclose(found.boxes[0, :2], shift + 20.0 * turn)
    exact = Perception(OracleDetector())
    assert exact.locate(readings(0.0)).ego.position.tolist() == [0.0, 0.0, 0.0]


def test_agent_with_latency_sends_time_of_measurement() -> None:
    """The agent fuses and sends detections with their time of measurement."""
    agent = build_agent(AgentSettings(detector_latency=0.1), CAR, None, seed=0, dt=DT)
    steps = [agent.act(readings(tick * DT, 10.0 * tick * DT), (), tick * DT, None) for tick in range(5)]
    assert [len(step.fused) for step in steps] == [0, 0, 1, 1, 1]
    assert [round(float(step.detections.boxes[0, 0]), 6) for step in steps[2:]] == [0.0, 0.5, 1.0]
    assert [round(step.outbox[0].detections.time, 6) for step in steps[2:]] == [0.0, 0.05, 0.1]


def test_perceive_between_scans_predicts_tracks_to_tick() -> None:
    """Scans at 10 Hz, ticks at 20 Hz: objects move at 10 m/s between scans, and end some time after the last scan."""
    perception = Perception(OracleDetector(), tracker=Tracker(TrackerSettings(coast=0.5)))
    for tick in range(40):
        new = perception.perceive(readings(tick * DT, 0.5 * tick if tick % 2 == 0 else None))
    assert new is not None
    assert new.time == pytest.approx(39 * DT)
    assert new.boxes[0, 0] == pytest.approx(0.5 * 39, abs=0.05)
    assert result_times(Perception(OracleDetector(), tracker=Tracker(TrackerSettings(coast=0.1))), 8, every=7) == [
        *(0.0, 0.05, 0.1),
        *(None, None, None, None),
        0.35,
    ]


class WithShares(WithoutVelocity):
    """Detector that returns the given shares from `in_view`."""

    def __init__(self, shares: Any) -> None:
        super().__init__()
        self.shares = shares

    def in_view(self, boxes: np.ndarray, readings: Readings, found: Detections) -> Any:
        return self.shares


@pytest.mark.parametrize("shares", [None, 1.0, np.ones(3), np.array([np.nan]), np.array([-3.0])])
def test_in_view_with_invalid_result_raises(shares: Any) -> None:
    perception = Perception(WithShares(shares), tracker=Tracker(TrackerSettings()))
    for tick in range(4):
        perception.perceive(readings(tick * DT, 0.5 * tick))
    with pytest.raises(InvalidResult, match="in_view"):
        perception.perceive(readings(4 * DT, 200.0))


def test_in_view_zero_keeps_undetected_tracks() -> None:
    left = []
    for share in (0.0, 1.0):
        perception = Perception(WithShares(np.array([share])), tracker=Tracker(TrackerSettings(coast=10.0)))
        for tick in range(30):
            perception.perceive(readings(tick * DT, 5.0))
        for tick in range(30, 36):
            new = perception.perceive(readings(tick * DT, 200.0))
        left.append(0 if new is None else int((new.boxes[:, 0] < 100.0).sum()))
    assert left == [1, 0]


class FixedTracker(TrackingMethod):
    """Tracker of a third party that returns the given results."""

    def __init__(self, update_result: Any, prediction: Any) -> None:
        super().__init__(TrackerKind(kind="fixed"))
        self.update_result, self.prediction = update_result, prediction

    def update(self, detections: Detections, in_view: object = None) -> Any:
        return self.update_result

    def predict(self, time: float) -> Any:
        return self.prediction


def test_update_of_tracker_with_invalid_result_raises() -> None:
    perception = Perception(OracleDetector(), tracker=FixedTracker((), None))
    with pytest.raises(InvalidResult, match=r"update returned an object of type tuple \(expected Detections\)"):
        perception.perceive(readings(0.0, 5.0))


def test_prediction_of_tracker_with_invalid_result_raises() -> None:
    undefined = Detections(
        0.0, np.full((1, 7), np.nan), np.ones(1), ("car",), np.zeros((1, 2)), np.zeros((1, 2, 2)), tracks=(1,)
    )
    perception = Perception(OracleDetector(), tracker=FixedTracker(Detections(0.0), undefined))
    perception.perceive(readings(0.0, 5.0))
    with pytest.raises(InvalidResult, match="predict returned boxes with the value nan"):
        perception.perceive(readings(DT, None))
