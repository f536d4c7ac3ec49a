"""Known trends of cooperative perception over a radio channel: measured and expected values.

Each function returns the arrays of one figure of `make reproduce`. Expected values follow from closed forms that
are independent of the measured code.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.communication.radio_line_of_sight import line_of_sight_states
from eidrive_scenario.experiments.average_precision import average_precision, match_by_share
from eidrive_scenario.fusion.average import AverageFusion
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.geometry import iou_bev
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.propagation.gains import blockage_moments, highway_los
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.packet_error import CURVES
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LineOfSightStates, RadioEnvironment
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

CAR = (4.5, 1.8, 1.5)
"""Length, width and height of a car [m]."""
TRUCK = (8.5, 2.5, 3.3)
"""Length, width and height of the firetruck [m]."""


@dataclass(frozen=True)
class Curve:
    """Measured and expected values over `x`, each (N,).

    chance  (N,) half width of the range that contains 95 % of the measured shares of random draws; None if exact
    """

    label: str
    x: Array
    measured: Array
    expected: Array
    chance: Array | None = None


def largest_shift(iou: float, length: float = CAR[0]) -> float:
    """Return the maximum longitudinal shift between a box and its object with an overlap of at least `iou` [m].

    IoU = (L - s) / (L + s) for a shift s.
    """
    return length * (1.0 - iou) / (1.0 + iou)


def precision_by_delay(
    speed: float, iou: float, delays: Sequence[float], *, compensated: bool = False, cars: int = 20, seed: int = 1
) -> Curve:
    """Return the average precision of a receiving station for cars at constant speed [m/s] over message delays [s].

    Without prediction, a box is v tau behind its car, so precision falls from 1 to 0 at `largest_shift`.
    """
    dt = 0.005
    headings = np.random.Generator(np.random.Philox(key=seed)).uniform(-math.pi, math.pi, cars)
    start = 40.0 * np.stack([np.arange(cars) % 5, np.arange(cars) // 5], axis=1)
    velocity = speed * np.stack([np.cos(headings), np.sin(headings)], axis=1)

    def true_detections(time: float) -> Detections:
        boxes = np.column_stack(
            [start + velocity * time, np.full(cars, CAR[2] / 2.0), np.tile(CAR, (cars, 1)), headings]
        )
        names = ("car",) * cars
        return Detections(time, boxes, np.ones(cars), names, velocity, np.tile(0.01 * np.eye(2), (cars, 1, 1)))

    measured = []
    for delay in delays:
        profile = ComposedProfile.model_validate({"delay": {"kind": "constant", "seconds": delay}})
        channel = ComposedChannel(profile, seed)
        fusion: FusionMethod = CovarianceIntersectionFusion() if compensated else AverageFusion()
        ticks = math.ceil(delay / dt - 1e-6) + 20
        for tick in range(ticks + 1):
            now = tick * dt
            fused = Detections(now)
            for received in channel.deliver("Ego", now):
                report = Report("RSU", received.message.detections, received.arrived)
                fusion.add_report(report)
                fused = fusion.fuse([report], now) if tick == ticks else fused
            detections = true_detections(now)
            state = StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0)
            channel.send(Message("RSU", tick, now, state, detections, 0), ["Ego"], now)
        truth = detections.boxes
        found = match_by_share(iou_bev(fused.boxes, truth), fused.scores, np.zeros(cars, dtype=bool), iou)
        measured.append(average_precision([found], cars))
    late = np.array([math.ceil(max(delay, dt) / dt - 1e-6) * dt for delay in delays])
    expected = np.ones(len(late)) if compensated else (speed * late <= largest_shift(iou) + 1e-9).astype(float)
    label = f"{speed:g} m/s, IoU {iou:g}" + (", predicted to the current time" if compensated else "")
    return Curve(label, np.array(delays), np.array(measured), expected)


def reception_by_distance(distances: Sequence[float], *, truck: bool, messages: int = 300) -> Curve:
    """Return the packet reception ratio between two antennas at 1.5 m on a highway, with or without a firetruck.

    The truck is a body in the world, which rays detect. Each message has independent shadowing. The expected
    value is the probability of a signal above -85 dBm, times the packet success ratio at that power. Random losses are
    shadowing (3 dB) and, behind the truck, blockage (TR 37.885, lognormal).
    """
    profile = RadioProfile.model_validate({"path_loss": {"kind": "tr37885", "environment": "highway"}, "jitter": 0.0})
    measured = []
    for distance in distances:
        antennas = {"Ego": (0.0, 0.0, 1.5), "RSU": (distance, 0.0, 1.5)}
        states = _line_of_sight(antennas, truck)
        delivered = 0
        for seed in range(messages):
            channel = RadioChannel(profile, seed)
            channel.update_environment(RadioEnvironment(antennas, lambda pairs, fixed=states: fixed))  # type: ignore[misc]
            state = StationState(0.0, distance, 0.0, 0.0, 0.0, 0.0)
            channel.transmit([(Message("RSU", 0, 0.0, state, Detections(0.0), 350), ["Ego"])], 0.0)
            delivered += len(channel.deliver("Ego", 0.05))
        measured.append(delivered / messages)
    at = np.array(distances)
    label = "behind the firetruck" if truck else "line of sight"
    expected = _expected_reception(at, profile, truck)
    return Curve(label, at, np.array(measured), expected, 1.96 * np.sqrt(expected * (1.0 - expected) / messages))


def _line_of_sight(antennas: dict[str, tuple[float, float, float]], truck: bool) -> LineOfSightStates:
    with World(None) as world:
        if truck:
            spec = ActorSpec("Firetruck", "firetruck", "truck", TRUCK, (0.0, 0.0, TRUCK[2] / 2.0))
            world.add(spec, Placement(antennas["RSU"][0] / 2.0, 0.0, yaw=math.pi / 2.0))
        return line_of_sight_states(world, antennas, [("Ego", "RSU")])


def _expected_reception(distance: Array, profile: RadioProfile, truck: bool) -> Array:
    """Return the expected packet reception ratio by the midpoint rule over both random losses."""
    steps = 400
    normal = np.linspace(-5.0, 5.0, steps + 1)
    weight = np.diff(ndtr(normal))
    middle = (normal[:-1] + normal[1:]) / 2.0
    low, top = np.full(len(distance), 1.5), np.full(len(distance), TRUCK[2] if truck else -np.inf)
    mean, spread = blockage_moments(distance, low, low, top)
    positive_mean = np.where(mean > 0.0, mean, 1.0)
    variance = np.log1p((spread / positive_mean) ** 2)
    exponent = np.log(positive_mean) - variance / 2.0
    extra = np.exp(exponent[:, None] + np.sqrt(variance)[:, None] * middle) * (mean > 0.0)[:, None]
    curve = CURVES["80211p_highway_nlos" if truck else "80211p_highway_los"]
    open_power = profile.radiated - highway_los(distance, profile.frequency_ghz)
    power = open_power[:, None, None] - extra[:, :, None] - 3.0 * middle
    through = (power >= profile.sensing) * (1.0 - curve.at(power - profile.noise, 350))
    share: Array = np.einsum("dbs,b,s->d", through, weight, weight)
    return share


def age_by_burst(
    bursts: Sequence[float], *, share: float = 0.3, period: float = 0.1, delay: float = 0.02, messages: int = 150_000
) -> tuple[Curve, Curve]:
    """Return mean and mean peak age of information over the mean length of loss bursts, at a fixed loss ratio.

    Gilbert-Elliott: mean age d + T E[K²] / 2 E[K] with E[K] = 1 + p/r, E[K²] = 1 + p (2 + r) / r², r = 1 / burst,
    p = r share / (1 - share). The peak age is d + T E[K], independent of the burst length.
    """
    mean, peak = [], []
    for burst in bursts:
        loss = {"kind": "gilbert_elliott", "probability": share, "burst": burst}
        delays = {"kind": "constant", "seconds": delay}
        channel = ComposedChannel(ComposedProfile.model_validate({"loss": loss, "delay": delays}), 1)
        for number in range(messages):
            now = number * period
            state = StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0)
            channel.send(Message("RSU", number, now, state, Detections(now), 0), ["Ego"], now)
            channel.deliver("Ego", now + period)
        link = channel.statistics(messages * period)["RSU", "Ego"]
        mean.append(link.mean_age or math.nan)
        peak.append(link.peak_age or math.nan)
    length = np.array(bursts)
    back = 1.0 / length
    into = back * share / (1.0 - share)
    slots, squared = 1.0 + into / back, 1.0 + into * (2.0 + back) / back**2
    return (
        Curve("mean age", length, np.array(mean), delay + period * squared / (2.0 * slots)),
        Curve("mean peak age", length, np.array(peak), delay + period * slots),
    )
